"""Reservations: the results cannot tell some things where numbers of the vehicle were assumed."""

from quadctl.lab.comparison.comparison import compare
from quadctl.lab.comparison.reservations import reservations, thrust_reservation
from quadctl.lab.flights.dataset import load_dataset
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.support.flights import obedient

SAID = "Thrust coefficient assumed: a wrong mass or thrust would look the same"


def test_an_assumed_thrust_coefficient_is_said_beside_the_error(raptor: Vehicle) -> None:
    assumed = raptor.model_copy(update={"assumed": ("rotor.thrust_n_per_rpm2",)})
    dataset = load_dataset([obedient(Model(raptor), 20.0, noise_m_s=0.01)], assumed)
    result = compare(Model(assumed), dataset)
    assert f"{SAID}." in str(result)
    assert SAID in result.to_dict()["notes"]


def test_an_assumed_throttle_is_not_where_the_thrust_is_from_rotor_speeds(raptor: Vehicle) -> None:
    dataset = load_dataset([obedient(Model(raptor), 20.0)], raptor)
    assert thrust_reservation(raptor.model_copy(update={"assumed": ("throttle",)}), dataset) is None
    assert reservations(raptor, dataset) == []


def test_other_numbers_are_listed(raptor: Vehicle) -> None:
    dataset = load_dataset([obedient(Model(raptor), 20.0)], raptor)
    assumed = raptor.model_copy(update={"assumed": ("rotor.time_constant_s", "rotor_height_m"), "inertia_kg_m2": None})
    (said,) = reservations(assumed, dataset)
    assert said.facts["names"] == ["motor lag", "height of the rotors above the logged position", "inertia"]
