"""Truth of a case, written beside its logs for the person who judges and never read by the tool."""

from typing import Any

import numpy as np

from studies.worlds.field.alike import indistinguishable
from studies.worlds.field.cases import Case
from studies.worlds.field.simulation import Track


def _closest(case: Case, tracks: list[Track]) -> dict[str, float]:
    """Least distances of a rotor from the ground and of the rotor plane from the ceiling, in radii."""
    radius = case.vehicle.radius_m
    closest = {"ground": round(min(float(np.min(track.lowest_m)) for track in tracks) / radius, 2)}
    if case.ceiling_m is not None:
        highest = max(-float(np.min(track.position_m[:, 2])) for track in tracks) + case.vehicle.rotor_height_m
        closest["ceiling"] = round((case.ceiling_m - highest) / radius, 2)
    return closest


def truth_document(case: Case, tracks: list[Track]) -> dict[str, Any]:
    """Content of `truth.json`: families, their parameters, timing, trims and the size of the effect in the flights.

    `share_of_variance` is the mean square of the hidden acceleration over its sum with that of the kinematic one.
    """
    parameters: dict[str, Any] = {}
    for hidden in case.hidden:
        key = "+".join(hidden.families)
        values = {name: float(f"{value:.5g}") for name, value in hidden.parameters.items()}
        if key in parameters:
            parameters[key] |= {"drag_form": hidden.variant, **values}
        else:
            parameters[key] = {"form": hidden.variant, **values}
    effect = float(np.mean([np.mean(np.sum(track.hidden_accel_m_s2**2, axis=1)) for track in tracks]))
    motion = float(np.mean([np.mean(np.sum(track.accel_m_s2**2, axis=1)) for track in tracks]))
    if "imu_bias" in case.families:
        effect = float(np.sum(case.sensing.imu_bias_m_s2**2))
    if not case.families:
        effect = 0.0
    for number, flight in enumerate(case.flights):
        if flight.mass_change != 0.0:
            parameters["payload"] |= {"flight": number + 1, "at_s": round(flight.mass_change_at_s, 2)}
    return {
        "case": case.name,
        "families": list(case.families),
        "strength": case.strength,
        "parameters": parameters,
        "timing": {
            "rotor_s": round(case.sensing.rotor_delay_s, 4),
            "velocity_s": round(case.sensing.velocity_lag_s, 4),
        },
        "trims_deg": round(case.trims_deg, 3),
        "indistinguishable": [list(pair) for pair in indistinguishable(case, tracks)],
        "share_of_variance": float(f"{effect / (effect + motion):.3g}"),
        "effect_rms_m_s2": float(f"{np.sqrt(effect):.3g}"),
        "closest_over_radius": _closest(case, tracks),
        "notes": list(case.notes),
    }
