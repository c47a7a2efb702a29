"""The vehicle of a log: what its rotors carry, and the order of its motors, by the moments that turn it."""

import numpy as np
import pytest

from quadctl.lab.flights.vehicle_match import Mismatch, motion_problem, weight_doubt
from quadctl.logs.findings import worded
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
    problem = motion_problem(np.zeros((500, 3)), thrust_n, torque, 0.1 * rng.standard_normal((500, 2)), raptor)
    assert (problem is not None) is refused
    if problem:
        assert problem.kind is Mismatch.MOTOR_ORDER and problem.facts["order"] == [2, 1, 4, 3]


def test_rotors_that_hold_against_a_levelling_ground_are_in_order(raptor: Vehicle) -> None:
    """Here the ground's moment is 1.9 times that of the rotors, and always against it."""
    rng = np.random.default_rng(1)
    lean = 0.05 * rng.standard_normal((500, 2))
    arms = np.array(raptor.moment_arms_m)
    holding = np.column_stack([lean, np.zeros(500)]) @ np.linalg.pinv(arms)
    thrust_n = raptor.weight_n / 4.0 + 5.0 * holding + 0.02 * rng.standard_normal((500, 4))
    made = (thrust_n - raptor.weight_n / 4.0) @ arms
    ground = -1.9 * 5.0 * np.column_stack([lean, np.zeros(500)])
    assert np.corrcoef(made[:, 0], (made + ground)[:, 0])[0, 1] < -0.9
    assert motion_problem(np.zeros((500, 3)), thrust_n, made + ground, lean, raptor) is None


@pytest.mark.parametrize(
    ("factor", "said"), [(1.3, None), (0.75, None), (1.9, "give 1.9 times"), (0.5, "give 0.5 times")]
)
def test_rotors_that_carry_another_weight_raise_a_doubt(raptor: Vehicle, factor: float, said: str | None) -> None:
    doubt = weight_doubt(factor, raptor, "rotor speed")
    assert (doubt is None) is (said is None)
    if said and doubt:
        assert said in worded(doubt) and "1.5 kg: is it the vehicle that flew" in worded(doubt)
