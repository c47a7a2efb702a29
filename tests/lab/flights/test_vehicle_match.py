"""The vehicle of a log: the order of its motors, by the moments that turn it."""

import numpy as np
import pytest

from quadctl.lab.flights.vehicle_match import motion_problem
from quadctl.vehicle import Vehicle


@pytest.mark.parametrize(
    ("share", "refused"),
    [
        pytest.param(1.0, False, id="right order"),
        pytest.param(-1.0, True, id="every motor in the place of the opposite one"),
        pytest.param(-0.2, False, id="rotors counter a moment of the ground that is 1.2 times theirs"),
    ],
)
def test_the_order_of_the_motors_is_judged_where_their_moments_turn_the_vehicle(
    raptor: Vehicle, share: float, refused: bool
) -> None:
    rng = np.random.default_rng(1)
    thrust_n = raptor.weight_n / 4.0 + 0.3 * rng.standard_normal((500, 4))
    made = (thrust_n - thrust_n.mean(axis=0)) @ np.array(raptor.moment_arms_m)
    torque = share * made + 0.1 * abs(share) * made.std() * rng.standard_normal(made.shape)
    problem = motion_problem(np.zeros((500, 3)), thrust_n, torque, raptor)
    assert (problem is not None) is refused
    if problem:
        assert "do not turn the vehicle as it turns" in problem
