"""Parameters of autopilots from a model: each formula by hand, and a reason where there is no number."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from quadctl.effects.body_drag import QuadraticDrag
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_curve import PowerCurve
from quadctl.effects.thrust_map import LineMap
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.errors import SettingsError
from quadctl.export.ardupilot import ARDUPILOT
from quadctl.export.autopilot import Dialect, Present, Row, parameter_file, parameters
from quadctl.export.estimate import Estimate, estimate
from quadctl.export.hover import bend, hover_throttle
from quadctl.export.px4 import PX4
from quadctl.model import Model, Provenance
from quadctl.parameter_file import read_parameters
from quadctl.vehicle import ThrottleCurve, Vehicle

DRAG = Provenance(logs=("runs.csv",), ci95={"d_x": (0.3, 0.5), "d_y": (0.35, 0.45), "d_z": (0.0, 0.1)})
AREA = Provenance(logs=("fast.csv",), ci95={"area_x_m2": (0.02, 0.04), "area_y_m2": (0.0, 0.05)})


def rows_of(model: Model, present: dict[str, float] | None = None) -> dict[str, Row]:
    now = None if present is None else Present(present, "now.params", is_whole=False)
    return {row.name: row for row in parameters(model, PX4, now)}


class TestHover:
    def test_the_rigid_body_hovers_at_the_line_of_the_vehicle_file(self, raptor: Vehicle) -> None:
        line = raptor.throttle
        assert hover_throttle(Model(raptor)) == pytest.approx(line.offset + line.per_newton * raptor.weight_n, abs=1e-8)

    def test_rotors_that_give_less_need_more_throttle(self, raptor: Vehicle) -> None:
        weak = Model(raptor).plus(ConstantScale(0.8))
        line = raptor.throttle
        assert hover_throttle(weak) == pytest.approx(line.offset + line.per_newton * raptor.weight_n / 0.8, abs=1e-8)

    def test_a_vehicle_that_nothing_lifts_is_refused(self, raptor: Vehicle) -> None:
        with pytest.raises(SettingsError, match="no throttle from 0 to 1 carries the vehicle"):
            hover_throttle(Model(raptor).plus(LineMap(0.2, -1.0)))

    def test_the_interval_is_that_of_the_parameter(self, raptor: Vehicle) -> None:
        fitted = Provenance(ci95={"factor": (0.9, 1.1)})
        found = estimate(Model(raptor).plus(ConstantScale(1.0), fitted), hover_throttle)
        line = raptor.throttle
        low, high = (line.offset + line.per_newton * raptor.weight_n / factor for factor in (1.1, 0.9))
        assert (found.low, found.high) == pytest.approx((low, high), abs=1e-8)

    def test_a_thrust_that_may_not_carry_the_vehicle_gives_no_number(self, raptor: Vehicle) -> None:
        fitted = Provenance(ci95={"factor": (0.4, 1.5)})
        row = rows_of(Model(raptor).plus(ConstantScale(0.9), fitted))["MPC_THR_HOVER"]
        assert row.lacking.startswith(
            "these flights do not tell it (it has no bounds): fly a flight away from the ground"
        )


class TestCurve:
    @pytest.mark.parametrize("present", [0.0, 0.3, 0.65])
    def test_thrust_that_is_proportional_to_the_command_keeps_the_bend(self, raptor: Vehicle, present: float) -> None:
        most_n = 8.0
        straight = ThrottleCurve(per_newton=1.0 / (4.0 * most_n), offset=0.0, max_thrust_per_rotor_n=most_n)
        assert bend(Model(raptor.model_copy(update={"throttle": straight})), present) == pytest.approx(
            present, abs=1e-6
        )

    def test_thrust_that_grows_as_the_square_of_the_signal_has_a_bend_of_one(self, raptor: Vehicle) -> None:
        most_n = 8.0
        straight = ThrottleCurve(per_newton=1.0 / (4.0 * most_n), offset=0.0, max_thrust_per_rotor_n=most_n)
        vehicle = raptor.model_copy(update={"throttle": straight})
        square = replace(PowerCurve(), exponent=4.0)  # T over the linear T to the power of two
        assert bend(Model(vehicle).plus(square), 0.0) == pytest.approx(1.0, abs=1e-6)

    def test_a_bend_that_is_zero_whatever_the_parameters_are_is_known(self, raptor: Vehicle) -> None:
        """Thrust that begins above zero bends the other way: no value above 0 is nearer within the intervals."""
        straight = ThrottleCurve(per_newton=1.0 / 32.0, offset=0.0, max_thrust_per_rotor_n=8.0)
        vehicle = raptor.model_copy(update={"throttle": straight})
        fitted = Provenance(logs=("a.ulg",), ci95={"factor": (0.79, 0.81), "offset": (0.19, 0.21)})
        row = rows_of(Model(vehicle).plus(LineMap(factor=0.8, offset=0.2), fitted), {"THR_MDL_FAC": 0.0})["THR_MDL_FAC"]
        assert row.lacking == ""
        assert row.estimate == Estimate(0.0, 0.0, 0.0)


class TestDrag:
    def test_momentum_drag_is_the_mean_at_sea_level(self, raptor: Vehicle) -> None:
        found = rows_of(Model(raptor).plus(LinearDrag(0.4, 0.4, 0.05), DRAG))["EKF2_MCOEF"]
        assert found.estimate is not None
        assert found.estimate.value == pytest.approx(0.4 * math.sqrt(1.225 / 1.205))
        assert found.logs == ("runs.csv",)

    def test_an_axis_along_which_nobody_flew_counts_as_little_as_it_is_known(self, raptor: Vehicle) -> None:
        """d_y rests at 0, and its interval is three times as wide: (0.4 + 0 / 9) / (1 + 1 / 9) = 0.36."""
        known = Provenance(ci95={"d_x": (0.3, 0.5), "d_y": (0.0, 0.3)})
        found = rows_of(Model(raptor).plus(LinearDrag(0.4, 0.0, 0.0), known))["EKF2_MCOEF"].estimate
        assert found is not None
        assert found.value == pytest.approx(0.36 * math.sqrt(1.225 / 1.205))
        assert found.low < 0.4 < found.high

    def test_a_drag_that_the_model_does_not_hold_is_off_and_the_estimator_uses_the_rest(self, raptor: Vehicle) -> None:
        rows = rows_of(Model(raptor).plus(LinearDrag(0.4, 0.4, 0.05), DRAG))
        values = {name: row.estimate.value for name, row in rows.items() if row.estimate is not None}
        assert (values["EKF2_BCOEF_X"], values["EKF2_BCOEF_Y"], values["EKF2_DRAG_CTRL"]) == (0.0, 0.0, 1.0)

    def test_the_ballistic_coefficient_is_mass_over_area(self, raptor: Vehicle) -> None:
        rows = rows_of(Model(raptor).plus(QuadraticDrag(0.03, 0.02, 0.0), AREA))
        found = rows["EKF2_BCOEF_X"].estimate
        assert found is not None
        assert (found.value, found.low, found.high) == pytest.approx((1.5 / 0.03, 1.5 / 0.04, 1.5 / 0.02))

    @pytest.mark.parametrize("area_m2", [0.02, 0.0], ids=["found above zero", "found at zero"])
    @pytest.mark.parametrize("dialect", [PX4, ARDUPILOT], ids=["PX4", "ArduPilot"])
    def test_an_area_that_is_not_told_from_zero_gives_no_number(
        self, raptor: Vehicle, dialect: Dialect, area_m2: float
    ) -> None:
        rows = parameters(Model(raptor).plus(QuadraticDrag(0.03, area_m2, 0.0), AREA), dialect)
        (row,) = [row for row in rows if row.name == dialect.ballistic_y]
        assert row.estimate is None
        assert row.lacking == (
            "the drag area seen from the side (area_y_m2) is not distinguished from zero: at most 0.05 m², so that it "
            "is at least 30 kg/m²: fly runs to the side at several speeds, such as missions/headings.yaml, and fit it"
        )

    @pytest.mark.parametrize(
        ("fitted", "area_m2"),
        [
            (Provenance(ci95={"area_x_m2": (0.02, 0.04)}), 0.02),
            (Provenance(ci95={"area_x_m2": (0.02, 0.04)}), 0.0),
            (Provenance(ci95={"area_x_m2": (0.02, 0.04), "area_y_m2": (0.0, 0.0)}), 0.0),
            (Provenance(ci95={"area_x_m2": (0.02, 0.04), "area_y_m2": (1e-9, 0.05)}), 0.02),
            (Provenance(ci95={"area_x_m2": (0.02, 0.04), "area_y_m2": (0.0019, 0.0021)}), 0.002),
        ],
        ids=[
            "no interval",
            "zero without interval",
            "interval of zero",
            "interval that almost reaches zero",
            "tiny area",
        ],
    )
    @pytest.mark.parametrize("dialect", [PX4, ARDUPILOT], ids=["PX4", "ArduPilot"])
    def test_no_file_holds_what_the_autopilot_cannot_take(
        self, raptor: Vehicle, tmp_path: Path, dialect: Dialect, fitted: Provenance, area_m2: float
    ) -> None:
        rows = parameters(Model(raptor).plus(QuadraticDrag(0.03, area_m2, 0.0), fitted), dialect)
        path = tmp_path / "out.params"
        path.write_text(parameter_file(rows, dialect, "fitted.yaml"))
        written = read_parameters(path)
        for name, (low, high) in dialect.ranges.items():
            assert low <= written.get(name, low) <= high
        assert dialect.ballistic_x in written

    def test_a_drag_without_intervals_of_its_own_gives_no_number(self, raptor: Vehicle) -> None:
        along_z = Provenance(logs=("climbs.csv",), ci95={"d_z": (0.1, 0.2)})
        row = rows_of(Model(raptor).plus(LinearDrag(0.4, 0.4, 0.15), along_z))["EKF2_MCOEF"]
        assert row.estimate is None
        assert row.lacking.startswith("none of the parameters that it depends on has a confidence interval: fly runs")

    def test_a_value_that_the_autopilot_does_not_take_is_named(self, raptor: Vehicle) -> None:
        strong = Provenance(ci95={"d_x": (1.9, 2.1), "d_y": (1.9, 2.1)})
        row = rows_of(Model(raptor).plus(LinearDrag(2.0, 2.0, 0.0), strong))["EKF2_MCOEF"]
        assert row.lacking == "it is 2.017 [1.945, 2.088], but PX4 takes 0 to 1"


def test_what_the_model_does_not_hold_is_named_with_the_command_and_a_flight_that_shows_it(
    raptor: Vehicle,
) -> None:
    rows = rows_of(Model(raptor))
    assert all(row.estimate is None for row in rows.values())
    fits = "`quadctl add rotor_drag` fits one to runs at several speeds, such as missions/forward_runs.yaml"
    assert rows["EKF2_MCOEF"].lacking == f"the model holds no rotor_drag; {fits}"
    with pytest.raises(SettingsError, match="no parameter of PX4 follows"):
        parameter_file(list(rows.values()), PX4, "rigid.yaml")


@pytest.mark.parametrize("dialect", [PX4, ARDUPILOT])
def test_the_file_can_be_read_again(raptor: Vehicle, tmp_path: Path, dialect: object) -> None:
    assert dialect in (PX4, ARDUPILOT)
    chosen = PX4 if dialect is PX4 else ARDUPILOT
    now = Present({chosen.momentum_drag: 0.15}, "now.params", is_whole=False)
    rows = parameters(Model(raptor).plus(LinearDrag(0.4, 0.4, 0.05), DRAG), chosen, now)
    path = tmp_path / "out.params"
    path.write_text(parameter_file(rows, chosen, "fitted.yaml"))
    read = read_parameters(path)
    assert read[chosen.momentum_drag] == pytest.approx(0.4 * math.sqrt(1.225 / 1.205))
    assert next(row.present for row in rows if row.name == chosen.momentum_drag) == 0.15
    assert chosen.hover not in read
