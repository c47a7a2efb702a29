"""An effect is added by adding one file: the search tries it, and finds it where it is missing."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from quadctl.effects import CATALOG, every_effect
from quadctl.effects.catalog import effects_in
from quadctl.lab.arrays import Floats
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.diagnosis import diagnose
from quadctl.logs.columns import rpm_columns
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.support.flights import obedient

FILE = '''"""Something on the vehicle swings to and fro."""

from dataclasses import dataclass
from typing import ClassVar

from quadctl.effects import Effect, parameter
from quadctl.numeric import sin


@dataclass(frozen=True)
class Swinging(Effect):
    name: ClassVar[str] = "pendulum.swinging"
    source: ClassVar[str] = "test"
    depends_on: ClassVar[tuple[str, ...]] = ("time",)
    physics: ClassVar[str] = "What swings below the vehicle pulls at it."
    distinguished_by: ClassVar[str] = "its period"
    mission: ClassVar[str] = "missions/hover_staircase.yaml"
    size: float = parameter(0.01, 0.0, 5.0, "", "largest value")

'''
FORCE = """    def force(self, total_thrust_n, c, vehicle):
        return 0.0, 0.0, self.size * sin(0.7 * c.time_s)
"""
TORQUE = """    def torque(self, thrust_n, c, vehicle):
        return 0.0, self.size * sin(0.7 * c.time_s), 0.0
"""
SIZE = {FORCE: 0.6, TORQUE: 0.05}


def with_thrust(log: FlightLog, vehicle: Vehicle, more_n: Sequence[Floats]) -> FlightLog:
    """The same flight by rotors that give so much more thrust each, N."""
    columns = dict(log.columns)
    for name, more in zip(rpm_columns(vehicle.n_rotors), more_n, strict=True):
        columns[name] = np.sqrt(columns[name] ** 2 + more / vehicle.rotor.thrust_n_per_rpm2)
    return replace(log, columns=columns)


def flown_with(method: str, vehicle: Vehicle) -> FlightLog:
    """A flight in which the rotors answer what the method of the file does."""
    log = obedient(Model(vehicle), noise_m_s=0.002)
    swing = SIZE[method] * np.sin(0.7 * log.time_s)
    if method == FORCE:
        return with_thrust(log, vehicle, [swing / vehicle.n_rotors] * vehicle.n_rotors)
    forward_m = [rotor.position_m[0] for rotor in vehicle.rotors]
    return with_thrust(log, vehicle, [-swing * x / sum(x * x for x in forward_m) for x in forward_m])


@pytest.mark.parametrize("method", [FORCE, TORQUE], ids=["force", "torque"])
def test_an_effect_in_one_file_is_found_by_the_search(method: str, tmp_path: Path, raptor: Vehicle) -> None:
    path = tmp_path / "pendulum.py"
    path.write_text(FILE + method)
    kinds = [kind for kind in every_effect([path]).values() if kind.family() in {"pendulum", "ground_effect"}]
    found = diagnose(Model(raptor, effect_files=(path,)), load_dataset([flown_with(method, raptor)], raptor), kinds)
    assert found.missing == ["pendulum"]
    assert found.best.effects[0].values() == pytest.approx({"size": SIZE[method]}, rel=0.1)


def test_a_file_of_the_package_is_in_the_catalogue(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "copied_effects"
    package.mkdir()
    (package / "pendulum.py").write_text(FILE + TORQUE)
    (package / "another.py").write_text("from quadctl.effects.wind import SteadyWind\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert [kind.name for kind in effects_in([str(package)], package.name)] == ["pendulum.swinging"]


def test_the_catalogue_begins_each_family_with_its_first_variant() -> None:
    first = {kind.family(): name for name, kind in reversed(CATALOG.items())}
    assert first["ground_effect"] == "ground_effect.exponential"
    assert first["wind"] == "wind.steady"
