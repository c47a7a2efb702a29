"""The workbench and its intake without a browser and without other processes."""

import asyncio
import os
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from quadctl.cli import app
from quadctl.effects.ground_effect import Exponential, Hayden
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.errors import QuadctlError, SettingsError
from quadctl.lab import finding as lab_finding
from quadctl.lab.evaluation import Evaluation, errors_of
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.lab.flights.preparation import MAX_BANDWIDTH_HZ
from quadctl.lab.selection.diagnosis import diagnose
from quadctl.lab.study import Study, quiet
from quadctl.logs.csv_log import write_csv
from quadctl.logs.findings import Kind, finding
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.quality import ChannelQuality, QualityReport, quality
from quadctl.model import Model, Provenance, StackedEffect, load_model
from quadctl.vehicle import Vehicle
from quadctl.vehicle_draft.draft import draft
from quadctl.web.panels.compensator import COMMANDS, name_of_file
from quadctl.web.panels.vehicle import TYPICAL
from quadctl.web.session.earlier import PREVIOUS
from quadctl.web.session.files import sha256_of
from quadctl.web.session.findings import Diagnosed, Findings
from quadctl.web.session.session import AUTOSAVED, Session, Step, load_session, session_to_yaml
from quadctl.web.work import jobs, reading, simulated
from quadctl.web.work.doubts import Doubt, cautions_of, doubt_beside
from quadctl.web.work.jobs import Opened
from quadctl.web.work.simulated import Simulation
from quadctl.web.work.state import Message, Work
from quadctl.web.work.worker import LIBRARIES, CancelledError
from quadctl.web.workbench import desk
from quadctl.web.workbench.intake import Intake
from quadctl.web.workbench.workbench import Workbench
from quadctl.words import fact
from tests.support.flights import obedient
from tests.support.log_files import ulog_bytes
from tests.support.places import RAPTOR, ROOT, VEHICLES
from tests.support.rollouts import ROLLOUTS

PX4_TRI = {
    "CA_ROTOR_COUNT": 3.0, "CA_ROTOR0_PX": 0.1, "CA_ROTOR0_PY": 0.2, "CA_ROTOR1_PX": -0.1, "CA_ROTOR1_PY": 0.2,
    "CA_ROTOR2_PX": 0.0, "CA_ROTOR2_PY": -0.3, "CA_ROTOR0_KM": 0.05, "CA_ROTOR1_KM": -0.05, "CA_ROTOR2_KM": 0.05,
    "MPC_THR_HOVER": 0.4,
}  # fmt: skip
"""Parameters of a PX4 with three rotors."""


class Here:
    """A worker that answers in this process, when it is told to; it opens logs, and refuses all else."""

    def __init__(self, *_: Any, **__: Any) -> None:
        self.go_on = asyncio.Event()
        self.go_on.set()
        self.opened: list[tuple[str, ...]] = []

    async def run(self, job: Callable[..., Any], *args: Any, progress: Callable[[str], None]) -> Any:
        await self.go_on.wait()
        if job is reading.read_logs:
            return [reading.OpenedLog(path, problem=_problem(path)) for path in args[0]]
        if job is not jobs.open_logs:
            raise CancelledError
        self.opened.append(tuple(log.path.name for log in args[0]))
        return Opened(args[0])

    def cancel(self) -> None:
        """Nothing: it is never cancelled."""

    close = cancel


def _problem(path: Path) -> str:
    return f"{path.name}: is empty" if "bad" in path.name else ""


class Dropped:
    """A file as a browser sends it."""

    def __init__(self, name: str) -> None:
        self.name = name

    async def save(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("")


class _Untouchable:
    """Results that must not be shown."""

    def __repr__(self) -> str:
        raise AssertionError("the results were shown as text")


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Workbench:
    monkeypatch.setattr(desk, "Worker", Here)
    made = Workbench(tmp_path, cast(Simulation, None))
    made.session = Session().begun_with(load_model(RAPTOR))
    return made


def worker(bench: Workbench) -> Here:
    return cast(Here, bench._quick)


def take(bench: Workbench, *names: str) -> "asyncio.Task[None]":
    files = cast(Any, [Dropped(name) for name in names])
    return asyncio.ensure_future(Intake(bench, []).take(files))


async def until(holds: Callable[[], bool]) -> None:
    async with asyncio.timeout(5.0):
        while not holds():
            await asyncio.sleep(0)


def names(bench: Workbench) -> list[str]:
    return [path.name for path in bench.session.logs]


class TestDrops:
    def test_a_drop_during_work_waits_for_it(self, bench: Workbench) -> None:
        async def drop_thrice() -> None:
            worker(bench).go_on.clear()
            first = take(bench, "a.csv")
            await until(lambda: bench.work is not None)
            later = [take(bench, "b.csv"), take(bench, "c.csv", "d.csv")]
            await until(lambda: bench.waiting == ("b.csv", "c.csv", "d.csv"))
            worker(bench).go_on.set()
            await asyncio.gather(first, *later)

        asyncio.run(drop_thrice())
        assert names(bench) == ["a.csv", "b.csv", "c.csv", "d.csv"]
        assert bench.waiting == () and bench.message is None

    def test_a_file_that_cannot_be_used_does_not_spoil_the_others(self, bench: Workbench) -> None:
        async def drop() -> None:
            await take(bench, "notes.md", "a.csv", "wrong.yaml", "bad.csv")

        asyncio.run(drop())
        assert names(bench) == ["a.csv", "bad.csv"]
        assert bench.message is not None
        for said in ("notes.md: is no flight log", "wrong.yaml", "bad.csv: is empty"):
            assert said in bench.message.text

    def test_a_file_is_named_as_it_was_dropped(self, bench: Workbench) -> None:
        async def drop() -> None:
            await take(bench, "mine.yaml")

        asyncio.run(drop())
        assert bench.message is not None and bench.message.text.startswith("mine.yaml: ")

    def test_its_name_in_a_task_computes_nothing(self, bench: Workbench) -> None:
        """Timers and tasks are named by the methods that they call: the repr of results would run their analysis."""
        bench.results = cast(Any, _Untouchable())
        assert "check" in str(bench.check)

    def test_an_old_failure_does_not_come_back_with_the_next_file(self, bench: Workbench) -> None:
        async def drop_twice() -> None:
            await take(bench, "bad.csv")
            assert bench.message is not None and "bad.csv" in bench.message.text
            await take(bench, "a.csv")

        asyncio.run(drop_twice())
        assert bench.message is None


def test_a_log_that_was_left_out_is_asked_about_again(bench: Workbench) -> None:
    async def answer_and_leave_out() -> None:
        await take(bench, "a.csv")
        (path,) = bench.session.logs
        await bench.use_anyway(path)
        assert bench.accepted == {path}
        await bench.forget_log(path)

    asyncio.run(answer_and_leave_out())
    assert bench.accepted == frozenset()


def test_what_was_answered_of_a_log_holds_where_it_cannot_be_left_out_now(bench: Workbench) -> None:
    async def leave_out_during_work() -> None:
        await take(bench, "a.csv")
        (path,) = bench.session.logs
        await bench.use_anyway(path)
        worker(bench).go_on.clear()
        later = take(bench, "b.csv")
        await until(lambda: bench.work is not None)
        with pytest.raises(CancelledError):
            await bench.forget_log(path)
        worker(bench).go_on.set()
        await later
        assert bench.accepted == {path}

    asyncio.run(leave_out_during_work())
    assert names(bench) == ["a.csv", "b.csv"]


def test_only_the_message_that_was_read_goes(bench: Workbench) -> None:
    bench.say("done", "first")
    first = bench.message
    bench.say("done", "first")  # the same words, another message
    bench.dismiss(first)
    assert bench.message is not None
    bench.dismiss(bench.message)
    assert bench.message is None


class TestUndo:
    @pytest.fixture
    def extended(self, bench: Workbench, monkeypatch: pytest.MonkeyPatch) -> Workbench:
        """A bench whose model has been given an effect, by a fit that takes no time."""

        async def judge(*_: Any) -> None:
            """Nothing is evaluated here."""

        monkeypatch.setattr(bench, "_judge", judge)
        step = bench.session.step
        assert step is not None
        added = Step("+ one", step.model.plus(Exponential(a=0.3, b=5.0)))

        async def apply(*_: Any) -> None:
            bench.session = bench.session.extended(added)

        monkeypatch.setattr(bench, "_extend", apply)
        asyncio.run(bench.add("one"))
        return bench

    def test_a_change_of_the_model_is_undone_and_redone(self, extended: Workbench) -> None:
        after = extended.session
        assert extended.history.can_undo and not extended.history.can_redo
        asyncio.run(extended.undo())
        assert [step.name for step in extended.session.sequence] == ["rigid body"]
        assert extended.history.can_redo and not extended.history.can_undo
        asyncio.run(extended.redo())
        assert extended.session == after

    def test_the_page_is_told_that_what_was_undone_can_be_redone(self, extended: Workbench) -> None:
        shown: list[tuple[bool, bool]] = []
        extended.subscribe(lambda: shown.append((extended.history.can_undo, extended.history.can_redo)))
        asyncio.run(extended.undo())
        assert shown[-1] == (False, True)
        asyncio.run(extended.redo())
        assert shown[-1] == (True, False)

    def test_another_step_is_said_and_can_be_left_by_undo(self, extended: Workbench) -> None:
        before = extended.session
        asyncio.run(extended.go(0))
        assert extended.message is not None and extended.message.undo
        expected = "The model is now that of step 1, rigid body. Later steps stay until something else is added."
        assert extended.message.text == expected
        asyncio.run(extended.undo())
        assert extended.session == before
        assert extended.message.text == "The model is now that of step 2, + one."

    def test_an_effect_that_was_switched_off_is_on_again(self, extended: Workbench) -> None:
        before = extended.session
        asyncio.run(extended.switch("ground_effect.exponential"))
        assert extended.session.off
        asyncio.run(extended.undo())
        assert extended.session == before

    def test_a_new_change_ends_the_redo(self, extended: Workbench) -> None:
        asyncio.run(extended.undo())
        asyncio.run(extended.add("another"))
        assert extended.history.can_undo and not extended.history.can_redo

    def test_another_vehicle_takes_the_effects_away_and_undo_brings_them_back(
        self, extended: Workbench, tmp_path: Path, raptor: Vehicle
    ) -> None:
        before, other = extended.session, tmp_path / "other.yaml"
        heavier = raptor.model_copy(update={"name": "other", "mass_kg": 2.0})
        other.write_text(yaml.safe_dump(heavier.model_dump(mode="json", exclude_none=True)), encoding="utf-8")
        asyncio.run(extended.begin_with(other))
        assert extended.session.model is not None and not extended.session.model.effects
        assert extended.message is not None and extended.message.undo
        assert extended.message.text == "The model is now other; ground_effect.exponential went with the one before."
        asyncio.run(extended.undo())
        assert extended.session.sequence == before.sequence
        asyncio.run(extended.redo())
        assert extended.session.model is not None and extended.session.model.vehicle.mass_kg == 2.0

    def test_a_change_is_undone_after_other_flights_were_opened_and_they_stay(self, extended: Workbench) -> None:
        asyncio.run(extended.open_logs([Path("a.csv")]))
        asyncio.run(extended.undo())
        assert [step.name for step in extended.session.sequence] == ["rigid body"]
        assert extended.session.logs == (Path("a.csv"),)
        asyncio.run(extended.redo())
        assert extended.session.logs == (Path("a.csv"),) and len(extended.session.sequence) == 2

    def test_errors_on_other_flights_do_not_come_back(self, extended: Workbench) -> None:
        extended.session = extended.session.judged(0.2)
        asyncio.run(extended.switch("ground_effect.exponential"))
        asyncio.run(extended.hold_out_by("flights"))
        asyncio.run(extended.undo())
        assert [step.error_m_s2 for step in extended.session.sequence] == [None, None]

    def test_forecasts_stay_with_their_vehicle_on_the_way_back_and_forth(
        self, extended: Workbench, raptor: Vehicle, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        async def run(job: Callable[..., Any], *args: Any, progress: Callable[[str], None]) -> Any:
            progress("fitting")
            return ROLLOUTS

        other = extended.session.begun_with(Model(raptor.model_copy(update={"mass_kg": 2.0})))
        extended.history = replace(extended.history, future=(other,))
        asyncio.run(extended.forecast())
        assert extended.session.rollouts is None  # there is no flight to forecast
        extended.opened = replace(extended.opened, seen=Dataset(()))
        monkeypatch.setattr(extended._quick, "run", run)
        asyncio.run(extended.forecast())
        assert [kept.rollouts for kept in extended.history.past] == [ROLLOUTS]
        assert [kept.rollouts for kept in extended.history.future] == [None]
        asyncio.run(extended.undo())
        assert extended.session.rollouts is ROLLOUTS and len(extended.session.sequence) == 1
        kept = load_session(extended.folder / AUTOSAVED).rollouts
        assert kept is not None and kept.mean("held", 2, 1).low == pytest.approx(
            ROLLOUTS.mean("held", 2, 1).low, rel=1e-4
        )

    def test_forecasts_that_are_cancelled_leave_all_as_it_was(self, extended: Workbench) -> None:
        extended.opened, before = replace(extended.opened, seen=Dataset(())), extended.session
        asyncio.run(extended.forecast())  # this worker ends all but the opening of logs
        assert extended.session is before and extended.work is None and extended.message is not None
        assert extended.message.text == "Forecasting the whole state was cancelled; nothing is lost."

    def test_another_session_has_nothing_to_undo(self, extended: Workbench) -> None:
        asyncio.run(extended.resume(replace(extended.session, view="tab=flights")))
        assert not extended.history.can_undo
        asyncio.run(extended.undo())
        assert extended.message is not None and "no change of the model to undo" in extended.message.text


class TestNewSession:
    @pytest.fixture
    def used(self, bench: Workbench) -> Workbench:
        """A bench with a flight, and an effect in its model."""
        asyncio.run(bench.open_logs([Path("a.csv")]))
        step = bench.session.step
        assert step is not None
        bench.session = bench.session.extended(Step("+ one", step.model.plus(Exponential(a=0.3, b=5.0))))
        return bench

    def test_it_has_the_vehicle_alone_and_the_one_before_is_kept(self, used: Workbench) -> None:
        before = used.session
        asyncio.run(used.start_anew())
        assert used.session.logs == () and [step.name for step in used.session.sequence] == ["rigid body"]
        assert used.session.model == before.sequence[0].model and used.session.vehicle_assumed
        assert not used.history.can_undo
        path = used.folder / f"{PREVIOUS}.lab.yaml"
        assert used.message is not None and f"{path}: open that file" in used.message.text
        kept = load_session(path)
        assert [path.name for path in kept.logs] == ["a.csv"]
        assert [step.model.effects for step in kept.sequence] == [step.model.effects for step in before.sequence]
        assert load_session(used.folder / AUTOSAVED).logs == ()  # nor is the old one resumed at the next start

    def test_there_is_a_way_back(self, used: Workbench) -> None:
        before = used.session
        asyncio.run(used.start_anew())
        assert used.message is not None and used.message.go_back
        asyncio.run(used.go_back())
        assert used.session.logs == before.logs
        assert [step.model for step in used.session.sequence] == [step.model for step in before.sequence]
        kept = load_session(used.folder / AUTOSAVED)  # nor is the new one resumed at the next start
        assert [path.name for path in kept.logs] == ["a.csv"]

    def test_each_that_was_kept_can_be_opened_later(self, used: Workbench) -> None:
        before = used.session
        asyncio.run(used.start_anew())
        asyncio.run(used.open_earlier(used.folder / f"{PREVIOUS}.lab.yaml"))
        assert [path.name for path in used.session.logs] == ["a.csv"]
        assert [step.model.effects for step in used.session.sequence] == [s.model.effects for s in before.sequence]
        asyncio.run(used.open_earlier(used.folder / "gone.lab.yaml"))
        assert used.message is not None and used.message.kind == "error"
        assert [path.name for path in used.session.logs] == ["a.csv"]

    def test_the_present_one_is_kept_where_another_is_opened_over_it(self, used: Workbench) -> None:
        before = used.session
        asyncio.run(used.resume(Session().with_logs([Path("b.csv")]).begun_with(before.sequence[0].model)))
        assert [path.name for path in used.session.logs] == ["b.csv"]
        assert [path.name for path in load_session(used.folder / f"{PREVIOUS}.lab.yaml").logs] == ["a.csv"]
        assert used.message is not None and used.message.go_back
        asyncio.run(used.go_back())
        assert [path.name for path in used.session.logs] == ["a.csv"]

    def test_those_before_that_one_stay(self, used: Workbench) -> None:
        asyncio.run(used.start_anew())
        asyncio.run(used.open_logs([Path("b.csv")]))
        asyncio.run(used.start_anew())
        kept = [load_session(used.folder / f"{PREVIOUS}{n}.lab.yaml").logs for n in ("", "-2")]
        assert [[path.name for path in logs] for logs in kept] == [["a.csv"], ["b.csv"]]

    def test_it_does_not_begin_where_the_one_before_cannot_be_kept(self, used: Workbench) -> None:
        before = used.session
        used.folder = used.folder / "file"
        used.folder.write_text("a file where the folder should be")
        asyncio.run(used.start_anew())
        assert used.session == before
        assert used.message is not None and f"{PREVIOUS}.lab.yaml: cannot be written" in used.message.text

    def test_without_flights_there_are_no_errors(self, used: Workbench) -> None:
        used.session = used.session.judged(0.2, 0.1)
        asyncio.run(used.forget_log(Path("a.csv")))
        assert [(step.error_m_s2, step.floor_m_s2) for step in used.session.sequence] == [(None, None), (None, None)]

    def test_the_last_effect_goes_without_a_flight_too(self, used: Workbench) -> None:
        asyncio.run(used.forget_log(Path("a.csv")))
        asyncio.run(used.remove("ground_effect.exponential"))
        assert used.session.model is not None and used.session.model.effects == ()
        asyncio.run(used.undo())
        assert used.session.model.effects

    def test_effects_that_would_have_to_be_refitted_stay(self, used: Workbench) -> None:
        asyncio.run(used.forget_log(Path("a.csv")))
        step = used.session.step
        assert step is not None
        used.session = used.session.extended(Step("+ two", step.model.plus(ConstantScale(1.1))))
        asyncio.run(used.remove("ground_effect.exponential"))
        assert used.message is not None
        assert used.message.text == "there is no flight to fit the model to: open one, or go back to a step before"


class TestSampleFlight:
    def test_it_is_flown_in_a_world_that_the_vehicle_file_does_not_hold_and_is_opened(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        flown: list[tuple[str, Any]] = []

        def simulate(plan: Any, folder: Path, hidden: Path, seed: int) -> Any:
            flown.append((plan.body.vehicle.name, yaml.safe_load(hidden.read_text())))
            folder.mkdir(parents=True, exist_ok=True)
            (folder / "sample.csv").write_text("time_s\n0.0\n")
            return SimpleNamespace(completed=True, log=folder / "sample.csv")

        class AlsoFlies(Here):
            async def run(
                self, job: Callable[..., Any], *args: Any, progress: Callable[[str], None], **more: Any
            ) -> Any:
                if getattr(job, "__func__", None) is Simulation.fly_sample:
                    return job(*args, progress)
                return await super().run(job, *args, progress=progress)

        monkeypatch.setattr(desk, "Worker", AlsoFlies)
        monkeypatch.setattr(simulated, "read_log", lambda path: FlightLog(path.name, path, {"time_s": np.zeros(1)}))
        world = {"effects": [{"effect": "hidden.ground_cushion"}]}
        made = Workbench(tmp_path, Simulation(simulate, ROOT / "missions", tmp_path, None, world))
        made.session = Session().begun_with(load_model(RAPTOR))
        asyncio.run(made.open_sample())
        assert flown == [(load_model(RAPTOR).vehicle.name, world)]
        assert names(made) == ["sample.csv"] and made.message is None

    def test_without_a_vehicle_it_asks_for_one(self, bench: Workbench) -> None:
        bench.session = Session()
        asyncio.run(bench.open_sample())
        assert bench.message is not None and "choose the one to fly" in bench.message.text


class TestNewVehicle:
    def test_a_few_numbers_make_a_vehicle(self, bench: Workbench) -> None:
        async def enter() -> None:
            await Intake(bench, []).use_new_vehicle(TYPICAL._replace(name="mine", mass_kg=2.0), {})

        asyncio.run(enter())
        assert bench.session.step is not None
        vehicle = bench.session.step.model.vehicle
        assert (vehicle.name, vehicle.mass_kg, vehicle.n_rotors) == ("mine", 2.0, 4)

    def test_the_parameters_in_a_log_say_rotors_and_throttle(self, bench: Workbench, tmp_path: Path) -> None:
        log, empty = tmp_path / "flight.ulg", tmp_path / "empty.ulg"
        log.write_bytes(ulog_bytes(parameters=PX4_TRI))
        empty.write_bytes(ulog_bytes(parameters={"MPC_XY_P": 1.0}))
        intake = Intake(bench, [])

        async def enter() -> None:
            assert await intake.parameters_of(empty) == {}
            assert bench.message is not None
            assert "empty.ulg: its parameters say neither rotors nor throttle in hover" in bench.message.text
            asked = TYPICAL._replace(name="mine", frame=None, arm_m=None, hover_throttle=None)
            await intake.use_new_vehicle(asked, await intake.parameters_of(log))

        asyncio.run(enter())
        assert bench.session.step is not None
        vehicle = bench.session.step.model.vehicle
        assert [rotor.position_m for rotor in vehicle.rotors] == [(0.1, 0.2, 0.0), (-0.1, 0.2, 0.0), (0.0, -0.3, 0.0)]
        hover = vehicle.throttle.offset + vehicle.throttle.per_newton * vehicle.weight_n
        assert hover == pytest.approx(PX4_TRI["MPC_THR_HOVER"], rel=1e-3)

    @pytest.mark.parametrize(
        ("wrong", "said"), [({"mass_kg": None}, "Mass with battery"), ({"hover_throttle": 2.0}, "less than 1")]
    )
    def test_a_number_that_is_wrong_is_named_and_nothing_changes(
        self, bench: Workbench, wrong: dict[str, Any], said: str
    ) -> None:
        before = bench.session

        async def enter() -> None:
            await Intake(bench, []).use_new_vehicle(TYPICAL._replace(**wrong), {})

        asyncio.run(enter())
        assert bench.session is before
        assert bench.message is not None and said in bench.message.text


class TestOwnVehicle:
    def enter(self, bench: Workbench, text: str, from_a_form: bool = False) -> Intake:
        intake = Intake(bench, [])
        asyncio.run(intake.use_vehicle(text, from_a_form))
        return intake

    def test_it_stands_among_those_to_choose_from_and_its_path_is_said(self, bench: Workbench, tmp_path: Path) -> None:
        intake = self.enter(bench, draft(TYPICAL._replace(name="my/own"), {}))
        assert intake.own_vehicles == [tmp_path / "vehicles" / "my_own.yaml"]
        assert bench.message is not None and str(tmp_path / "vehicles" / "my_own.yaml") in bench.message.text
        asyncio.run(bench.begin_with(intake.own_vehicles[0]))
        assert bench.session.step is not None and bench.session.step.model.vehicle.name == "my/own"

    def test_one_in_a_file_that_is_dropped_stands_there_too(self, bench: Workbench, tmp_path: Path) -> None:
        path = tmp_path / "uploads" / "dropped.yaml"
        path.parent.mkdir()
        path.write_text(RAPTOR.read_text().replace("name: raptor", "name: mine"))
        intake = Intake(bench, [])
        asyncio.run(intake._begin_with(path))
        assert [own.name for own in intake.own_vehicles] == ["mine.yaml"]
        assert bench.session.sequence[0].model.vehicle.name == "mine"
        assert bench.message is not None and "The vehicle is kept in" in bench.message.text

    def test_one_that_cannot_fly_is_not_kept_and_a_form_hears_of_it_in_its_own_words(self, bench: Workbench) -> None:
        weak = yaml.safe_load(RAPTOR.read_text())
        weak["throttle"]["max_thrust_per_rotor_n"] = 1.0
        text = yaml.safe_dump(weak)
        assert self.enter(bench, text).own_vehicles == []
        assert bench.message is not None and "throttle.max_thrust_per_rotor_n is 1, expected more" in bench.message.text
        self.enter(bench, text, from_a_form=True)
        assert bench.message.text.startswith(
            "This vehicle cannot fly: Most thrust of a rotor / N is 1, expected more than 3.68 N"
        )


class TestExport:
    def test_the_file_and_the_commands_that_use_it_are_said(self, bench: Workbench) -> None:
        bench.say_exported("model.yaml")
        assert bench.message is not None and "saved as model.yaml in the downloads folder" in bench.message.text
        assert [command for _, command in COMMANDS] == [
            "quadctl fly MISSION --model {name}",
            "quadctl simulate MISSION --model {name} --hidden {name}",
            "quadctl export {name} --to px4 --link URL --apply",
            "quadctl compare {name} LOG",
        ]

    def test_its_name_is_that_of_the_vehicle_and_what_was_added(self, raptor: Vehicle) -> None:
        own = raptor.model_copy(update={"name": "my 7 inch/v2"})
        effects = tuple(StackedEffect(effect.from_values({}, "")) for effect in (Exponential, Hayden, ConstantScale))
        assert name_of_file(Model(own)) == "my_7_inch_v2.yaml"
        assert name_of_file(Model(raptor, effects[:1])) == "raptor_ground_effect.yaml"
        assert name_of_file(Model(raptor, (*effects, *effects[:1]))) == "raptor_4_effects.yaml"

    def test_the_commands_are_those_that_there_are(self, bench: Workbench, capsys: pytest.CaptureFixture[str]) -> None:
        for _, command in COMMANDS:
            _, name, *words = command.split()
            options = [word for word in words if word.startswith("--")]
            shown = CliRunner().invoke(app, [name, "--help"], env={"COLUMNS": "200"}).output
            assert all(option in shown for option in options), command

    def test_a_search_that_ends_says_so(self, bench: Workbench) -> None:
        model = bench.session.model
        assert model is not None
        diagnosis = SimpleNamespace(
            answer=[lab_finding.Finding(lab_finding.Kind.MISSING, {"families": ["ground_effect", "inflow"]})]
        )
        bench.results = replace(bench.results, found=cast(Any, SimpleNamespace(diagnosis=diagnosis)))
        bench.message = Message("error", "b.csv: holds no flight")
        bench._say_found(model)
        assert bench.message.kind == "error"  # it stays
        bench.message = None
        bench._say_found(replace(model, name="another one"))
        assert bench.message is None
        bench._say_found(model)
        assert bench.message == Message(
            "found", "The search has ended. Missing: ground effect and inflow. See What is missing."
        )

    def test_yes_is_the_answer_to_the_question_about_the_vehicle(self, bench: Workbench) -> None:
        bench.session = replace(bench.session, vehicle_assumed=True)
        bench.confirm_vehicle()
        assert not bench.session.vehicle_assumed
        assert not load_session(bench.folder / AUTOSAVED).vehicle_assumed


class TestResuming:
    """A session knows its logs by name and hash."""

    def test_a_log_that_has_changed_is_left_out_with_one_sentence(self, bench: Workbench, tmp_path: Path) -> None:
        same, other, gone = (tmp_path / name for name in ("same.csv", "other.csv", "gone.csv"))
        same.write_text("1")
        other.write_text("2")
        hashes = {same: sha256_of(same), other: "12ab" * 16, gone: "34cd" * 16}
        asyncio.run(bench.resume(replace(bench.session.with_logs([same, other, gone]), hashes=hashes)))
        assert bench.session.logs == (same, gone)
        assert bench.message is not None
        assert re.fullmatch(r"other.csv: has the SHA-256 \w{12}, expected 12ab12ab12ab as [^.]*\.", bench.message.text)

    def test_a_session_from_elsewhere_finds_the_logs_that_were_dropped_with_it(
        self, bench: Workbench, tmp_path: Path
    ) -> None:
        (tmp_path / "uploads").mkdir()
        log = tmp_path / "uploads" / "a.csv"
        log.write_text("1")
        session = replace(bench.session, logs=(Path("/elsewhere/a.csv"),), view="show=time")
        (tmp_path / "uploads" / "s.lab.yaml").write_text(session_to_yaml(session))
        asyncio.run(Intake(bench, [])._begin_with(tmp_path / "uploads" / "s.lab.yaml"))
        assert bench.session.logs == (log,)
        assert bench.session.view == "show=time"


class TestOtherModel:
    """A model of a file is shown beside those of the session."""

    def test_it_needs_as_many_rotors(self, bench: Workbench) -> None:
        hexarotor = load_model(VEHICLES / "f550.yaml")
        with pytest.raises(SettingsError, match="has 6 rotors, expected 4 as raptor has"):
            bench.show_beside(hexarotor)
        assert bench.other_model is None

    def test_the_session_stays_as_it_is(self, bench: Workbench) -> None:
        session = bench.session
        bench.show_beside(replace(load_model(RAPTOR), name="mine.yaml"))
        assert bench.other_model is not None and bench.session is session


def opened_logs(
    paths: list[Path],
    vehicle: Vehicle,
    accepted: frozenset[Path] = frozenset(),
    known: list[reading.OpenedLog] | None = None,
) -> Opened:
    """The logs, read and prepared as the worker does it."""
    read = reading.read_logs(paths, known or [], quiet)
    return jobs.open_logs(read, frozenset(), vehicle, "blocks", accepted, quiet)


class TestOpening:
    @pytest.fixture
    def read(self, monkeypatch: pytest.MonkeyPatch, raptor: Vehicle) -> list[str]:
        """Names of the logs that are read, in their order."""
        seen: list[str] = []

        def reading(path: Path) -> FlightLog:
            seen.append(path.name)
            return obedient(load_model(RAPTOR), 20.0, name=path.name)

        monkeypatch.setattr("quadctl.web.work.reading.read_log", reading)
        return seen

    def test_a_log_is_read_once_unless_it_changes(self, tmp_path: Path, raptor: Vehicle, read: list[str]) -> None:
        a, b = tmp_path / "a.csv", tmp_path / "b.csv"
        a.write_text("1")
        b.write_text("2")

        def open_both(vehicle: Vehicle, known: list[reading.OpenedLog]) -> list[reading.OpenedLog]:
            return opened_logs([a, b], vehicle, known=known).logs

        one = opened_logs([a], raptor).logs
        both = open_both(raptor, one)
        assert read == ["a.csv", "b.csv"]
        assert both[0] is one[0]
        heavy = open_both(raptor.model_copy(update={"mass_kg": 2.0 * raptor.mass_kg}), both)
        assert read == ["a.csv", "b.csv"] and heavy[0].vehicle != raptor
        a.write_text("changed")
        open_both(raptor, both)
        assert read == ["a.csv", "b.csv", "a.csv"]

    def test_a_copy_is_used_when_its_original_is_left_out(
        self, tmp_path: Path, raptor: Vehicle, read: list[str]
    ) -> None:
        a, b = tmp_path / "a.csv", tmp_path / "b.csv"
        for path in (a, b):
            path.touch()
        both = opened_logs([a, b], raptor)
        assert both.usable == [a] and "holds the same flight as a.csv" in both.logs[1].problem
        assert opened_logs([b], raptor, known=both.logs).usable == [b] and read == ["a.csv", "b.csv"]


class TestForecasts:
    @pytest.fixture
    def flown(self, tmp_path: Path, raptor: Vehicle) -> Opened:
        """Flights at 25 Hz."""
        paths = [tmp_path / "a.csv", tmp_path / "b.csv"]
        for seed, path in enumerate(paths):
            log = obedient(Model(raptor), 20.0, noise_m_s=0.01, seed=seed, name=path.name)
            slow = {name: values[:: round(len(log.time_s) / 500)] for name, values in log.columns.items()}
            write_csv(replace(log, columns=slow, phase=None), path)
        return opened_logs(paths, raptor)

    def test_what_the_flights_lack_is_one_sentence_without_a_folder(self, flown: Opened, raptor: Vehicle) -> None:
        with pytest.raises(QuadctlError) as refused:
            jobs.forecast(flown, frozenset(), raptor, quiet)
        assert str(refused.value).startswith("a.csv: its rotor ") and "come at 25 Hz" in str(refused.value)

    def test_flights_that_are_held_out_are_those_that_are_forecast(
        self, flown: Opened, raptor: Vehicle, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        asked: list[list[str]] = []

        def forecast(used: list[FlightLog], vehicle: Vehicle, held_out: list[FlightLog], _: Any) -> Any:
            asked.append([log.name for log in (*used, *held_out)])
            return len(used)

        monkeypatch.setattr("quadctl.lab.rotation.unseen.forecast_unseen", forecast)
        said: list[str] = []
        path = flown.logs[0].path
        assert jobs.forecast(flown, frozenset([path]), raptor, said.append) == cast(Any, 1)
        assert asked == [["b.csv", "a.csv"]] and said == ["reading b.csv", "reading a.csv"]


class TestErrorsOfAllSteps:
    """Every step of the model sequence has its error on the flights that count now."""

    @pytest.fixture
    def flown(self, raptor: Vehicle) -> tuple[Model, Dataset, Dataset]:
        truth = Model(raptor).plus(Exponential(a=0.3, b=5.0))
        logs = [obedient(truth, 30.0, noise_m_s=0.01, seed=seed, name=f"{seed}.csv") for seed in (0, 1)]
        seen, unseen = (load_dataset([log], raptor) for log in logs)
        return truth, seen, unseen

    def test_they_are_those_of_an_evaluation(self, flown: tuple[Model, Dataset, Dataset]) -> None:
        truth, seen, unseen = flown
        models = [Model(truth.vehicle), truth]
        for held_out in (None, unseen):
            found = errors_of(models, seen, held_out, lambda text: None)
            evaluated = [Study(model, seen, held_out).evaluate() for model in models]
            assert found == [pytest.approx((each.error_m_s2, each.floor_m_s2)) for each in evaluated]

    def test_a_model_fitted_to_other_flights_is_judged_as_it_stands_not_by_refits(
        self, flown: tuple[Model, Dataset, Dataset]
    ) -> None:
        """The model that is drawn is the one as it stands: the error beside it must be of the same."""
        truth, seen, _ = flown
        wrong = Exponential(a=1.2, b=5.0)

        def judged(logs: tuple[str, ...] | None) -> Evaluation:
            item = StackedEffect(wrong, None if logs is None else Provenance(logs=logs))
            model = replace(truth, stack=(item,))
            evaluation = Study(model, seen).evaluate()
            assert evaluation.by_flight["0.csv"]["total"] == pytest.approx(evaluation.error_m_s2)
            assert evaluation.remainder.error_m_s2 == pytest.approx(evaluation.error_m_s2)
            return evaluation

        refitted = judged(("0.csv",))
        assert refitted.kind == "cross-validated" and refitted.error_m_s2 < 0.2
        for elsewhere in (judged(("1.csv",)), judged(None)):
            assert elsewhere.kind == "as it stands" and elsewhere.error_m_s2 > 4.0 * refitted.error_m_s2

    def test_a_step_that_is_not_known_is_computed_with_the_current_one(
        self, bench: Workbench, flown: tuple[Model, Dataset, Dataset], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        truth, seen, unseen = flown

        async def run(job: Callable[..., Any], *args: Any, progress: Callable[[str], None]) -> Any:
            return job(*args, progress=progress)

        async def look() -> None:
            """Nothing is looked for here."""

        monkeypatch.setattr(bench._quick, "run", run)
        monkeypatch.setattr(bench, "look", look)
        step = Step("+ ground_effect.exponential", truth)
        bench.session, bench.opened = bench.session.extended(step), Opened([], seen, unseen)
        asyncio.run(bench._judge(lambda text: None))
        first, last = (step.error_m_s2 for step in bench.session.sequence)
        assert first is not None and last is not None and first > 2.0 * last


class TestRefit:
    """A refit is a step of the model sequence where it changes the model."""

    @pytest.fixture
    def fitted(self, bench: Workbench, raptor: Vehicle, monkeypatch: pytest.MonkeyPatch) -> Workbench:
        """On a step whose effect was never fitted to the flight that is open."""
        given = Model(raptor).plus(Exponential(a=0.5, b=5.0))
        flown = obedient(Model(raptor).plus(Exponential(a=0.3, b=5.0)), 30.0, noise_m_s=0.01, name="0.csv")
        bench.opened = Opened([], load_dataset([flown], raptor), None)
        bench.session = bench.session.extended(Step("+ ground_effect.exponential", given))

        async def run(job: Callable[..., Any], *args: Any, progress: Callable[[str], None]) -> Any:
            return job(*args, progress=progress)

        async def judge(*_: Any) -> None:
            """Nothing is evaluated here."""

        monkeypatch.setattr(bench._quick, "run", run)
        monkeypatch.setattr(bench, "_judge", judge)
        asyncio.run(bench.refit())
        return bench

    def test_other_parameters_are_a_step(self, fitted: Workbench) -> None:
        assert fitted.session.sequence[-1].name == "refitted" and fitted.history.can_undo
        (effect,) = fitted.session.sequence[-1].model.effects
        assert effect.values()["a"] == pytest.approx(0.3, abs=0.05)

    def test_the_same_parameters_again_are_none_and_it_is_said(self, fitted: Workbench) -> None:
        before = fitted.session
        asyncio.run(fitted.refit())
        assert fitted.session is before
        assert fitted.message is not None and "the parameters that the model has already" in fitted.message.text

    def test_the_same_parameters_on_another_flight_are_a_step(self, fitted: Workbench) -> None:
        """They were not known to hold there."""
        assert fitted.opened.seen is not None and fitted.session.model is not None
        (item,) = fitted.session.model.stack
        elsewhere = replace(item, fitted=Provenance(logs=("1.csv",)))
        fitted.session = fitted.session.extended(Step("as it was", replace(fitted.session.model, stack=(elsewhere,))))
        before = len(fitted.session.sequence)
        asyncio.run(fitted.refit())
        assert len(fitted.session.sequence) == before + 1


class TestEvidence:
    """Every effect of the model, and every one that was found missing, has evidence when it is asked for."""

    @pytest.fixture
    def extended(self, bench: Workbench, raptor: Vehicle, monkeypatch: pytest.MonkeyPatch) -> Workbench:
        """On the step after a search, with the effect that it found."""
        truth, rigid = Model(raptor).plus(Exponential(a=0.3, b=5.0)), bench.session.sequence[0].model
        seen = load_dataset([obedient(truth, 30.0, noise_m_s=0.01, name="0.csv")], raptor)

        async def run(job: Callable[..., Any], *args: Any, progress: Callable[[str], None]) -> Any:
            return job(*args, progress=progress)

        monkeypatch.setattr(bench._quick, "run", run)
        found = Findings.of(diagnose(rigid, seen, [Exponential, Hayden]), {})
        bench.session, bench.opened = bench.session.searched(rigid, found), Opened([], seen, None)
        bench.session = bench.session.extended(Step("+ ground_effect.exponential", truth))
        return bench

    def test_of_an_effect_in_the_model_with_the_search_that_found_it(self, extended: Workbench) -> None:
        asyncio.run(extended.gather("ground_effect.exponential"))
        gathered = extended.results.evidence["ground_effect.exponential"]
        assert gathered is not None and gathered.search is not None
        assert gathered.evidence.after["total"] < 0.5 * gathered.evidence.before["total"]
        assert {c.effect.name for c in gathered.search.diagnosis.ranking} >= {"ground_effect.hayden"}

    def test_what_was_said_stays_while_it_is_gathered_again(self, extended: Workbench) -> None:
        extended.say("error", "garbage.csv: is no flight log.")
        said = extended.message
        asyncio.run(extended.gather("ground_effect.exponential"))
        assert extended.message is said

    def test_of_an_effect_that_was_found_missing(self, extended: Workbench) -> None:
        extended.session = extended.session.at(0)
        extended._show_found()
        asyncio.run(extended.gather("ground_effect.exponential"))
        assert extended.results.evidence["ground_effect.exponential"] is not None

    def test_of_no_other_effect(self, extended: Workbench) -> None:
        asyncio.run(extended.gather("wind.constant"))
        assert extended.results.evidence == {}

    def test_the_next_flight_is_to_distinguish_confounded_effects_of_earlier_steps_too(
        self, extended: Workbench, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        search, model, seen = extended.session.sequence[0].found, extended.session.model, extended.opened.seen
        assert search is not None and model is not None and seen is not None
        search.content["confounded"] = [["ground_effect", "tether"]]
        nothing = replace(diagnose(model, seen, [Hayden]), confounded=[])
        extended.results = replace(extended.results, found=Diagnosed(nothing, {}))
        asked = []

        async def run(job: Callable[..., Any], diagnosis: Any, *_: Any, progress: Callable[[str], None]) -> None:
            asked.append(diagnosis.confounded)

        monkeypatch.setattr(extended._quick, "run", run)
        monkeypatch.setattr(extended, "simulation", SimpleNamespace(missions=ROOT / "missions"))
        asyncio.run(extended.suggest())
        assert asked == [[["ground_effect", "tether"]]]

    def test_it_does_not_begin_beside_other_work(self, extended: Workbench) -> None:
        extended.work = Work("Refitting")
        asyncio.run(extended.gather("ground_effect.exponential"))
        assert (extended.results.evidence, extended.message) == ({}, None)


class TestCautions:
    """The page says what the data lack where it judges the residual."""

    def test_an_estimator_that_was_reset(self) -> None:
        report = replace(_report(), findings=(finding(Kind.RESET, [(3.2, 3.2)], of="height"),))
        (said,) = cautions_of(report, MAX_BANDWIDTH_HZ, (0.0, 5.0))
        assert str(said) == "The estimator reset its height at 3.2 s: it jumps there."
        assert cautions_of(report, MAX_BANDWIDTH_HZ, (4.0, 5.0)) == []  # before the take-off

    def test_a_channel_that_limits_the_bandwidth(self) -> None:
        report = _report(rates_hz={"rpm": 2.86, "position": 9.24})
        (said,) = cautions_of(report, 1.01, (0.0, 5.0))
        assert str(said).startswith(
            "The slowest channel, rpm, comes 2.86 times a second, once not for 2.2 s, at 0 s: o"
        )
        assert said.facts["bandwidth_hz"] == 1.01 and said.facts["enough_hz"] == 9
        assert cautions_of(report, MAX_BANDWIDTH_HZ, (0.0, 5.0)) == []

    def test_a_gap_before_the_take_off_is_none_of_the_flight(self) -> None:
        (said,) = cautions_of(_report(rates_hz={"rpm": 2.86}), 1.01, (3.0, 5.0))
        assert said.kind is Doubt.SLOW and said.facts["gap_s"] == 0.0


SILENT = FlightLog("a.csv", None, {"time_s": np.arange(0.0, 5.0, 0.02)})
"""A log without events."""


def _report(rates_hz: dict[str, float] | None = None) -> QualityReport:
    report = quality(SILENT)
    first = ChannelQuality("", (), "", 100, 1.0, 0.1, 2.17, 0.0, 1, 0.0, 0.0)
    channels = tuple(replace(first, name=name, rate_hz=rate) for name, rate in (rates_hz or {}).items())
    return replace(report, channels=channels, record=replace(report.record, thrust_source="rpm"))


class TestDoubts:
    """A log that seems to be of another vehicle is asked about, and not used before the answer."""

    @pytest.fixture
    def metas(self, monkeypatch: pytest.MonkeyPatch) -> dict[str, dict[str, Any]]:
        """Contents of the sidecars of the logs that are read, by their names."""
        said: dict[str, dict[str, Any]] = {}

        def reading(path: Path) -> FlightLog:
            seed = list(said).index(path.name)  # each flight is another one
            log = obedient(load_model(RAPTOR), 20.0, noise_m_s=0.01, seed=seed, name=path.name)
            return replace(log, meta=said[path.name])

        monkeypatch.setattr("quadctl.web.work.reading.read_log", reading)
        return said

    def opened(self, vehicle: Vehicle, metas: dict[str, dict[str, Any]], *accepted: str) -> jobs.Opened:
        paths = [Path(name) for name in metas]
        return opened_logs(paths, vehicle, frozenset(Path(name) for name in accepted))

    def test_another_mass_is_asked_about(self, raptor: Vehicle, metas: dict[str, dict[str, Any]]) -> None:
        metas["a.csv"] = {"vehicle": {"name": raptor.name, "mass_kg": 1.9}}
        asked = self.opened(raptor, metas)
        assert asked.logs[0].doubt == fact(Doubt.MASS, said_kg=1.9, mass_kg=raptor.mass_kg)
        assert asked.usable == [] and asked.seen is None
        answered = self.opened(raptor, metas, "a.csv")
        assert answered.logs[0].doubt is None and answered.seen is not None

    def test_another_autopilot_is_asked_about(self, raptor: Vehicle, metas: dict[str, dict[str, Any]]) -> None:
        metas |= {"a.csv": {"autopilot": "simulated PX4"}, "b.csv": {"autopilot": "ArduPilot"}, "c.csv": {}}
        asked = self.opened(raptor, metas)
        assert [log.doubt and str(log.doubt) for log in asked.logs] == [
            None,
            "This flight was flown by ArduPilot, a.csv by PX4",
            None,
        ]
        assert asked.seen is not None and asked.seen.names == ["a.csv", "c.csv"]

    def test_thrust_from_another_source_is_asked_about(self) -> None:
        one, other = (FlightLog(name, None, {"time_s": np.zeros(1)}) for name in ("a.csv", "b.csv"))
        doubt = doubt_beside(other, "throttle command", one, "rotor speed")
        assert doubt is not None and doubt.kind is Doubt.THRUST and doubt.facts["first"] == "a.csv"
        assert doubt_beside(other, "rotor speed", one, "rotor speed") is None


def test_the_process_that_workers_are_forked_from_has_no_thread() -> None:
    """A thread would not be there after the fork, and whoever waits for it would wait for ever."""
    code = (
        f"import os, sys, {LIBRARIES}; "
        "print(len(os.listdir('/proc/self/task')), [name for name in ('polars', 'scipy.stats') if name in sys.modules])"
    )
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
    run = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, env=environment)
    assert run.stdout.strip() == "1 []"


def test_the_page_starts_without_what_only_a_spectrum_needs() -> None:
    code = "import sys, quadctl.web.page.server; print('scipy.stats' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout == "False\n"


def test_logs_are_read_before_the_libraries_of_the_lab_are_loaded() -> None:
    """The first figure waits for nothing but the log."""
    code = "import sys, quadctl.web.work.reading; print(*[name for name in sys.modules if name.startswith('scipy')])"
    loaded = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout
    assert loaded.strip() == ""
