"""The page without a browser: sessions as values, work that can be cancelled, files that are kept out, figures."""

import asyncio
import csv
import socket
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quadctl.cli import main
from quadctl.effects.ground_effect import Exponential, Hayden
from quadctl.effects.motor_lag import FirstOrderLag
from quadctl.errors import QuadctlError, SettingsError
from quadctl.lab.comparison.comparison import Comparison, compare
from quadctl.lab.fitting.fitted_model import fit_model
from quadctl.lab.fitting.fitter import Fitter, Optimum
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.lab.flights.prediction import rmse
from quadctl.lab.selection.diagnosis import Diagnosis, diagnose
from quadctl.lab.selection.rule import is_supported
from quadctl.lab.study import Study, quiet
from quadctl.lab.symbolic.effect_file import as_effect_file
from quadctl.lab.symbolic.formula import Formula, Law, Symbolic
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from quadctl.web.elements.figure import Figure, figure, to_csv
from quadctl.web.elements.theme import DARK, LIGHT
from quadctl.web.figures.downsample import POINTS, downsampled
from quadctl.web.figures.error_map import CLOUD, error_map
from quadctl.web.figures.path import path_figure
from quadctl.web.figures.profile import profile_figure
from quadctl.web.figures.ratio import ratio_over_height
from quadctl.web.figures.rollouts import rollout_figure
from quadctl.web.figures.timeline import full_timeline
from quadctl.web.panels.fails import share_of
from quadctl.web.session.files import keep_expression, own_effects, places_of, require_inside, upload_path
from quadctl.web.session.findings import Findings, require_formula
from quadctl.web.session.session import Session, Step, load_session, session_to_yaml
from quadctl.web.work import jobs
from quadctl.web.work.predictions import predictions
from quadctl.web.work.reading import log_names
from quadctl.web.work.worker import CancelledError, Worker
from tests.support.flights import obedient
from tests.support.places import ROOT
from tests.support.rollouts import ROLLOUTS

A, B = Path("a.csv"), Path("b.csv")


@pytest.fixture
def extended(raptor: Vehicle) -> Session:
    """Two logs, and a sequence of three steps whose last one is where we stand."""
    rigid = Model(raptor)
    cushion = rigid.plus(Exponential(a=0.3, b=5.0))
    session = Session().with_logs([A, B]).begun_with(rigid).judged(0.4)
    session = session.extended(Step("+ ground_effect.exponential", cushion)).judged(0.1)
    return session.extended(Step("refitted", cushion)).judged(0.09)


class TestSession:
    def test_going_back_and_adding_again_leaves_what_was_above_behind(self, extended: Session) -> None:
        again = extended.at(0).extended(Step("+ other", extended.sequence[1].model))
        assert [step.name for step in again.sequence] == ["rigid body", "+ other"]
        assert again.current == 1

    def test_going_back_alone_loses_nothing(self, extended: Session) -> None:
        assert extended.at(0).at(2) == extended

    def test_an_effect_is_switched_off_and_on_again(self, extended: Session) -> None:
        off = extended.switched("ground_effect.exponential")
        assert off.model is not None and off.model.stack == ()
        assert off.switched("ground_effect.exponential").model == extended.model

    def test_other_flights_make_all_errors_unknown(self, extended: Session) -> None:
        assert [step.error_m_s2 for step in extended.with_role(B, unseen=True).sequence] == [None, None, None]

    def test_the_noise_floor_is_the_least_that_any_step_has_shown(self, extended: Session, tmp_path: Path) -> None:
        assert extended.floor_m_s2 is None
        session = extended.judged(0.09, 0.05).at(0).judged(0.4, 0.16)
        path = tmp_path / "session.lab.yaml"
        path.write_text(session_to_yaml(session))
        assert session.floor_m_s2 == load_session(path).floor_m_s2 == 0.05
        assert session.unjudged().floor_m_s2 is None

    def test_not_all_flights_can_be_held_out(self, extended: Session) -> None:
        held = extended.with_role(A, unseen=True)
        assert held.unseen == {A}
        with pytest.raises(SettingsError, match="at least one"):
            held.with_role(B, unseen=True)

    def test_a_file_gives_the_session_back(self, extended: Session, tmp_path: Path) -> None:
        session = extended.with_role(B, unseen=True).judged(0.09).at(1)
        path = tmp_path / "session.lab.yaml"
        path.write_text(session_to_yaml(session))
        again = load_session(path)
        assert [log.resolve() for log in again.logs] == [log.resolve() for log in session.logs]
        assert again.unseen == {B.resolve()}
        assert [(r.name, r.error_m_s2, r.model.effects) for r in again.sequence] == [
            (r.name, r.error_m_s2, r.model.effects) for r in session.sequence
        ]
        assert again.current == 1

    def test_a_file_holds_the_hashes_of_the_logs_and_the_choices_of_the_tab(
        self, extended: Session, tmp_path: Path
    ) -> None:
        path = tmp_path / "session.lab.yaml"
        path.write_text(session_to_yaml(replace(extended, hashes={A: "12ab"}, view="show=time&axis=north")))
        again = load_session(path)
        assert again.hashes == {A.resolve(): "12ab"}
        assert again.view == "show=time&axis=north"
        assert again.without_log(A.resolve()).hashes == {}

    def test_of_one_flight_that_is_left_no_whole_flight_is_held_out_by_turns(self, extended: Session) -> None:
        by_flights = replace(extended, hold_out="flights")
        assert by_flights.without_log(A).hold_out == "blocks"
        more = by_flights.with_logs([Path("c.csv"), Path("d.csv")])
        assert more.without_log(A).hold_out == "flights"

    def test_logs_that_lie_beside_the_session_now_are_found(self, extended: Session, tmp_path: Path) -> None:
        gone = [Path("/elsewhere/a.csv"), Path("/elsewhere/b.csv")]
        session = Session(hashes={gone[0]: "12ab"}, unseen=frozenset(gone[:1])).with_logs(gone)
        (tmp_path / "a.csv").touch()
        moved = session.moved(places_of(session.logs, [tmp_path]))
        assert moved.logs == (tmp_path / "a.csv", gone[1])
        assert moved.unseen == {tmp_path / "a.csv"} and moved.hashes == {tmp_path / "a.csv": "12ab"}

    def test_what_was_found_is_found_again_in_the_file(self, found: Diagnosis, tmp_path: Path) -> None:
        path = tmp_path / "found.lab.yaml"
        session = Session().with_logs([A]).begun_with(found.model).searched(found.model, Findings.of(found, {}))
        path.write_text(session_to_yaml(session))
        step = load_session(path).sequence[0]
        assert step.found is not None
        again = step.found.diagnosed(step.model, found.dataset).diagnosis
        assert str(again) == str(found)
        assert [is_supported(c) for c in again.ranking] == [is_supported(c) for c in found.ranking]
        assert again.best.effects == found.best.effects

    def test_forecasts_are_those_of_the_flights_and_of_the_vehicle(
        self, extended: Session, raptor: Vehicle, tmp_path: Path
    ) -> None:
        session, path = extended.forecast(raptor, ROLLOUTS), tmp_path / "session.lab.yaml"
        path.write_text(session_to_yaml(session.at(1)))
        again = load_session(path).rollouts
        assert again is not None and set(again.errors) == set(ROLLOUTS.errors)
        for model, blocks in ROLLOUTS.errors.items():
            np.testing.assert_allclose(again.errors[model], blocks, atol=1e-6)
        heavier = raptor.model_copy(update={"mass_kg": 2.0})
        assert session.begun_with(Model(raptor)).rollouts is ROLLOUTS
        assert session.begun_with(Model(heavier)).rollouts is None
        assert extended.forecast(heavier, ROLLOUTS).rollouts is None
        assert session.with_role(B, unseen=True).rollouts is None

    def test_other_flights_make_what_was_found_unknown(self, found: Diagnosis) -> None:
        session = Session().with_logs([A, B]).begun_with(found.model).searched(found.model, Findings.of(found, {}))
        assert session.with_role(B, unseen=True).sequence[0].found is None

    @pytest.mark.parametrize(
        ("text", "said"),
        [
            ("switched_off: [ground_effect.hayden]", "switched_off holds ground_effect.hayden"),
            ("rungs: [{name: x, model: {vehicle: RAPTOR, effects: []}, found: '{'}]", "found: is not valid JSON"),
            (
                "rungs: [{name: x, model: {vehicle: RAPTOR, effects: []}, found: '{}'}]",
                r"found: required field missing @ \$.verdict",
            ),
            ("rungs: [{name: x, model: {effects: []}}]", "vehicle"),
            ("steps: 1", "steps"),
            ("rollouts: '[]'", "rollouts holds no errors"),
            ("rollouts: '{'", "rollouts holds no errors"),
            ('rollouts: \'{"held": [[[0.1]]], "forecast": [[[0.1]]]}\'', "rollouts holds no errors"),
            ("- 1", "expected"),
        ],
    )
    def test_what_is_no_session_is_refused_in_one_sentence(self, text: str, said: str, tmp_path: Path) -> None:
        path = tmp_path / "no.lab.yaml"
        path.write_text(text.replace("RAPTOR", str(ROOT / "config" / "vehicles" / "raptor.yaml")))
        with pytest.raises(SettingsError, match=said) as caught:
            load_session(path)
        assert str(path) in str(caught.value)


@pytest.fixture(scope="module")
def flight(raptor: Vehicle) -> Dataset:
    truth = Model(raptor).plus(Exponential(a=0.3, b=5.0))
    return load_dataset([obedient(truth, noise_m_s=0.01)], raptor)


@pytest.fixture(scope="module")
def found(raptor: Vehicle, flight: Dataset) -> Diagnosis:
    """Diagnosis of a flight that obeys one of the two effects searched for."""
    return diagnose(Model(raptor), flight, [Exponential, Hayden])


class TestFindings:
    def test_an_expression_becomes_the_same_effect_again_and_never_overwrites_another(
        self, raptor: Vehicle, flight: Dataset, tmp_path: Path
    ) -> None:
        unexplained = diagnose(Model(raptor), flight, [])
        symbolic = Findings.of(unexplained, {}).diagnosed(unexplained.model, flight).diagnosis.symbolic
        assert unexplained.symbolic is not None and symbolic is not None
        (tmp_path / "unexplained.py").write_text("another")
        path = keep_expression(symbolic, unexplained.model, tmp_path)
        assert path.read_text() == as_effect_file(unexplained.symbolic, "unexplained.expression")
        assert keep_expression(symbolic, unexplained.model, tmp_path) == path
        assert (tmp_path / "unexplained.py").read_text() == "another"

    def formula(self, part: str) -> Formula:
        return Formula((part,), ("height_over_radius",), {"a": 1.0, "k1": 2.0}, {}, {}, 0.5, np.empty(0))

    def test_a_session_holds_no_program(self, raptor: Vehicle, flight: Dataset, found: Diagnosis) -> None:
        law = Law("up", self.formula("__import__('os')"), self.formula("{a}"), 0.0)
        evil = replace(found, symbolic=Symbolic("world", (law,), {}))
        text = Findings.of(evil, {}).to_json()
        with pytest.raises(SettingsError, match="is no formula"):
            Findings.from_json(text, found.model)

    @pytest.mark.parametrize(
        "part", ["{a}*exp(-0.5*height_over_radius)", "{k1}*speed*abs(speed)", "{a}*exp(-((north + 1e-05)/0.3)**2)"]
    )
    def test_a_formula_is_taken(self, part: str) -> None:
        assert require_formula(self.formula(part)).parts == (part,)

    @pytest.mark.parametrize(
        "part",
        ["__import__('os')", "{a.__class__}", "{a}*eval(speed)", "speed.real", "speed; north", "{a!r}", "[speed]", "{"],
    )
    def test_what_would_be_a_program_is_refused(self, part: str) -> None:
        with pytest.raises(SettingsError, match="is no formula"):
            require_formula(self.formula(part))


OWN_EFFECT = """
from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects import Conditions, Effect, parameter
from quadctl.numeric import Number, Vector
from quadctl.vehicle import Vehicle


@dataclass(frozen=True)
class Push(Effect):
    name: ClassVar[str] = "own.push"
    source: ClassVar[str] = "a test"
    depends_on: ClassVar[tuple[str, ...]] = ()
    physics: ClassVar[str] = "A steady push up."
    distinguished_by: ClassVar[str] = "nothing"
    mission: ClassVar[str] = "missions/hover_staircase.yaml"
    force_n: float = parameter(0.1, -1.0, 1.0, "N", "force up")

    def force(self, total_thrust_n: Number, c: Conditions, vehicle: Vehicle) -> Vector:
        return (0.0, 0.0, -self.force_n)
"""


class TestFitOnce:
    """The fit of a model goes with it from action to action."""

    def test_a_further_step_is_evaluated_without_another_fit(
        self, raptor: Vehicle, flight: Dataset, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        before = Study(Model(raptor), flight).evaluate()
        fitted: list[tuple[str, ...]] = []

        def counted(self: Fitter, *arguments: Any, **named: Any) -> Optimum:
            fitted.append(tuple(effect.name for effect in self.model.effects))
            return fit(self, *arguments, **named)

        fit = Fitter.fit
        monkeypatch.setattr(Fitter, "fit", counted)
        study = Study(Model(raptor), flight, None, before.solution)
        extended = jobs.next_step(Study.add, study, "ground_effect.exponential", progress=quiet)
        assert fitted == [("ground_effect.exponential",)] * 2  # on top of the model, and continued to the minimum
        assert extended.evaluation.error_m_s2 == extended.model.stack[-1].fitted.rmse_after  # type: ignore[union-attr]
        jobs.look_for(Study(extended.model, flight, None, extended.evaluation.solution), quiet)
        assert ("ground_effect.exponential",) not in fitted[2:]

    def test_an_effect_of_a_file_stays_known_to_the_model_and_to_the_next_search(
        self, raptor: Vehicle, flight: Dataset, tmp_path: Path
    ) -> None:
        path = tmp_path / "own.py"
        path.write_text(OWN_EFFECT)
        before = Study(Model(raptor), flight).evaluate()
        study = Study(Model(raptor), flight, None, before.solution)
        extended = jobs.next_step(Study.add, study, str(path), progress=quiet)
        assert extended.model.effect_files == (path,)
        fit = Study(extended.model, flight, None, extended.evaluation.solution).fit()
        assert fit.fitter.model.effect_files == (path,)

    def test_a_fit_without_its_flights_is_the_same_fit_on_them_again(self, raptor: Vehicle, flight: Dataset) -> None:
        fit = fit_model(Model(raptor).plus(Exponential()), flight)
        again = fit.solution.on(flight)
        assert again.model == fit.model and np.array_equal(again.draws, fit.draws)


def _say_and_wait(progress: Callable[[str], None]) -> None:
    progress("begun")
    time.sleep(600.0)


def _double(x: int, progress: Callable[[str], None]) -> int:
    return 2 * x


def _fail(progress: Callable[[str], None]) -> None:
    raise SettingsError("it is wrong")


class TestWorker:
    def test_cancelled_work_ends_at_once_and_the_next_is_done(self) -> None:
        async def story() -> int:
            worker = Worker()
            try:
                begun = asyncio.Event()
                work = asyncio.ensure_future(worker.run(_say_and_wait, progress=lambda text: begun.set()))
                await begun.wait()
                worker.cancel()
                with pytest.raises(CancelledError):
                    await work
                with pytest.raises(QuadctlError, match="it is wrong"):
                    await worker.run(_fail)
                return int(await worker.run(_double, 21))
            finally:
                worker.close()

        assert asyncio.run(asyncio.wait_for(story(), 120.0)) == 42


class TestCommand:
    @pytest.mark.parametrize(
        ("arguments", "said"),
        [
            (["no_such.csv"], "no_such.csv: there is no such file"),
            ([str(ROOT / "README.md")], "README.md: has no header"),
            ([str(ROOT / "config" / "vehicles" / "raptor.yaml")], "expected a flight log, or --model raptor.yaml"),
            ([str(ROOT / "missions")], "missions: is a directory, expected the flight logs in it"),
            (["--model", "no_such.yaml"], "no_such.yaml"),
            (["--session", "no_such.lab.yaml"], "no_such.lab.yaml"),
            (["--out", str(ROOT / "README.md")], "README.md: is a file, expected a folder to write into"),
            (["/dev/null"], "/dev/null: is a device or a pipe, expected a file that holds a flight log"),
            (["--missions", str(ROOT / "README.md")], "README.md is a file, expected a folder"),
        ],
    )
    def test_what_is_not_there_is_said_before_anything_is_served(
        self, arguments: list[str], said: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.setattr("sys.argv", ["quadctl", "lab", "--no-open", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        assert ended.value.code == 1
        assert said in capsys.readouterr().err

    def test_a_port_that_is_taken_is_said(
        self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        with socket.socket() as other:
            other.bind(("127.0.0.1", 0))
            other.listen()
            port = str(other.getsockname()[1])
            monkeypatch.setattr("sys.argv", ["quadctl", "lab", "--no-open", "--port", port])
            with pytest.raises(SystemExit) as ended:
                main()
        assert ended.value.code == 1
        assert f"port {port} is taken" in capsys.readouterr().err


class TestFiles:
    @pytest.mark.parametrize("name", ["../../etc/flight.csv", "/etc/flight.csv", "..\\flight.csv", ".flight.csv"])
    def test_a_dropped_file_lands_in_the_folder_whatever_its_name(self, name: str, tmp_path: Path) -> None:
        path = upload_path(tmp_path, name)
        assert path == tmp_path / "flight.csv"

    @pytest.mark.parametrize("name", ["photo.png", "flight", "", "run.csv.exe"])
    def test_what_is_no_log_by_its_name_is_refused(self, name: str, tmp_path: Path) -> None:
        with pytest.raises(QuadctlError, match=r"expected \.csv"):
            upload_path(tmp_path, name)

    def test_a_session_cannot_lead_out_of_the_folder(self, tmp_path: Path) -> None:
        inside = tmp_path / "lab"
        inside.mkdir()
        (inside / "link.csv").symlink_to("/etc/passwd")
        require_inside(inside, (inside / "a.csv",))
        for path in (inside / "../secret.csv", Path("/etc/passwd"), inside / "link.csv"):
            with pytest.raises(QuadctlError, match="outside"):
                require_inside(inside, (path,))

    def test_python_files_are_found_wherever_settings_name_them(self) -> None:
        model = {"vehicle": "raptor.yaml", "effect_files": ["a.py"]}
        assert list(own_effects(model)) == ["a.py"]
        assert list(own_effects({"rungs": [{"model": model}, {"model": {"effect_files": "b"}}, 1]})) == ["a.py"]

    def test_logs_of_the_same_name_are_told_apart_by_their_folders(self) -> None:
        paths = [Path(name) for name in ("a/flight.csv", "b/flight.csv", "b/other.csv", "c/b/flight.csv")]
        assert log_names(paths) == ["flight.csv (a)", "flight.csv (b)", "other.csv", "flight.csv (c/b)"]


class TestDownsampling:
    def test_a_long_line_keeps_its_peaks_its_gaps_and_few_points(self) -> None:
        x = np.arange(60_000.0)
        y = np.sin(x / 900.0)
        y[31_234], y[40_000:41_000] = 9.0, np.nan
        few_x, few_y = downsampled(x, y)
        assert len(few_x) <= 2 * POINTS
        assert np.nanmax(few_y) == 9.0 and np.isnan(few_y).any()
        assert (np.diff(few_x) > 0.0).all()

    def test_a_window_is_shown_in_full_detail_with_its_neighbours(self) -> None:
        x = np.arange(60_000.0)
        few_x, _ = downsampled(x, x, (100.5, 110.5))
        assert few_x.tolist() == list(range(100, 112))


@pytest.fixture(scope="module")
def compared(raptor: Vehicle) -> Comparison:
    truth = Model(raptor).plus(Exponential(a=0.3, b=5.0))
    return compare(Model(raptor), load_dataset([obedient(truth, noise_m_s=0.01)], raptor))


@pytest.fixture(scope="module")
def figures(compared: Comparison) -> list[Figure]:
    flight = compared.dataset.flights[0]
    some = flight.variables["height_over_radius"] < 3.0
    log = obedient(compared.model, noise_m_s=0.01)
    timeline = full_timeline(flight, log, {"rigid body": flight.measured}, "up", DARK, some)
    return [
        timeline.figure(DARK),
        profile_figure(compared, compared.profiles[0], LIGHT),
        error_map(compared, "up", ("height_over_radius", "climb_rate"), LIGHT),
        path_figure(flight, some, LIGHT),
        ratio_over_height(compared.model.plus(Exponential()), compared.dataset, LIGHT),
    ]


class TestFigures:
    def test_errors_of_forecasts_have_their_intervals(self) -> None:
        drawn = rollout_figure(ROLLOUTS, 2, LIGHT)
        held, model, forecast = drawn["data"]
        assert [one["name"] for one in (held, model, forecast)] == ["held", "model", "forecast"]
        of = ROLLOUTS.mean("forecast", 3, 2)
        assert (forecast["y"][3], forecast["error_y"]["array"][3]) == pytest.approx((of.value, of.high - of.value))
        assert drawn["layout"]["yaxis"]["title"]["text"] == "error of rotation / rad"
        assert len(to_csv(drawn).splitlines()) == 5

    def test_every_axis_has_a_title_with_a_unit(self, figures: list[Figure]) -> None:
        for drawn in figures:
            for title in _axis_titles(drawn):
                assert " / " in title or title.startswith("thrust ratio"), title

    def test_every_figure_gives_its_numbers_as_csv(self, figures: list[Figure]) -> None:
        for drawn in figures:
            rows = to_csv(drawn).splitlines()
            assert len(rows) > 10
            assert {len(row) for row in csv.reader(rows)} == {len(next(csv.reader(rows)))}

    def test_a_curve_without_a_name_is_refused(self) -> None:
        line = {"type": "scatter", "x": [0.0], "y": [0.0]}
        with pytest.raises(ValueError, match="curve 1 of a figure has no name"):
            figure([{**line, "name": "height"}, line], LIGHT, 200)

    def test_the_brushed_samples_stand_out_in_the_timeline(self, figures: list[Figure], compared: Comparison) -> None:
        (selected,) = [trace for trace in figures[0]["data"] if trace["name"] == "selected"]
        heights = compared.dataset.variable("height_over_radius")
        assert heights is not None
        assert len(selected["x"]) == np.count_nonzero(heights < 3.0) > 0

    def test_the_share_of_a_profile_is_a_caption_that_breaks_into_lines(
        self, figures: list[Figure], compared: Comparison
    ) -> None:
        assert "title" not in figures[1]["layout"]
        assert "% of the squared error of this axis" in str(share_of(compared.profiles[0], compared))

    def test_the_name_of_the_band_stands_on_a_ground_of_its_own(self, figures: list[Figure]) -> None:
        (note,) = figures[4]["layout"]["annotations"]
        assert (note["text"], note["bgcolor"]) == ("heights flown", LIGHT.surface)

    def test_a_map_of_a_long_flight_has_few_points(self, compared: Comparison) -> None:
        (samples,) = [
            t for t in error_map(compared, "up", ("thrust", "climb_rate"), LIGHT)["data"] if t["name"] == "samples"
        ]
        assert len(samples["x"]) <= 2 * CLOUD


class TestPredictions:
    def test_a_figure_shows_the_residual_that_the_error_is_computed_from(self, raptor: Vehicle) -> None:
        lagging = Model(raptor).plus(FirstOrderLag(time_constant_s=0.15))
        dataset = load_dataset([obedient(lagging, noise_m_s=0.01)], raptor)
        (flight,) = dataset.flights
        shown = predictions({"lag": lagging, "rigid body": Model(raptor)}, flight)
        for name, model in (("lag", lagging), ("rigid body", Model(raptor))):
            residual = flight.measured - shown[name]
            assert rmse(residual)["total"] == compare(model, dataset).rmse["total"]


def _axis_titles(drawn: Figure) -> list[str]:
    layout: dict[str, Any] = drawn["layout"].get("scene", drawn["layout"])
    found = [value["title"]["text"] for key, value in layout.items() if key[1:5] == "axis"]
    assert len(found) >= 2
    return found
