"""Test whether another family could have made the same accelerations in the flights of a case.

The hidden acceleration of a case is known here without noise. If the regressors of another family explain all of it but
what no log of these flights could show, the two families are indistinguishable in the flown data.
"""

import numpy as np

from studies.worlds.field.arrays import Floats, rotate, rotate_back
from studies.worlds.field.cases import Case
from studies.worlds.field.simulation import Track

UNSEEN_M_S2 = 0.025
"""Root mean square of a left-over acceleration that is not seen beside gusts and estimator errors."""
UNSEEN_SHARE = 0.15
"""Share of the effect's root mean square that may be left over where it is also below `SMALL_M_S2`."""
SMALL_M_S2 = 0.06
ROTATIONAL = ("rotor_fault", "rotor_interaction", "motor_lag", "imu_bias")
"""Families whose moments, timing or sensor tell them apart whatever the accelerations are."""


def _regressors(case: Case, track: Track, every: int) -> dict[str, Floats]:
    """Accelerations per unit parameter that the simplest form of each family makes, shape (samples, parameters, 3)."""
    attitude = track.attitude[::every]
    down = attitude[:, :, 2]
    velocity = track.velocity_m_s[::every]
    body = rotate_back(attitude, velocity)
    lift = np.sum(track.rpm[::every] ** 2, axis=1) * case.vehicle.thrust_n_per_rpm2 / case.vehicle.mass_kg
    mean_rpm = np.mean(track.rpm[::every], axis=1) / case.vehicle.hover_rpm
    up = -track.position_m[::every, 2]
    height = (up + case.vehicle.rotor_height_m) / case.vehicle.radius_m
    edge = np.hypot(body[:, 0], body[:, 1])
    diagonal = np.eye(3)[None] * np.ones((len(body), 1, 1))

    def along_thrust(*factors: Floats) -> Floats:
        return np.stack([-(lift * factor)[:, None] * down for factor in factors], axis=1)

    def along_body(components: Floats) -> Floats:
        return rotate(attitude[:, None], diagonal * components[:, None, :])

    constant = np.ones(len(body))
    world_down = np.array([0.0, 0.0, 1.0])
    return {
        "thrust_scale": along_thrust(constant),
        "thrust_curve": along_thrust(np.log(np.maximum(mean_rpm, 0.1))),
        "rotor_drag": along_body(-body),
        "body_drag": along_body(-body * np.linalg.norm(body, axis=1)[:, None]),
        "inflow": along_thrust(body[:, 2] / np.maximum(mean_rpm, 0.3)),
        "translational_lift": along_thrust(edge**2),
        "thrust_tilt": np.stack([lift[:, None] * attitude[:, :, axis] for axis in (0, 1)], axis=1),
        "tether": (up[:, None] * world_down)[:, None],
        "ground_effect": along_thrust(np.exp(-height), np.exp(-0.5 * height)),
    }


def indistinguishable(case: Case, tracks: list[Track]) -> list[tuple[str, str]]:
    """Pairs of the hidden family and each other family that explains its accelerations in all flights together."""
    families = case.families
    if len(families) != 1 or families[0] in ROTATIONAL:
        return []
    every = 20
    hidden = np.concatenate([track.hidden_accel_m_s2[::every] for track in tracks]).reshape(-1)
    size = float(np.sqrt(np.mean(hidden**2)))
    per_track = [_regressors(case, track, every) for track in tracks]
    pairs: list[tuple[str, str]] = []
    for family in per_track[0]:
        if family == families[0]:
            continue
        stacked = np.concatenate([regressors[family] for regressors in per_track])
        matrix = stacked.swapaxes(1, 2).reshape(-1, stacked.shape[1])
        solution = np.linalg.lstsq(matrix, hidden, rcond=None)[0]
        left = float(np.sqrt(np.mean((hidden - matrix @ solution) ** 2)))
        if left < min(UNSEEN_M_S2, 0.5 * size) or (left < UNSEEN_SHARE * size and left < SMALL_M_S2):
            pairs.append((families[0], family))
    return pairs
