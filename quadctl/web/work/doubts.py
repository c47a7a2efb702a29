"""Doubts whether a log belongs to the vehicle and to the flights that are open: sentences to ask a person."""

import math

from quadctl.flight.autopilot.firmwares import FIRMWARES
from quadctl.lab.comparison.wording import sentence
from quadctl.lab.flights.preparation import BANDWIDTH_PER_UPDATE_RATE, MAX_BANDWIDTH_HZ
from quadctl.logs.findings import Kind, of_kind
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.quality import QualityReport
from quadctl.logs.words import worded
from quadctl.vehicle import Vehicle

MASS_TOLERANCE = 0.02
"""Largest relative difference of two statements of the mass of one vehicle."""
ENOUGH_HZ = math.ceil(MAX_BANDWIDTH_HZ / BANDWIDTH_PER_UPDATE_RATE)
"""Rate of the slowest channel from which on the filter has its full bandwidth."""


def doubt_of(log: FlightLog, vehicle: Vehicle) -> str:
    """Doubt whether `vehicle` flew the log; empty where there is none."""
    said = log.meta.get("vehicle")
    mass = said.get("mass_kg") if isinstance(said, dict) else None
    if isinstance(mass, int | float) and abs(mass - vehicle.mass_kg) > MASS_TOLERANCE * vehicle.mass_kg:
        return f"This flight says {mass:g} kg, the vehicle has {vehicle.mass_kg:g} kg"
    return ""


def names_its_vehicle(log: FlightLog) -> bool:
    """Tell whether the log says which vehicle flew it, or what that weighed (see `doubt_of`)."""
    said = log.meta.get("vehicle")
    return bool(said.keys() & {"name", "mass_kg"}) if isinstance(said, dict) else bool(said)


def doubt_beside(log: FlightLog, source: str | None, first: FlightLog, first_source: str | None) -> str:
    """Doubt whether the log can be analysed together with the `first` flight; empty where there is none."""
    autopilot, first_autopilot = firmware(log), firmware(first)
    if autopilot and first_autopilot and autopilot != first_autopilot:
        return f"This flight was flown by {autopilot}, {first.name} by {first_autopilot}"
    if source and first_source and source != first_source:
        return f"The thrust of this flight is from {source}, that of {first.name} from {first_source}"
    return ""


def cautions_of(report: QualityReport, bandwidth_hz: float, used_s: tuple[float, float]) -> list[str]:
    """Sentences on what the data of a log lack that its residual, of this bandwidth, may show.

    `used_s` are the first and the last time that are used: a gap before the take-off is none of the residual.
    """
    resets = [reset for reset in of_kind(report.findings, Kind.RESET) if reset.touches(*used_s)]
    found = [f"{sentence(worded(reset))}." for reset in resets]
    channels = [report.channel(name) for name in (report.thrust_source or "", "position", "velocity", "attitude")]
    known = [channel for channel in channels if channel is not None and channel.rate_hz > 0.0]
    if bandwidth_hz < MAX_BANDWIDTH_HZ and known:
        slowest = min(known, key=lambda channel: channel.rate_hz)
        there = used_s[0] <= slowest.longest_gap_at_s + slowest.longest_gap_s and slowest.longest_gap_at_s <= used_s[1]
        longest = f", once not for {slowest.longest_gap_s:.1f} s, at {slowest.longest_gap_at_s:.0f} s"
        gap = longest if slowest.n_gaps and there else ""
        found.append(
            f"The slowest channel, {slowest.name}, comes {slowest.rate_hz:.3g} times a second{gap}: only changes "
            f"slower than {bandwidth_hz:.2g} Hz are compared, and what happens between its values counts as error. To "
            f"see quicker changes, log it at {ENOUGH_HZ:.0f} Hz or more."
        )
    return found


def firmware(log: FlightLog) -> str:
    """Firmware that the log names; empty where it names none that is known."""
    said = str(log.meta.get("autopilot", ""))
    return next((known.name for known in FIRMWARES.values() if known.name.lower() in said.lower()), "")
