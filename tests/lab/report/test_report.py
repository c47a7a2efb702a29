"""Specification of the report: what a person finds on the page, and what the page never does."""

import dataclasses
import re
from collections.abc import Callable, Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import TypeAlias

import numpy as np
import pytest
from matplotlib.figure import Figure

from quadctl.effects.ground_effect import CheesemanForward, Exponential
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.errors import LogError, SettingsError
from quadctl.lab import plots
from quadctl.lab.comparison.comparison import Comparison, compare
from quadctl.lab.comparison.wording import FLOOR, number, p_in_words, quantity, roughly
from quadctl.lab.effect_curves import effect_curves, ratio_curve
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.report.numbers import lowest_floors, rmse_interval
from quadctl.lab.report.page import render_report, write_report
from quadctl.lab.report.results import Results, Shown
from quadctl.lab.selection.addition import Addition, add
from quadctl.lab.selection.diagnosis import Diagnosis, Verdict, diagnose
from quadctl.lab.tracking.metrics import Window, metrics
from quadctl.lab.tracking.step_response import StepResponses, step_responses
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from quadctl.words import estimate
from tests.support.flights import CUSHION, SHORTER, flown_once, obedient, simulated, to_and_fro

Worded: TypeAlias = Callable[[Results], "Page"]
CANDIDATES = (ConstantScale, Exponential, LinearDrag)
NASTY = '<script>alert("x")</script>&_$a$.csv'
VOID = {"meta", "br", "link", "img", "input", "hr"}
STEP = SHORTER["step_response"]
UNIT = re.compile(r" / (m/s²|m/s|m s|N|V|deg|s|m|mm|%|rotor radii)$")


class Page(HTMLParser):
    """Parser of a page: elements with their attributes, texts, and whether all are closed in order."""

    def __init__(self, html: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[str] = []
        self.feed(html)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.texts))

    @property
    def sections(self) -> list[str | None]:
        return [attrs["id"] for tag, attrs in self.tags if tag == "section"]


@dataclasses.dataclass(frozen=True)
class Flown:
    """Results on simulated flights over a ground whose effect is not in the catalogue."""

    before: Comparison
    diagnosis: Diagnosis
    addition: Addition
    before_unseen: Comparison
    after: Comparison
    steps: StepResponses

    @property
    def results(self) -> Results:
        return Results(self.before, self.diagnosis, self.addition, self.before_unseen, self.after, self.steps)


@pytest.fixture(scope="module")
def flown(raptor: Vehicle, shared: Path, tmp_path_factory: pytest.TempPathFactory) -> Flown:
    rigid = Model(raptor)
    seen = load_dataset([flown_once("hover_staircase", [CUSHION], 1, shared)], raptor)
    steps = _step_logs(tmp_path_factory.mktemp("steps"))
    unseen = load_dataset([steps["none"]], raptor)
    addition = add(Exponential, rigid, seen)
    return Flown(
        compare(rigid, seen),
        diagnose(rigid, seen, CANDIDATES),
        addition,
        compare(rigid, unseen),
        compare(addition.model, unseen),
        _steps(steps),
    )


def _step_logs(where: Path) -> dict[str, FlightLog]:
    return {
        "none": simulated("step_response", [CUSHION], 3, where, STEP),
        "models/found.yaml": simulated("step_response", [], 3, where, STEP),
        "out of ground effect": simulated("step_response_high", [], 4, where, STEP),
    }


def _steps(logs: dict[str, FlightLog]) -> StepResponses:
    flights = list(logs.values())
    return step_responses(logs, metrics(flights[:2], flights[2:], window=Window(phase="step")), Window(phase="step"))


@pytest.fixture(scope="module")
def html(flown: Flown) -> str:
    return render_report(flown.results)


@pytest.fixture(scope="module")
def page(html: str) -> Page:
    return Page(html)


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures are empty: drawing them takes most of the time."""
    monkeypatch.setattr(plots, "to_svg", lambda figure, name: "<svg></svg>")


@pytest.fixture
def worded(undrawn: None) -> Worded:
    return lambda results: Page(render_report(results))


@pytest.fixture(scope="module")
def made(raptor: Vehicle) -> Comparison:
    """Short comparison of a flight with HTML in its name."""
    log = obedient(Model(raptor).plus(ConstantScale(factor=1.1)), noise_m_s=0.01, name=NASTY)
    return compare(Model(raptor, name="<b>rigid</b>"), load_dataset([log], raptor))


class TestWhatThePageHolds:
    def test_all_sections_in_reading_order(self, page: Page) -> None:
        assert page.sections == [
            *("flights", "over-time", "open-loop", "variables", "fails"),
            *("missing", "before-after", "effects", "steps"),
        ]
        assert page.open == []

    def test_the_first_page_stands_alone_and_all_else_is_folded(self, page: Page) -> None:
        folded = [attrs for tag, attrs in page.tags if tag == "details"]
        assert len(folded) == len(page.sections)
        assert not any("open" in attrs for attrs in folded)

    def test_only_the_comparison_is_required(self, worded: Worded, made: Comparison) -> None:
        assert worded(Results(made)).sections == [*("flights", "over-time", "open-loop", "variables", "fails")]

    def test_the_headline_is_the_error_on_unseen_flights_and_the_verdict(self, flown: Flown, page: Page) -> None:
        start, end = page.text.index("Flight model report"), page.text.index("The flights")
        headline = page.text[start:end]
        before, after = flown.before_unseen.rmse["total"], flown.after.rmse["total"]
        assert f"{number(before)} → {number(after)} m/s² \u2212{round(100 * (1 - after / before))}%" in headline
        assert flown.after.dataset.names[0] in headline
        assert "Missing: ground effect." in headline
        floor = min(flown.before_unseen.noise_floor["total"], flown.after.noise_floor["total"])
        assert f"{after / floor:.2f} times the reference error" in headline

    def test_what_is_of_the_model_before_anything_was_added_says_so(self, worded: Worded, flown: Flown) -> None:
        said = ": rigid body, before anything was added"
        whole = worded(Results(flown.before, flown.diagnosis, flown.addition)).texts
        assert sum(text.endswith(said) for text in whole) == 3
        assert sum(text.endswith(": rigid body with additions") for text in whole) == 2
        assert said not in worded(Results(flown.before, flown.diagnosis)).text

    def test_what_was_added_is_judged_too_where_no_flight_is_held_out(self, worded: Worded, flown: Flown) -> None:
        seen = worded(Results(flown.before, flown.diagnosis, flown.addition))
        assert seen.sections[-1] == "still-fails"
        assert "Where the model still fails: rigid body with additions" in seen.text
        improved = compare(flown.addition.model, flown.before.dataset)
        assert len(improved.fails_where) < len(flown.before.fails_where)
        told = f"{len(improved.fails_where)} finding" if improved.fails_where else "no significant error"
        assert told in seen.text[seen.text.index("Where the model still fails: ") :]

    def test_the_noise_floor_is_the_lowest_over_all_steps_as_on_the_page(self, worded: Worded, flown: Flown) -> None:
        first = {axis: 2.0 * floor for axis, floor in flown.before.noise_floor.items()}
        shown = Results(dataclasses.replace(flown.before, noise_floor=first), flown.diagnosis, flown.addition)
        lowest = lowest_floors(shown)["total"]
        assert lowest < 0.9 * first["total"]
        text = worded(shown).text
        assert f"reference error: {FLOOR} {roughly(lowest)}" in text
        assert f"The reference error is {roughly(lowest)}: {FLOOR}." in text
        assert f"reference error is {roughly(first['total'])}" not in text

    def test_a_report_of_the_page_repeats_its_numbers_and_its_words(self, worded: Worded, flown: Flown) -> None:
        said = ("No missing effect is found, if the vehicle is raptor (1.5 kg).", "An error remains.")
        shown = Shown(said, flown.before.model.vehicle, 0.0321, (0.321, 0.123), "on blocks")
        text = worded(flown.results._replace(shown=shown, after=None)).text
        top = text[: text.index("The model :")]
        assert "0.321 → 0.123 m/s²" in top
        assert "Acceleration error (RMSE over all axes), on blocks" in top
        assert " ".join(said) in top
        assert "Added to rigid body: ground effect." in top
        assert (
            "nothing is fitted to these flights, not even the per-flight bias; the number at the top is on blocks."
            in text
        )
        assert f"reference error: {FLOOR} {roughly(0.0321)}" in top

    def test_the_verdict_is_on_the_condition_that_the_vehicle_flew_where_nobody_has_said_so(
        self, worded: Worded, flown: Flown
    ) -> None:
        shown = Shown(condition=flown.before.model.vehicle)
        text = worded(flown.results._replace(shown=shown)).text
        assert "Missing: ground effect, if the vehicle is raptor (1.5 kg)." in text

    def test_before_on_unseen_flights_is_worked_out_where_it_is_not_given(self, worded: Worded, flown: Flown) -> None:
        text = worded(Results(flown.before, after=flown.after)).text
        assert f"{number(flown.before_unseen.rmse['total'])} → {number(flown.after.rmse['total'])} m/s²" in text

    def test_numbers_come_from_the_objects_with_unit_and_uncertainty(self, flown: Flown, page: Page) -> None:
        low, high = rmse_interval(flown.before.residual, flown.before.dataset)
        total = flown.before.rmse["total"]
        assert low < total < high
        of = "RMSE over all axes, per-flight bias not removed, 95% interval"
        assert f"{quantity(total)} ({of} {low:.3g} to {high:.3g})" in page.text
        (item,) = flown.addition.model.stack
        for name, unit in (("a", ""), ("b", " 1/m")):
            value, interval = estimate(item.effect.values()[name], item.ci95[name])
            assert f"{name} = {value}{unit} {interval}" in page.text
        assert f"from {quantity(flown.diagnosis.steps[0].rmse['total'])} to " in page.text

    def test_the_flights_say_what_was_dropped_and_how_they_were_read(self, flown: Flown, page: Page) -> None:
        flight = flown.before.dataset.flights[0]
        assert flight.notes
        for note in flight.notes:
            assert f"{flight.name}: {note}." in page.text
        assert f"{flight.bandwidth_hz:.2f}" in page.text
        assert flight.thrust_source in page.text

    def test_candidates_come_with_physics_p_and_the_answer_none(self, flown: Flown, page: Page) -> None:
        for candidate in flown.diagnosis.ranking:
            assert candidate.effect.name in page.text
            if candidate.fitted:
                assert candidate.effect.physics in page.text
                assert p_in_words(candidate.p_value) in page.text
        for verdict in ("missing", "none", "unexplained"):
            assert ("td", verdict) in _first_cells(page)

    def test_the_verdict_is_said_in_words(self, worded: Worded, flown: Flown, made: Comparison) -> None:
        answers: tuple[tuple[Verdict, str], ...] = (
            ("none", "No known effect is missing: none reduces the held-out error enough to matter."),
            ("unexplained", "Something is missing that no known effect explains."),
        )
        for verdict, words in answers:
            changed = dataclasses.replace(
                flown.diagnosis,
                verdict=verdict,
                missing=[],
                steps=flown.diagnosis.steps[:1],
                unexplained=verdict == "unexplained",
            )
            text = worded(Results(made, changed)).text
            assert words in text
            assert "Missing: " not in text

    def test_an_assumed_thrust_coefficient_is_said_beside_the_verdict(
        self, worded: Worded, flown: Flown, made: Comparison
    ) -> None:
        said = "Thrust coefficient assumed: a wrong mass or thrust would look the same."
        assert said not in worded(Results(made, flown.diagnosis)).text
        vehicle = made.model.vehicle.model_copy(update={"assumed": ("rotor.thrust_n_per_rpm2",)})
        model = dataclasses.replace(made.model, vehicle=vehicle)
        diagnosis = dataclasses.replace(flown.diagnosis, model=model)
        text = worded(Results(dataclasses.replace(made, model=model), diagnosis)).text
        assert said in text[: text.index("The model :")]
        assert said in text[text.index("What is missing") :]  # beside the thrust scale that was tried

    def test_confounded_effects_are_named_with_what_tells_them_apart(
        self, worded: Worded, flown: Flown, made: Comparison
    ) -> None:
        confounded = dataclasses.replace(flown.diagnosis, confounded=[["ground_effect", "thrust_scale"]])
        text = worded(Results(made, confounded)).text
        assert "Ground effect or thrust scale: these data do not distinguish them." in text
        assert ConstantScale.distinguished_by in text

    def test_the_table_of_step_responses_labels_signed_and_absolute(self, flown: Flown, page: Page) -> None:
        for heading in ("M_A signed / m s", "M_A absolute / m s", "M_B signed / m s", "M_B absolute / m s"):
            assert heading in page.text
        table = flown.steps.table
        assert list(flown.steps.tracks) == ["none", "found", "out of ground effect"]
        for flight in table.flights:
            assert f"{flight.m_a_absolute:.3f}" in page.text
            assert f"{flight.rmse_m:.3f}" in page.text
        assert f"{table.flights[0].m_b_absolute:.3f} to {table.flights[1].m_b_absolute:.3f} m s" in page.text

    def test_step_responses_of_other_flights_than_the_table_are_refused(self, flown: Flown) -> None:
        with pytest.raises(LogError, match=r"expected those measured: .*step_response"):
            step_responses({"none": FlightLog("other.csv", None, {"time_s": np.arange(3.0)})}, flown.steps.table)


def _first_cells(page: Page) -> Iterator[tuple[str, str]]:
    return (("td", text.strip()) for text in page.texts if text.strip())


class TestWhatThePageNeverDoes:
    def test_it_needs_nothing_from_outside(self, html: str, page: Page) -> None:
        assert not re.search(r"https?:|@import|url\((?!#)", html)
        assert "script" not in {tag for tag, _ in page.tags}
        for tag, attributes in page.tags:
            for name in ("src", "href", "xlink:href"):
                value = attributes.get(name)
                assert value is None or value.startswith(("#", "data:image/png;base64,")), (tag, name)

    def test_it_stays_light(self, html: str) -> None:
        assert len(html.encode()) < 3_000_000

    def test_ids_that_figures_refer_to_are_there_once(self, html: str) -> None:
        ids = re.findall(r' id="([^"]+)"', html)
        for name in set(re.findall(r'(?:href="#|url\(#)([^")]+)', html)):
            assert ids.count(name) == 1, name

    def test_names_are_text_and_nothing_else(self, made: Comparison) -> None:
        html = render_report(Results(made))
        assert "<script" not in html
        assert "<b>rigid" not in html
        page = Page(html)
        assert NASTY in page.text
        assert "<b>rigid</b>" in page.text
        assert page.open == []

    def test_a_figure_takes_names_literally(self, flown: Flown) -> None:
        track = next(iter(flown.steps.tracks.values()))
        page = Page(plots.to_svg(plots.step_tail({f"_{NASTY}": track}), "tail"))
        assert NASTY in page.text
        assert "script" not in {tag for tag, _ in page.tags}


@pytest.mark.usefixtures("undrawn")
class TestWriting:
    def test_the_page_is_whole_and_nothing_else_is_left(self, made: Comparison, tmp_path: Path) -> None:
        path = tmp_path / "new" / "report.html"
        write_report(path, comparison=made)
        assert path.read_text(encoding="utf-8").endswith("</html>")
        assert [entry.name for entry in path.parent.iterdir()] == ["report.html"]

    def test_the_old_page_stays_until_the_new_one_is_whole(
        self, made: Comparison, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        path = tmp_path / "report.html"
        path.write_text("old")

        def full_disk(self: Path, text: str, **how: str) -> int:
            self.touch()
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(Path, "write_text", full_disk)
        with pytest.raises(SettingsError, match="No space left on device"):
            write_report(path, comparison=made)
        assert path.read_text() == "old"
        assert [entry.name for entry in tmp_path.iterdir()] == ["report.html"]

    def test_a_path_that_cannot_be_written_is_one_sentence(self, made: Comparison, tmp_path: Path) -> None:
        (tmp_path / "file").write_text("")
        (tmp_path / "folder").mkdir()
        for path in (tmp_path / "file" / "report.html", tmp_path / "folder"):
            with pytest.raises(SettingsError) as error:
                write_report(path, comparison=made)
            assert str(error.value).startswith(f"{path}: the report cannot be written (")
            assert "\n" not in str(error.value)
        assert sorted(entry.name for entry in tmp_path.iterdir()) == ["file", "folder"]


class TestFigures:
    def test_axes_say_what_they_show_and_in_which_unit(self, flown: Flown, raptor: Vehicle) -> None:
        flight = flown.before.dataset.flights[0]
        floor = flown.before.noise_floor["total"]
        two = _fitted_drag(raptor)
        figures: dict[str, Figure] = {
            "time": plots.acceleration_over_time(flight, flight.measured, {"rigid body": flight.measured}),
            **{
                f"{profile.axis} over {profile.variable}": plots.residual_over_variable(flown.before, profile)
                for profile in flown.before.profiles
            },
            "before and after": plots.before_after(flown.addition.before, flown.addition.after, None),
            "drag": plots.effect_over_variable(effect_curves(two, 1)[0]),
            "scale": plots.effect_over_variable(effect_curves(two, 0)[0]),
            "steps": plots.step_heights(flown.steps.on_one_reference),
            "tail": plots.step_tail(flown.steps.on_one_reference),
        }
        for name, figure in figures.items():
            assert isinstance(figure, Figure)
            for ax in figure.axes:
                assert UNIT.search(ax.get_ylabel()), (name, ax.get_ylabel())
            named = [tick.get_text() for tick in figure.axes[-1].get_xticklabels()] == ["north", "east", "up", "total"]
            assert named or UNIT.search(figure.axes[-1].get_xlabel()), (name, figure.axes[-1].get_xlabel())
        for figure in (plots.ranking(flown.diagnosis, floor), plots.model_sequence(flown.diagnosis, floor)):
            assert UNIT.search(figure.axes[0].get_xlabel())
        ratio = plots.thrust_ratio(flown.addition, 0).axes[0]
        assert UNIT.search(ratio.get_xlabel())
        assert "thrust ratio" in ratio.get_ylabel()

    def test_the_ranking_shows_every_candidate_that_was_fitted_and_none(self, flown: Flown) -> None:
        ax = plots.ranking(flown.diagnosis, flown.before.noise_floor["total"]).axes[0]
        names = [label.get_text() for label in ax.get_yticklabels()]
        fitted = [c.effect.name for c in flown.diagnosis.ranking if c.fitted]
        assert names == [*fitted, "none"] and len(fitted) < len(flown.diagnosis.ranking)

    def test_the_curve_has_its_band_and_the_measured_ratio_lies_on_it(self, flown: Flown) -> None:
        curve = ratio_curve(flown.addition, 0)
        assert (curve.low <= curve.high).all()
        # The hidden cushion has another form than the fitted one: they agree to a percent, not to the last digit.
        fitted = np.interp(curve.measured.x, curve.height_over_radius, curve.ratio)
        assert np.abs(curve.measured.mean - fitted).max() < 0.01
        assert curve.measured.mean[0] > 1.1
        assert (np.diff(curve.measured.x) > 0.0).all()
        small = flown.addition.model.vehicle.rotor.model_copy(update={"radius_m": 0.05})
        vehicle = flown.addition.model.vehicle.model_copy(update={"rotor": small})
        model = dataclasses.replace(flown.addition.model, vehicle=vehicle)
        high = ratio_curve(dataclasses.replace(flown.addition, model=model), 0)
        assert high.height_over_radius[-1] > high.data_range[1] > 14.0  # drawn as high as was flown

    def test_a_form_that_knows_of_forward_speed_has_its_curve_too(self, made: Comparison) -> None:
        html = render_report(Results(made, None, add(CheesemanForward, made.model, made.dataset), None, None, None))
        assert "thrust ratio over height" in html

    def test_an_effect_is_seen_in_the_residual_without_it_and_gone_with_it(self, raptor: Vehicle) -> None:
        addition = _fitted_drag(raptor)
        (scale,) = effect_curves(addition, 0)
        assert (scale.variable, scale.component) == ("time", "up")
        assert scale.binned_before.mean == pytest.approx(0.98, abs=0.15)  # a tenth of the weight
        assert scale.binned_after.mean == pytest.approx(0.0, abs=0.02)
        assert scale.fitted.mean == pytest.approx(scale.binned_before.mean, abs=0.02)
        drag = effect_curves(addition, 1)
        assert [(c.variable, c.component) for c in drag] == [("speed_forward", "forward"), ("speed_right", "right")]

    def test_a_figure_is_the_same_whatever_style_the_caller_has_set(self, flown: Flown) -> None:
        import matplotlib as mpl

        expected = plots.to_svg(plots.before_after(flown.addition.before, flown.addition.after, None), "bars")
        with mpl.rc_context({"font.size": 30.0, "svg.fonttype": "path"}):
            again = plots.to_svg(plots.before_after(flown.addition.before, flown.addition.after, None), "bars")
        assert again == expected


def _fitted_drag(raptor: Vehicle) -> Addition:
    """Drag on top of a thrust scale, fitted to a flight to and fro that has only the scale."""
    log = to_and_fro(obedient(Model(raptor).plus(ConstantScale(factor=1.1)), noise_m_s=0.005), 0.8)
    return add(LinearDrag, Model(raptor).plus(ConstantScale()), load_dataset([log], raptor))


@pytest.mark.usefixtures("undrawn")
class TestFirstPage:
    def test_it_stands_alone(self, raptor: Vehicle) -> None:
        truth = Model(raptor).plus(Exponential(a=0.3, b=5.0))
        flown = load_dataset([obedient(truth, 30.0, name="a.csv")], raptor)
        hashed = dataclasses.replace(flown, flights=[dataclasses.replace(f, sha256=64 * "7") for f in flown.flights])
        page = Page(render_report(Results(compare(truth, hashed))))
        first = page.text.partition("Flights")[0]
        assert "Written" in first and "by quadctl" in first
        assert "m a = m g" in first
        assert "ground_effect.exponential" in first and "a = 0.3" in first and "b = 5 1/m" in first
        assert f"a.csv (SHA-256 {12 * '7'}" in first

    def test_it_names_one_error_only(self, raptor: Vehicle) -> None:
        flown = load_dataset([obedient(Model(raptor).plus(Exponential(a=0.3, b=5.0)), 30.0)], raptor)
        text = Page(render_report(Results(compare(Model(raptor), flown)))).text
        assert "as given, per-flight bias not removed" not in text


@pytest.mark.usefixtures("undrawn")
def test_the_equation_names_parameters_without_markup(raptor: Vehicle) -> None:
    log = obedient(Model(raptor).plus(ConstantScale(factor=1.1)), noise_m_s=0.01)
    html = render_report(Results(compare(Model(raptor).plus(ConstantScale(1.1)), load_dataset([log], raptor))))
    assert "All rotors give factor times the thrust that the vehicle file says, with factor = 1.1" in html
