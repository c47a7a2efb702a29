"""A weak rotor beside what turns a vehicle as it does: a centre of mass that is off, and a thrust that is wrong."""

from dataclasses import replace

import numpy as np
import pytest

from quadctl.effects.rotor_fault import WeakRotor
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.lab.fitting.nuisances import KINDS, MOMENTS, moments_beyond_usual, rotor_moments_n_m
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.lab.selection.diagnosis import diagnose
from quadctl.logs.columns import rpm_columns
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.support.flights import obedient

PAIR = (ConstantScale, WeakRotor)


@pytest.fixture
def short(raptor: Vehicle) -> Vehicle:
    """Arms of 31 mm, of which 2 mm are much."""
    arms = tuple(
        place.model_copy(update={"position_m": tuple(0.25 * x for x in place.position_m)}) for place in raptor.rotors
    )
    return raptor.model_copy(update={"rotors": arms})


@pytest.fixture
def six(raptor: Vehicle) -> Vehicle:
    """Six rotors, of which the second and the fifth lie straight beside the centre."""
    places = [(0.26, 0.15), (0.0, 0.3), (-0.26, 0.15), (-0.26, -0.15), (0.0, -0.3), (0.26, -0.15)]
    rotors = tuple(
        raptor.rotors[0].model_copy(update={"position_m": (x, y, 0.0), "spin": ("ccw", "cw")[i % 2]})
        for i, (x, y) in enumerate(places)
    )
    return raptor.model_copy(update={"rotors": rotors})


def flown(vehicle: Vehicle, thrust_per_rotor: list[float]) -> Dataset:
    """A level flight in which each rotor gives this share of k rpm^2, and none turns the vehicle."""
    log = obedient(Model(vehicle), 60.0, noise_m_s=0.005)
    shares = zip(rpm_columns(vehicle.n_rotors), thrust_per_rotor, strict=True)
    faster = {name: log[name] / np.sqrt(share) for name, share in shares}
    return load_dataset([replace(log, columns=log.columns | faster)], vehicle)


def test_of_short_arms_it_is_told_from_a_thrust_that_is_wrong_and_a_centre_of_mass_that_is_off(short: Vehicle) -> None:
    found = diagnose(Model(short), flown(short, [1.0, 1.0, 0.84, 1.0]), PAIR)
    assert found.missing == ["rotor_fault"]
    assert found.ranking[0].effect.values() == pytest.approx({"loss": 0.16, "rotor": 3.0}, abs=0.02)


def test_of_short_arms_a_centre_of_mass_that_is_a_little_off_beside_a_thrust_that_is_wrong_is_none(
    short: Vehicle,
) -> None:
    found = diagnose(Model(short), flown(short, [0.975, 0.975, 0.945, 0.945]), PAIR)
    assert found.missing == ["thrust_scale"]


def test_a_moment_about_one_axis_beside_a_thrust_that_is_wrong_is_none(six: Vehicle) -> None:
    """Six rotors that give 8 % less, and a centre of mass that is off to the side."""
    found = diagnose(Model(six), flown(six, [0.92, 0.96, 0.92, 0.92, 0.87, 0.92]), PAIR)
    assert found.missing == ["thrust_scale"]


def test_beyond_the_usual_is_what_a_nuisance_takes_of_a_moment_above_its_bound(short: Vehicle) -> None:
    (flight,) = flown(short, [1.0] * 4).flights
    taken = np.zeros((1, len(KINDS)))
    taken[0, MOMENTS] = 0.03, -0.07, 0.05
    expected = np.array([0.0, -0.03, 0.01]) * rotor_moments_n_m(flight)
    assert moments_beyond_usual([flight], taken) == pytest.approx(expected)
