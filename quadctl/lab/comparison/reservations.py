"""Reservations: what results cannot tell, since they rest on numbers of the vehicle that nobody has measured."""

from quadctl.effects import Effect
from quadctl.lab.comparison.wording import Said
from quadctl.lab.flights.channels import ROTOR_SPEED
from quadctl.lab.flights.dataset import Dataset
from quadctl.vehicle import Assumable, Vehicle
from quadctl.words import Fact, fact

_NAMES: dict[Assumable, str] = {
    "rotor.thrust_n_per_rpm2": "thrust coefficient",
    "throttle": "thrust over throttle",
    "rotor.torque_to_thrust_m": "drag torque of the rotors",
    "rotor.time_constant_s": "motor lag",
    "rotor_height_m": "height of the rotors above the logged position",
    "rotors": "distances of the rotors from the centre",
}


def vehicle_in_words(vehicle: Vehicle) -> str:
    """Name and mass of a vehicle: `raptor (1.5 kg)`."""
    return f"{vehicle.name} ({vehicle.mass_kg:g} kg)"


def is_of_the_thrust(effect: Effect) -> bool:
    """Tell whether an error of the mass or of the thrust in the vehicle file looks like this effect."""
    return bool(effect.corrects) and {"thrust", "mass"} >= set(effect.corrects)


def thrust_reservation(vehicle: Vehicle, dataset: Dataset) -> Fact | None:
    """Reservation about the thrust of these flights, where it comes from an assumed number; None where it does not."""
    of_speed = {flight.thrust_source == ROTOR_SPEED for flight in dataset.flights}
    fields: dict[bool, Assumable] = {True: "rotor.thrust_n_per_rpm2", False: "throttle"}
    assumed = [_NAMES[fields[speed]] for speed in sorted(of_speed, reverse=True) if fields[speed] in _assumed(vehicle)]
    return fact(Said.THRUST_ASSUMED, names=assumed) if assumed else None


def reservations(vehicle: Vehicle, dataset: Dataset) -> list[Fact]:
    """Reservations about numbers of the vehicle that were assumed, that about the thrust first."""
    thrust = thrust_reservation(vehicle, dataset)
    others = [_NAMES[name] for name in _assumed(vehicle) if name not in ("rotor.thrust_n_per_rpm2", "throttle")]
    if vehicle.inertia_kg_m2 is None and others:
        others.append("inertia")
    return [said for said in (thrust, fact(Said.ASSUMED, names=others) if others else None) if said is not None]


def _assumed(vehicle: Vehicle) -> tuple[Assumable, ...]:
    return vehicle.assumed or ()
