"""Time of one tick of control with each compensator, beside an empty function call."""

import timeit
from collections.abc import Callable, Iterator

from quadctl.compensator import Compensator
from quadctl.control import ControllerSettings, Memory, control
from quadctl.effects import CATALOG
from quadctl.model import Model, load_model
from quadctl.state import Setpoint, VehicleState
from studies.page import ROOT

Row = tuple[str, str, str]


def rows() -> Iterator[Row]:
    rigid = load_model(ROOT / "config/vehicles/raptor.yaml")
    state = VehicleState(
        0.0, (0.0, 0.0, -0.3), (0.1, 0.0, 0.1), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (5600.0,) * 4, battery_v=16.0
    )
    setpoint, settings = Setpoint((0.0, 0.0, -0.4)), ControllerSettings()
    empty = min(timeit.repeat(lambda: None, number=20000, repeat=5)) / 20000
    found: dict[str, tuple[float, float]] = {}
    for name, model in {"none": rigid, **{n: rigid.plus(e()) for n, e in CATALOG.items()}, "all": _all(rigid)}.items():
        compensator = Compensator(model)

        def tick(compensator: Compensator = compensator) -> object:
            return control(setpoint, state, Memory(), 0.02, 0.0, rigid.vehicle, settings, compensator)

        def alone(compensator: Compensator = compensator) -> object:
            return compensator(state, 0.0, 14.7)

        found[name] = _each_s(tick), _each_s(alone)
    for name in ("none", max(found.keys() - {"all"}, key=lambda name: found[name][0]), "all"):
        whole, only = found[name]
        yield (
            f"control tick with {name}",
            f"{1e6 * whole:.1f} us, of which compensator {1e6 * only:.1f} us",
            f"{whole / empty:.0f} empty calls",
        )


def _each_s(call: Callable[[], object]) -> float:
    return min(timeit.repeat(call, number=2000, repeat=5)) / 2000


def _all(rigid: Model) -> Model:
    """One effect of each family."""
    model = rigid
    for effect in CATALOG.values():
        if effect.family() not in {e.family() for e in model.effects}:
            model = model.plus(effect())
    return model
