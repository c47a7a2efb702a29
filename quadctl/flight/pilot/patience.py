"""Patience: how long a flight, and a check of it, waits for a state that it may use."""

from quadctl.state import VehicleState

READY_TIMEOUT_S = 15.0
BOOT_TIMEOUT_S = 60.0
"""Longest wait for an autopilot that reports that it is not ready, as it does for some time after boot."""


def patience_s(state: VehicleState) -> float:
    """Longest wait for a better state than this one, s."""
    return READY_TIMEOUT_S if state.ready_to_arm and state.estimator_ok else BOOT_TIMEOUT_S
