"""Equations of motion for other programs: the numbers of the model itself, in every effect, with nothing dropped in
silence."""

import ast
import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from quadctl.effects import CATALOG
from quadctl.effects.base import Conditions, Effect
from quadctl.effects.battery_sag import PowerSag
from quadctl.effects.ground_effect import Exponential
from quadctl.effects.ground_effect_surfaces import Surfaces
from quadctl.effects.imu_bias import ConstantBias
from quadctl.effects.motor_lag import FirstOrderLag, lagged
from quadctl.effects.payload import MassStep
from quadctl.effects.per_flight import with_own_values
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.rotor_fault import UnequalRotors
from quadctl.effects.thrust_map import LineMap
from quadctl.effects.wind import SteadyWind, WindOfEachFlight
from quadctl.export.dynamics import dynamics
from quadctl.export.equations import STATE
from quadctl.export.numpy_code import numpy_code
from quadctl.export.targets import PROGRAMS
from quadctl.frames import rotate_inverse
from quadctl.model import Model, Provenance, save_model
from quadctl.vehicle import Vehicle, load_vehicle
from tests.support.commands import Result
from tests.support.held_out import Floats, HeldOut
from tests.support.places import VEHICLES

DRAWS = 25
Equations = Callable[[Any, Any, Any], Floats]


class Written:
    """Equations as a program reads them from the file."""

    def __init__(self, target: str, model: Model, folder: Path) -> None:
        path = folder / f"body.{target}"
        self.left_out = PROGRAMS[target](model, path)
        self.place: dict[str, Any] = {}
        if target == "numpy":
            exec(path.read_text(), self.place)
            self.x_dot: Equations = self.place["x_dot"]
            self.commanded: Equations = self.place["x_dot_commanded"]
        else:
            file = ca.FileDeserializer(str(path))
            self.x_dot, self.commanded = (_as_numpy(file.unpack()) for _ in range(2))


def _as_numpy(function: ca.Function) -> Equations:
    return lambda x, u, p: np.array(function(x, u, p)).ravel()


@pytest.fixture(params=["numpy", "casadi"])
def write(request: pytest.FixtureRequest, tmp_path: Path) -> Callable[[Model], Written]:
    return lambda model: Written(request.param, model, tmp_path)


# --- what the model itself says ----------------------------------------------------------------------------------


def askew(name: str) -> Vehicle:
    """A vehicle none of whose numbers is 0 or 1 by chance."""
    vehicle = load_vehicle(VEHICLES / f"{name}.yaml")
    changes = {"rotor_height_m": 0.07, "ceiling_m": 4.1, "air_density_kg_m3": 1.13}
    return vehicle.model_copy(update={**changes, "inertia_kg_m2": (0.011, 0.014, 0.023)})


VEHICLE_OF = {False: askew("raptor"), True: askew("f550_tilted")}
"""A quadrotor, and a hexarotor with tilted rotors."""


def vehicle_of(effect: type[Effect]) -> Vehicle:
    return VEHICLE_OF[not effect.applies_to(VEHICLE_OF[False])]


def drawn(effect: type[Effect], vehicle: Vehicle, random: np.random.Generator) -> Effect:
    """The effect with random parameters within its bounds: anywhere, or not far from the usual ones."""
    values = {}
    for p in effect.parameters():
        near = p.default + random.uniform(-0.4, 0.4) * (abs(p.default) or 0.3)
        wide = random.uniform(max(p.low, -300.0), min(p.high, 300.0))
        values[p.name] = float(np.clip(near if random.random() < 0.5 else wide, p.low, p.high))
    if "rotor" in values:
        values["rotor"] = float(random.integers(1, vehicle.n_rotors + 1))
    if "flight" in values:
        values["flight"] = 0.0
    return effect(**values)


def drawn_state(random: np.random.Generator) -> Floats:
    """A state in motion, leaning, turned and turning, up to 4 m above the ground."""
    turn = random.normal(size=4)
    position = [*random.uniform(-5.0, 5.0, 2), -random.uniform(0.0, 4.0)]
    return np.array(
        [*position, *random.uniform(-8.0, 8.0, 3), *turn / np.linalg.norm(turn), *random.uniform(-3.0, 3.0, 3)]
    )


def drawn_parameters(model: Model, random: np.random.Generator) -> Floats:
    """Voltage, time, and the share of each surface that the model names."""
    surfaces = [name for e in model.effects if isinstance(e, Surfaces) for name in e.surfaces]
    return np.array([random.uniform(9.0, 17.0), random.uniform(0.0, 200.0), *random.uniform(0.0, 0.5, len(surfaces))])


def conditions(model: Model, x: Floats, p: Floats, thrust_rate_n_s: Floats | None = None) -> Conditions:
    q = (x[6], x[7], x[8], x[9])
    named = [name for e in model.effects if isinstance(e, Surfaces) for name in e.surfaces]
    return Conditions(
        height_m=model.vehicle.rotor_height_m - x[2],
        velocity_body_m_s=rotate_inverse(q, (x[3], x[4], x[5])),
        attitude=q,
        time_s=float(p[1]),
        battery_v=float(p[0]),
        position_ne_m=(x[0], x[1]),
        surfaces=tuple(zip(named, p[2:], strict=True)),
        rates_rad_s=(x[10], x[11], x[12]),
        thrust_rate_n_s=() if thrust_rate_n_s is None else tuple(thrust_rate_n_s),
    )


def derivative(model: Model, x: Floats, nominal_n: Floats, p: Floats, thrust_rate_n_s: Floats | None = None) -> Floats:
    """Derivatives of position, velocity and body rates by the model's own prediction."""
    c, inertia = conditions(model, x, p, thrust_rate_n_s), np.array(model.vehicle.principal_inertia_kg_m2)
    turning = np.array(model.body_torque(list(nominal_n), c)) - np.cross(x[10:13], inertia * x[10:13])
    return np.array([*x[3:6], *model.acceleration_ned(list(nominal_n), c), *turning / inertia])


MOVES = [0, 1, 2, 3, 4, 5, 10, 11, 12]
"""States whose derivatives the model predicts."""
SPECIAL: list[type[Effect]] = [
    Surfaces.over(["turf", "gravel"]),
    with_own_values(WindOfEachFlight, [2]),
    type(UnequalRotors.of({1: 1.0, 3: 1.0})),
]
EVERY = pytest.mark.parametrize(
    "effect",
    [*CATALOG.values(), *SPECIAL],
    ids=lambda e: e.name + "".join(f"_{i}" for i in e.__dict__.get("numbers", ())),
)


# --- every effect in every target --------------------------------------------------------------------------------


@EVERY
def test_every_effect_moves_the_vehicle_as_in_the_model(
    effect: type[Effect], write: Callable[[Model], Written]
) -> None:
    vehicle, random = vehicle_of(effect), np.random.default_rng(7)
    for _ in range(DRAWS):
        model = Model(vehicle).plus(drawn(effect, vehicle, random))
        x, nominal_n, p = (
            drawn_state(random),
            random.uniform(0.0, 8.0, vehicle.n_rotors),
            drawn_parameters(model, random),
        )
        found = write(model).x_dot(x, nominal_n, p)
        assert found[MOVES] == pytest.approx(derivative(model, x, nominal_n, p), rel=1e-9, abs=1e-9)


@EVERY
def test_every_effect_acts_on_the_rotors_that_follow_commands(
    effect: type[Effect], write: Callable[[Model], Written]
) -> None:
    vehicle, random = vehicle_of(effect), np.random.default_rng(8)
    n, line, lag_s = vehicle.n_rotors, vehicle.throttle, vehicle.rotor.time_constant_s
    for _ in range(5):
        model = Model(vehicle).plus(drawn(effect, vehicle, random))
        x, p = drawn_state(random), drawn_parameters(model, random)
        rotors_n, command = random.uniform(0.0, 8.0, n), random.uniform(0.0, 1.0, n)
        late_n = random.uniform(0.0, 8.0, n) if issubclass(effect, FirstOrderLag) else np.array([])
        found = write(model).commanded([*x, *rotors_n, *late_n], command, p)
        commanded_n = np.maximum(command - line.offset, 0.0) / (line.per_newton * n)
        follow = [(commanded_n - rotors_n) / lag_s]
        if len(late_n):
            follow.append((rotors_n - late_n) / model.effects[0].values()["time_constant_s"])
        thrust_n = late_n if len(late_n) else rotors_n
        assert found[MOVES] == pytest.approx(derivative(model, x, thrust_n, p, follow[-1]), rel=1e-9, abs=1e-9)
        assert found[len(STATE) :] == pytest.approx(np.concatenate(follow), rel=1e-9, abs=1e-9)


@EVERY
def test_constants_of_the_numpy_file_are_the_parameters(effect: type[Effect], tmp_path: Path) -> None:
    """Whoever changes one gets the model with that parameter, except for numbers of rotors and flights."""
    vehicle, random = vehicle_of(effect), np.random.default_rng(9)
    for _ in range(5):
        first, other = (drawn(effect, vehicle, random) for _ in range(2))
        kept = {name: value for name, value in first.values().items() if name in ("rotor", "flight")}
        model = Model(vehicle).plus(replace(other, **kept))
        written = Written("numpy", Model(vehicle).plus(first), tmp_path)
        for name, value in model.effects[0].values().items():
            written.place[f"{effect.family()}_{name}".upper()] = value
        x, nominal_n, p = (
            drawn_state(random),
            random.uniform(0.0, 8.0, vehicle.n_rotors),
            drawn_parameters(model, random),
        )
        expected = derivative(model, x, nominal_n, p)
        assert written.x_dot(x, nominal_n, p)[MOVES] == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_effects_act_together_in_their_order(write: Callable[[Model], Written]) -> None:
    random = np.random.default_rng(10)
    vehicle = VEHICLE_OF[False]
    kinds = ["thrust_map.line", "battery_sag.voltage", "wind.steady", "thrust_curve.power", "body_drag.quadratic"]
    kinds += ["ground_effect.sanchez", "rotor_interaction.wake", "ground_torque.levelling", "thrust_tilt.fixed"]
    for _ in range(DRAWS):
        model = Model(vehicle)
        for name in random.permutation(kinds):
            model = model.plus(drawn(CATALOG[name], vehicle, random))
        x, nominal_n, p = drawn_state(random), random.uniform(0.0, 8.0, 4), drawn_parameters(model, random)
        found = write(model).x_dot(x, nominal_n, p)
        assert found[MOVES] == pytest.approx(derivative(model, x, nominal_n, p), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("sag", ["battery_sag.voltage", "battery_sag.voltage_power"])
def test_a_voltage_that_is_not_known_corrects_nothing(sag: str, write: Callable[[Model], Written]) -> None:
    model = Model(VEHICLE_OF[False]).plus(CATALOG[sag].from_values({"share": 1.5, "reference_v": 15.3}, "test"))
    x, nominal_n = drawn_state(np.random.default_rng(11)), np.array([3.0, 3.5, 4.0, 3.2])
    found = write(model).x_dot(x, nominal_n, [math.nan, 3.0])
    p = np.array([15.3, 3.0])
    assert found[MOVES] == pytest.approx(derivative(model, x, nominal_n, p), rel=1e-9, abs=1e-9)


def test_the_attitude_turns_with_the_body_rates(write: Callable[[Model], Written]) -> None:
    """The quaternion after a short time is the one before times a turn about the body's axes."""
    x = drawn_state(np.random.default_rng(12))
    found = write(Model(VEHICLE_OF[False])).x_dot(x, np.full(4, 3.0), [16.0, 0.0])[6:10]
    w, v, rates = x[6], x[7:10], x[10:13]
    expected = [-0.5 * v @ rates, *(0.5 * (w * rates + np.cross(v, rates)))]
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-12)


# --- lag ---------------------------------------------------------------------------------------------------------


def test_rotors_follow_a_command_as_in_the_lab(write: Callable[[Model], Written]) -> None:
    """The lag of the vehicle file, then the motor lag of the model, by the lab's own filter."""
    vehicle = VEHICLE_OF[False]
    model = Model(vehicle).plus(LineMap(0.9, 0.05)).plus(FirstOrderLag(0.08))
    line, step_s = vehicle.throttle, 0.002
    time_s = np.arange(0.0, 1.0, step_s)
    command = 0.55 + 0.1 * np.sin(7.0 * time_s) + 0.05 * np.sin(23.0 * time_s)
    nominal_n = (command - line.offset) / (line.per_newton * 4)
    rotors_n = lagged(nominal_n, step_s, vehicle.rotor.time_constant_s)
    late_n = lagged(0.9 * rotors_n + 0.05 * vehicle.weight_n / 4, step_s, 0.08)
    equations = write(model).commanded
    state = np.array([0.0, 0.0, -2.0, 0.0, 0.0, 0.0, 1.0, *[0.0] * 6, *[rotors_n[0]] * 4, *[late_n[0]] * 4])
    thrusts = []
    for now, then in itertools.pairwise(command):
        thrusts.append(state[[13, 17]])
        rates = [equations(state, np.full(4, now), [16.0, 0.0])[13:]]  # Heun's method
        ahead = np.concatenate([state[:13], state[13:] + step_s * rates[0]])
        rates.append(equations(ahead, np.full(4, then), [16.0, 0.0])[13:])
        state[13:] += 0.5 * step_s * (rates[0] + rates[1])
    found = np.array(thrusts).T
    assert found == pytest.approx(np.array([rotors_n, late_n])[:, :-1], abs=2e-3)


def test_effects_before_a_motor_lag_are_late_and_those_after_it_are_not(write: Callable[[Model], Written]) -> None:
    vehicle, random = VEHICLE_OF[False], np.random.default_rng(13)
    ground, lag, sag = Exponential(0.3, 2.0), FirstOrderLag(0.07), PowerSag(1.4, 15.1)
    model = Model(vehicle).plus(ground).plus(lag).plus(sag)
    x, p = drawn_state(random), np.array([13.2, 5.0])
    rotors_n, late_n = random.uniform(1.0, 8.0, (2, 4))
    found = write(model).commanded([*x, *rotors_n, *late_n], np.full(4, 0.4), p)
    c = conditions(model, x, p)
    assert found[17:] == pytest.approx((ground.ratio(c, vehicle) * rotors_n - late_n) / 0.07, rel=1e-9)
    assert found[MOVES] == pytest.approx(derivative(Model(vehicle).plus(sag), x, late_n, p), rel=1e-9, abs=1e-9)


def test_rotors_without_a_lag_have_no_states(write: Callable[[Model], Written]) -> None:
    vehicle = VEHICLE_OF[False]
    prompt = vehicle.model_copy(update={"rotor": vehicle.rotor.model_copy(update={"time_constant_s": 0.0})})
    x, command = drawn_state(np.random.default_rng(14)), np.array([0.4, 0.5, 0.6, 0.1])
    found = write(Model(prompt)).commanded(x, command, [16.0, 0.0])
    nominal_n = np.maximum(command - prompt.throttle.offset, 0.0) / (4 * prompt.throttle.per_newton)
    assert len(found) == len(STATE)
    assert found[MOVES] == pytest.approx(derivative(Model(prompt), x, nominal_n, np.array([16.0, 0.0])), rel=1e-9)


# --- the files ---------------------------------------------------------------------------------------------------


def some_model(vehicle: Vehicle) -> Model:
    fitted = Provenance(logs=("a.csv",), ci95={"a": (0.25, 0.35)})
    return (
        Model(vehicle).plus(Exponential(0.3, 4.0), fitted).plus(SteadyWind(2.0, -1.0)).plus(LinearDrag(0.3, 0.4, 0.1))
    )


def test_the_numpy_file_reads_as_physics() -> None:
    code, _ = numpy_code(some_model(VEHICLE_OF[False]))
    assert (
        "# --- ground_effect.exponential ---\n"
        "GROUND_EFFECT_A = 0.3  # gain in thrust at height 0, [0.25, 0.35]\n"
        "GROUND_EFFECT_B = 4.0  # 1/m, rate at which it fades with height\n"
        "GROUND_EFFECT_C = 1.0  # ratio far away\n"
    ) in code
    assert (
        "    z = np.maximum(height_m, 0.5 * ROTOR_RADIUS_M)\n"
        "    return GROUND_EFFECT_C + GROUND_EFFECT_A * np.exp(-GROUND_EFFECT_B * z)\n"
    ) in code
    assert "WIND_DRAG = 0.0  # 1/s, deceleration per airspeed, where the model holds no drag" in code  # it holds one


@EVERY
def test_the_numpy_file_has_a_function_for_each_effect_and_needs_numpy_alone(effect: type[Effect]) -> None:
    vehicle = vehicle_of(effect)
    code, _ = numpy_code(Model(vehicle).plus(drawn(effect, vehicle, np.random.default_rng(15))))
    parsed = ast.parse(code)
    imported = {node.module if isinstance(node, ast.ImportFrom) else node.names[0].name for node in ast.walk(parsed)
                if isinstance(node, ast.Import | ast.ImportFrom)}  # fmt: skip
    assert imported == {"numpy", "types"}
    functions = [node for node in ast.walk(parsed) if isinstance(node, ast.FunctionDef)]
    own = [node for node in functions if node.name.startswith(effect.name.replace(".", "_"))]
    acts = not (effect.adds_lag or effect.acts_by("sensed_m_s2"))
    assert bool(own) == acts
    assert all(" = 0.0" not in (ast.get_docstring(node) or " = 0.0") for node in own)  # of words, not a signature
    assert max(map(len, code.splitlines())) < 170


def test_the_numpy_file_takes_many_samples_and_what_holds_for_all_of_them(tmp_path: Path) -> None:
    model, random = some_model(VEHICLE_OF[False]), np.random.default_rng(16)
    written = Written("numpy", model, tmp_path)
    x, u = np.array([drawn_state(random) for _ in range(4)]).T, random.uniform(1.0, 6.0, 4)
    many = written.x_dot(x, u, [14.2, 3.0])
    assert many.shape == (13, 4)
    for i in range(4):
        assert many[:, i] == pytest.approx(written.x_dot(x[:, i], u, [14.2, 3.0]), rel=1e-12)
    rotors = np.concatenate([x, np.tile(u[:, None], 4)])
    assert written.commanded(rotors, np.full((4, 4), 0.5), np.tile([[14.2], [3.0]], 4)).shape == (17, 4)


@pytest.mark.parametrize("target", ["casadi", "numpy"])
def test_a_held_out_flight_is_predicted_as_by_the_model(held_out: HeldOut, target: str, tmp_path: Path) -> None:
    equations = Written(target, held_out.model, tmp_path).x_dot

    def by_target(velocity: Floats, attitude: Floats, thrust_n: Floats) -> Floats:
        rest = np.zeros(3)
        rows = zip(velocity, attitude, thrust_n, strict=True)
        return np.array([equations([*rest, *v, *q, *rest], t, [16.0, 3.0])[3:6] for v, q, t in rows])

    held_out.assert_as_good(by_target)


def test_jacobians_come_with_casadis(raptor: Vehicle) -> None:
    equations = dynamics(Model(raptor).plus(LinearDrag(0.3, 0.4, 0.1)))
    x = [0.3, -0.2, -2.0, 1.0, 0.0, 0.0, 1.0, *[0.0] * 6]
    by_x = np.array(equations.function.factory("j", ["x", "u", "p"], ["jac:x_dot:x"])(x, [3.67] * 4, [16.0, 3.0]))
    assert by_x[3, 3] == pytest.approx(-0.3)  # level and to the north: d_x
    assert by_x[4, 4] == pytest.approx(-0.4)
    rotors = [*x, *[3.67] * 4]
    by_u = np.array(equations.commanded.factory("j", ["x", "u", "p"], ["jac:x_dot:u"])(rotors, [0.5] * 4, [16.0, 3.0]))
    assert by_u[13, 0] == pytest.approx(1.0 / (4 * raptor.throttle.per_newton * raptor.rotor.time_constant_s))


def test_a_saved_function_is_loaded_by_casadi_alone(raptor: Vehicle, tmp_path: Path) -> None:
    PROGRAMS["casadi"](Model(raptor), tmp_path / "body.casadi")
    function = ca.Function.load(str(tmp_path / "body.casadi"))
    hover = [raptor.weight_n / 4.0] * 4
    x = [0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0, *[0.0] * 6]
    assert float(function(x, hover, [14.0, 0.0])[5]) == pytest.approx(0.0, abs=1e-12)


# --- what is left out --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("effect", "reason"),
    [
        (ConstantBias(0.1, 0.2, 0.3), "imu_bias.offset: an error of the accelerometer, which moves nothing"),
        (MassStep(0.2, 9.0, 2.0), "payload.step: it begins in flight 2, and these equations are of no flight"),
        (
            SPECIAL[1](),
            "wind.each_flight: its values of flight 2: those of all other flights are taken",
        ),
    ],
)
def test_what_the_equations_do_not_hold_is_said(
    effect: Effect, reason: str, quadctl: Callable[..., Result], raptor: Vehicle, tmp_path: Path
) -> None:
    save_model(Model(raptor).plus(LinearDrag(0.3, 0.4, 0.1)).plus(effect), tmp_path / "fitted.yaml")
    for target in ("casadi", "numpy"):
        written = tmp_path / f"body.{target}"
        done = quadctl("export", tmp_path / "fitted.yaml", "--to", target, "-o", written)
        assert done.status == 0, done.err
        assert f"Left out: {reason}." in done.out
    assert f"Not in these equations: {reason}." in " ".join(written.read_text().split())


def test_a_fit_to_commands_keeps_their_delay(held_out: HeldOut) -> None:
    """The recorded PX4, whose lag the vehicle file states, has no other delay than that of its estimate."""
    fitted = held_out.model.stack[0].fitted
    assert fitted is not None and fitted.command_delay_s is not None
    value, low, high = fitted.command_delay_s
    assert low < value < high
    assert low > -0.1 and high < 0.1


def test_the_delay_of_the_command_in_the_flights_of_the_fit_is_told(
    quadctl: Callable[..., Result], raptor: Vehicle, tmp_path: Path
) -> None:
    fitted = Provenance(command_delay_s=(0.023, 0.011, 0.035))
    save_model(Model(raptor).plus(LinearDrag(0.3, 0.4, 0.1), fitted), tmp_path / "fitted.yaml")
    for target in PROGRAMS:
        done = quadctl("export", tmp_path / "fitted.yaml", "--to", target, "-o", tmp_path / target)
        assert "Left out: delay of the command: 0.023 s [0.011, 0.035] in the flights of the fit" in done.out
        lined = "Left out: throttle line (0.1644 + 0.02394 T)" in done.out
        assert lined == (target in ("rotorpy", "crazyflow", "gazebo"))
    constant = "COMMAND_DELAY_S = 0.023  # x_dot_commanded takes the command of so long ago"
    assert constant in (tmp_path / "numpy").read_text()


def test_a_lag_is_not_left_out(quadctl: Callable[..., Result], raptor: Vehicle, tmp_path: Path) -> None:
    save_model(Model(raptor).plus(FirstOrderLag()), tmp_path / "fitted.yaml")
    done = quadctl("export", tmp_path / "fitted.yaml", "--to", "numpy", "-o", tmp_path / "body.py")
    assert done.status == 0, done.err
    assert "Left out" not in done.out
    refused = quadctl("export", tmp_path / "fitted.yaml", "--to", "numpy")
    assert "--to numpy needs -o FILE" in refused.err


TABLE = """
from dataclasses import dataclass
from typing import ClassVar
import math
import numpy as np
from quadctl.effects import Conditions, ThrustRatio, parameter

@dataclass(frozen=True)
class Table(ThrustRatio):
    name: ClassVar[str] = "thrust_table.height"
    source: ClassVar[str] = "test"
    depends_on: ClassVar[tuple[str, ...]] = ("height_over_radius",)
    physics: ClassVar[str] = "A table."
    distinguished_by: ClassVar[str] = "nothing"
    mission: ClassVar[str] = "missions/hover_staircase.yaml"
    gain: float = parameter(0.1, 0.0, 1.0, "", "gain")

    def ratio(self, c, vehicle):
        return 1.0 + self.gain * np.vectorize(lambda height: math.exp(-float(height)))(c.height_m)
"""


@pytest.mark.parametrize("target", ["casadi", "numpy"])
def test_an_effect_whose_code_takes_numbers_only_is_a_sentence_that_says_what_to_do(
    quadctl: Callable[..., Result], raptor_path: Path, tmp_path: Path, target: str
) -> None:
    (tmp_path / "table.py").write_text(TABLE)
    content = f"vehicle: {raptor_path}\neffect_files: [table.py]\neffects: [{{effect: thrust_table.height}}]\n"
    (tmp_path / "own.yaml").write_text(content)
    done = quadctl("export", tmp_path / "own.yaml", "--to", target, "-o", tmp_path / "body")
    assert done.status == 1
    assert "thrust_table.height cannot be evaluated with symbols" in done.err
    assert "use the functions of quadctl.numeric" in done.err
    assert done.err.count("\n") == 1
