"""Real logs with known truth: what is called missing in each is what is known to be there, and nothing else.

The README beside the logs says what is known of each. The PX4 and ArduPilot logs are of the real autopilots over their
own simulators, so that the truth is known; RAPTOR is a real vehicle, of which is known what cannot be there. What the
lab does not achieve yet is an expected failure with its reason: once it is achieved, the mark has to go.
CI searches some of each kind; `make real` all of them, and writes a page about more of these logs, with parameters.
"""

import functools
from dataclasses import dataclass
from typing import Any

import pytest

from quadctl.lab import diagnose
from quadctl.lab.selection.diagnosis import Diagnosis
from tests.support.places import DATA, RAPTOR

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not (DATA / "real").is_dir(), reason="the real logs are not here"),
]

VEHICLES = {
    "raptor": RAPTOR,
    "real/px4": DATA / "real/px4/vehicle.yaml",
    "real/ardupilot": DATA / "real/ardupilot/vehicle.yaml",
    "real/ardupilot/hexa": DATA / "real/ardupilot/hexa_vehicle.yaml",
}


LINE = {"thrust_scale", "thrust_map"}
"""The vehicle file's line from command to thrust is off: a scale or a line corrects it."""
DRAG = {"rotor_drag", "body_drag"}


def by_make_real(value: Any) -> Any:
    return pytest.param(value, marks=pytest.mark.real)


@functools.cache
def found_in(log: str) -> Diagnosis:
    folder = log.rpartition("/")[0]
    vehicle = VEHICLES["real/ardupilot/hexa" if "hexa" in log else folder]
    return diagnose(vehicle, DATA / log)


class TestPx4:
    """Truth: a drag of 1.0 1/s along all axes of the body, and nothing else; accelerometers without bias, no wind."""

    LOGS = (
        "real/px4/excitation.csv",
        by_make_real("real/px4/excitation.ulg"),
        by_make_real("real/px4/forward_runs.csv"),
        "real/px4/forward_runs.ulg",
        by_make_real("real/px4/vertical_runs.csv"),
        "real/px4/vertical_runs.ulg",
    )

    @pytest.mark.parametrize("log", LOGS)
    def test_the_drag_is_all_that_is_missing(self, log: str) -> None:
        assert found_in(log).missing == ["rotor_drag"]

    @pytest.mark.parametrize("log", LOGS)
    def test_its_intervals_hold_the_truth(self, log: str) -> None:
        """Along body y, too, where nobody flew: the estimator's velocity errors are as large as the sideward speed."""
        for axis in ("d_x", "d_y", "d_z"):
            low, high = found_in(log).ranking[0].ci95[axis]
            assert low < 1.0 < high, axis


class TestArduPilot:
    """Truth: linear and quadratic drag; no ground effect, wind or bias. In .csv thrust is 1/1.115 of what the output
    says; in .bin the parameters tell why, and reading has undone it."""

    @pytest.mark.parametrize(
        "log",
        [
            by_make_real("real/ardupilot/excitation.csv"),
            "real/ardupilot/excitation.bin",
            "real/ardupilot/forward_runs.csv",
            by_make_real("real/ardupilot/forward_runs.bin"),
        ],
    )
    def test_thrust_and_drag_are_found_where_it_flew_fast(self, log: str) -> None:
        missing = set(found_in(log).missing)
        assert missing & DRAG
        assert missing <= LINE | DRAG
        assert bool(missing & LINE) is log.endswith(".csv")

    def test_an_effect_that_is_fitted_to_nothing_is_not_called_measured(self) -> None:
        measured = found_in("real/ardupilot/forward_runs.csv").measured
        assert all(any(c.effect.values()[name] for name in c.ci95) for c in measured if c.ci95)

    @pytest.mark.parametrize(
        "log",
        [
            by_make_real("real/ardupilot/hover_staircase.csv"),
            "real/ardupilot/hover_staircase.bin",
            "real/ardupilot/hexa_staircase.csv",
            by_make_real("real/ardupilot/hexa_staircase.bin"),
            by_make_real("real/ardupilot/vertical_runs.csv"),
            "real/ardupilot/vertical_runs.bin",
        ],
    )
    def test_nothing_is_named_that_is_absent_where_it_hardly_flew_forward(self, log: str) -> None:
        """A drag along body z may be called an inflow there, if the diagnosis says that it may be a drag."""
        found = found_in(log)
        maybe_drag = {"inflow"} if ["inflow", "rotor_drag"] in found.confounded else set()
        assert set(found.missing) <= LINE | DRAG | maybe_drag
        assert bool(LINE & set(found.missing)) is log.endswith(".csv")


def test_a_hover_over_the_ground_has_a_thrust_scale_and_a_ground_effect() -> None:
    """Appius' thesis fits both to this flight."""
    found = found_in("raptor/HOVERING.csv")
    assert found.missing == ["thrust_scale", "ground_effect"]
    (ground,) = (effect for effect in found.best.effects if effect.family() == "ground_effect")
    assert ground.name == "ground_effect.exponential"
    assert 0.07 < ground.values()["a"] < 0.2 and 2.0 < ground.values()["b"] < 8.0


@pytest.mark.real
def test_flying_forward_over_the_ground_shows_a_drag_as_well() -> None:
    assert {"thrust_scale", "ground_effect", "rotor_drag"} <= set(found_in("raptor/FORWARD_SPEED.csv").missing)


@pytest.mark.xfail(strict=True, reason="p = 0.03: it is not beyond all that errors of the rotor speeds may explain")
def test_oscillations_have_an_inflow() -> None:
    """Our own analysis found it beside the thrust scale and a ground effect."""
    missing = set(found_in("raptor/OSCILLATIONS.csv").missing)
    assert {"thrust_scale", "inflow"} <= missing <= {"thrust_scale", "ground_effect", "inflow"}


@dataclass(frozen=True)
class Repeated:
    """Two flights of one mission by one vehicle, indoors, without wind, cable or payload."""

    mission: str
    possible: frozenset[str]

    @property
    def logs(self) -> tuple[str, str]:
        return f"raptor/{self.mission}_01.csv", f"raptor/{self.mission}_02.csv"


LOW = frozenset({"ground_effect", "inflow", "thrust_tilt", *LINE})
HIGH = LOW - {"ground_effect"}


def differ(mission: str, possible: frozenset[str], reason: str) -> Any:
    marks = (pytest.mark.xfail(strict=True, reason=reason), pytest.mark.real)
    return pytest.param(Repeated(mission, possible), marks=marks)


class TestRepeatedFlights:
    """RAPTOR without rotor speeds: thrust by the vehicle file's line from the command, which another battery shifts."""

    @pytest.mark.parametrize(
        "flights",
        [
            by_make_real(Repeated("HAYDEN", LOW)),
            Repeated("SANCHEZ", LOW),
            by_make_real(Repeated("CHEESEMAN", LOW)),
            Repeated("NO_COMPENSATION", LOW),
            differ("APPIUS", LOW, "the second is called a tilt: its thrust follows the height in another way"),
            Repeated("HIGH_ALTITUDE", HIGH),
        ],
        ids=lambda flights: flights.mission,
    )
    def test_have_the_same_names(self, flights: Repeated) -> None:
        one, other = (found_in(log).missing for log in flights.logs)
        assert sorted(one) == sorted(other)
        assert set(one) <= flights.possible

    @pytest.mark.parametrize(
        ("log", "turned"),
        [
            ("APPIUS_FWD_V_050", True),
            ("NO_COMPENSATION_V_050", False),
            pytest.param("NO_COMPENSATION_V_125", False, marks=pytest.mark.real),
        ],
    )
    def test_runs_with_rotor_speeds_are_slowed_by_a_drag_and_their_rotors_give_less(
        self, log: str, turned: bool
    ) -> None:
        """Three missions at 0.5 and 1.25 m/s, flown with and without a compensator; one shows a moment with the
        airspeed, too."""
        moment = ["airspeed_moment"] if turned else []
        assert sorted(found_in(f"raptor/{log}.csv").missing) == [*moment, "rotor_drag", "thrust_scale", "thrust_tilt"]

    def test_the_moment_with_the_airspeed_is_the_same_high_above_the_ground(self) -> None:
        """Another mission at the same speed: each value stands in the interval of the other."""
        one, other = (
            next(c for c in found_in(f"raptor/{log}.csv").ranking if c.family == "airspeed_moment")
            for log in ("APPIUS_FWD_V_050", "HIGH_ALTITUDE_V_050")
        )
        for a, b in ((one, other), (other, one)):
            low, high = a.ci95["k"]
            assert 2.0 < low < b.effect.values()["k"] < high

    @pytest.mark.real
    def test_in_a_minute_a_weak_battery_is_not_told_from_a_thrust_that_is_off(self) -> None:
        """The one takes the place of the other, with an error that is smaller by chance."""
        found = found_in("raptor/HIGH_ALTITUDE_V_125.csv")
        pair = {"battery_sag", "thrust_scale"}
        assert found.missing[0] in pair and found.steps[1].rmse["total"] < 0.3 * found.steps[0].rmse["total"]
        assert pair in [set(one) for one in found.confounded]

    @pytest.mark.parametrize("log", ["raptor/HIGH_ALTITUDE_01.csv", "raptor/HIGH_ALTITUDE_02.csv"])
    def test_high_above_the_ground_there_is_no_ground_effect(self, log: str) -> None:
        assert "ground_effect" not in found_in(log).missing
