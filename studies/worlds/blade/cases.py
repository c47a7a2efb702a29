"""Cases: which vehicle flies which missions with which hidden effects."""

import zlib
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from studies.worlds.blade.controllers import CASCADE, GEOMETRIC, PERSON, draw_tuning
from studies.worlds.blade.effects import Effect
from studies.worlds.blade.flight import COMMANDED, MEASURED, THROTTLE, Copy, Flight, Pack
from studies.worlds.blade.logs import Recorder, draw_recorder
from studies.worlds.blade.missions import Demand, plan
from studies.worlds.blade.rotors import hover_induced_velocity
from studies.worlds.blade.sensors import Suite, draw_suite
from studies.worlds.blade.sizes import draw
from studies.worlds.blade.vehicles import GRAVITY, RPM, Vehicle, draw_vehicle

SMALL, MIDDLE, LARGE = (0.03, 0.25), (0.5, 2.2), (2.2, 10.0)


@dataclass(frozen=True)
class Recipe:
    """Case before its numbers are drawn."""

    name: str
    hidden: tuple[tuple[str, str], ...]
    """Families and their forms."""
    mass: tuple[float, float]
    suite: str
    shapes: tuple[str, ...]
    """Mission of each flight."""
    space: str
    demand: dict[str, Any] = field(default_factory=dict)
    """Demands of the missions beside the space that there is."""
    pilot: int | None = None
    source: str = MEASURED
    rotor_rates: tuple[float, float] = (5.0, 50.0)
    light_air: float = 0.0


@dataclass(frozen=True)
class Case:
    """Case with all its numbers."""

    recipe: Recipe
    vehicle: Vehicle
    flights: tuple[Flight, ...]
    demands: tuple[Demand, ...]
    recorder: Recorder
    attempt: int


def _space(rng: np.random.Generator, space: str, vehicle: Vehicle) -> dict[str, float]:
    """Limits of a space: a motion-capture `room`, a `hall`, a `field`, or the air just above the `floor`."""
    if space == "room":
        return {"extent": rng.uniform(1.3, 2.3), "low": 0.7, "high": 2.2, "speed": rng.uniform(1.5, 2.8)}
    if space == "hall":
        return {"extent": rng.uniform(4.0, 8.0), "low": 1.0, "high": 4.0, "speed": rng.uniform(2.0, 4.0)}
    if space == "field":
        return {"extent": rng.uniform(15.0, 25.0), "low": 4.0, "high": 12.0, "speed": rng.uniform(3.5, 6.0)}
    radius, hub = vehicle.radius, vehicle.rotor_height
    if space == "floor":
        low = max(rng.uniform(0.6, 0.8) * radius - hub, 0.015)
        return {"extent": 1.5, "low": low, "high": low + rng.uniform(4.5, 7.0) * radius, "speed": rng.uniform(0.8, 1.5)}
    assert space == "ceiling" and vehicle.ceiling is not None
    high = vehicle.ceiling - hub - rng.uniform(1.7, 1.9) * radius
    return {"extent": 1.2, "low": high - rng.uniform(3.5, 5.0) * radius, "high": high, "speed": 1.2}


def _prepare(rng: np.random.Generator, recipe: Recipe) -> Vehicle:
    families = {family for family, _ in recipe.hidden}
    vehicle = draw_vehicle(rng, recipe.name, recipe.mass)
    if recipe.space == "floor":
        vehicle = replace(vehicle, rotor_height=round(vehicle.radius * rng.uniform(0.05, 0.4), 3))
    if recipe.space == "ceiling":
        vehicle = replace(vehicle, ceiling=round(rng.uniform(2.2, 3.5), 2))
    if recipe.source != MEASURED and "motor_lag" not in families:
        # The log tells commands: motors so quick that their lag is none to speak of.
        vehicle = replace(vehicle, time_constant=round(rng.uniform(0.012, 0.018), 3))
    if families & {"thrust_scale", "payload", "battery_sag", "rotor_fault", "tether", "thrust_map", "wind"}:
        needed = 2.1 * vehicle.mass * GRAVITY / vehicle.count  # what its owner would not fly with less
        if vehicle.largest_thrust < needed:
            scale = vehicle.largest_thrust / needed
            line = (vehicle.throttle[0] * scale, vehicle.throttle[1])
            vehicle = replace(vehicle, largest_thrust=needed, throttle=line)
    return vehicle


def _demand(rng: np.random.Generator, recipe: Recipe, vehicle: Vehicle, shape: str) -> Demand:
    wanted: dict[str, Any] = {
        **_space(rng, recipe.space, vehicle),
        "heading": str(rng.choice(["fixed", "turning", "steps"])),
        **recipe.demand,
    }
    spare = vehicle.largest_thrust * vehicle.count / vehicle.mass - GRAVITY
    induced = float(hover_induced_velocity(vehicle.mass * GRAVITY / vehicle.count, vehicle.radius, vehicle.air_density))
    wanted["lift"] = min(wanted.get("lift", 2.5), 0.5 * spare)
    wanted["climb"] = min(wanted.get("climb", 2.0), 0.5 * induced)
    return Demand(shape=shape, duration=float(round(rng.uniform(45.0, 75.0))), **wanted)


def _in_flight(rng: np.random.Generator, effects: list[Effect], duration: float, later: bool) -> tuple[Effect, ...]:
    """Effects with the moments of one flight."""
    out = []
    for effect in effects:
        if effect.family == "payload" or (effect.family == "rotor_fault" and later):
            moment = float(round(rng.uniform(0.3, 0.65) * duration, 2))
            out.append(replace(effect, values={**effect.values, "moment_s": moment}))
        else:
            out.append(effect)
    return tuple(out)


def draw_case(recipe: Recipe, seed: int, attempt: int, strength: float, duration: float | None = None) -> Case:
    """Case with its numbers; another attempt of the same seed draws everything anew. A duration is for short tests."""
    rng = np.random.default_rng([seed, zlib.crc32(recipe.name.encode()), attempt])
    families = {family for family, _ in recipe.hidden}
    vehicle = _prepare(rng, recipe)
    demands = tuple(_demand(rng, recipe, vehicle, shape) for shape in recipe.shapes)
    if duration is not None:
        demands = tuple(replace(demand, duration=duration) for demand in demands)
    drawn = [draw(rng, family, form, vehicle, demands[0]).at(strength) for family, form in recipe.hidden]
    recorder = draw_recorder(rng, vehicle.hover_speed * RPM, recipe.rotor_rates)
    if "battery_sag" in families:
        recorder = replace(recorder, battery=True)
    if "imu_bias" in families:
        recorder = replace(recorder, accelerometer=True)
    if recipe.source == COMMANDED:
        recorder = replace(recorder, rate=max(recorder.rate, 50.0))
    suite = draw_suite(rng, recipe.suite, low=recipe.space in ("floor", "ceiling"))
    suite = _turn_board(suite, drawn)
    kind = int(rng.choice([CASCADE, GEOMETRIC])) if recipe.pilot is None else recipe.pilot
    lag = next((float(np.asarray(e.values["time_constant_s"])) for e in drawn if e.family == "motor_lag"), None)
    tuning = draw_tuning(
        rng, kind, vehicle.time_constant if lag is None else lag, suite.delay * 0.5, stiff=recipe.space == "ceiling"
    )
    spread = rng.normal(0.0, 0.006, vehicle.count).clip(-0.012, 0.012)
    copy = Copy(
        k_error=float(np.clip(rng.normal(0.0, 0.007), -0.014, 0.014)),
        spread=(spread - spread.mean()).tolist(),
        centre=(rng.normal(0.0, 0.006, 2) * vehicle.arm).tolist(),
        inertia_error=rng.normal(0.0, 0.02, 3).clip(-0.04, 0.04).tolist(),
    )
    cells = int(np.clip(round(1 + 1.9 * np.log10(vehicle.mass / 0.03)), 1, 6))
    loss, resistance = rng.uniform(0.12, 0.25), rng.uniform(0.03, 0.07)
    later = bool(rng.random() < 0.4)
    flights = []
    for i, demand in enumerate(demands):
        if "battery_sag" in families:
            charge = [0.97, 0.62, 0.42][i] + float(rng.uniform(-0.03, 0.03))
            drain = float(rng.uniform(0.26, 0.34)) / demand.duration
        else:
            charge, drain = float(rng.uniform(0.7, 1.0)), 1.0 / float(rng.uniform(600.0, 1500.0))
        flights.append(
            Flight(
                vehicle=vehicle,
                effects=_in_flight(rng, drawn, demand.duration, later),
                reference=plan(rng, demand),
                suite=suite,
                tuning=tuning,
                copy=copy,
                pack=Pack(cells, charge, drain, float(resistance), float(loss)),
                source=recipe.source,
                command_delay=1 if recipe.source != MEASURED else int(rng.integers(1, 5)),
                light_air=recipe.light_air * float(rng.uniform(0.7, 1.0)),
                seed=int(rng.integers(2**31)),
            )
        )
    return Case(recipe, vehicle, tuple(flights), demands, recorder, attempt)


def _turn_board(suite: Suite, effects: list[Effect]) -> Suite:
    """Suite whose board sits askew where a hidden tilt says so."""
    for effect in effects:
        if (effect.family, effect.form) == ("thrust_tilt", "board"):
            turned = np.asarray(suite.board) + np.append(np.asarray(effect.values["angles_rad"], float), 0.0)
            return replace(suite, board=turned.tolist())
    return suite


FAST: dict[str, Any] = {
    "extent": 36.0,
    "speed": 10.5,
    "low": 6.0,
    "high": 7.5,
    "acceleration": 4.0,
    "heading": "turning",
}
QUICK: dict[str, Any] = {"rate": 0.75, "lift": 5.0, "climb": 2.5}
SWINGS: dict[str, Any] = {"rate": 0.6, "lift": 2.5, "climb": 2.5}
TURNING: dict[str, Any] = {"heading": "turning"}
CLIMBS: dict[str, Any] = {"extent": 3.0, "low": 4.0, "high": 16.0, "climb": 3.0, "lift": 2.5, "rate": 0.14}
LEVEL: dict[str, Any] = {"high": 7.0, "low": 6.3, "heading": "steps"}
BREEZE: dict[str, Any] = {"extent": 3.0, "speed": 1.2, "heading": "steps"}
ROPE: dict[str, Any] = {"low": 1.0, "extent": 2.5, "climb": 2.0}
SEEN: dict[str, Any] = {"rotor_rates": (25.0, 50.0)}
SKIM: dict[str, Any] = {"low": 0.09, "high": 0.26, "speed": 2.5, "acceleration": 4.0, "extent": 1.8}
RUNS: dict[str, Any] = {**FAST, "heading": "steps"}


def _hidden() -> list[Recipe]:
    """Cases of one hidden effect."""
    out: list[Recipe] = []

    def add(family: str, *rows: dict[str, Any]) -> None:
        for i, row in enumerate(rows, 1):
            form = row.pop("form", "")
            out.append(Recipe(name=f"{family}_{i}", hidden=((family, form),), **row))

    low = {"space": "floor", "rotor_rates": (12.0, 50.0)}
    add(
        "ground_effect",
        {"form": "images", "mass": MIDDLE, "suite": "mocap", "shapes": ("staircase", "staircase", "spline"), **low},
        {"form": "hayden", "mass": MIDDLE, "suite": "flow", "shapes": ("staircase", "vertical"), **low},
        {"form": "danjun", "mass": LARGE, "suite": "rtk", "shapes": ("staircase", "spline"), **low},
    )
    roof = {"space": "ceiling", "mass": (2.0, 5.0), "rotor_rates": (10.0, 50.0)}
    add(
        "ceiling_effect",
        {"form": "contact", "suite": "mocap", "shapes": ("ceiling_staircase", "ceiling_staircase"), **roof},
        {"form": "images", "suite": "mocap", "shapes": ("ceiling_staircase", "spline"), **roof},
        {"form": "decay", "suite": "flow", "shapes": ("ceiling_staircase", "ceiling_staircase", "spline"), **roof},
    )
    add(
        "rotor_drag",
        {"form": "speed", "mass": SMALL, "suite": "mocap", "shapes": ("lemniscate", "spline"), "space": "room",
         "demand": {"speed": 2.8, "acceleration": 4.5}},
        {"form": "thrust", "mass": MIDDLE, "suite": "gnss", "shapes": ("dashes", "lemniscate"), "space": "field"},
        {"form": "axes", "mass": LARGE, "suite": "gnss", "shapes": ("dashes", "sticks", "spline"), "space": "field",
         "pilot": PERSON, "demand": {"heading": "steps"}},
    )  # fmt: skip
    add(
        "body_drag",
        {"form": "bluff", "mass": MIDDLE, "suite": "gnss", "shapes": ("dashes", "lemniscate"), "space": "field",
         "demand": FAST},
        {"form": "plates", "mass": LARGE, "suite": "rtk", "shapes": ("dashes", "dashes", "spline"), "space": "field",
         "demand": FAST},
        {"form": "frontal", "mass": MIDDLE, "suite": "gnss", "shapes": ("dashes", "dashes"), "space": "field",
         "demand": {**FAST, "heading": "course"}},
    )  # fmt: skip
    add(
        "inflow",
        {"mass": MIDDLE, "suite": "gnss", "shapes": ("vertical", "vertical"), "space": "field", "demand": CLIMBS},
        {"mass": SMALL, "suite": "mocap", "shapes": ("vertical", "spline", "vertical"), "space": "room",
         "demand": {"low": 0.7, "high": 2.7, "climb": 1.8, "rate": 0.3}},
        {"mass": LARGE, "suite": "rtk", "shapes": ("vertical", "spline"), "space": "field",
         "demand": {**CLIMBS, "extent": 8.0, "speed": 2.0}},
    )  # fmt: skip
    add(
        "translational_lift",
        {"mass": MIDDLE, "suite": "gnss", "shapes": ("dashes", "lemniscate"), "space": "field", "demand": LEVEL},
        {"mass": (0.25, 0.6), "suite": "flow", "shapes": ("lemniscate", "dashes"), "space": "hall",
         "demand": {"speed": 4.5, "acceleration": 4.0, "low": 1.8, "high": 2.3}},
        {"mass": LARGE, "suite": "gnss", "shapes": ("dashes", "sticks", "dashes"), "space": "field", "demand": LEVEL},
    )  # fmt: skip
    add(
        "wind",
        {"form": "rotor", "mass": MIDDLE, "suite": "gnss", "shapes": ("spline", "staircase"), "space": "field",
         "demand": {**BREEZE, "heading": "turning"}},
        {"form": "body", "mass": LARGE, "suite": "rtk", "shapes": ("spline", "spline"), "space": "field",
         "demand": BREEZE},
        {"form": "rotor", "mass": MIDDLE, "suite": "gnss", "shapes": ("sticks", "spline", "staircase"),
         "space": "field", "demand": BREEZE, "pilot": PERSON},
    )  # fmt: skip
    share = {"form": "share"}
    add(
        "thrust_scale",
        {**share, "mass": SMALL, "suite": "mocap", "shapes": ("spline", "lemniscate"), "space": "room"},
        {**share, "mass": MIDDLE, "suite": "flow", "shapes": ("sticks", "staircase"), "space": "hall", "pilot": PERSON},
        {**share, "mass": LARGE, "suite": "gnss", "shapes": ("spline", "staircase", "dashes"), "space": "field"},
    )
    add(
        "payload",
        {"form": "dropped", "mass": MIDDLE, "suite": "mocap", "shapes": ("spline", "staircase"), "space": "room"},
        {"form": "taken", "mass": LARGE, "suite": "gnss", "shapes": ("staircase", "spline"), "space": "field"},
        {"form": "dropped", "mass": LARGE, "suite": "rtk", "shapes": ("sticks", "spline", "spline"), "space": "field",
         "pilot": PERSON},
    )  # fmt: skip
    tired: dict[str, Any] = {"source": COMMANDED}
    add(
        "battery_sag",
        {"mass": SMALL, "suite": "mocap", "shapes": ("spline", "staircase", "spline"), "space": "room", **tired},
        {"mass": MIDDLE, "suite": "gnss", "shapes": ("staircase", "spline"), "space": "field", **tired},
        {"mass": MIDDLE, "suite": "mocap", "shapes": ("spline", "spline", "staircase"), "space": "room",
         "source": THROTTLE},
    )  # fmt: skip
    add(
        "motor_lag",
        {"mass": MIDDLE, "suite": "mocap", "shapes": ("vertical", "spline"), "space": "room", "demand": QUICK,
         "source": COMMANDED, "pilot": GEOMETRIC},
        {"mass": LARGE, "suite": "rtk", "shapes": ("vertical", "vertical"), "space": "field",
         "demand": {**QUICK, "extent": 4.0}, "source": COMMANDED, "pilot": GEOMETRIC},
        {"mass": (0.5, 1.2), "suite": "mocap", "shapes": ("vertical", "vertical", "spline"), "space": "room",
         "demand": {**QUICK, "rate": 0.9}, "source": COMMANDED, "pilot": GEOMETRIC},
    )  # fmt: skip
    add(
        "thrust_tilt",
        {"form": "motors", "mass": MIDDLE, "suite": "mocap", "shapes": ("spline", "staircase"), "space": "room",
         "demand": TURNING},
        {"form": "board", "mass": MIDDLE, "suite": "gnss", "shapes": ("spline", "dashes"), "space": "field",
         "demand": TURNING},
        {"form": "motors", "mass": LARGE, "suite": "gnss", "shapes": ("sticks", "spline", "staircase"),
         "space": "field", "demand": {"heading": "steps"}, "pilot": PERSON},
    )  # fmt: skip
    add(
        "tether",
        {"form": "slack", "mass": MIDDLE, "suite": "gnss", "shapes": ("staircase", "vertical"), "space": "field",
         "demand": {**ROPE, "high": 12.0, "rate": 0.08}},
        {"form": "straight", "mass": LARGE, "suite": "rtk", "shapes": ("staircase", "spline"), "space": "field",
         "demand": {**ROPE, "high": 16.0}},
        {"form": "slack", "mass": (0.3, 0.8), "suite": "flow", "shapes": ("staircase", "vertical", "spline"),
         "space": "hall", "demand": {**ROPE, "high": 6.0, "rate": 0.1}},
    )  # fmt: skip
    add(
        "rotor_fault",
        {"mass": MIDDLE, "suite": "mocap", "shapes": ("spline", "lemniscate"), "space": "room", **SEEN},
        {"mass": LARGE, "suite": "gnss", "shapes": ("spline", "staircase"), "space": "field", **SEEN},
        {"mass": SMALL, "suite": "mocap", "shapes": ("staircase", "spline", "spline"), "space": "room", **SEEN},
    )
    add(
        "thrust_curve",
        {"form": "power", "mass": MIDDLE, "suite": "mocap", "shapes": ("vertical", "vertical"), "space": "room",
         "demand": QUICK, "pilot": GEOMETRIC, **SEEN},
        {"form": "mixed", "mass": SMALL, "suite": "mocap", "shapes": ("vertical", "spline"), "space": "room",
         "demand": QUICK, "pilot": GEOMETRIC, **SEEN},
        {"form": "power", "mass": LARGE, "suite": "rtk", "shapes": ("vertical", "vertical", "spline"),
         "space": "field", "demand": {**QUICK, "extent": 4.0}, "pilot": GEOMETRIC, **SEEN},
    )  # fmt: skip
    add(
        "imu_bias",
        {"mass": MIDDLE, "suite": "mocap", "shapes": ("spline", "lemniscate"), "space": "room", "demand": TURNING},
        {"mass": SMALL, "suite": "mocap", "shapes": ("spline", "staircase"), "space": "room", "demand": TURNING},
        {"mass": LARGE, "suite": "mocap", "shapes": ("spline", "spline", "vertical"), "space": "room",
         "demand": {"heading": "steps", "extent": 2.5, "high": 3.0, "low": 1.2}},
    )  # fmt: skip
    add(
        "ground_torque",
        {"mass": MIDDLE, "suite": "mocap", "shapes": ("spline", "lemniscate"), "demand": SKIM, "space": "floor",
         **SEEN},
        {"mass": MIDDLE, "suite": "mocap", "shapes": ("dashes", "spline"), "demand": SKIM, "space": "floor", **SEEN},
        {"mass": (0.5, 1.2), "suite": "mocap", "shapes": ("spline", "dashes", "lemniscate"), "demand": SKIM,
         "space": "floor", **SEEN},
    )  # fmt: skip
    add(
        "rotor_interaction",
        {"mass": MIDDLE, "suite": "gnss", "shapes": ("dashes", "lemniscate"), "demand": RUNS, "space": "field", **SEEN},
        {"mass": LARGE, "suite": "rtk", "shapes": ("dashes", "spline"), "demand": RUNS, "space": "field", **SEEN},
        {"mass": MIDDLE, "suite": "rtk", "shapes": ("dashes", "dashes", "lemniscate"), "space": "field",
         "demand": {**FAST, "heading": "course"}, **SEEN},
    )  # fmt: skip
    add(
        "thrust_map",
        {"mass": MIDDLE, "suite": "mocap", "shapes": ("vertical", "spline"), "space": "room", "demand": SWINGS,
         "source": THROTTLE, "pilot": GEOMETRIC},
        {"mass": SMALL, "suite": "mocap", "shapes": ("vertical", "vertical"), "space": "room", "demand": SWINGS,
         "source": THROTTLE, "pilot": GEOMETRIC},
        {"mass": LARGE, "suite": "rtk", "shapes": ("vertical", "spline", "vertical"), "space": "field",
         "demand": {**SWINGS, "extent": 5.0}, "source": THROTTLE, "pilot": GEOMETRIC},
    )  # fmt: skip
    return out


def _pairs() -> list[Recipe]:
    """Cases of two hidden effects."""
    out: list[Recipe] = []

    def pair(first: tuple[str, str], second: tuple[str, str], **row: Any) -> None:
        out.append(Recipe(name=f"pair_{first[0]}_{second[0]}", hidden=(first, second), **row))

    pair(("ground_effect", "images"), ("battery_sag", ""), mass=MIDDLE, suite="mocap",
         shapes=("staircase", "staircase", "spline"), space="floor", source=COMMANDED)  # fmt: skip
    pair(("ground_effect", "danjun"), ("thrust_tilt", "motors"), mass=MIDDLE, suite="mocap",
         shapes=("staircase", "spline"), space="floor", demand=TURNING, rotor_rates=(12.0, 50.0))  # fmt: skip
    pair(("wind", "alone"), ("rotor_drag", "speed"), mass=MIDDLE, suite="gnss", shapes=("dashes", "lemniscate"),
         space="field", demand=TURNING)  # fmt: skip
    pair(("wind", "rotor"), ("payload", "dropped"), mass=LARGE, suite="rtk", shapes=("spline", "staircase"),
         space="field", demand=BREEZE)  # fmt: skip
    pair(("wind", "body"), ("thrust_tilt", "motors"), mass=MIDDLE, suite="gnss", shapes=("spline", "staircase"),
         space="field", demand={**BREEZE, **TURNING})  # fmt: skip
    pair(("inflow", ""), ("rotor_drag", "thrust"), mass=MIDDLE, suite="gnss", shapes=("vertical", "dashes", "spline"),
         space="field", demand={"climb": 3.0, "rate": 0.14, "high": 14.0})  # fmt: skip
    pair(("translational_lift", ""), ("rotor_drag", "speed"), mass=LARGE, suite="gnss", shapes=("dashes", "lemniscate"),
         space="field", demand=LEVEL)  # fmt: skip
    pair(("body_drag", "bluff"), ("thrust_tilt", "board"), mass=MIDDLE, suite="gnss", shapes=("dashes", "lemniscate"),
         space="field", demand=FAST)  # fmt: skip
    pair(("payload", "taken"), ("rotor_drag", "axes"), mass=LARGE, suite="gnss", shapes=("dashes", "spline", "dashes"),
         space="field")  # fmt: skip
    pair(("tether", "slack"), ("wind", "rotor"), mass=LARGE, suite="gnss", shapes=("staircase", "vertical"),
         space="field", demand={**BREEZE, **ROPE, "high": 14.0, "rate": 0.08})  # fmt: skip
    pair(("thrust_scale", "share"), ("body_drag", "plates"), mass=MIDDLE, suite="rtk", shapes=("dashes", "spline"),
         space="field", demand=FAST)  # fmt: skip
    pair(("motor_lag", ""), ("thrust_curve", "power"), mass=MIDDLE, suite="mocap", shapes=("vertical", "vertical"),
         space="room", demand=QUICK, source=COMMANDED, pilot=GEOMETRIC)  # fmt: skip
    pair(("rotor_fault", ""), ("rotor_drag", "speed"), mass=MIDDLE, suite="gnss", shapes=("dashes", "lemniscate"),
         space="field", **SEEN)  # fmt: skip
    return out


def _clean() -> list[Recipe]:
    """Cases in which nothing is hidden."""
    clean: list[dict[str, Any]] = [
        {"mass": SMALL, "suite": "mocap", "shapes": ("spline", "lemniscate"), "space": "room"},
        {"mass": MIDDLE, "suite": "mocap", "shapes": ("spline", "vertical"), "space": "room", "light_air": 0.02},
        {"mass": MIDDLE, "suite": "gnss", "shapes": ("spline", "dashes"), "space": "field", "light_air": 0.03},
        {"mass": MIDDLE, "suite": "flow", "shapes": ("staircase", "sticks"), "space": "hall", "pilot": PERSON},
        {"mass": LARGE, "suite": "gnss", "shapes": ("dashes", "lemniscate"), "space": "field", "light_air": 0.03,
         "demand": {"speed": 7.0}},
        {"mass": LARGE, "suite": "rtk", "shapes": ("staircase", "spline", "vertical"), "space": "field"},
        {"mass": MIDDLE, "suite": "mocap", "shapes": ("staircase", "staircase"), "space": "floor", "light_air": 0.02},
        {"mass": LARGE, "suite": "gnss", "shapes": ("sticks", "spline"), "space": "field", "pilot": PERSON,
         "light_air": 0.03, "rotor_rates": (3.0, 6.0)},
        {"mass": SMALL, "suite": "flow", "shapes": ("lemniscate", "spline"), "space": "hall", "light_air": 0.02},
        {"mass": MIDDLE, "suite": "mocap", "shapes": ("spline", "vertical"), "space": "room", "source": THROTTLE},
        {"mass": MIDDLE, "suite": "rtk", "shapes": ("dashes", "lemniscate", "spline"), "space": "field",
         "demand": {"extent": 26.0, "speed": 8.0, "low": 6.0, "high": 7.5, "acceleration": 4.0}},
        {"mass": MIDDLE, "suite": "gnss", "shapes": ("staircase", "vertical"), "space": "field", "light_air": 0.03,
         "demand": {"climb": 2.5, "rate": 0.12}, "rotor_rates": (3.0, 10.0)},
    ]  # fmt: skip
    return [Recipe(name=f"clean_{i:02d}", hidden=(), **row) for i, row in enumerate(clean, 1)]


RECIPES: dict[str, Recipe] = {recipe.name: recipe for recipe in _hidden() + _pairs() + _clean()}
