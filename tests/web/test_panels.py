"""Panels of the lab page: a panel can show its fields only, and a tab that stays open is never stale."""

import asyncio
import functools
import inspect
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast, get_type_hints
from unittest.mock import MagicMock, create_autospec

import numpy as np
import pytest
from nicegui import ui
from nicegui.client import Client
from nicegui.element import Element

from quadctl.effects.ground_effect import Exponential, Hayden
from quadctl.effects.inflow import AxialInflow
from quadctl.effects.payload import MassStep
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.lab.comparison.failures import Failure, Stretch
from quadctl.lab.comparison.remainder import Remainder
from quadctl.lab.comparison.wording import number, quantity, share_of_g
from quadctl.lab.evidence import evidence_for
from quadctl.lab.finding import Finding
from quadctl.lab.finding import Kind as Found
from quadctl.lab.fitting.fitted_model import fit_model
from quadctl.lab.fitting.nuisances import BOUND, KINDS
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.lab.flights.prediction import GROUPS
from quadctl.lab.flights.vehicle_match import weight_doubt
from quadctl.lab.selection import diagnosis as lab_diagnosis
from quadctl.lab.selection.diagnosis import diagnose
from quadctl.lab.selection.unseen import UnseenError
from quadctl.lab.selection.wording import rival_of
from quadctl.lab.study import Study
from quadctl.lab.verdict import Statement
from quadctl.logs.findings import Kind, finding
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.quality import quality
from quadctl.model import Model, Provenance, StackedEffect
from quadctl.vehicle import Vehicle
from quadctl.web.elements.theme import DARK, LIGHT
from quadctl.web.figures.ratio import ratio_over_height
from quadctl.web.page.page import TABS, Page
from quadctl.web.panels.choices import Choices
from quadctl.web.panels.compensator import answer, doubts, far
from quadctl.web.panels.fails import Failures
from quadctl.web.panels.glossary import GLOSSARY
from quadctl.web.panels.help import KEYS
from quadctl.web.panels.overview import as_drawn, beside_the_motion
from quadctl.web.panels.panel import Controls, Panel
from quadctl.web.panels.stack import BEYOND, NUISANCES, SAME_CAUSE, apart, at_limits, kind_of
from quadctl.web.panels.verdict import OF_BLOCKS, Verdict, on_whole_flights
from quadctl.web.panels.view import OWNERS, View, owner_of
from quadctl.web.panels.words import Said
from quadctl.web.session.findings import Diagnosed, Findings
from quadctl.web.session.history import History
from quadctl.web.session.session import Session, Step
from quadctl.web.work.doubts import Doubt
from quadctl.web.work.jobs import Opened
from quadctl.web.work.reading import OpenedLog
from quadctl.web.work.simulated import FAR, WITH, WITHOUT
from quadctl.web.work.state import Gathered, Message, Results, Work
from quadctl.web.workbench.intake import Intake
from quadctl.web.workbench.workbench import Workbench
from quadctl.words import fact
from tests.support.flights import obedient
from tests.support.places import ROOT, VEHICLES
from tests.support.rollouts import ROLLOUTS


def subclasses(panel: type[Panel]) -> list[type[Panel]]:
    """All classes that stand on `panel`, bases of others included."""
    return [each for direct in panel.__subclasses__() for each in (direct, *subclasses(direct))]


CLASSES = sorted(subclasses(Panel), key=lambda panel: panel.__name__)
PANELS = [each for each in CLASSES if not inspect.isabstract(each)]
FAILURE = Failure(
    "up", "time", 0.0, 9.0, 0.5, 9.0, 100, "offset", 25.0, (Stretch("1.csv", 1.0, 5.0, 0.9, whole=False),)
)
ADDRESSES = {"url", "id", "for"}
"""Properties that hold the number of an element, another one in every tab."""
FIELDS = [(panel, field.name) for panel in PANELS for field in fields(panel)]


class TestPanel:
    @pytest.mark.parametrize(("panel", "name"), FIELDS)
    def test_every_field_is_one_of_the_view_and_has_its_type(self, panel: type[Panel], name: str) -> None:
        owner = OWNERS[owner_of(name)]
        attribute = inspect.getattr_static(owner, name, None)
        is_property = isinstance(attribute, property) and attribute.fget is not None
        offered = get_type_hints(attribute.fget)["return"] if is_property else get_type_hints(owner)[name]
        assert get_type_hints(panel)[name] == offered

    @pytest.mark.parametrize(("panel", "name"), FIELDS)
    def test_a_change_of_any_field_is_seen(self, panel: type[Panel], name: str) -> None:
        shown = panel(**{field.name: object() for field in fields(panel)})
        assert shown.shows_the_same_as(replace(shown))
        assert not shown.shows_the_same_as(replace(shown, **{name: object()}))

    def test_there_is_nothing_to_read_from_the_controls(self) -> None:
        actions = [action for name, action in vars(Controls).items() if inspect.isfunction(action) and name[0] != "_"]
        assert actions
        assert all(get_type_hints(action)["return"] is type(None) for action in actions)

    def test_panels_only_act_on_the_workbench(self) -> None:
        code = "".join(path.read_text() for path in (ROOT / "quadctl" / "web" / "panels").glob("*.py"))
        called = set(re.findall(r"\bdo\.bench\.(\w+)", code))
        assert len(called) > 20
        for name in called:
            assert get_type_hints(getattr(Workbench, name))["return"] is type(None), name

    def test_what_panels_choose_is_a_choice_of_the_tab(self) -> None:
        code = "".join(path.read_text() for path in (ROOT / "quadctl" / "web" / "panels").glob("*.py"))
        named = set(re.findall(r"\bdo\.choose[(,]\s*(\w+)=", code))
        assert len(named) > 5 and named <= {field.name for field in fields(Choices)}

    def test_fields_that_cannot_be_compared_by_value_are_compared_by_identity(self) -> None:
        @dataclass(frozen=True)
        class Numbers(Panel):
            values: float

            def draw(self, do: Controls) -> None:
                """Nothing to draw."""

        assert Numbers(np.nan).shows_the_same_as(Numbers(np.nan))


class TestItsDocumentation:
    """docs/lab-page.md says in which file each part of the page is."""

    @pytest.fixture
    def rows(self) -> dict[str, tuple[list[str], list[str]]]:
        """Files of the panels and of the figures, by the part of the page."""
        text = (ROOT / "docs" / "lab-page.md").read_text().partition("| part of the page |")[2].partition("\n\n")[0]
        cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines()[2:]]
        return {
            part: (re.findall(r"`(.+?)`", panels), re.findall(r"`(.+?)`", figures)) for part, panels, figures in cells
        }

    def test_it_names_the_file_of_every_tab(self, rows: dict[str, tuple[list[str], list[str]]]) -> None:
        tabs = {tab.title: path_of(tab.panels[0].__module__) for tab in TABS.values()}
        assert {part: panels[0] for part, (panels, _) in rows.items() if part in tabs} == tabs

    def test_it_names_the_file_of_every_panel(self, rows: dict[str, tuple[list[str], list[str]]]) -> None:
        assert {file for panels, _ in rows.values() for file in panels} == {path_of(p.__module__) for p in CLASSES}

    def test_it_names_the_figures_that_these_files_draw(self, rows: dict[str, tuple[list[str], list[str]]]) -> None:
        for part, (panels, figures) in rows.items():
            code = "".join((ROOT / "quadctl" / "web" / file).read_text() for file in panels)
            drawn = {f"figures/{name}.py" for name in re.findall(r"from quadctl\.web\.figures\.(\w+) import", code)}
            assert set(figures) == drawn, part


def path_of(module: str) -> str:
    """File of a module in quadctl/web/."""
    return module.removeprefix("quadctl.web.").replace(".", "/") + ".py"


@pytest.fixture(scope="module")
def views(raptor: Vehicle) -> dict[str, View]:
    """A page on which everything is shown; and the same after one change each, by its name."""
    rigid = Model(raptor)
    fitted = StackedEffect(Exponential(a=0.3, b=5.0), Provenance(logs=("0.csv", "1.csv")))
    truth = replace(rigid, stack=(fitted,))
    logs = [obedient(truth, 30.0, noise_m_s=0.01, seed=seed, name=f"{seed}.csv") for seed in (0, 1)]
    dataset = load_dataset(logs, raptor)
    opened = Opened([OpenedLog(Path(log.name), log, quality(log)) for log in logs], dataset, None)
    evaluation = Study(truth, dataset).evaluate()
    elsewhere = replace(truth, stack=(replace(fitted, fitted=Provenance(logs=("0.csv",))),))
    found = Diagnosed(diagnose(rigid, dataset, [Exponential, Hayden]), {})
    effect = found.diagnosis.steps[1].effect
    gathered = Gathered(evidence_for(effect, fit_model(found.diagnosis.best, dataset)), found)
    session = Session().with_logs([Path(log.name) for log in logs]).begun_with(rigid).judged(0.4)
    session = session.extended(Step("+ ground_effect.exponential", truth)).judged(0.1, 0.05)
    results = Results(evaluation, found, checked=())
    view = View(
        session=session,
        opened=opened,
        results=results,
        work=None,
        search=None,
        message=None,
        as_read=(),
        waiting=(),
        windows=1,
        history=History((session,)),
        hidden=None,
        vehicles=(Path("raptor.yaml"),),
        own_vehicles=(),
        folder=Path("lab"),
        theme=LIGHT,
        choices=Choices(axis="up", channels=("z_m", "motor1_rpm")),
        other_model=None,
    )
    searching = replace(view, search=Work("Looking"), results=replace(results, found=None, before=found))
    working = replace(view, work=Work("Fitting"))
    empty = replace(view, session=Session(), opened=Opened(), results=Results())
    suggestion = SimpleNamespace(best=None, reasons=(), answer=("this mission tells most",))

    def chosen(**changes: Any) -> dict[str, Any]:
        return {"choices": replace(view.choices, **changes)}

    asked = chosen(evidence=gathered.evidence.effect.name)
    changed: dict[str, dict[str, Any]] = {
        "another step": {"session": session.at(0)},
        "one more step": {"session": session.extended(Step("refitted", truth))},
        "an error that became known": {"session": session.judged(0.09, 0.04)},
        "an effect switched off": {"session": session.switched("ground_effect.exponential")},
        "another vehicle": {"session": session.begun_with(Model(raptor.model_copy(update={"name": "other"})))},
        "forecasts of the whole state": {"session": session.forecast(raptor, ROLLOUTS)},
        "a flight held out": {"session": session.with_role(Path("1.csv"), True)},
        "another cross-validation": {"session": replace(session, hold_out="flights")},
        "a log that cannot be used": {"opened": replace(opened, logs=[OpenedLog(Path("x.csv"), problem="no log")])},
        "a log of another vehicle": {
            "opened": replace(
                opened, logs=[replace(opened.logs[0], doubt=fact(Doubt.MASS, said_kg=1.9, mass_kg=1.5)), opened.logs[1]]
            )
        },
        "a log with a gap": {"opened": replace(opened, seen=load_dataset([_with_a_gap(logs[0])], raptor))},
        "no flight that can be used": {"opened": replace(opened, seen=None)},
        "no flight": {"opened": Opened()},
        "a log that has been read": {"opened": Opened(), "work": Work("Reading flights"), "as_read": (logs[0],)},
        "a vehicle of half the mass": {"opened": replace(opened, seen=_of_half_the_mass(dataset, raptor))},
        "a vehicle whose thrust was assumed": {"session": _with_assumed_thrust(session)},
        "values of other flights": {"session": _with_a_drop(session)},
        "a fit to one of the flights": {"session": _fitted_to(session, ("0.csv",))},
        "an error as the model stands": {
            "session": _fitted_to(session, ("0.csv",)),
            "results": replace(results, evaluation=Study(elsewhere, dataset).evaluate()),
        },
        "a fit to a flight before it was held out": {
            "session": _fitted_to(session.with_role(Path("1.csv"), True), ("0.csv", "1.csv"))
        },
        "no evaluation": {"results": replace(results, evaluation=None)},
        "nothing found": {"results": replace(results, found=None)},
        "findings of another step": {
            "session": session.at(0),
            "results": replace(results, found=None, before=found),
        },
        "a suggestion": {"results": replace(results, suggestion=cast(Any, suggestion))},
        "steps that were flown": {"results": replace(results, steps=_steps())},
        "a warning of the check": {"results": replace(results, checked=("too high",))},
        "a refusal of the check": {"results": replace(results, checked=None, refused="it has a pole")},
        "a file that waits": {"waiting": ("a.csv",)},
        "a change taken back": {"history": History((), (session,))},
        "a second window": {"windows": 2},
        "a message": {"message": Message("error", "no")},
        "another world": {"hidden": Path("hidden.yaml")},
        "other vehicles": {"vehicles": ()},
        "a vehicle of one's own": {"own_vehicles": (Path("lab/vehicles/mine.yaml"),)},
        "a vehicle that nobody has named": {"session": replace(session, vehicle_assumed=True)},
        "another axis": chosen(axis="north"),
        "another flight": chosen(flight="1.csv"),
        "other channels": chosen(channels=("roll_deg",)),
        "a step beside the others": chosen(beside="0"),
        "the model of a file beside the others": {
            **chosen(beside="file"),
            "other_model": replace(truth, name="mine.yaml"),
        },
        "the evidence for an effect": {
            **asked,
            "results": replace(results, evidence={gathered.evidence.effect.name: gathered}),
        },
        "evidence that no search gave": {
            **asked,
            "results": replace(results, evidence={gathered.evidence.effect.name: replace(gathered, search=None)}),
        },
        "evidence that is asked for": asked,
        "evidence that is gathered": {**asked, "work": Work("Gathering")},
        "evidence that was cancelled": {
            **asked,
            "results": replace(results, evidence={gathered.evidence.effect.name: None}),
        },
        "flights over each other": chosen(over_each_other=True),
        "a selection": chosen(brush={"height_over_radius": (1.0, 3.0)}),
        "other colours": {"theme": DARK},
    }
    after = {name: replace(view, **change) for name, change in changed.items()}
    return {
        "at first": view,
        **after,
        "a search": searching,
        "a step of the search": replace(searching, search=Work("Looking", "hayden")),
        "work": working,
        "a step of the work": replace(working, work=Work("Fitting", "hayden")),
        "nothing yet": empty,
        "a log without a vehicle": replace(empty, session=Session().with_logs([Path("a.csv")])),
    }


def choosing(view: View, **changes: Any) -> View:
    """The same view after a choice in its tab."""
    return replace(view, choices=replace(view.choices, **changes))


def _with_a_gap(log: FlightLog) -> FlightLog:
    """The same without what was logged between 12 and 15 s."""
    kept = (log.time_s < 12.0) | (log.time_s > 15.0)
    phase = None if log.phase is None else log.phase[kept]
    return replace(log, columns={name: values[kept] for name, values in log.columns.items()}, phase=phase)


def _of_half_the_mass(dataset: Dataset, vehicle: Vehicle) -> Dataset:
    light = vehicle.model_copy(update={"mass_kg": 0.5 * vehicle.mass_kg})
    doubt = weight_doubt(2.0, light, dataset.flights[0].thrust_source)
    assert doubt is not None
    flights = tuple(replace(f, vehicle=light, findings=[*f.findings, doubt]) for f in dataset.flights)
    return replace(dataset, flights=flights)


def _with_assumed_thrust(session: Session) -> Session:
    """The same session, if nobody had measured the thrust coefficient, with a thrust scale in the model."""
    sequence = []
    for step in session.sequence:
        vehicle = step.model.vehicle.model_copy(update={"assumed": ("rotor.thrust_n_per_rpm2",)})
        sequence.append(replace(step, model=replace(step.model, vehicle=vehicle).plus(ConstantScale(1.1))))
    return replace(session, sequence=tuple(sequence))


def _with_a_drop(session: Session) -> Session:
    """The same session, if the model held a drop in the second of two flights that stood in another order."""
    step = session.sequence[1]
    drop = StackedEffect(MassStep(-0.1, 9.0, flight=2.0), Provenance(logs=("1.csv", "0.csv")))
    model = replace(step.model, stack=(*step.model.stack, drop))
    return replace(session, sequence=(session.sequence[0], replace(step, model=model)))


def _fitted_to(session: Session, logs: tuple[str, ...]) -> Session:
    """The same session, if the effects had been fitted to these flights."""
    step = session.sequence[1]
    stack = tuple(replace(item, fitted=Provenance(logs=logs)) for item in step.model.stack)
    return replace(session, sequence=(session.sequence[0], replace(step, model=replace(step.model, stack=stack))))


def _nothing_found(view: View, error_m_s2: float, floor_m_s2: float, verdict: lab_diagnosis.Verdict = "none") -> View:
    """The same view, if the search had found no effect, and this error remained."""
    assert view.results.found is not None and view.results.evaluation is not None
    diagnosis = replace(view.results.found.diagnosis, verdict=verdict, missing=[], ranking=[], steps=[])
    left = Remainder(error_m_s2, 0.994 * error_m_s2, floor_m_s2, ("thrust",), "up")
    evaluation = replace(view.results.evaluation, remainder=left)
    session = view.session.judged(error_m_s2, floor_m_s2)
    results = replace(view.results, evaluation=evaluation, found=Diagnosed(diagnosis, {}))
    comparison = replace(evaluation.comparison, noise_floor={"total": floor_m_s2})
    results = replace(results, evaluation=replace(evaluation, comparison=comparison))
    return replace(view, session=session, results=results)


def stated(view: View) -> Statement:
    said = Verdict.of(view).statement
    assert said is not None
    return said


def _steps() -> Any:
    time_s = np.linspace(0.0, 5.0, 50)
    track = SimpleNamespace(time_s=time_s, error_m=0.0 * time_s, position_m=time_s, reference_m=time_s)
    metrics = SimpleNamespace(m_a_absolute=1.0, m_b_absolute=1.0, m_b_signed=1.0, rmse_m=1.0)
    return SimpleNamespace(
        on_one_reference=dict.fromkeys((WITHOUT, WITH, FAR), track), flown=dict.fromkeys((WITHOUT, WITH), metrics)
    )


@functools.cache
def stands_for(kind: type) -> Any:
    """Calls are noted, and compared with what `kind` takes. One for all tabs: to make it takes as long as a page."""
    return create_autospec(kind, instance=True)


class OpenTab:
    """A tab of a browser without the browser."""

    def __init__(self, tab: str, view: View) -> None:
        self._view = view
        self._client = Client(ui.page("/"))
        with self._client:
            self._page = Page(stands_for(Workbench), stands_for(Intake), self._client, f"show={tab}")
            self._page.view = lambda: self._view  # type: ignore[method-assign]
            self._page.build(view.theme)

    def follow(self, view: View) -> None:
        self._view = view
        self._page.refresh()

    def acts_on(self, key: str, shift: bool = False) -> set[str]:
        """Actions on the model that a key calls."""
        bench = self._page.bench
        bench.results = self._view.results  # type: ignore[misc]
        cast(Any, bench).reset_mock()
        with self._client:
            asyncio.run(self._page.press(key, shift))
        return {call[0] for call in cast(Any, bench).method_calls}

    @property
    def texts(self) -> set[str]:
        """All texts, those of dialogs that are closed, too."""
        return {element.text for element in self._client.elements.values() if isinstance(element, ui.label)}

    @property
    def buttons(self) -> dict[str, ui.button]:
        """Buttons by their texts."""
        return {e.text: e for e in self._client.elements.values() if isinstance(e, ui.button)}

    @property
    def every_button(self) -> list[ui.button]:
        return [e for e in self._client.elements.values() if isinstance(e, ui.button)]

    @property
    def part(self) -> str:
        return self._page._choices.show

    @property
    def choices(self) -> Choices:
        return self._page._choices

    def choose(self, **changes: Any) -> None:
        """Choose without a browser, whose address would follow."""
        self._page._choices = replace(self.choices, **changes)

    @property
    def shown(self) -> Any:
        return _shown(self._client.content)

    @property
    def figures(self) -> list[ui.plotly]:
        return [element for element in self._client.elements.values() if isinstance(element, ui.plotly)]

    def close(self) -> None:
        self._client.delete()


def click(button: ui.button) -> None:
    (listener,) = (each for each in button._event_listeners.values() if each.type == "click")
    button._handle_event({"listener_id": listener.id, "args": []})


def _shown(element: Element) -> Any:
    """All that a person sees of an element: its kind, its properties, and what it holds."""
    if not element.visible or element.tag == "nicegui-dark_mode":  # a button sets the colours, not the view
        return None
    said = {name: value for name, value in element.props.items() if name not in ADDRESSES and value is not False}
    properties = {name: _comparable(value) for name, value in said.items()}
    held = [_shown(child) for slot in element.slots.values() for child in slot.children]
    return element.tag, sorted(element.classes), dict(element.style), properties, getattr(element, "text", None), held


def _comparable(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _comparable(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_comparable(each) for each in value]
    return value.tobytes() if isinstance(value, np.ndarray) else value


@pytest.fixture
def tabs(views: dict[str, View], monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str, View], OpenTab]]:
    """Opens tabs: (part of the page, view) -> tab."""
    monkeypatch.setattr(ui, "timer", lambda *_, **__: None)  # there is no server whose loop would run it
    made: list[OpenTab] = []

    def opened(tab: str, view: View) -> OpenTab:
        made.append(OpenTab(tab, view))
        return made[-1]

    yield opened
    for tab in made:
        tab.close()


@pytest.fixture(scope="module")
def known() -> dict[tuple[str, str], Any]:
    """The content of new tabs: drawing every part of the page for every change takes a minute."""
    return {}


@pytest.fixture
def shown_anew(
    views: dict[str, View], tabs: Callable[[str, View], OpenTab], known: dict[tuple[str, str], Any]
) -> Callable[[str, str], Any]:
    """Tells what a new tab shows: (part of the page, name of the view)."""

    def shown(tab: str, name: str) -> Any:
        if (tab, name) not in known:
            known[tab, name] = tabs(tab, views[name]).shown
        return known[tab, name]

    return shown


class TestOpenTab:
    @pytest.mark.long
    @pytest.mark.parametrize("tab", TABS)
    def test_it_shows_after_every_change_what_a_new_tab_shows(
        self,
        tab: str,
        views: dict[str, View],
        tabs: Callable[[str, View], OpenTab],
        shown_anew: Callable[[str, str], Any],
    ) -> None:
        following, at_first = tabs(tab, views["at first"]), shown_anew(tab, "at first")
        for name, view in views.items():
            following.follow(view)
            assert following.shown == shown_anew(tab, name), f"after {name}"
            following.follow(views["at first"])
            assert following.shown == at_first, f"back from {name}"

    @pytest.mark.long
    def test_every_change_is_seen_in_some_part_of_the_page(
        self, views: dict[str, View], shown_anew: Callable[[str, str], Any]
    ) -> None:
        for name in views.keys() - {"at first"}:
            assert any(shown_anew(tab, name) != shown_anew(tab, "at first") for tab in TABS), name

    def test_a_figure_stays_as_it_is_while_work_goes_on(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        tab = tabs("time", views["at first"])
        figure = tab.figures[0]
        for name in ("work", "a step of the work", "a message", "an error that became known"):
            tab.follow(views[name])
            assert tab.figures[0] is figure, name
        tab.follow(views["another axis"])
        assert tab.figures[0] is not figure

    def test_flights_that_the_model_was_not_fitted_to_are_named_and_a_refit_is_offered(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        assert "The model is fitted to" not in str(tabs("missing", views["at first"]).shown)
        shown = str(tabs("missing", views["a fit to one of the flights"]).shown)
        assert "The model is fitted to 0.csv only, not to 1.csv." in shown
        assert "Refit to all flights" in shown

    def test_the_error_of_a_model_that_was_not_fitted_to_the_flights_says_so(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        shown = str(tabs("missing", views["an error as the model stands"]).shown)
        assert "of g, as it stands, " in shown and " removed, on 0.csv" in shown
        assert "; it is fitted to 0.csv." in shown
        assert "Errors of the model as it stands, " in shown
        assert "as it stands" not in str(tabs("missing", views["at first"]).shown)

    def test_values_of_single_flights_that_are_used_for_others_are_told(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        said = "payload.step holds values of 1.csv, 0.csv, which are used in this order for 0.csv, 1.csv."
        assert said in str(tabs("time", views["values of other flights"]).shown)
        assert views["at first"].of_other_flights == ()

    def test_the_report_is_given_the_words_of_the_page(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        view = views["a vehicle that nobody has named"]
        verdict = Verdict.of(view)
        said, *more = verdict.sentences
        assert said.endswith(", if the vehicle is raptor (1.5 kg).")
        assert set(tabs("missing", view).texts) >= {said}
        assert more and verdict.condition == view.session.vehicle
        assert Verdict.of(views["a search"]).sentences == ()

    def test_a_bar_says_where_its_error_is_of_a_model_as_it_stands(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        said = "not fitted to all of these flights"
        assert said not in str(tabs("missing", views["at first"]).shown)
        assert str(tabs("missing", views["an error as the model stands"]).shown).count(said) == 1

    def test_a_broken_line_is_explained(self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]) -> None:
        said = "Lines are broken where the analysis leaves samples out"
        assert said not in str(tabs("time", views["at first"]).shown)
        assert said in str(tabs("time", views["a log with a gap"]).shown)

    @pytest.mark.parametrize("tab", ["missing", "fails", "compensator"])
    def test_an_assumed_thrust_is_said_beside_what_rests_on_it(
        self, tab: str, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        said = "Thrust coefficient assumed: a wrong mass or thrust would look the same."
        assert said not in str(tabs(tab, views["at first"]).shown)
        shown = str(tabs(tab, views["a vehicle whose thrust was assumed"]).shown)
        assert shown.count(said) == 2  # beside the thrust scale in the model, and in this part of the page

    def test_a_flight_that_was_fitted_before_it_was_held_out_gives_no_held_out_error(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        view = views["a fit to a flight before it was held out"]
        shown = str(tabs("missing", view).shown)
        assert "The model is fitted to 1.csv, too: the error there is no held-out error." in shown
        assert "Refit without what is held out" in shown

    def test_the_evidence_for_what_is_missing_opens_when_it_is_asked_for_and_not_before(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        tab = tabs("missing", views["at first"])
        before = len(tab.figures)
        tab.follow(views["the evidence for an effect"])
        assert len(tab.figures) == before + 1
        assert "What else was tried, and why it lost" in str(tab.shown)
        assert "To distinguish ground effect from confounded effects: hovering at many heights" in str(tab.shown)
        tab.follow(views["at first"])
        assert len(tab.figures) == before

    def test_one_flight_is_recommended_that_which_adds_the_most_where_it_is_known(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        view = views["the evidence for an effect"]
        unknown = str(tabs("missing", view).shown)
        assert "To distinguish ground effect from confounded effects:" in unknown
        assert "quadctl fly" not in unknown  # which mission adds most is not known yet
        suggestion = views["a suggestion"].results.suggestion
        known = str(tabs("missing", replace(view, results=replace(view.results, suggestion=suggestion))).shown)
        assert "this mission tells most" in known
        assert "To distinguish ground effect from confounded effects" not in known  # which is another question

    def test_an_effect_in_the_model_has_evidence_too(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        tab = tabs("time", views["at first"])
        said = "Evidence for ground_effect.exponential"
        (button,) = [button for button in tab.every_button if button.props.get("aria-label") == said]
        assert button.enabled
        assert views["evidence that is asked for"].gathering == "wanted"
        assert views["evidence that is gathered"].gathering == "waiting"
        assert views["evidence that was cancelled"].gathering == "cancelled"
        assert choosing(views["at first"], evidence="wind.constant").gathering == ""
        shown = str(tabs("missing", views["evidence that no search gave"]).shown)
        assert "No search on these flights has tried it beside others" in shown

    def test_axes_have_names_that_a_reader_understands(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        view = views["the evidence for an effect"]
        assert view.gathered is not None
        errors = dict.fromkeys(axis for group, axes in GROUPS.items() for axis in (*axes, group))
        known = replace(view.gathered.evidence, before=dict.fromkeys(errors, 0.2), after=dict.fromkeys(errors, 0.1))
        gathered = {view.choices.evidence: replace(view.gathered, evidence=known)}
        shown = str(tabs("missing", replace(view, results=replace(view.results, evidence=gathered))).shown)
        assert "imu north" not in shown
        for name in ("accelerometer error north / m/s²", "roll moment / N m", "north / m/s²"):
            assert f"'{name}'" in shown

    def test_the_evidence_says_which_fit_its_numbers_are_of(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        view = views["the evidence for an effect"]
        assert view.gathered is not None
        shown = str(tabs("missing", view).shown)
        assert "The figures are of one fit of the effect together with" in shown
        assert f"changes by {view.gathered.evidence.drop_in_words} (95%)" in shown
        assert "Numbers of the search that found it" in shown

    def test_a_further_model_lies_over_the_others_with_its_name(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        view = views["the model of a file beside the others"]
        assert list(view.models) == ["rigid body", "with added effects", "file mine.yaml"]
        figure = cast(Any, tabs("time", view).figures[0].figure)
        assert {"file mine.yaml", "residual, file mine.yaml"} <= {curve["name"] for curve in figure["data"]}

    def test_a_log_of_another_vehicle_gets_a_question_instead_of_a_tick(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        asked = str(tabs("flights", views["a log of another vehicle"]).shown)
        assert "0.csv: This flight says 1.9 kg, the vehicle has 1.5 kg. Use it anyway?" in asked
        at_first = str(tabs("flights", views["at first"]).shown)
        assert asked.count("check_circle") == at_first.count("check_circle") - 1

    def test_a_vehicle_that_nobody_has_named_is_asked_about_beside_the_headline_and_the_flights(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        question = "Evaluated as raptor (1.5 kg): is that the vehicle that flew?"
        asked = views["a vehicle that nobody has named"]
        assert str(tabs("missing", asked).shown).count(question) == 1
        assert str(tabs("flights", asked).shown).count(question) == 2
        assert question not in str(tabs("flights", views["at first"]).shown)
        named = [replace(log, log=replace(log.log, meta={"vehicle": {"mass_kg": 1.5}})) for log in asked.opened.logs]  # type: ignore[type-var]
        assert replace(asked, opened=replace(asked.opened, logs=named)).unconfirmed is None

    def test_a_vehicle_whose_thrust_carries_another_weight_is_asked_about(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        asked = "0.csv: by the rotor speed the rotors of 'raptor' give 2 times the thrust that carries its 0.75 kg"
        tab = tabs("missing", views["a vehicle of half the mass"])
        assert asked in str(tab.shown)
        assert "Choose another" in tab.buttons
        assert "Missing: ground effect, if the vehicle is raptor (1.5 kg)." in str(tab.shown)
        assert asked not in str(tabs("missing", views["at first"]).shown)

    def test_a_finding_holds_only_if_the_assumed_vehicle_flew(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        said = "Missing: ground effect, if the vehicle is raptor (1.5 kg)."
        assert said in str(tabs("missing", views["a vehicle that nobody has named"]).shown)
        assert said not in str(tabs("missing", views["at first"]).shown)

    def test_the_vehicle_in_use_is_marked_among_those_to_choose_from(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        view = replace(views["at first"], vehicles=tuple(sorted(VEHICLES.glob("*.yaml"))))
        buttons = tabs("flights", view).buttons
        assert buttons["raptor, 1.5 kg"].props["aria-pressed"] == "true"
        marked = [name for name, button in buttons.items() if button.props.get("aria-pressed") == "true"]
        assert marked == ["raptor, 1.5 kg"]

    def test_the_form_of_a_new_vehicle_says_what_is_assumed(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        shown = str(tabs("flights", views["at first"]).shown)
        for guess in (
            "motor lag of 0.04 s",
            "thrust coefficient 0.011",
            "tangent of a square law",
            "1.2 propeller diameters",
        ):
            assert guess in shown

    def test_the_bias_of_a_flight_that_no_fit_has_seen_is_in_its_error_and_the_words_say_so(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        view = views["at first"]
        assert view.opened.seen is not None and view.session.model is not None
        whole = replace(view.opened.seen, hold_out="flights")
        found = Study(view.session.model, whole).evaluate()
        there = replace(view, opened=replace(view.opened, seen=whole), results=Results(found))
        assert str(kind_of(found)).endswith("per-flight bias not removed")
        blocks, flights = (str(tabs("missing", each).shown) for each in (view, there))
        assert " not removed: on held-out flights" in flights and "bias removed: on" not in flights
        assert " removed: on held-out blocks" in blocks and " included" not in blocks

    def test_biases_at_their_limit_are_named_with_their_flights(self, views: dict[str, View]) -> None:
        evaluation = views["at first"].results.evaluation
        assert evaluation is not None
        assert at_limits(evaluation, None) == []
        nuisances = evaluation.solution.optimum.nuisances.copy()
        nuisances[1, 0] = BOUND[0]
        optimum = replace(evaluation.solution.optimum, nuisances=nuisances)
        limited = replace(evaluation, solution=replace(evaluation.solution, optimum=optimum))
        (at_limit,) = at_limits(limited, None)
        assert str(at_limit) == "The per-flight bias reaches its bound: thrust (1.csv)."
        found = views["at first"].results.found
        assert found is not None
        for p_value, more in ((0.04, [fact(Said.MORE_IS, family="thrust_scale", p=0.04)]), (1e-5, [])):
            candidate = replace(found.diagnosis.ranking[0], effect=ConstantScale(0.98), p_value=p_value)
            tried = replace(found, diagnosis=replace(found.diagnosis, ranking=[candidate]))
            assert at_limits(limited, tried) == [at_limit, *more]

    def test_whether_the_flights_agree_is_said_beside_the_error_and_where_the_model_fails(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        evaluation = views["at first"].results.evaluation
        assert evaluation is not None and evaluation.agreement is not None
        assert str(evaluation.agreement.answer) in str(tabs("missing", views["at first"]).shown)
        first, *more = map(str, evaluation.agreement.parts)
        shown = str(tabs("fails", views["at first"]).shown)
        assert all(part.rstrip(".")[1:] in shown for part in (first, *more))

    def test_a_flight_held_out_is_compared_with_those_that_the_model_was_fitted_to(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        opened, session = views["at first"].opened, views["a fit to one of the flights"].session
        assert opened.seen is not None and session.model is not None
        seen, unseen = opened.seen.some([0]), opened.seen.some([1])
        found = Study(session.model, seen, unseen).evaluate()
        assert found.agreement is not None and found.agreement.fitted == "these"
        assert (found.agreement.reference, found.agreement.judged) == (("0.csv",), ("1.csv",))
        view = replace(views["at first"], opened=replace(opened, seen=seen, unseen=unseen), results=Results(found))
        shown = str(tabs("fails", view).shown)
        assert "On 0.csv (used by the fits)" in shown and "On 1.csv (held out)" in shown
        assert found.agreement.judged_m_s2 == pytest.approx(found.error_m_s2)
        assert {name: errors["total"] for name, errors in found.by_flight.items()} == pytest.approx(
            {"0.csv": found.agreement.reference_m_s2, "1.csv": found.agreement.judged_m_s2}
        )

    def test_a_sentence_leads_to_its_flight_with_one_click(self, views: dict[str, View]) -> None:
        do = create_autospec(Controls, instance=True)
        evaluation = views["at first"].results.evaluation
        assert evaluation is not None
        comparison = replace(evaluation.comparison, fails_where=[FAILURE])
        wrong = replace(evaluation, agreement=None, comparison=comparison)
        with Client(ui.page("/")), pytest.MonkeyPatch.context() as patched:
            patched.setattr(ui, "run_javascript", ran := MagicMock())
            Failures(wrong, "", False, LIGHT).draw(do)
            (show,) = [e for e in ui.context.client.elements.values() if isinstance(e, ui.button) and e.text == "Show"]
            for listener in show._event_listeners.values():
                if listener.type == "click":
                    listener.handler(None)  # type: ignore[misc]
        do.choose.assert_called_once_with(brush={"time": (0.0, 9.0)}, axis="up", flight="1.csv")
        assert "scrollIntoView" in ran.call_args.args[0]

    def test_a_sentence_on_the_whole_flight_has_nothing_to_show(self, views: dict[str, View]) -> None:
        evaluation = views["at first"].results.evaluation
        assert evaluation is not None
        comparison = replace(evaluation.comparison, fails_where=[replace(FAILURE, low=0.0, high=100.0)])
        wrong = replace(evaluation, agreement=None, comparison=comparison)
        with Client(ui.page("/")):
            Failures(wrong, "", False, LIGHT).draw(create_autospec(Controls, instance=True))
            elements = list(ui.context.client.elements.values())
        assert "Show" not in [e.text for e in elements if isinstance(e, ui.button)]
        assert "range: most of 1.csv" in [getattr(e, "text", "") for e in elements]

    def test_the_figure_says_the_errors_of_the_flight_that_it_shows(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        evaluation = views["at first"].results.evaluation
        assert evaluation is not None
        for name, errors in evaluation.by_flight.items():
            worst, other = sorted(("north", "east", "up"), key=errors.__getitem__)[:0:-1]
            view = choosing(views["at first"], flight=name, axis=worst)
            shown = str(tabs("missing", view).shown)
            assert (
                f"Error in this flight, all axes: {quantity(errors['total'])}; of the axis that is plotted, {worst}"
                in shown
            )
            assert "the axis with the largest error." in shown
            shown = str(tabs("missing", choosing(view, axis=other)).shown)
            assert f"It is largest {worst}: {quantity(errors[worst])}." in shown

    def test_a_line_that_is_drawn_without_the_bias_says_how_far_it_is_off(self, views: dict[str, View]) -> None:
        flight = views["at first"].flight
        assert flight is not None
        vehicle = flight.vehicle
        light = Model(vehicle.model_copy(update={"mass_kg": 0.9 * vehicle.mass_kg}))
        assert as_drawn(0.1, light, flight, "north") == []  # thrust is upright
        (said,) = as_drawn(0.1, light, flight, "up")
        off = said.facts["off_m_s2"]
        assert off == pytest.approx(9.81 / 0.9 - 9.81, abs=0.3)  # the rotors carry 1 / 0.9 of the weight
        assert as_drawn(off, light, flight, "up") == []

    def test_of_a_flight_that_hardly_moves_it_is_said_that_no_model_would_be_closer(
        self, views: dict[str, View]
    ) -> None:
        """In hover a model that predicts no acceleration at all has the smaller error."""
        view = views["at first"]
        assert view.flight is not None
        measured = view.flight.measured
        moves = float(np.sqrt(np.mean(measured[:, 2] ** 2)))
        assert beside_the_motion(0.9 * moves, view.flight, "up") == []
        (said,) = beside_the_motion(1.1 * moves, view.flight, "up")
        assert said.facts["moves_m_s2"] == pytest.approx(moves)

    def test_what_an_added_effect_looks_like_stays_on_its_card(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        view = views["at first"]
        warning = "Looks like thrust scale: these data do not distinguish them."
        assert warning not in str(tabs("missing", view).shown)
        first, *later = view.session.sequence
        found = Findings({"ranking": [], "confounded": [["ground_effect", "thrust_scale"]]})
        session = replace(view.session, sequence=(replace(first, found=found), *later))
        assert warning in str(tabs("missing", replace(view, session=session)).shown)
        assert session.at(0).confounded == {}

    def test_a_model_outlives_its_flights(self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]) -> None:
        empty, session = views["nothing yet"], views["at first"].session
        assert "Download model" not in tabs("missing", empty).buttons
        assert "Download model" not in tabs("missing", replace(empty, session=session.at(0))).buttons  # a rigid body
        kept = tabs("missing", replace(empty, session=session)).buttons
        assert "Download model" in kept and "Report" not in kept

    def test_the_vehicle_in_use_is_confirmed_and_not_begun_with_again(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        tab = tabs("flights", replace(views["at first"], vehicles=(VEHICLES / "raptor.yaml", VEHICLES / "x500.yaml")))
        bench = cast(Any, tab._page.bench)
        bench.begin_with = MagicMock()
        in_use, _ = (b for b in tab.every_button if "aria-pressed" in b.props)
        assert in_use.props["aria-pressed"] == "true"
        click(in_use)
        assert bench.confirm_vehicle.called and not bench.begin_with.called

    def test_a_selection_goes_with_its_flights(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        view = views["at first"]
        assert view.opened.seen is not None
        first, second = view.opened.seen.flights
        alone, other = (
            replace(view, opened=replace(view.opened, seen=replace(view.opened.seen, flights=(flight,))))
            for flight in (first, replace(second, name="other.csv"))
        )
        tab = tabs("time", view)
        tab.choose(brush={"time": (1.0, 2.0)}, axis="east")
        chosen = tab.choices
        tab.follow(alone)  # one of the flights is still open
        assert tab.choices == chosen
        tab.follow(replace(view, opened=Opened()))
        told: list[str] = []
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(ui.navigate.history, "replace", told.append)
            tab.follow(other)
        assert (tab.choices.brush, tab.choices.axis, tab.choices.show) == ({}, "", chosen.show)
        assert told == [f"/?{tab.choices.query()}"]  # the address is a link to what is shown now

    def test_a_selection_goes_with_the_flight_that_it_was_made_in(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        view = views["at first"]
        assert view.opened.seen is not None
        first, second = (
            replace(view, opened=replace(view.opened, seen=replace(view.opened.seen, flights=(flight,))))
            for flight in view.opened.seen.flights
        )
        monkeypatch.setattr(ui.navigate.history, "replace", lambda *_: None)
        for left, kept in ((first, True), (second, False)):
            tab = tabs("time", view)
            tab.choose(brush={"time": (1.0, 2.0)}, axis="east", flight=view.opened.seen.names[0])
            tab.follow(left)
            assert (tab.choices.axis == "east") == kept
            assert bool(tab.choices.brush) == kept

    def test_the_axis_that_was_chosen_goes_with_its_vehicle(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(ui.navigate.history, "replace", lambda *_: None)
        view = views["at first"]
        tab = tabs("time", view)
        tab.choose(axis="east")
        tab.follow(choosing(view, axis="east"))
        assert tab.choices.axis == "east"
        step = view.session.sequence[0]
        named = replace(step.model, vehicle=step.model.vehicle.model_copy(update={"name": "another"}))
        tab.follow(replace(view, session=replace(view.session, sequence=(replace(step, model=named),), current=0)))
        assert tab.choices.axis == ""

    def test_no_tick_for_a_model_that_knows_what_is_held_out(self, views: dict[str, View]) -> None:
        view = views["a fit to a flight before it was held out"]
        found = stated(_nothing_found(view, error_m_s2=0.19, floor_m_s2=0.186)).verdict
        assert found == Finding(Found.NONE_BUT_FITTED_TO_HELD_OUT, {"flights": ["1.csv"]})

    def test_an_offset_at_its_limit_is_marked(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        view = views["at first"]
        limit = "* At the limit: "
        assert limit not in str(tabs("missing", view).shown)
        assert "At the limit" not in str(tabs("missing", view).shown)
        evaluation = view.results.evaluation
        assert evaluation is not None
        optimum = evaluation.solution.optimum
        fitted = np.zeros_like(optimum.nuisances)
        fitted[1, 0] = KINDS[0].bound
        solution = replace(evaluation.solution, optimum=replace(optimum, nuisances=fitted))
        results = replace(view.results, evaluation=replace(evaluation, solution=solution))
        shown = str(tabs("missing", replace(view, results=results)).shown)
        assert limit in shown and "'+1.50 *'" in shown and "'0.00'" in shown
        assert "The per-flight bias reaches its bound: thrust (" in shown  # outside of what is folded
        assert "more thrust is a thrust scale" in shown and "more height" not in shown

    def test_offsets_that_differ_from_flight_to_flight_are_said_beside_the_agreement(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        view = views["at first"]
        evaluation = view.results.evaluation
        assert evaluation is not None
        assert apart(evaluation) == []
        optimum = evaluation.solution.optimum
        fitted = np.zeros_like(optimum.nuisances)
        fitted[0, 0], fitted[1, 0] = 0.015, -0.015
        solution = replace(evaluation.solution, optimum=replace(optimum, nuisances=fitted))
        results = replace(view.results, evaluation=replace(evaluation, solution=solution))
        said = "Parameters that are fitted to each flight separately also differ: thrust by at least 3%."
        assert said in str(tabs("fails", replace(view, results=results)).shown)

    def test_that_blocks_of_time_were_held_out_of_several_flights_is_said(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        view = views["at first"]
        assert OF_BLOCKS in str(tabs("missing", view).shown)
        whole = replace(view, session=replace(view.session, hold_out="flights"))
        assert OF_BLOCKS not in str(tabs("missing", whole).shown)

    def test_the_error_on_whole_flights_stands_beside_that_on_blocks(self) -> None:
        unseen = [
            UnseenError("blocks", {"total": 1.63}, {"total": 0.443}),
            UnseenError("flights", {"total": 1.64}, {"total": 0.61}),
        ]
        (found,) = on_whole_flights(unseen)
        assert found.facts == {"same": False, "before": 1.64, "after": 0.61, "on_blocks": 0.443}
        assert on_whole_flights(unseen[:1]) == []

    def test_another_form_of_an_effect_lost_against_that_effect(self, views: dict[str, View]) -> None:
        found = views["at first"].results.found
        assert found is not None
        (chosen,) = found.diagnosis.chosen
        other = next(c for c in found.diagnosis.ranking if c.family == chosen.family and c is not chosen)
        first = replace(other, effect=AxialInflow())
        assert rival_of(other, [first, chosen]) is chosen
        assert rival_of(first, [chosen]) is chosen
        assert rival_of(first, []) is None

    def test_of_every_offset_in_the_table_it_is_said_what_more_would_be(self) -> None:
        assert {SAME_CAUSE.get(name, name) for name in NUISANCES} == set(BEYOND)

    def test_a_confounded_effect_says_of_what(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        view = views["at first"]
        assert view.results.found is not None
        diagnosis = view.results.found.diagnosis
        other = next(c for c in diagnosis.ranking if c.effect.name == "ground_effect.hayden")
        renamed = replace(other, effect=AxialInflow())
        ranking = [c for c in diagnosis.ranking if c is not other]
        alike = replace(diagnosis, ranking=[*ranking, renamed], confounded=[["ground_effect", "inflow"]])
        results = replace(view.results, found=replace(view.results.found, diagnosis=alike))
        said = "It explains the same as ground effect: beside that it changes nothing, in its place it would."
        assert said in str(tabs("missing", replace(view, results=results)).shown)
        assert said not in str(tabs("missing", view).shown)

    def test_the_error_that_a_change_is_of_is_named(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        view = views["at first"]
        shown = str(tabs("missing", view).shown)
        assert "Held-out acceleration error, " in shown
        assert "% held-out acceleration error" in shown
        assert "% since rigid body" in shown
        held = str(tabs("missing", views["a flight held out"]).shown)
        assert "The flights are those for fitting." in held

    def test_the_factor_far_from_the_ground_is_no_part_of_the_curve(self, views: dict[str, View]) -> None:
        view = views["at first"]
        assert view.session.model is not None and view.opened.seen is not None
        scaled = view.session.model.plus(ConstantScale(0.87))
        assert far(scaled).kind is Said.FACTOR and far(scaled).facts["factor"] == pytest.approx(0.87, abs=1e-4)
        assert far(view.session.model).kind is Said.FACTOR_ONE
        own, without = (
            next(
                curve["y"]
                for curve in ratio_over_height(model, view.opened.seen, LIGHT)["data"]
                if curve["name"] == "this model"
            )
            for model in (scaled, view.session.model)
        )
        assert own == pytest.approx(without)
        assert own[-1] == pytest.approx(1.0, abs=0.01)

    def test_the_curve_reaches_as_high_as_was_flown(self, views: dict[str, View]) -> None:
        model, seen = views["at first"].session.model, views["at first"].opened.seen
        assert model is not None and seen is not None
        small = model.vehicle.rotor.model_copy(update={"radius_m": 0.05})
        fine = replace(model, vehicle=model.vehicle.model_copy(update={"rotor": small}))
        highest = seen.heights_m[1] / small.radius_m
        assert highest > 14.0
        (own,) = (c for c in ratio_over_height(fine, seen, LIGHT)["data"] if c["name"] == "this model")
        assert own["x"][-1] > highest

    def test_what_far_from_the_ground_means_is_explained_where_it_stands(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        shown = str(tabs("compensator", views["at first"]).shown)
        assert "Far from the ground: what does it mean?" in shown
        assert shown.count(GLOSSARY["far from the ground"]) == 2  # under the mouse, and in the help

    def test_one_sentence_says_whether_the_compensator_helps(self, views: dict[str, View]) -> None:
        model = views["at first"].session.model
        assert model is not None
        without = SimpleNamespace(m_b_absolute=0.249, rmse_m=0.148)
        compensated = SimpleNamespace(m_b_absolute=0.078, rmse_m=0.144)
        steps = cast(Any, SimpleNamespace(flown={WITHOUT: without, WITH: compensated}))
        said = str(answer(model, steps))
        assert said.startswith("Better with the compensator: the part of the error that the ground causes")
        assert "changes by \u221269%, from 0.249 to 0.078 m s." in said and said.endswith("changes by \u22123%.")
        worse = cast(Any, SimpleNamespace(flown={WITHOUT: compensated, WITH: without}))
        assert str(answer(model, worse)).startswith("Not better with the compensator")
        flat = replace(model, stack=()).plus(ConstantScale(1.2))
        assert answer(flat, worse) == fact(Said.NO_GROUND)

    def test_a_compensator_for_what_may_be_another_effect_is_not_just_accepted(self, views: dict[str, View]) -> None:
        model = views["at first"].session.model
        assert model is not None
        scaled = replace(model, stack=()).plus(ConstantScale(1.2))
        (doubt,) = doubts(scaled, {"thrust_scale": ("battery_sag",)})
        assert doubt.facts["families"] == ("thrust_scale", "battery_sag")
        assert doubts(scaled, {}) == []
        both = scaled.plus(Exponential(0.1, 2.0))
        assert doubts(both, {"thrust_scale": ("ground_effect",)}) == []  # it corrects for both

    def test_a_measure_that_changes_its_sign_has_no_change_in_percent(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        def changes(signed: float) -> int:
            """Number of measures whose change is shown, where all but the signed one are halved."""
            steps = _steps()
            steps.flown[WITH] = SimpleNamespace(m_a_absolute=0.5, m_b_absolute=0.5, m_b_signed=signed, rmse_m=0.5)
            view = replace(views["at first"], results=replace(views["at first"].results, steps=steps))
            return str(tabs("compensator", view).shown).count("'\u221250%'")

        assert changes(signed=0.5) == 4
        assert changes(signed=-0.5) == 3

    def test_what_the_data_lack_stands_beside_the_verdict(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        view = views["at first"]
        first = view.opened.logs[0]
        assert first.quality is not None
        report = replace(first.quality, findings=(finding(Kind.RESET, [(8.0, 8.0)], of="height"),))
        logs = [replace(first, quality=report, flight=view.opened.flights[0]), view.opened.logs[1]]
        shown = str(tabs("missing", replace(view, opened=replace(view.opened, logs=logs))).shown)
        assert "0.csv: The estimator reset its height at 8.0 s: it jumps there." in shown

    def test_a_message_that_was_read_is_gone_in_the_next_part(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(ui.navigate.history, "push", lambda *_: None)
        tab = tabs("missing", views["at first"])
        for kind, dismissed in (("done", True), ("error", False)):
            bench = cast(Any, tab._page.bench)
            bench.message = Message(cast(Any, kind), "it is done")
            with tab._client:
                tab._page._show("fails" if dismissed else "time")
            assert bench.dismiss.called == dismissed
            bench.dismiss.reset_mock()

    def test_a_message_goes_by_itself_unless_it_is_an_error(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        later: list[Callable[[], None]] = []
        monkeypatch.setattr(ui, "timer", lambda _, act, once: later.append(act))
        tab = tabs("missing", views["at first"])
        bench = cast(Any, tab._page.bench)
        for kind, goes in (("done", True), ("found", True), ("error", False)):
            message = Message(cast(Any, kind), "it is so")
            tab.follow(replace(views["at first"], message=message))
            for act in later:
                act()
            assert bench.dismiss.call_args_list == ([((message,),)] if goes else [])
            later.clear()
            bench.dismiss.reset_mock()

    def test_what_is_there_but_small_is_no_contradiction(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        view = views["at first"]
        assert view.results.found is not None
        first = view.results.found.diagnosis.ranking[0]
        little = {name: 0.999 * error for name, error in first.before.items()}
        small = replace(first, after=little, p_value=1e-9)
        nothing = replace(view.results.found.diagnosis, verdict="small", missing=[], ranking=[small], steps=[])
        nothing = replace(nothing, small=[[small]])
        results = replace(view.results, found=Diagnosed(nothing, {}))
        shown = str(tabs("missing", replace(view, results=results)).shown)
        assert "Measured, but small in these flights: ground_effect." in shown
        assert "Why not: it is there, but small: " in shown

    def test_the_verdict_has_a_tick_only_where_the_error_is_near_the_noise_floor(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        view = _nothing_found(views["at first"], error_m_s2=0.323, floor_m_s2=0.186)
        shown = str(tabs("missing", view).shown)
        assert "No known effect is missing, but not all of the error is noise." in shown
        assert "No effect of the catalogue, added to this model, reduces the held-out error " in shown
        assert "p below 0.01" in shown  # what is enough
        assert "An error of 0.323 m/s² remains." in shown
        assert "explains 67% of its square" in shown and "leaves 0.19 m/s²" in shown
        assert "without thrust it explains 1%" in shown
        assert "check_circle" not in shown
        near = str(tabs("missing", _nothing_found(view, error_m_s2=0.2, floor_m_s2=0.186)).shown)
        assert "No missing effect is found." in near and "check_circle" in near
        assert "An error of 0.200 m/s² remains, 8% above the " in near

    def test_a_model_that_is_fitted_to_other_flights_gets_no_tick(self, views: dict[str, View]) -> None:
        """The errors of a search are those of refits: the model as it stands may be far off."""
        view = _nothing_found(views["a fit to one of the flights"], error_m_s2=0.2, floor_m_s2=0.186)
        assert stated(view).verdict == Finding(Found.NONE_BUT_FITTED_TO_OTHERS, {"flights": ["0.csv"]})

    @pytest.mark.parametrize(("error_m_s2", "kind"), [(0.441, Found.LITTLE_UNEXPLAINED), (0.9, Found.UNEXPLAINED)])
    def test_what_no_effect_explains_is_called_little_where_it_is(
        self, error_m_s2: float, kind: Found, views: dict[str, View]
    ) -> None:
        view = _nothing_found(views["at first"], error_m_s2, floor_m_s2=0.428, verdict="unexplained")
        assert stated(view).verdict.kind is kind

    def test_a_larger_error_on_a_held_out_flight_is_said_beside_the_verdict(self, views: dict[str, View]) -> None:
        view = _nothing_found(views["at first"], error_m_s2=0.567, floor_m_s2=0.246)
        evaluation = view.results.evaluation
        assert evaluation is not None
        judged = replace(evaluation, unseen=replace(evaluation.comparison, rmse={"total": 0.567}))
        found = stated(replace(view, results=replace(view.results, evaluation=judged)))
        assert found.verdict == Finding(Found.NONE_BUT_LARGER_HELD_OUT, {"flights": ["0.csv", "1.csv"]})
        assert found.more[-1].facts["flights"] == ["0.csv", "1.csv"]

    def test_the_error_is_said_in_words(self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]) -> None:
        evaluation = views["at first"].results.evaluation
        assert evaluation is not None
        error = evaluation.error_m_s2
        expected = f"Acceleration error of the model (RMSE): {quantity(error)}, {share_of_g(error)} of g"
        assert expected in str(tabs("missing", views["at first"]).shown)

    @pytest.mark.parametrize(
        ("key", "shift", "done"),
        [("z", False, "undo"), ("Z", True, "redo"), ("r", False, "refit"), ("a", False, "add"), ("x", False, "")],
    )
    def test_keys_act_on_the_model(
        self, key: str, shift: bool, done: str, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        assert tabs("missing", views["at first"]).acts_on(key, shift) == {done} - {""}

    def test_keys_show_the_parts_of_the_page_and_the_help_lists_them(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(ui.navigate.history, "push", lambda address: None)
        tab = tabs("missing", views["at first"])
        for key, name in zip("12345", TABS, strict=True):
            tab.acts_on(key)
            assert tab.part == name
        assert set(KEYS) <= tab.texts

    def test_the_words_of_the_trade_are_explained_where_they_stand(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        everywhere = "".join(
            str(tabs(tab, views[name]).shown) for tab in TABS for name in ("at first", "steps that were flown")
        )
        for word in ("fold", "reference error", "M_A", "M_B", "per-flight bias"):
            assert GLOSSARY[word] in everywhere, word

    def test_each_of_several_flights_has_its_error(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        evaluation = views["at first"].results.evaluation
        assert evaluation is not None and list(evaluation.by_flight) == ["0.csv", "1.csv"]
        totals = [errors["total"] for errors in evaluation.by_flight.values()]
        mean_square = np.mean(np.square(totals))
        assert np.sqrt(mean_square) == pytest.approx(evaluation.error_m_s2, rel=0.01)
        shown = str(tabs("missing", views["at first"]).shown)
        assert all(number(total) in shown for total in totals)

    def test_every_curve_of_every_figure_has_a_name_of_its_own(
        self, views: dict[str, View], tabs: Callable[[str, View], OpenTab]
    ) -> None:
        drawn = [
            (shown.props["aria-label"], shown.figure["data"])
            for name in ("at first", "a selection", "steps that were flown")
            for tab in TABS
            for shown in tabs(tab, views[name]).figures
        ]
        labels = {label for label, _ in drawn}
        assert {"Flight over time", "Flight path", "Step response", "Selected samples over time"} <= labels
        for label, curves in drawn:
            names = [curve.get("name") for curve in curves]
            assert names and all(names) and len(set(names)) == len(names), (label, names)
