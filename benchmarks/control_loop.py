"""Lateness of the 50 Hz loop in a real-time flight over MAVLink, beside a plain `await asyncio.sleep(0.02)` loop; and
what one tick of control costs with each compensator, beside an empty function call."""

import asyncio
import tempfile
import time
import timeit
from collections.abc import Iterator
from pathlib import Path

from rich.console import Console

import sitl.run
from quadctl.compensator import Compensator
from quadctl.control import ControllerSettings, Memory, control
from quadctl.effects import CATALOG
from quadctl.flight.session import fly_real_time, prepare_flight
from quadctl.model import Model, load_model
from quadctl.state import Setpoint, VehicleState

ROOT = Path(__file__).parent.parent
SECONDS = 20.0
Row = tuple[str, str, str]


def rows() -> Iterator[Row]:
    yield from _compute()
    yield from _lateness()


def _lateness() -> Iterator[Row]:
    plain = asyncio.run(_plain_sleep_loop(SECONDS))
    plan = prepare_flight(ROOT / "missions/step_response.yaml", ROOT / "config/flight.yaml", "sanchez", None)
    with tempfile.TemporaryDirectory() as directory, sitl.run.mock_process(plan.body.vehicle, None, 1) as url:
        outcome = fly_real_time(plan, url, Path(directory), Console(quiet=True))
    for name in ("p50", "p99", "max"):
        yield (
            f"tick lateness {name}, {outcome.ticks} ticks of flight over MAVLink",
            f"{outcome.late_ms[name]:.2f} ms",
            f"{plain[name]:.2f} ms in a plain sleep(0.02) loop",
        )


async def _plain_sleep_loop(seconds: float) -> dict[str, float]:
    """How much longer than 20 ms each round of the loop that everybody writes first takes, ms."""
    late = []
    before = time.monotonic()
    for _ in range(int(seconds / 0.02)):
        await asyncio.sleep(0.02)
        now = time.monotonic()
        late.append(1e3 * (now - before - 0.02))
        before = now
    late.sort()
    return {"p50": late[len(late) // 2], "p99": late[int(0.99 * len(late))], "max": late[-1]}


def _compute() -> Iterator[Row]:
    rigid = load_model(ROOT / "config/vehicles/raptor.yaml")
    state = VehicleState(
        0.0, (0.0, 0.0, -0.3), (0.1, 0.0, 0.1), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (5600.0,) * 4, battery_v=16.0
    )
    setpoint, settings = Setpoint((0.0, 0.0, -0.4)), ControllerSettings()
    empty = min(timeit.repeat(lambda: None, number=20000, repeat=5)) / 20000
    for name, model in {"none": rigid, **{n: rigid.plus(e()) for n, e in CATALOG.items()}, "all": _all(rigid)}.items():
        compensator = Compensator(model)

        def tick(compensator: Compensator = compensator) -> object:
            return control(setpoint, state, Memory(), 0.02, 0.0, rigid.vehicle, settings, compensator)

        def alone(compensator: Compensator = compensator) -> object:
            return compensator(state, 0.0, 14.7)

        whole = min(timeit.repeat(tick, number=2000, repeat=5)) / 2000
        only = min(timeit.repeat(alone, number=2000, repeat=5)) / 2000
        yield (
            f"control tick with {name}",
            f"{1e6 * whole:.1f} us, of it the compensator {1e6 * only:.1f} us",
            f"{whole / empty:.0f} empty calls",
        )


def _all(rigid: Model) -> Model:
    """One effect of each family."""
    model = rigid
    for effect in CATALOG.values():
        if effect.family() not in {e.family() for e in model.effects}:
            model = model.plus(effect())
    return model
