"""`actuation: full` is refused, before anything moves, where the rotors or the autopilot cannot give lateral force."""

import asyncio
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
import yaml

from quadctl.flight.autopilot.ardupilot import ARDUPILOT
from quadctl.flight.autopilot.firmware import Firmware
from quadctl.flight.autopilot.px4 import PX4
from quadctl.flight.preflight.check import check_flight
from quadctl.flight.preflight.facts import Kind
from quadctl.flight.preflight.findings import Finding, Verdict
from quadctl.flight.preflight.lateral import ask_about_lateral_force
from quadctl.flight.preflight.plan import FlightPlan, read_flight
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.vehicle import Vehicle, load_vehicle
from quadctl.words import Fact, fact
from tests.support.places import ROOT

TILTED = load_vehicle(ROOT / "config" / "vehicles" / "f550_tilted.yaml")
UPRIGHT = ROOT / "config" / "vehicles" / "raptor.yaml"


def planned(where: Path, vehicle: Vehicle, actuation: str = "full") -> FlightPlan:
    described, config = where / "vehicle.yaml", where / "flight.yaml"
    described.write_text(yaml.safe_dump(vehicle.model_dump(mode="json", exclude_none=True)))
    config.write_text(yaml.safe_dump({"vehicle": "vehicle.yaml", "controller": {"actuation": actuation}}))
    return read_flight(ROOT / "missions" / "sidestep.yaml", config, None, None)


def about_actuation(plan: FlightPlan) -> list[Finding]:
    return [finding for finding in check_flight(plan) if finding.topic == "actuation"]


class Asked:
    """An autopilot of this firmware with these parameters."""

    def __init__(self, firmware: Firmware, parameters: dict[str, float]) -> None:
        self.description = firmware.name
        self.firmware = firmware
        self._parameters = parameters

    async def parameters(self, names: Iterable[str]) -> dict[str, float]:
        return {name: self._parameters[name] for name in names if name in self._parameters}


def asked(plan: FlightPlan, firmware: Firmware, **changes: float | None) -> list[Finding]:
    parameters: dict[str, Any] = {**SimulatedAutopilot(TILTED).parameters, **changes}
    known = {name: value for name, value in parameters.items() if value is not None}
    return asyncio.run(ask_about_lateral_force(plan, Asked(firmware, known)))


def test_six_tilted_rotors_pass_with_their_reach(tmp_path: Path) -> None:
    (finding,) = about_actuation(planned(tmp_path, TILTED))
    assert finding.verdict is Verdict.OK
    assert finding.text == "full, lateral force up to 2.9 N in hover (13% of the weight)"


def test_tilt_is_not_asked_about_lateral_force(tmp_path: Path) -> None:
    plan = planned(tmp_path, load_vehicle(UPRIGHT), "tilt")
    assert about_actuation(plan) == []
    assert asked(plan, ARDUPILOT) == []


def test_lateral_force_of_upright_rotors_is_refused(tmp_path: Path) -> None:
    (finding,) = about_actuation(planned(tmp_path, load_vehicle(UPRIGHT)))
    assert finding.verdict is Verdict.REFUSED
    assert finding.objection == fact(Kind.UPRIGHT, vehicle="raptor")


def test_rotors_that_lean_without_full_rank_are_refused(tmp_path: Path) -> None:
    rotors = [{**rotor.model_dump(), "cant_deg": 0.0} for rotor in TILTED.rotors]
    inward = Vehicle.model_validate({**TILTED.model_dump(), "rotors": rotors})
    (finding,) = about_actuation(planned(tmp_path, inward))
    assert finding.verdict is Verdict.REFUSED
    assert finding.objection == fact(Kind.TOO_FEW_DIRECTIONS, vehicle="f550_tilted", rank=4)


def test_px4_with_the_vehicles_control_allocation_passes(tmp_path: Path) -> None:
    (finding,) = asked(planned(tmp_path, TILTED), PX4)
    assert finding.verdict is Verdict.OK


@pytest.mark.parametrize(
    ("changes", "kind", "facts"),
    [
        ({"CA_ROTOR2_AX": 0.0, "CA_ROTOR2_AY": 0.0, "CA_ROTOR2_AZ": -1.0}, Kind.OTHER_AXIS, {"rotor": 3}),
        ({"CA_AIRFRAME": 1.0}, Kind.NO_MULTIROTOR, {"airframe": 1.0}),
        ({"CA_ROTOR5_AY": None}, Kind.AXES_UNTOLD, {"name": "CA_ROTOR5_AY"}),
    ],
)
def test_px4_with_other_rotors_is_refused(
    tmp_path: Path, changes: dict[str, float | None], kind: Kind, facts: dict[str, Any]
) -> None:
    (finding,) = asked(planned(tmp_path, TILTED), PX4, **changes)
    assert finding.verdict is Verdict.REFUSED
    assert finding.objection is not None
    assert finding.objection.kind is kind
    assert finding.objection.facts.items() >= facts.items()


def test_ardupilot_has_no_such_setpoint_and_is_refused(tmp_path: Path) -> None:
    (finding,) = asked(planned(tmp_path, TILTED), ARDUPILOT)
    assert finding.verdict is Verdict.REFUSED
    assert finding.objection == Fact(Kind.NO_LATERAL_SETPOINT)
