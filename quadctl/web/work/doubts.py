"""Doubts whether a log belongs to the vehicle and to the flights that are open, to be put to a person."""

import math
from enum import unique

from quadctl.flight.autopilot.firmwares import FIRMWARES
from quadctl.lab.comparison.wording import sentence
from quadctl.lab.flights.preparation import BANDWIDTH_PER_UPDATE_RATE, MAX_BANDWIDTH_HZ
from quadctl.logs.findings import Kind, of_kind, worded
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.quality import QualityReport
from quadctl.vehicle import Vehicle
from quadctl.words import Fact, Kinds, When, fact

MASS_TOLERANCE = 0.02
"""Largest relative difference of two statements of the mass of one vehicle."""
ENOUGH_HZ = math.ceil(MAX_BANDWIDTH_HZ / BANDWIDTH_PER_UPDATE_RATE)
"""Rate of the slowest channel from which on the filter has its full bandwidth."""


@unique
class Doubt(Kinds):
    """Doubts about a log, and cautions on its data, each with its template."""

    MASS = "This flight says {said_kg:g} kg, the vehicle has {mass_kg:g} kg"
    AUTOPILOT = "This flight was flown by {autopilot}, {first} by {first_autopilot}"
    THRUST = "The thrust of this flight is from {source}, that of {first} from {first_source}"
    RESET = "{reset}."
    SLOW = (
        "The slowest channel, {channel}, comes {rate_hz:.3g} times a second",
        When("gap_s", ", once not for {gap_s:.1f} s, at {gap_at_s:.0f} s"),
        ": only changes slower than {bandwidth_hz:.2g} Hz are compared, and what happens between its values counts as "
        "error. To see quicker changes, log it at {enough_hz:.0f} Hz or more.",
    )


def doubt_of(log: FlightLog, vehicle: Vehicle) -> Fact | None:
    """Doubt whether `vehicle` flew the log; None where there is none."""
    said = log.meta.get("vehicle")
    mass = said.get("mass_kg") if isinstance(said, dict) else None
    if isinstance(mass, int | float) and abs(mass - vehicle.mass_kg) > MASS_TOLERANCE * vehicle.mass_kg:
        return fact(Doubt.MASS, said_kg=mass, mass_kg=vehicle.mass_kg)
    return None


def names_its_vehicle(log: FlightLog) -> bool:
    """Tell whether the log says which vehicle flew it, or what that weighed (see `doubt_of`)."""
    said = log.meta.get("vehicle")
    return bool(said.keys() & {"name", "mass_kg"}) if isinstance(said, dict) else bool(said)


def doubt_beside(log: FlightLog, source: str | None, first: FlightLog, first_source: str | None) -> Fact | None:
    """Doubt whether the log can be analysed together with the `first` flight; None where there is none."""
    autopilot, first_autopilot = firmware(log), firmware(first)
    if autopilot and first_autopilot and autopilot != first_autopilot:
        return fact(Doubt.AUTOPILOT, autopilot=autopilot, first=first.name, first_autopilot=first_autopilot)
    if source and first_source and source != first_source:
        return fact(Doubt.THRUST, source=source, first=first.name, first_source=first_source)
    return None


def cautions_of(report: QualityReport, bandwidth_hz: float, used_s: tuple[float, float]) -> list[Fact]:
    """Shortcomings of the data of a log that its residual, of this bandwidth, may show.

    `used_s` are the first and the last time that are used: a gap before the take-off is none of the residual.
    """
    resets = [reset for reset in of_kind(report.findings, Kind.RESET) if reset.touches(*used_s)]
    found = [fact(Doubt.RESET, reset=sentence(worded(reset))) for reset in resets]
    channels = [report.channel(name) for name in (report.thrust_source or "", "position", "velocity", "attitude")]
    known = [channel for channel in channels if channel is not None and channel.rate_hz > 0.0]
    if bandwidth_hz < MAX_BANDWIDTH_HZ and known:
        slow = min(known, key=lambda channel: channel.rate_hz)
        there = used_s[0] <= slow.longest_gap_at_s + slow.longest_gap_s and slow.longest_gap_at_s <= used_s[1]
        gap = {"gap_s": slow.longest_gap_s if slow.n_gaps and there else 0.0, "gap_at_s": slow.longest_gap_at_s}
        rates = {"rate_hz": slow.rate_hz, "bandwidth_hz": bandwidth_hz, "enough_hz": ENOUGH_HZ}
        found.append(fact(Doubt.SLOW, channel=slow.name, **gap, **rates))
    return found


def firmware(log: FlightLog) -> str:
    """Firmware that the log names; empty where it names none that is known."""
    said = str(log.meta.get("autopilot", ""))
    return next((known.name for known in FIRMWARES.values() if known.name.lower() in said.lower()), "")
