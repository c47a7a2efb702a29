"""Reservations: what results cannot tell, since they rest on numbers of the vehicle that nobody has measured."""

from quadctl.effects import Effect
from quadctl.lab.comparison.wording import listed, sentence
from quadctl.lab.flights.channels import ROTOR_SPEED
from quadctl.lab.flights.dataset import Dataset
from quadctl.vehicle import Assumable, Vehicle

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


def on_condition(said: str, vehicle: Vehicle | None) -> str:
    """The sentence on the condition that `vehicle` flew; as it is where None."""
    return said if vehicle is None else f"{said[:-1]}, if the vehicle is {vehicle_in_words(vehicle)}."


def is_of_the_thrust(effect: Effect) -> bool:
    """Tell whether an error of the mass or of the thrust in the vehicle file looks like this effect."""
    return bool(effect.corrects) and {"thrust", "mass"} >= set(effect.corrects)


def thrust_reservation(vehicle: Vehicle, dataset: Dataset) -> str:
    """Sentence on the thrust of these flights, where it comes from an assumed number; empty where it does not."""
    of_speed = {flight.thrust_source == ROTOR_SPEED for flight in dataset.flights}
    fields: dict[bool, Assumable] = {True: "rotor.thrust_n_per_rpm2", False: "throttle"}
    assumed = [_NAMES[fields[speed]] for speed in sorted(of_speed, reverse=True) if fields[speed] in _assumed(vehicle)]
    if not assumed:
        return ""
    return f"{sentence(listed(assumed))} assumed: a wrong mass or thrust cannot be told from it."


def reservations(vehicle: Vehicle, dataset: Dataset) -> list[str]:
    """Sentences on numbers of the vehicle that were assumed, that on the thrust first."""
    thrust = thrust_reservation(vehicle, dataset)
    others = [_NAMES[name] for name in _assumed(vehicle) if name not in ("rotor.thrust_n_per_rpm2", "throttle")]
    if vehicle.inertia_kg_m2 is None and others:
        others.append("inertia")
    more = f"Assumed, and not measured: {listed(others)}." if others else ""
    return [said for said in (thrust, more) if said]


def _assumed(vehicle: Vehicle) -> tuple[Assumable, ...]:
    return vehicle.assumed or ()
