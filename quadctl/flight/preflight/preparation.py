"""A flight read from its files and checked, before anything moves: what every flight begins with, real or simulated."""

from collections.abc import Sequence
from pathlib import Path

from quadctl.errors import FlightError
from quadctl.flight.preflight.check import check_flight
from quadctl.flight.preflight.findings import Verdict, of_verdict
from quadctl.flight.preflight.plan import FlightPlan, read_flight
from quadctl.flight.preflight.time_scale import with_time_scale


def prepare_flight(
    mission: Path,
    config: Path | None,
    model: str | None,
    offset_up_m: float | None,
    overrides: Sequence[str] = (),
    time_scale: str | None = None,
) -> FlightPlan:
    """Read a flight as `read_flight` does, scale its time and check it; warnings are kept in the plan.

    Raises
    ------
    SettingsError
        One sentence that names the file, the field, the value and what was expected.
    FlightError
        A check refuses the flight.
    """
    plan = with_time_scale(read_flight(mission, config, model, offset_up_m, overrides), time_scale)
    findings = check_flight(plan)
    refused = of_verdict(findings, Verdict.REFUSED)
    if refused:
        raise FlightError(f"{mission} must not be flown like this: {'; '.join(map(str, refused))}")
    return plan._replace(warnings=of_verdict(findings, Verdict.WARNING))
