"""Errors that every real flight has, drawn per case from a seed: no physics that a model should hold."""

import math
import random
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from quadctl.frames import multiply, quaternion_from_euler
from quadctl.logs.flight_log import FlightLog
from quadctl.sitl.vehicle.body import Motion
from quadctl.sitl.vehicle.estimator import Estimator
from quadctl.sitl.vehicle.hidden import Noise, Telemetry
from quadctl.state import Quat, Vec3

COEFFICIENT_ERROR = (0.007, 0.013)
"""Share by which each rotor is off, up or down: rotors of one batch differ by about a percent."""
ATTITUDE_BIAS_DEG = 0.3
DATUM_M = 0.01
SLOPE_DEG = 1.0
"""Slope of the ground in the frame of the log: the public RAPTOR logs have 0.9 degrees."""
DELAY_S = (0.02, 0.04)
RPM_EXTRA_DELAY_S = (0.01, 0.04)
"""Time by which rotor speeds are older than the position."""
RPM_RATE_HZ = (10.0, 25.0)
GUST_M_S2 = (0.02, 0.06)
"""Standard deviation of the push of light turbulence on a small vehicle."""
GUST_TIME_S = 1.2
IMU_BIAS_M_S2 = 0.03
"""Bias of an accelerometer after calibration: 3 mg."""
IMU_NOISE_M_S2 = 0.15
HELD_SHARE, DROPPED_SHARE = 0.03, 0.02


@dataclass(frozen=True)
class Nuisances:
    """One vehicle's and one set-up's own errors; the same in all flights of a case, but for gusts and lost samples."""

    rotor_coefficients: tuple[float, ...]
    """True thrust coefficient over the file's, one per rotor."""
    attitude_bias: Quat
    datum_m: float
    """Logged height minus true height."""
    slope: tuple[float, float]
    """Rise of the ground per metre north and east."""
    delay_s: float
    rpm_delay_s: float
    rpm_rate_hz: float
    gust_m_s2: float
    imu_bias_m_s2: Vec3
    seed: int

    @classmethod
    def draw(cls, n_rotors: int, seed: int, flight: int = 0) -> "Nuisances":
        """Those of a case; `flight` changes what differs from flight to flight."""
        chance = random.Random(f"nuisances {seed}")
        coefficients = tuple(
            1.0 + chance.choice((-1.0, 1.0)) * chance.uniform(*COEFFICIENT_ERROR) for _ in range(n_rotors)
        )
        lean, toward = math.radians(ATTITUDE_BIAS_DEG) * chance.uniform(0.3, 1.0), chance.uniform(0.0, 2.0 * math.pi)
        rise, uphill = math.tan(math.radians(SLOPE_DEG)) * chance.random(), chance.uniform(0.0, 2.0 * math.pi)
        delay = chance.uniform(*DELAY_S)

        def bias() -> float:
            return chance.uniform(-IMU_BIAS_M_S2, IMU_BIAS_M_S2)

        return cls(
            rotor_coefficients=coefficients,
            attitude_bias=quaternion_from_euler(lean * math.cos(toward), lean * math.sin(toward), 0.0),
            datum_m=chance.uniform(-DATUM_M, DATUM_M),
            slope=(rise * math.cos(uphill), rise * math.sin(uphill)),
            delay_s=delay,
            rpm_delay_s=delay + chance.uniform(*RPM_EXTRA_DELAY_S),
            rpm_rate_hz=chance.uniform(*RPM_RATE_HZ),
            gust_m_s2=chance.uniform(*GUST_M_S2),
            imu_bias_m_s2=(bias(), bias(), bias()),
            seed=1000 * seed + flight,
        )

    def gusts(self) -> "Gusts":
        return Gusts(self.gust_m_s2, random.Random(f"gusts {self.seed}"))

    def estimator(self) -> "BiasedEstimator":
        telemetry = Telemetry(delay_s=self.delay_s, rpm_delay_s=self.rpm_delay_s, rpm_rate_hz=self.rpm_rate_hz)
        return BiasedEstimator(Noise(), telemetry, self.seed, self.attitude_bias, self.datum_m)

    def with_lost_samples(self, log: FlightLog) -> FlightLog:
        """Some rows missing, and some in which the state is still that of the row before."""
        chance = np.random.default_rng(self.seed)
        n = len(log)
        held = _bursts(chance, n, HELD_SHARE, 4)
        held[0] = False
        source = np.maximum.accumulate(np.where(held, 0, np.arange(n)))
        state = [c for c in log.columns if c.startswith(("x_m", "y_m", "z_m", "v", "roll", "pitch", "yaw"))]
        columns = {name: values[source] if name in state else values for name, values in log.columns.items()}
        kept = ~_bursts(chance, n, DROPPED_SHARE, 8)
        return FlightLog(log.name, log.path, columns, log.phase, log.meta, log.findings).rows(kept)


class Gusts:
    """Turbulence as a push: a first-order Markov process per axis, as Dryden's longitudinal spectrum."""

    def __init__(self, size_m_s2: float, chance: random.Random) -> None:
        self._chance = chance
        self._size: Vec3 = (size_m_s2, size_m_s2, 0.5 * size_m_s2)
        self.value = [chance.gauss(0.0, size) for size in self._size]
        self._until_draw_s = 0.0

    def step(self, dt: float) -> list[float]:
        """m/s^2, NED. Drawn every 20 ms: a vehicle does not feel what is quicker."""
        self._until_draw_s -= dt
        if self._until_draw_s <= 0.0:
            self._until_draw_s = 0.02
            keep = math.exp(-0.02 / GUST_TIME_S)
            rest = math.sqrt(1.0 - keep * keep)
            self.value = [
                keep * v + rest * self._chance.gauss(0.0, s) for v, s in zip(self.value, self._size, strict=True)
            ]
        return self.value


class BiasedEstimator(Estimator):
    """An estimator whose attitude leans and whose height has another zero."""

    def __init__(self, noise: Noise, telemetry: Telemetry, seed: int, bias: Quat, datum_m: float) -> None:
        super().__init__(noise, telemetry, seed)
        self._bias = bias
        self._datum_m = datum_m

    def _update(self, motion: Motion, now: float) -> None:
        north, east, down = motion.position_ned_m
        super()._update(
            motion._replace(
                position_ned_m=(north, east, down - self._datum_m),
                attitude=multiply(motion.attitude, self._bias),
            ),
            now,
        )


def _bursts(chance: np.random.Generator, n: int, share: float, longest: int) -> NDArray[np.bool_]:
    """A mask that is true in bursts of up to `longest`, `share` of the time."""
    mask = np.zeros(n, dtype=bool)
    for start in np.flatnonzero(chance.random(n) < 2.0 * share / (longest + 1)):
        mask[start : start + int(chance.integers(1, longest + 1))] = True
    return mask
