"""Descriptions of one case: vehicle, sensing, hidden effects and the flights made with them."""

from dataclasses import dataclass, field

import numpy as np

from studies.worlds.field.arrays import Floats
from studies.worlds.field.missions import Reference
from studies.worlds.field.vehicles import Beliefs, Vehicle


@dataclass(frozen=True)
class Hidden:
    """One hidden effect of a case, its parameters already scaled with the strength."""

    families: tuple[str, ...]
    variant: str
    """Key of `effects.EFFECTS`, or `family.kind` of an effect that acts on masses, motors, axes or sensors."""
    parameters: dict[str, float]


@dataclass(frozen=True)
class Sensing:
    """Estimators, sensors and logger of one vehicle, common to its flights."""

    kind: str
    """`mocap`, `flow` or `gps`."""
    position_sigma_m: float
    position_time_s: float
    velocity_sigma_m_s: float
    velocity_time_s: float
    velocity_lag_s: float
    attitude_sigma_deg: float
    tilt_per_accel_deg: float
    """Tilt error per horizontal acceleration, degrees per m/s^2."""
    tilt_time_s: float
    """Time constant with which the tilt error follows the acceleration."""
    drift_deg: float
    yaw_bias_deg: float
    gyro_lag_s: float
    rotor_delay_s: float
    rotor_rate_hz: float
    rpm_quantum: float
    log_rate_hz: float
    hold_rate_hz: float
    """Rate at which the estimator publishes; rows between two estimates repeat the older one. 0: at every row."""
    missing_rows: float
    repeated_rows: float
    imu: bool
    imu_bias_m_s2: Floats
    imu_noise_m_s2: float
    imu_lag_s: float
    battery_column: bool
    command_columns: bool
    rotor_columns: bool


@dataclass(frozen=True)
class Control:
    """Controller of one vehicle."""

    kind: str
    """`geometric`, `lqr` or `indi`."""
    inner_hz: int
    outer_hz: int
    rate_gain: float
    attitude_gain: float
    flat_bandwidth: float
    up_bandwidth: float
    damping: float
    integral_time_s: float
    feedforward: float
    lead: float
    """Share of the motor lag that the controller makes up for by lead in the commanded speeds."""
    max_tilt_rad: float


@dataclass(frozen=True)
class Flight:
    """One flight of a case: what is asked of the vehicle and what nature and sensors add."""

    reference: Reference
    settle_s: float
    """Time flown before the log begins."""
    mean_wind_m_s: Floats
    """Mean air velocity at 10 m above ground, NED."""
    shear: bool
    gusts_m_s: Floats
    """NED, at steps of `NOISE_STEP_S`."""
    gust_coupling_per_s: float
    """Acceleration per gust velocity in flights whose vehicle has no drag of its own."""
    position_noise_m: Floats
    velocity_noise_m_s: Floats
    tilt_noise_rad: Floats
    trim_rad: Floats
    """Constant rotation of the estimated body frame against the true one (roll, pitch, yaw)."""
    mass_change: float
    """Relative change of mass at `mass_change_at_s` of the log; 0 for none."""
    mass_change_at_s: float
    mass_change_takes_s: float
    charge: float
    """State of charge of the battery at the start."""
    seed: int
    """Seed of the logger's random numbers."""


@dataclass(frozen=True)
class Case:
    """One hidden case."""

    name: str
    vehicle: Vehicle
    beliefs: Beliefs
    control: Control
    sensing: Sensing
    hidden: tuple[Hidden, ...]
    flights: tuple[Flight, ...]
    strength: float
    trims_deg: float
    ceiling_m: float | None
    states_motor_time: bool
    notes: tuple[str, ...] = field(default=())

    @property
    def families(self) -> tuple[str, ...]:
        """Families of all hidden effects, each once."""
        return tuple(dict.fromkeys(family for hidden in self.hidden for family in hidden.families))

    def parameter(self, family: str, name: str, default: float) -> float:
        """Value of a hidden parameter, or the default where the case does not hide that family."""
        for hidden in self.hidden:
            if family in hidden.families and name in hidden.parameters:
                return hidden.parameters[name]
        return default


NOISE_STEP_S = 0.02


def noise_samples(duration_s: float) -> int:
    """Number of samples of noise for a flight of this length, settling included."""
    return int(np.ceil(duration_s / NOISE_STEP_S)) + 2
