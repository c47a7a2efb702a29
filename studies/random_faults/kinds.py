"""The kinds of faults: how each is drawn, and how it acts. Sizes and durations vary, so that most heal in time."""

import math
import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from quadctl.effects.rotor_fault import WeakRotor
from quadctl.sitl.server import faults
from quadctl.state import NAN, VehicleState

from .stage import Stage, Trouble, Way

Size = Mapping[str, Any]
Draw = Callable[[random.Random], dict[str, Any]]
Act = Callable[[Stage, Size, float], None]
"""Function of stage, size and duration, s."""

LONGEST_FLOAT_S = 20.0
"""Time after which a vehicle that does not come down lands all the same: on an empty battery, in the end."""
STREAMS = (
    *("LOCAL_POSITION_NED", "ATTITUDE_QUATERNION", "HEARTBEAT", "CURRENT_MODE", "SYS_STATUS", "EXTENDED_SYS_STATE"),
    *("ESTIMATOR_STATUS", "EKF_STATUS_REPORT", "TIMESYNC", "COMMAND_ACK", "STATUSTEXT"),
)


@dataclass(frozen=True)
class Kind:
    """A kind of fault."""

    draw: Draw
    act: Act
    weight: float = 1.0
    lasting: bool = True
    """True: it lasts for a time that is drawn, too."""


def _trouble(make: Callable[[Size], Trouble]) -> Act:
    return lambda stage, size, lasts_s: stage.begin(make(size), lasts_s)


def _spoiled(part: str, axis: int, value: float) -> faults.Distortion:
    def distort(estimate: VehicleState) -> VehicleState:
        values = list(getattr(estimate, part))
        values[axis] = value
        changes: dict[str, Any] = {part: tuple(values)}
        return replace(estimate, **changes)

    return distort


def _draw_spoiled(r: random.Random) -> dict[str, Any]:
    part = r.choice(["position_ned_m", "velocity_ned_m_s", "attitude"])
    return {
        "part": part,
        "axis": r.randrange(3),
        "value": r.choice([NAN, math.inf, 0.0 if part == "attitude" else NAN]),
    }


def _draw_vector(r: random.Random, least: float, most: float) -> tuple[float, float, float]:
    size, way, up = _log(r, least, most), r.uniform(0.0, math.tau), r.uniform(-1.0, 1.0)
    flat = math.sqrt(1.0 - up * up)
    return size * flat * math.cos(way), size * flat * math.sin(way), -size * up


def _log(r: random.Random, least: float, most: float) -> float:
    return math.exp(r.uniform(math.log(least), math.log(most)))


def _weaken(stage: Stage, size: Size, lasts_s: float) -> None:
    body = stage.mock.autopilot.body
    body.truth = body.truth.plus(WeakRotor(loss=size["loss"], rotor=float(size["rotor"])))


def _take(stage: Stage, size: Size, lasts_s: float) -> None:
    """Take the mode; give it back after a time, or land by hand."""
    mode = stage.profile.stick if size["mode"] == "stick" else size["mode"]
    stage.take_mode(mode)
    if size["back_s"] is not None:
        stage.later(size["back_s"], lambda: stage.take_mode(stage.profile.offboard))
    stage.later(size["land_s"], lambda: stage.take_mode("LAND"))


def _draw_take(r: random.Random) -> dict[str, Any]:
    back_s = _log(r, 0.02, 3.0) if r.random() < 0.5 else None
    mode = r.choice(["stick", "stick", "RTL", "LAND"])
    return {"mode": mode, "back_s": back_s, "land_s": r.uniform(4.0, 8.0)}


def _restart(stage: Stage, size: Size, lasts_s: float) -> None:
    if size["dark_s"] > 0.0:
        stage.begin(Trouble(silent=True, deaf=True), size["dark_s"])
    stage.mock.restart()


def _lose_remote(stage: Stage, size: Size, lasts_s: float) -> None:
    stage.mock.autopilot.lose_remote()


def _lose_aid(stage: Stage, size: Size, lasts_s: float) -> None:
    stage.mock.autopilot.lose_position_aid()
    if math.isfinite(lasts_s):

        def find_again() -> None:
            stage.mock.autopilot.estimator.aid_lost_s = None

        stage.later(lasts_s, find_again)


def _fail_battery(stage: Stage, size: Size, lasts_s: float) -> None:
    if stage.mock.autopilot.armed:
        stage.mock.autopilot.fail_battery()


def _disarm(stage: Stage, size: Size, lasts_s: float) -> None:
    stage.mock.autopilot._disarm()


def _float(stage: Stage, size: Size, lasts_s: float) -> None:
    """The landing comes down slowly, or not at all for a time."""
    parameters, name = stage.mock.autopilot.parameters, stage.profile.land_speed
    before = parameters[name]
    parameters[name] = before * size["share"]
    stage.later(min(lasts_s, LONGEST_FLOAT_S), lambda: parameters.update({name: before}))


def _interrupt_twice(stage: Stage, size: Size, lasts_s: float) -> None:
    stage.interrupt("SIGINT")
    stage.later(size["again_s"], lambda: stage.interrupt("SIGINT"))


def _draw_way(r: random.Random) -> dict[str, Any]:
    """Troubles of one direction or both."""
    return {"ways": r.choice(["down", "up", "both"])}


def _ways(make: Callable[[Size], Way]) -> Callable[[Size], Trouble]:
    def trouble(size: Size) -> Trouble:
        way, none = make(size), Way()
        return Trouble(
            down=way if size["ways"] != "up" else none,
            up=way if size["ways"] != "down" else none,
        )

    return trouble


KINDS: dict[str, Kind] = {
    "a value is spoiled": Kind(
        _draw_spoiled, _trouble(lambda s: Trouble(_spoiled(s["part"], s["axis"], s["value"]))), 1.5
    ),
    "attitude of zeros": Kind(lambda r: {}, _trouble(lambda s: Trouble(faults.no_attitude)), 0.5),
    "frozen": Kind(
        lambda r: {"part": r.choice(["position", "attitude"])}, _trouble(lambda s: Trouble(faults.frozen(s["part"])))
    ),
    "position is off": Kind(
        lambda r: {"by_m": _draw_vector(r, 0.05, 5.0), "over_s": r.choice([0.0, r.uniform(0.1, 3.0)])},
        _trouble(lambda s: Trouble(faults.displaced(s["by_m"], s["over_s"]))),
        2.0,
    ),
    "velocity is off": Kind(
        lambda r: {"to_m_s": _log(r, 0.3, 15.0), "over_s": r.uniform(0.1, 2.0)},
        _trouble(lambda s: Trouble(faults.hurried(s["to_m_s"], s["over_s"]))),
    ),
    "attitude is off": Kind(
        lambda r: {"roll_deg": r.uniform(2.0, 75.0)},
        _trouble(lambda s: Trouble(faults.leaning(math.radians(s["roll_deg"])))),
    ),
    "battery reads": Kind(
        lambda r: {"volts": r.choice([12.0, 13.4, 13.6, NAN])},
        _trouble(lambda s: Trouble(faults.battery_at(s["volts"]))),
        0.5,
    ),
    "estimator rejects its sensors": Kind(
        lambda r: {"ratio": r.uniform(0.9, 3.0)}, _trouble(lambda s: Trouble(estimator_ratio=s["ratio"])), 0.5
    ),
    "position aid lost": Kind(lambda r: {}, _lose_aid),
    "messages stop": Kind(
        lambda r: {"names": r.sample(STREAMS, r.choice([1, 1, 1, 2, 3]))},
        _trouble(lambda s: Trouble(withheld=frozenset(s["names"]))),
        3.0,
    ),
    "all messages stop": Kind(lambda r: {}, _trouble(lambda s: Trouble(silent=True)), 1.5),
    "it hears nothing": Kind(lambda r: {}, _trouble(lambda s: Trouble(deaf=True)), 1.5),
    "link cut": Kind(lambda r: {}, _trouble(lambda s: Trouble(silent=True, deaf=True))),
    "delay": Kind(
        lambda r: {**_draw_way(r), "delay_s": _log(r, 0.03, 1.5)},
        _trouble(_ways(lambda s: Way(delay_s=s["delay_s"]))),
        1.5,
    ),
    "jitter, loss, duplicates": Kind(
        lambda r: {
            **_draw_way(r),
            "jitter_s": _log(r, 0.005, 0.4),
            "loss": r.uniform(0.0, 0.7),
            "duplicates": r.uniform(0.0, 0.5),
        },
        _trouble(_ways(lambda s: Way(0.0, s["jitter_s"], s["loss"], s["duplicates"]))),
        1.5,
    ),
    "modes are refused": Kind(lambda r: {}, _trouble(lambda s: Trouble(refuse_modes="not now"))),
    "arming is refused": Kind(lambda r: {}, _trouble(lambda s: Trouble(refuse_arming="not now")), 0.3),
    "landing floats": Kind(lambda r: {"share": r.choice([0.0, 0.1, 0.5])}, _float, 0.7),
    "a motor is weak": Kind(
        lambda r: {"loss": r.uniform(0.1, 0.9), "rotor": r.randrange(1, 5)}, _weaken, lasting=False
    ),
    "battery fails": Kind(lambda r: {}, _fail_battery, 0.5, lasting=False),
    "remote control lost": Kind(lambda r: {}, _lose_remote, 0.5, lasting=False),
    "disarmed": Kind(lambda r: {}, _disarm, 0.4, lasting=False),
    "autopilot restarts": Kind(lambda r: {"dark_s": r.choice([0.0, _log(r, 0.05, 5.0)])}, _restart, 0.7, lasting=False),
    "a person takes the mode": Kind(_draw_take, _take, 3.0, lasting=False),
    "stall": Kind(
        lambda r: {"seconds": _log(r, 0.05, 8.0), "how": r.choice(["loop", "interpreter", "process"])},
        lambda stage, s, lasts_s: stage.stall(s["seconds"], s["how"]),
        2.0,
        lasting=False,
    ),
    "killed": Kind(lambda r: {}, lambda stage, s, lasts_s: stage.kill(), 0.4, lasting=False),
    "disk full": Kind(lambda r: {}, lambda stage, s, lasts_s: stage.fill_disk(), 0.6, lasting=False),
    "signal": Kind(
        lambda r: {"name": r.choice(["SIGINT", "SIGTERM", "SIGHUP"])},
        lambda stage, s, lasts_s: stage.interrupt(s["name"]),
        1.5,
        lasting=False,
    ),
    "Ctrl-C twice": Kind(lambda r: {"again_s": _log(r, 0.01, 3.0)}, _interrupt_twice, lasting=False),
}
