"""The thrust chain of each firmware: what it adds between the commanded thrust and the motor outputs."""

import math

import numpy as np
import pytest

from quadctl.thrust_chain import ardupilot, px4
from quadctl.thrust_chain.chain import Ambient

COPTER = {
    "ATC_ANGLE_BOOST": 1.0,
    "MOT_THST_EXPO": 0.65,
    "MOT_SPIN_MIN": 0.15,
    "MOT_SPIN_MAX": 0.95,
    "MOT_BAT_VOLT_MAX": 12.8,
    "MOT_BAT_VOLT_MIN": 9.6,
}
"""Parameters of the recorded ArduPilot."""
RECORDED = Ambient(battery_v=12.73, density_ratio=0.9015)


@pytest.mark.parametrize(
    ("tilt_deg", "boost"), [(0.0, 1.0), (10.39, 1.0168), (13.19, 1.0272), (60.0, 2.0), (80.0, 2.0)]
)
def test_angle_boost_is_that_recorded(tilt_deg: float, boost: float) -> None:
    """CTUN.ABst over GUIA.Thrust of a real flight at 10.39 and 13.19 degrees; at most 2, where versions differ."""
    assert ardupilot.angle_boost(math.cos(math.radians(tilt_deg)), COPTER) == pytest.approx(boost, abs=2e-4)


@pytest.mark.parametrize("parameters", [{}, {"ATC_ANGLE_BOOST": 0.0}])
def test_no_boost_is_undone_where_it_is_off_or_not_known(parameters: dict[str, float]) -> None:
    assert ardupilot.angle_boost(0.9, parameters) == 1.0


@pytest.mark.parametrize("told", [set(COPTER) - {name} for name in COPTER], ids=lambda told: str(set(COPTER) - told))
def test_no_parameter_is_taken_for_told(told: set[str]) -> None:
    """On a lossy link any of them may be missing."""
    parameters = {name: COPTER[name] for name in told}
    for chain in (ardupilot.CHAIN, px4.CHAIN):
        assert math.isfinite(chain.boost(0.9, parameters))
        thrust = chain.thrust_of_output(0.58675, parameters, RECORDED)
        assert chain.output_of_thrust(thrust, parameters, RECORDED) == pytest.approx(0.58675)
        assert chain.additions(0.3443, parameters, RECORDED)


def test_a_voltage_compensation_of_which_a_parameter_is_missing_is_not_called_off() -> None:
    parameters = {name: value for name, value in COPTER.items() if name != "MOT_BAT_VOLT_MIN"}
    (voltage,) = [line for line in ardupilot.additions(0.3443, parameters, RECORDED) if "MOT_BAT" in line.parameters]
    assert voltage.remark.startswith("not known")


def test_a_recorded_output_is_the_commanded_thrust() -> None:
    """Hover of the recorded ArduPilot: pulses of 1586.75 us at a thrust of 0.3443."""
    assert ardupilot.thrust_of_output(0.58675, COPTER, RECORDED) == pytest.approx(0.3443, abs=0.001)
    alone = ardupilot.thrust_of_output(0.58675, COPTER, Ambient())
    assert alone / 0.3443 == pytest.approx(1.115, abs=0.003)  # the curve removed, the compensations not


@pytest.mark.parametrize("ambient", [Ambient(), RECORDED, Ambient(9.0, 0.9)])
@pytest.mark.parametrize("thrust", [0.0, 0.1, 0.35, 0.5])
def test_an_output_gives_back_its_thrust(thrust: float, ambient: Ambient) -> None:
    output = ardupilot.output_of_thrust(thrust, COPTER, ambient)
    assert ardupilot.thrust_of_output(output, COPTER, ambient) == pytest.approx(thrust, abs=1e-9)
    bend = {"THR_MDL_FAC": 0.3, "MC_BAT_SCALE_EN": 1.0}
    scaled = ambient._replace(battery_scale=1.2)
    assert px4.thrust_of_output(px4.output_of_thrust(thrust, bend, scaled), bend, scaled) == pytest.approx(thrust)


def test_a_whole_log_is_one_call() -> None:
    outputs, volts = np.array([0.5, 0.6, 0.7]), np.array([12.6, math.nan, 9.0])
    ambient = Ambient(volts, np.full(3, 0.9))
    found = ardupilot.thrust_of_output(outputs, COPTER, ambient)
    for i, thrust in enumerate(found):
        assert thrust == pytest.approx(ardupilot.thrust_of_output(outputs[i], COPTER, Ambient(volts[i], 0.9)))


def test_curves_that_are_not_possible_leave_the_output_as_it_is() -> None:
    assert ardupilot.thrust_of_output(0.4, COPTER | {"MOT_SPIN_MIN": 0.96}, RECORDED) == 0.4
    assert px4.thrust_of_output(0.4, {"THR_MDL_FAC": 7.0}, Ambient()) == 0.4


def test_the_table_says_what_is_added_at_hover_and_at_a_tilt() -> None:
    boost, curve, voltage, air = ardupilot.additions(0.3455, COPTER, RECORDED)
    assert (boost.at_hover, boost.at_tilt) == pytest.approx((0.0, 0.0353), abs=1e-4)
    assert curve.parameters == "MOT_THST_EXPO 0.65, MOT_SPIN_MIN 0.15, MOT_SPIN_MAX 0.95"
    assert voltage.at_hover == pytest.approx(0.008, abs=0.001)
    assert air.at_hover == pytest.approx(0.109, abs=0.001)
    assert all(
        addition.at_hover == addition.at_tilt == 0.0 for addition in px4.additions(0.5, {"THR_MDL_FAC": 0}, RECORDED)
    )
    assert px4.additions(0.5, {"THR_MDL_FAC": 0.3}, RECORDED)[0].at_hover == pytest.approx(
        0.147, abs=0.001
    )  # 0.573 over 0.5
