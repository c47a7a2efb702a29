"""The whole workflow of a user without hardware, explained step by step on the terminal.

A simulated vehicle lives in a world with a ground effect that the catalogue does not hold. It flies data-collection
missions; the rigid body is compared with them; what is missing is found and added; the error on a flight that no fit
has seen falls; and step responses show what the found model is worth as a compensator.
"""

from contextlib import AbstractContextManager
from pathlib import Path
from typing import NamedTuple, Protocol

import yaml
from rich.console import Console

from quadctl.errors import QuadctlError
from quadctl.files import write_text
from quadctl.flight.pilot.outcome import Outcome
from quadctl.flight.pilot.settings import DEFAULT_CONFIG
from quadctl.flight.preflight.computer import lacking_to_fly
from quadctl.flight.preflight.plan import FlightPlan
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.installed import describe, locate
from quadctl.lab.comparison.unseen_flights import judge
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.report.page import write_report
from quadctl.lab.selection.discovery import discover
from quadctl.lab.tracking.metrics import MetricsTable, Window, metrics
from quadctl.lab.tracking.rendering import render
from quadctl.lab.tracking.step_response import step_responses
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_log
from quadctl.model import load_model, save_model
from quadctl.sample_world import HIDDEN
from quadctl.vehicle import Vehicle

TEXTBOOK = "hayden"
MISSIONS = Path("missions")
VEHICLE = Path("config/vehicles/raptor.yaml")


class Simulator(Protocol):
    """The part of the simulator that the demo needs."""

    def simulate(self, plan: FlightPlan, log_dir: Path, hidden: Path | None, seed: int) -> Outcome: ...

    def mock_process(self, vehicle: Vehicle, hidden: Path | None, seed: int) -> AbstractContextManager[str]: ...


class Demo(NamedTuple):
    """Folder, hidden truth, simulator and console of one run."""

    out: Path
    hidden: Path
    simulator: Simulator
    console: Console

    def fly(self, mission: str, model: str, seed: int) -> FlightLog:
        plan = prepare_flight(_mission(mission), None, model, None)
        outcome = self.simulator.simulate(plan, self.out / "logs", self.hidden, seed)
        if not outcome.completed:
            raise QuadctlError(f"the simulated flight of {mission} was not completed: {outcome.ended}")
        self.say(f"  flew {mission} with compensator '{plan.compensator.name}': {outcome.log}")
        return read_log(outcome.log)

    def say(self, text: str) -> None:
        self.console.print(text, soft_wrap=True, highlight=False)


def run(out: Path, console: Console, simulator: Simulator, real_time: bool) -> None:
    """Walk the circle; logs, models and the report go to `out`.

    Raises
    ------
    QuadctlError
        A step did not do what it should.
    """
    demo = Demo(out, _write_hidden(out), simulator, console)
    for what, path in (("missions", MISSIONS), ("configuration", DEFAULT_CONFIG), ("vehicle", VEHICLE)):
        demo.say(describe(what, locate(path)))
    demo.say("[bold]1. Fly[/]: three hover staircases in a simulated world with a ground effect that the model lacks.")
    logs = [demo.fly("hover_staircase", "none", seed) for seed in (1, 2, 3)]

    rigid = load_model(locate(VEHICLE))
    seen, unseen = load_dataset(logs[:2], rigid.vehicle, "flights"), load_dataset(logs[2:], rigid.vehicle)
    with console.status("comparing, diagnosing, adding"):
        discovery = discover(rigid, seen)
    demo.say("\n[bold]2. Compare[/]: the rigid body against the first two flights.")
    console.print(discovery.before)
    demo.say("\n[bold]3. Diagnose[/]: which effect is missing?")
    console.print(discovery.diagnosis)
    if not discovery.additions:
        raise QuadctlError("the diagnosis found nothing missing, expected the hidden ground effect")
    demo.say("\n[bold]4. Add[/]: what was found, fitted to the first two flights.")
    console.print(discovery.additions[-1])
    found = out / "found.yaml"
    save_model(discovery.model, found)
    demo.say(f"Saved: {found}")

    demo.say("\n[bold]5. Judge[/]: the third flight, which no fit has seen.")
    judged = judge(rigid, discovery.model, unseen)
    console.print(judged)

    demo.say("\n[bold]6. Fly again[/]: step responses into the ground effect.")
    steps = _fly_steps(demo, found)
    console.print(render(steps.table))

    if real_time and (lacking := lacking_to_fly()) is not None:
        demo.say(f"\n[bold]7. Over MAVLink[/]: left out, as a flight in real time needs {lacking}.")
    elif real_time:
        demo.say("\n[bold]7. Over MAVLink[/]: a short flight in real time on a simulated PX4, compensated.")
        _fly_mavlink(demo, found)

    report = out / "report.html"
    write_report(
        report,
        comparison=discovery.before,
        diagnosis=discovery.diagnosis,
        addition=discovery.additions[-1],
        before_unseen=judged.before,
        after=judged.after,
        steps=step_responses(steps.logs, steps.table),
    )
    before, after = (comparison.rmse["total"] for comparison in (judged.before, judged.after))
    differences = [f"{flight.m_b_absolute:.3f}" for flight in steps.table.flights if not flight.is_reference]
    demo.say(
        f"\nIn short: {', '.join(discovery.diagnosis.missing)} is missing; error on the unseen flight {before:.3f} -> "
        f"[bold]{after:.3f} m/s^2[/]; difference of a step from one far from the ground (absolute M_B) "
        f"{differences[0]} m s uncompensated, {differences[1]} by the textbook's formula, {differences[2]} by what was "
        "found."
    )
    demo.say(f"Report: [bold]{report}[/]")
    flights = " ".join(str(log.path) for log in logs)
    demo.say(f"The same in your browser, click by click: [bold]quadctl lab {flights} --hidden {demo.hidden}[/]")


class Steps(NamedTuple):
    """Step responses by compensator, and their metrics."""

    logs: dict[str, FlightLog]
    table: MetricsTable


def _mission(name: str) -> Path:
    return locate(MISSIONS / f"{name}.yaml")


def _write_hidden(out: Path) -> Path:
    path = out / "hidden.yaml"
    write_text(path, "# What the simulated world hides; nothing but the simulator reads it.\n" + yaml.safe_dump(HIDDEN))
    return path


def _fly_steps(demo: Demo, found: Path) -> Steps:
    high = demo.fly("step_response_high", "none", 10)
    logs = {name: demo.fly("step_response", name, 11) for name in ("none", TEXTBOOK, str(found))}
    table = metrics(list(logs.values()), [high], window=Window(phase="step"))
    return Steps({**logs, "out of ground effect": high}, table)


def _fly_mavlink(demo: Demo, found: Path) -> None:
    from quadctl.flight.session import fly_real_time  # loads MAVSDK, which the lockstep flights do without

    plan = prepare_flight(_mission("short_hop"), None, str(found), None)
    with demo.simulator.mock_process(plan.body.vehicle, demo.hidden, 20) as url:
        outcome = fly_real_time(plan, url, demo.out / "logs", demo.console)
    demo.say("\n".join(outcome.lines()))
    if not outcome.completed:
        raise QuadctlError(f"the flight over MAVLink was not completed: {outcome.ended}")
