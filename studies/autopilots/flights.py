"""The same missions on the real autopilots, as recorded, and on the mocks: tracking, and the error of the estimate."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from quadctl.control import ControllerSettings
from quadctl.flight.pilot.outcome import Tally
from quadctl.flight.pilot.settings import load_flight_settings
from quadctl.flight.pilot.tick import Tick
from quadctl.flight.preflight.preparation import prepare_flight
from quadctl.frames import euler_from_quaternion
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.read import read_log
from quadctl.sitl.run import fly_lockstep
from studies.page import ROOT

from .measured import mock

DATA = ROOT / "../shared/data/real"
MISSIONS = ("vertical_runs", "forward_runs", "excitation")
"""Missions that were recorded on both autopilots."""
CHANNELS = ("north", "east", "up", "v north", "v east", "v up", "roll", "pitch", "yaw")
UNITS = ("m",) * 3 + ("m/s",) * 3 + ("deg",) * 3
STEP_S = 0.02
MARGIN_S = 2.0
"""Time left out after the take-off and before the landing."""
AIRBORNE_M = 0.3

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Error:
    """Error of the estimate in one channel: its size, and the time in which its correlation falls to 1/e."""

    std: float
    time_s: float


@dataclass(frozen=True)
class Flown:
    """One mission on one autopilot."""

    log: FlightLog
    rmse_m: tuple[float, float, float]
    """Position against reference: north, east, up."""
    errors: tuple[Error, ...]
    """By CHANNELS."""


def recorded(name: str, mission: str) -> Flown:
    """The flight of the real autopilot."""
    log = read_log(DATA / name / f"{mission}.csv")
    truth, estimate = (_px4 if name == "px4" else _ardupilot)(DATA / name, mission)
    return Flown(log, tracking(log), errors(truth, estimate))


def simulated(name: str, mission: str, where: Path, seed: int = 1) -> Flown:
    """The same flight on the mock, in lockstep; its log is written to the folder `where`."""
    autopilot = mock(name, seed)
    plan = prepare_flight(ROOT / "missions" / f"{mission}.yaml", ROOT / "sitl" / name / "flight.yaml", "none", None)
    plan = plan._replace(
        settings=plan.settings.model_copy(update={"controller": recorded_law(plan.settings.controller)})
    )
    pilot = plan.pilot(name == "ardupilot")
    recorder = plan.recorder(where, f"simulated {autopilot.name}")
    truth: list[tuple[float, ...]] = []
    estimate: list[tuple[float, ...]] = []

    def witness(tick: Tick) -> None:
        del tick
        body, e = autopilot.body, autopilot.estimator
        truth.append((autopilot.time_s, *body.position, *body.velocity, *body.attitude))
        estimate.append((autopilot.time_s, *e.position, *e.velocity, *e.attitude))

    rate_hz = plan.settings.controller.rate_hz
    tally = Tally(1.0 / rate_hz)
    fly_lockstep(autopilot, pilot, rate_hz, [recorder, tally, witness])
    recorder.close(pilot.ended)
    outcome = tally.outcome(pilot, recorder.path, recorder.problem)
    log = read_log(Path(outcome.log))
    return Flown(log, tracking(log), errors(_motion(np.array(truth)), _motion(np.array(estimate))))


def recorded_law(controller: ControllerSettings) -> ControllerSettings:
    """The controller of the thesis, with which the real autopilots were flown, in the limits of `controller`."""
    thesis = load_flight_settings(ROOT / "config/flight_thesis.yaml").controller
    return controller.model_copy(update={name: getattr(thesis, name) for name in thesis.model_fields_set})


def tracking(log: FlightLog) -> tuple[float, float, float]:
    """RMSE of the logged position against its reference: north, east, up, m."""
    north, east, up = (
        float(np.sqrt(np.nanmean((log[f"{axis}_m"] - log[f"{axis}_ref_m"]) ** 2))) for axis in ("x", "y", "z")
    )
    return north, east, up


@dataclass(frozen=True)
class Motion:
    """Time, and the nine CHANNELS at it; angles are unwrapped."""

    time_s: tuple[Floats, ...]
    values: tuple[Floats, ...]

    def at(self, channel: int, time_s: Floats) -> Floats:
        return np.interp(time_s, self.time_s[channel], self.values[channel])


def errors(truth: Motion, estimate: Motion) -> tuple[Error, ...]:
    """Errors of an estimate while the vehicle is in the air."""
    height = truth.values[2] - np.median(truth.values[2][: round(1.0 / STEP_S)])
    flying = truth.time_s[2][height > AIRBORNE_M]
    time_s = np.arange(flying[0] + MARGIN_S, flying[-1] - MARGIN_S, STEP_S)
    found = []
    for channel in range(len(CHANNELS)):
        error = estimate.at(channel, time_s) - truth.at(channel, time_s)
        found.append(Error(float(np.std(error)), _correlation_s(error)))
    return tuple(found)


def _correlation_s(error: Floats) -> float:
    centred, n = error - error.mean(), len(error)
    spectrum = np.fft.rfft(centred, 2 * n)
    correlation = np.fft.irfft(spectrum * np.conj(spectrum))[:n]
    return float(np.argmax(correlation < correlation[0] / np.e) * STEP_S)


# --- sources of truth and estimate ------------------------------------------------------------------------------------


def _motion(rows: Floats) -> Motion:
    """Motion from rows of time, position NED, velocity NED, quaternion."""
    time, w, x, y, z = rows[:, 0], *rows[:, 7:11].T
    angles = euler_from_quaternion((w, x, y, z))
    signs = (1.0, 1.0, -1.0, 1.0, 1.0, -1.0)
    linear = [sign * rows[:, i] for i, sign in enumerate(signs, start=1)]
    return _of(time, linear, [np.degrees(angle) for angle in angles], time)


def _of(time_s: Floats, linear: list[Floats], degrees: list[Floats], attitude_s: Floats) -> Motion:
    angles = [np.unwrap(angle, period=360.0) for angle in degrees]
    return Motion((time_s,) * 6 + (attitude_s,) * 3, (*linear, *angles))


def _px4(folder: Path, mission: str) -> tuple[Motion, Motion]:
    from pyulog import ULog

    names = ("vehicle_local_position", "vehicle_attitude")
    log = ULog(str(folder / f"{mission}.ulg"), [*names, *(f"{name}_groundtruth" for name in names)])
    topics: dict[str, Mapping[str, Any]] = {}
    for data in log.data_list:
        topics.setdefault(data.name, data.data)

    def motion(suffix: str) -> Motion:
        place, turn = topics[names[0] + suffix], topics[names[1] + suffix]
        signs = {"x": 1.0, "y": 1.0, "z": -1.0, "vx": 1.0, "vy": 1.0, "vz": -1.0}
        linear = [sign * np.asarray(place[field], dtype=np.float64) for field, sign in signs.items()]
        w, x, y, z = (np.asarray(turn[f"q[{i}]"], dtype=np.float64) for i in range(4))
        degrees = [np.degrees(angle) for angle in euler_from_quaternion((w, x, y, z))]
        return _of(1e-6 * place["timestamp"], linear, degrees, 1e-6 * turn["timestamp"])

    return motion("_groundtruth"), motion("")


def _ardupilot(folder: Path, mission: str) -> tuple[Motion, Motion]:
    from pymavlink.DFReader import DFReader_binary

    reader = DFReader_binary(str(folder / f"{mission}.bin"))
    rows: dict[str, list[tuple[float, ...]]] = {"XKF1": [], "SIM2": [], "ATT": [], "SIM": []}
    for message in _messages(reader, list(rows)):
        at_s, kind = 1e-6 * message.TimeUS, message.get_type()
        if kind in ("ATT", "SIM"):
            rows[kind].append((at_s, message.Roll, message.Pitch, message.Yaw))
        elif kind == "SIM2" or message.C == 0:
            m = message
            rows[kind].append((at_s, m.PN, m.PE, -m.PD, m.VN, m.VE, -m.VD))

    def motion(place: str, turn: str) -> Motion:
        p, a = np.array(rows[place]), np.array(rows[turn])
        return _of(p[:, 0], list(p[:, 1:].T), list(a[:, 1:].T), a[:, 0])

    return motion("SIM2", "SIM"), motion("XKF1", "ATT")


def _messages(reader: Any, kinds: list[str]) -> Iterator[Any]:
    receive: Callable[..., Any] = reader.recv_match
    while (message := receive(type=kinds)) is not None:
        yield message


def mean_error(flights: Sequence[Flown], channel: int) -> Error:
    """Root mean square of the sizes, and mean of the times, of the errors of several flights."""
    found = [flown.errors[channel] for flown in flights]
    return Error(float(np.sqrt(np.mean([e.std**2 for e in found]))), float(np.mean([e.time_s for e in found])))
