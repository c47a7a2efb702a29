"""The equations of motion of a model as one Python file that reads as physics and needs NumPy and nothing else.

Each effect is a function of its own, with its parameters as constants above it. Its lines are what the effect's own
code computes, by `terms`.
"""

import inspect
import re
import textwrap
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from quadctl.effects.base import Conditions, Effect, ThrustRatio
from quadctl.export.equations import (
    FAILURES,
    SHARE,
    STATE,
    Actuation,
    actuation,
    cannot_be_evaluated,
    left_out,
    parameters,
)
from quadctl.export.terms import Named, Names, Renamed, Symbol, written
from quadctl.frames import GRAVITY_M_S2
from quadctl.model import Model, StackedEffect
from quadctl.observer import DISTURBANCES, delayed, disturbances, foreseen, lagged, rolled_out, steady_filter
from quadctl.vehicle import Vehicle
from quadctl.words import Fact

WIDTH = 110
"""Width of the text in the file."""


class _Argument(NamedTuple):
    """An argument of an effect's function, and the names of its parts where it has several."""

    name: str
    parts: tuple[str, ...] = ()
    remark: str = ""


VELOCITY = _Argument("velocity", ("u", "v", "w"), "forward, right, down")
ATTITUDE = _Argument("attitude", ("q_w", "q_x", "q_y", "q_z"))
POSITION = _Argument("position", ("north_m", "east_m"))
RATES = _Argument("rates", ("p", "q", "r"), "about forward, right, down, rad/s")
THRUST_RATE = _Argument("thrust_rate")
ARGUMENTS = (
    *(_Argument("thrust_n"), _Argument("total_n"), _Argument("height_m"), VELOCITY, ATTITUDE),
    *(_Argument("time_s"), _Argument("battery_v"), POSITION, RATES, THRUST_RATE),
)
"""Arguments in the order in which they stand."""
_RESERVED = {"np", "known_or", "vector", "to_body", "to_world"}
_OBSERVING = (delayed, lagged, steady_filter, disturbances, foreseen, rolled_out)
"""Functions of the observer, whose text the file holds as it stands."""


class _Function(NamedTuple):
    """A function of the file: how an effect acts in one way."""

    name: str
    text: str
    arguments: tuple[str, ...]

    @property
    def call(self) -> str:
        return f"{self.name}({', '.join(self.arguments)})"


class _Symbols(NamedTuple):
    """Symbols of what an effect's functions take."""

    thrust_n: list[Symbol]
    total_n: Symbol
    here: Conditions
    vehicle: Any


class _Hook(NamedTuple):
    """One way in which an effect may act."""

    ending: str
    """Ending of the function's name, where the effect acts in several ways."""
    said: str
    """Quantity that the function returns."""
    of: Callable[[Any, _Symbols], Any]
    """Result of the effect: a number, or one for each axis or rotor."""


RATIO = _Hook("ratio", "Factor on the thrust of each rotor.", lambda e, s: e.ratio(s.here, s.vehicle))
THRUST = _Hook("thrust", "Thrust of each rotor, N.", lambda e, s: e.rotor_thrust(s.thrust_n, s.here, s.vehicle))
FORCE = _Hook(
    "force", "Force on the body: forward, right, down, N.", lambda e, s: e.force(s.total_n, s.here, s.vehicle)
)
MOMENT = _Hook(
    "moment", "Moment on the body: roll, pitch, yaw, N m.", lambda e, s: e.torque(s.thrust_n, s.here, s.vehicle)
)
WIND = _Hook("velocity", "Velocity of the air: north, east, down, m/s.", lambda e, s: e.wind_ned_m_s(s.here))


def numpy_code(model: Model) -> tuple[str, tuple[Fact, ...]]:
    """Text of the Python file, and what of the model it leaves out.

    Raises
    ------
    SettingsError
        An effect cannot be evaluated with terms.
    """
    return _File(model).text(), left_out(model, actuation(model))


class _File:
    """The parts of the file, which are found while the effects are written."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self._vehicle: Vehicle = model.vehicle
        self._used: dict[str, Any] = {}
        """Constants of the vehicle that the effects use."""
        self._stages: Actuation = actuation(model)
        self._names = parameters(model)
        self._reacts = model.needs_thrust_rate

    def text(self) -> str:
        effects, blocks = self._effects()
        wind = [function for hook, _, function in effects if hook is WIND]
        observes = self._model.observer is not None
        callables = "from collections.abc import Callable\n" if observes else ""
        imports = f"{callables}from types import SimpleNamespace\n\nimport numpy as np"
        parts = [
            f"{self._docstring()}\n\n{imports}\n\n{self._constants()}",
            *blocks,
            _HELPERS,
            self._conditions(wind),
            self._thrust(effects),
            self._motion(effects),
            self._x_dot(),
            self._commanded(),
            *([inspect.getsource(function) for function in _OBSERVING] if observes else []),
            self._observed() if observes else "",
        ]
        return "\n\n\n".join(part.strip("\n") for part in parts if part) + "\n"

    # --- effects ---------------------------------------------------------------------------------------------------

    def _effects(self) -> tuple[list[tuple[_Hook, Effect, _Function]], list[str]]:
        """Functions of all effects, each with its hook and effect, and the text of each effect."""
        found: list[tuple[_Hook, Effect, _Function]] = []
        blocks: list[str] = []
        for item, acting in zip(self._model.stack, self._model.acting, strict=True):
            effect = item.effect
            if effect.adds_lag:
                continue
            hooks = [(hook, acting if hook in (FORCE, MOMENT) else effect) for hook in _hooks(effect, acting)]
            constants = _Constants(replace(item, effect=acting))
            functions = [(hook, self._function(hook, constants.named(of), len(hooks) > 1)) for hook, of in hooks]
            found += [(hook, effect, function) for hook, function in functions]
            if functions:
                body = "\n\n\n".join(function.text for _, function in functions)
                blocks.append(f"# --- {effect.name} ---\n{constants.text(body)}\n\n\n{body}")
        return found, blocks

    def _function(self, hook: _Hook, effect: Effect, is_one_of_several: bool) -> _Function:
        shares = [name for name in self._names if name.startswith(SHARE)]
        each = [f"thrust_n[{i}]" for i in range(self._vehicle.n_rotors)]
        here = Conditions(
            height_m=Symbol("height_m"),
            velocity_body_m_s=(Symbol("u"), Symbol("v"), Symbol("w")),
            attitude=(Symbol("q_w"), Symbol("q_x"), Symbol("q_y"), Symbol("q_z")),
            time_s=Symbol("time_s"),
            battery_v=Symbol("battery_v"),
            position_ne_m=(Symbol("north_m"), Symbol("east_m")),
            surfaces=tuple((name.removeprefix(SHARE), Symbol(name)) for name in shares),
            rates_rad_s=(Symbol("p"), Symbol("q"), Symbol("r")),
            thrust_rate_n_s=[Symbol(f"thrust_rate[{i}]") for i in range(self._vehicle.n_rotors)],
        )
        vehicle = Renamed(self._vehicle, "", self._used)
        names = Names()
        try:
            with names.noted():
                result = hook.of(effect, _Symbols([Symbol(one) for one in each], Symbol("total_n"), here, vehicle))
        except FAILURES as error:
            raise cannot_be_evaluated(effect.name, error) from None
        results = list(result) if isinstance(result, Sequence) else [result]
        arguments = [*ARGUMENTS, *map(_Argument, shares)]
        taken = {part for argument in arguments for part in (argument.name, *argument.parts)} | _RESERVED
        lines, values = written(results, names, taken)
        lines, values = ([_with_sum(text, " + ".join(each)) for text in texts] for texts in (lines, values))
        returned = values[0] if hook is RATIO else _of_all_rotors(values, lines) if hook is THRUST else _vector(values)
        words = set(re.findall(r"\w+", " ".join([*lines, returned])))
        needed = [a for a in arguments if words & {a.name, *a.parts}]
        unpacked = [
            f"{', '.join(a.parts)} = {a.name}{f'  # {a.remark}' if a.remark else ''}" for a in needed if a.parts
        ]
        name = effect.name.replace(".", "_") + (f"_{hook.ending}" if is_one_of_several else "")
        body = [_docstring_of(effect, hook), *unpacked, *map(_short, [*lines, f"return {returned}"])]
        head = f"def {name}({', '.join(a.name for a in needed)}):"
        text = textwrap.indent("\n".join(body), "    ")
        return _Function(name, f"{head}\n{text}", tuple(a.name for a in needed))

    # --- the rest of the file --------------------------------------------------------------------------------------

    def _docstring(self) -> str:
        effects = ", ".join(effect.name for effect in self._model.effects) or "none: the rigid body"
        said = [
            f"Equations of motion of {self._model.name}, written by quadctl. Effects: {effects}.",
            "x_dot takes the nominal thrust of each rotor; x_dot_commanded takes their commands and holds their lag.",
            *([_HOW_OBSERVED] if self._model.observer is not None else []),
            "World axes: north, east, down; body axes: forward, right, down; quaternions: body to world, scalar first.",
            *(f"Not in these equations: {reason}." for reason in left_out(self._model, self._stages)),
        ]
        first, *others = ("\n".join(textwrap.wrap(sentence, WIDTH)) for sentence in said)
        return f'"""{first}\n\n' + "\n".join(others) + '\n"""'

    def _constants(self) -> str:
        vehicle, line = self._vehicle, self._vehicle.throttle
        stages, delay = self._stages, self._model.command_delay_s
        states = stages.states(vehicle.n_rotors)
        lines = [
            _tuple("STATE", STATE),
            *([_tuple("ROTOR_STATES", states)] if states else ["ROTOR_STATES = ()"]),
            _tuple("PARAMETERS", self._names),
            f"N_ROTORS = {vehicle.n_rotors}",
            f"THRUST_N_PER_RPM2 = {vehicle.rotor.thrust_n_per_rpm2!r}  # nominal thrust of a rotor over rpm squared",
            "",
            f"# --- vehicle {vehicle.name} ---",
            f"MASS_KG = {vehicle.mass_kg!r}",
            f"INERTIA_KG_M2 = np.array({list(vehicle.principal_inertia_kg_m2)!r})",
            f"GRAVITY_M_S2 = {GRAVITY_M_S2!r}",
            f"ROTOR_HEIGHT_M = {vehicle.rotor_height_m!r}  # of the rotor plane above the position",
            _array(
                "ROTOR_AXES",
                [[part + 0.0 for part in rotor.axis] for rotor in vehicle.rotors],
                "unit vectors of the thrust",
            ),
            _array("MOMENT_ARMS_M", [list(arm) for arm in vehicle.moment_arms_m], "moment per thrust"),
            f"THROTTLE_OFFSET = {line.offset!r}  # command without thrust",
            f"THROTTLE_PER_NEWTON = {line.per_newton!r}  # command per thrust of all rotors, 1/N",
            *(f"{stage.constant} = {stage.time_constant_s!r}  # s, lag: {stage.said}" for stage in stages.stages),
            *([f"COMMAND_DELAY_S = {delay[0]!r}  # x_dot_commanded takes the command of so long ago"] if delay else []),
            *self._observer(delay is not None),
        ]
        known = {line.partition(" = ")[0] for line in lines}
        for name, value in sorted(self._used.items()):
            if name not in known:
                lines.append(f"{name} = {value!r}" if isinstance(value, float) else _array(name, value))
        return "\n".join(lines)

    def _observer(self, has_delay: bool) -> list[str]:
        """Constants of the observer, where the model has one."""
        observer = self._model.observer
        if observer is None:
            return []
        following = "".join(f"[{stage.constant}] * N_ROTORS + " for stage in self._stages.stages)
        return [
            *([] if has_delay else ["COMMAND_DELAY_S = 0.0"]),
            "",
            "# --- observer of slow forces and moments ---",
            f"STEP_S = {observer.step_s!r}  # of its samples",
            _tuple("DISTURBANCES", DISTURBANCES),
            _array("NOISE", observer.noise.tolist(), "quick, quick_s, slow, slow_s, sensor: as in DISTURBANCES"),
            _array("TRUSTED", observer.trusted.tolist(), "share, damping 1/s of roll_out about roll, pitch, yaw"),
            f"LAGS_S = np.array({following}[*NOISE[:, 1], *NOISE[:, 3]])  # of what stands behind STATE",
        ]

    def _conditions(self, winds: Sequence[_Function]) -> str:
        shares = [f"        {name}=p[{i}]," for i, name in enumerate(self._names) if name.startswith(SHARE)]
        return "\n".join(
            [
                "def conditions(x, p):",
                '    """Flight conditions that the effects depend on, from the state and the parameters."""',
                "    here = SimpleNamespace(",
                "        height_m=ROTOR_HEIGHT_M - x[2],  # of the rotor plane above the ground",
                "        velocity=to_body(x[6:10], x[3:6]),  # relative to the air",
                "        attitude=x[6:10],",
                "        battery_v=p[0],",
                "        time_s=p[1],",
                "        position=x[0:2],",
                "        rates=x[10:13],",
                *(["        thrust_rate=np.zeros(N_ROTORS),  # N/s; x_dot_commanded knows it"] if self._reacts else []),
                *shares,
                "    )",
                *(
                    f"    air = to_body(here.attitude, {_called(wind)})\n    here.velocity = added(here.velocity, -air)"
                    for wind in winds
                ),
                "    return here",
            ]
        )

    def _thrust(self, effects: Sequence[tuple[_Hook, Effect, _Function]]) -> str:
        def function(name: str, said: str, of: Model) -> str:
            lines = []
            for hook, effect, called in effects:
                if effect in of.effects and hook in (RATIO, THRUST):
                    changed = _called(called)
                    lines.append(f"    thrust_n = {f'thrust_n * {changed}' if hook is RATIO else changed}")
            return "\n".join([f"def {name}(thrust_n, here):", f'    """{said}"""', *lines, "    return thrust_n"])

        stages = self._stages
        whole = "Thrust of each rotor, N, from the nominal one: k rpm squared."
        if stages.late is None:
            return function("rotor_thrust", whole, self._model)
        early = function("early_thrust", "Thrust that the rotors follow with the motor lag, N.", stages.before)
        late = function("late_thrust", "Thrust of each rotor, N, from that behind the motor lag.", stages.after)
        both = f'def rotor_thrust(thrust_n, here):\n    """{whole}"""\n'
        return "\n\n\n".join([early, late, both + "    return late_thrust(early_thrust(thrust_n, here), here)"])

    def _motion(self, effects: Sequence[tuple[_Hook, Effect, _Function]]) -> str:
        forces, moments = ([f for hook, _, f in effects if hook is kind] for kind in (FORCE, MOMENT))
        total = any("total_n" in function.arguments for function in forces)
        return "\n".join(
            [
                "def motion(x, thrust_n, here):",
                '    """Time derivative of the state, as in STATE, by the thrust of each rotor."""',
                *(["    total_n = np.sum(thrust_n, axis=0)"] if total else []),
                "    force = ROTOR_AXES.T @ thrust_n",
                *(f"    force = added(force, {_called(function)})" for function in forces),
                "    moment = MOMENT_ARMS_M.T @ thrust_n",
                *(f"    moment = added(moment, {_called(function)})" for function in moments),
                "    north, east, down = to_world(here.attitude, force) / MASS_KG",
                "    roll, pitch, yaw = moment",
                "    j_x, j_y, j_z = INERTIA_KG_M2",
                "    q_w, q_x, q_y, q_z = here.attitude",
                "    p, q, r = x[10:13]  # body rates",
                "    return vector(",
                "        *x[3:6],",
                "        north,",
                "        east,",
                "        down + GRAVITY_M_S2,",
                "        0.5 * (-q_x * p - q_y * q - q_z * r),",
                "        0.5 * (q_w * p + q_y * r - q_z * q),",
                "        0.5 * (q_w * q + q_z * p - q_x * r),",
                "        0.5 * (q_w * r + q_x * q - q_y * p),",
                "        (roll - (j_z - j_y) * q * r) / j_x,",
                "        (pitch - (j_x - j_z) * r * p) / j_y,",
                "        (yaw - (j_y - j_x) * p * q) / j_z,",
                "    )",
            ]
        )

    def _x_dot(self) -> str:
        return "\n".join(
            [
                "def x_dot(x, u, p):",
                '    """Time derivative of the state x, as in STATE, shape (13,) or (13, samples).',
                "",
                "    u: nominal thrust of each rotor, THRUST_N_PER_RPM2 rpm squared, N; p: as in PARAMETERS.",
                '    """',
                "    x, u, p = aligned(x, u, p)",
                "    here = conditions(x, p)",
                "    return motion(x, rotor_thrust(u, here), here)",
            ]
        )

    def _commanded(self) -> str:
        stages, n, at = self._stages, self._vehicle.n_rotors, len(STATE)
        lines, rates, thrust = [], [], "commanded_n"
        if stages.rotors is not None:
            lines.append(f"rotors_n = x[{at}:{at + n}]")
            rates.append(f"(commanded_n - rotors_n) / {stages.rotors.constant}")
            thrust, at = "rotors_n", at + n
        if stages.late is not None:
            lines.append(f"late_n = x[{at}:{at + n}]")
            rates.append(f"(early_thrust({thrust}, here) - late_n) / {stages.late.constant}")
        moved = "late_thrust(late_n, here)" if stages.late is not None else f"rotor_thrust({thrust}, here)"
        if self._reacts and rates:
            lines.append(f"here.thrust_rate = {rates[-1]}")
        result = f"motion(x, {moved}, here)"
        parts = [f"        *{result},", *(f"        *({rate})," for rate in rates)]
        returned = "\n".join(["    return vector(", *parts, "    )"]) if rates else f"    return {result}"
        return "\n".join(
            [
                "def commanded_thrust(u):",
                '    """Nominal thrust of each rotor, N, for a command u, 0..1, by the vehicle\'s throttle line."""',
                "    return np.maximum(u - THROTTLE_OFFSET, 0.0) / (THROTTLE_PER_NEWTON * N_ROTORS)",
                "",
                "",
                "def x_dot_commanded(x, u, p):",
                '    """Time derivative of x, as in STATE and ROTOR_STATES, shape (states,) or (states, samples).',
                "",
                "    u: command of each rotor, 0..1, to which its thrust is proportional; p: as in PARAMETERS.",
                '    """',
                "    x, u, p = aligned(x, u, p)",
                "    here = conditions(x, p)",
                "    commanded_n = commanded_thrust(u)",
                *(f"    {line}" for line in lines),
                returned,
            ]
        )

    def _observed(self) -> str:
        stages, wanted, lines, states = self._stages, "commanded_thrust(u)", [], ["x"]
        if stages.rotors is not None:
            lines.append(f"rotors_n = lagged({wanted}, {stages.rotors.constant}, STEP_S)")
            wanted, states = "rotors_n", [*states, "rotors_n"]
        if stages.late is not None:
            early = f"early_thrust({wanted}, conditions(x, p))"
            lines.append(f"late_n = lagged({early}, {stages.late.constant}, STEP_S)")
            states.append("late_n")
        if lines:
            lines.append(f"x = np.concatenate([{', '.join(states)}])")
        return _OBSERVED.replace("    # rotors\n", "".join(f"    {line}\n" for line in lines))


class _Constants:
    """Parameters of an effect as constants of the file."""

    def __init__(self, item: StackedEffect) -> None:
        self._effect = item.effect
        self._intervals = item.fitted.ci95 if item.fitted is not None else {}

    def named(self, effect: Effect) -> Effect:
        """The effect with its parameters as `Named` numbers, where they are those of the file."""
        own = self._effect.values()
        named = {
            name: Named(own[name], self._name(name)) for name, value in effect.values().items() if value == own[name]
        }
        return replace(effect, **named)

    def text(self, body: str) -> str:
        """Definitions of those that the functions use; the others are told."""
        lines = []
        for p in type(self._effect).parameters():
            value, name = self._effect.values()[p.name], self._name(p.name)
            interval = "[{:.4g}, {:.4g}]".format(*self._intervals[p.name]) if p.name in self._intervals else ""
            told = ", ".join(part for part in (p.unit, p.meaning, interval) if part)
            used = re.search(rf"\b{name}\b", body) is not None
            lines.append(f"{name} = {value!r}  # {told}" if used else f"# {p.name} is {value:g}: {told}")
        return "\n".join(lines)

    def _name(self, parameter: str) -> str:
        return f"{self._effect.family()}_{parameter}".upper()


def _hooks(effect: Effect, acting: Effect) -> Iterator[_Hook]:
    """Ways in which an effect acts."""
    kind = type(effect)
    if kind.acts_by("wind_ned_m_s"):
        yield WIND
    if isinstance(effect, ThrustRatio) and kind.rotor_thrust is ThrustRatio.rotor_thrust:
        yield RATIO
    elif kind.acts_by("rotor_thrust"):
        yield THRUST
    if acting.acts_by("force"):
        yield FORCE
    if acting.acts_by("torque"):
        yield MOMENT


def _of_all_rotors(values: Sequence[str], lines: Sequence[str]) -> str:
    """Expression of the thrusts of all rotors: one for all where they are alike."""
    alike = {re.sub(rf"\bthrust_n\[{i}\]", "thrust_n", value) for i, value in enumerate(values)}
    (one, *others) = alike
    is_alike = not others and "thrust_n[" not in one and not any("thrust_n[" in line for line in lines)
    return one if is_alike else _vector(values)


def _vector(values: Sequence[str]) -> str:
    return f"vector({', '.join(values)})"


def _called(function: _Function) -> str:
    """Call of an effect's function with the conditions that it needs."""
    own = {"thrust_n", "total_n"}
    return f"{function.name}({', '.join(a if a in own else f'here.{a}' for a in function.arguments)})"


def _tuple(name: str, values: Sequence[str]) -> str:
    text = ", ".join(f'"{value}"' for value in values)
    if len(text) < WIDTH - len(name):
        return f"{name} = ({text},)"
    wrapped = textwrap.wrap(text, WIDTH - 4, break_long_words=False)
    return f"{name} = (\n" + "\n".join(f"    {line}" for line in wrapped) + ",\n)"


def _array(name: str, rows: Sequence[Any], remark: str = "") -> str:
    told = f"  # {remark}" if remark else ""
    if not isinstance(rows[0], list):
        return f"{name} = np.array({[*rows]!r}){told}"
    return f"{name} = np.array([{told}\n" + "\n".join(f"    {[*row]!r}," for row in rows) + "\n])"


def _docstring_of(effect: Effect, hook: _Hook) -> str:
    """Docstring of an effect's function: its result, the physics, the source."""
    # A class that is made for a model, as for its surfaces, has its own signature for a docstring.
    written_by_hand = (kind.__doc__ or "" for kind in type(effect).__mro__ if not _has_signature(kind))
    doc = " ".join(next(written_by_hand).split("\n\n")[0].split())
    lines = [
        f'"""{hook.said}',
        "",
        *textwrap.wrap(doc, WIDTH),
        *textwrap.wrap(f"Source: {effect.source}.", WIDTH),
        '"""',
    ]
    return "\n".join(line.replace("\\", "\\\\") for line in lines)


def _has_signature(kind: type) -> bool:
    """True where a class has the docstring that a dataclass gets without one."""
    return (kind.__doc__ or f"{kind.__name__}(").startswith(f"{kind.__name__}(")


def _with_sum(text: str, each: str) -> str:
    """The text, in which the thrusts of all rotors, added one by one, are a sum."""
    return text.replace(f"({each})", "np.sum(thrust_n, axis=0)").replace(each, "np.sum(thrust_n, axis=0)")


def _parted(arguments: str) -> list[str]:
    """Arguments of a call, each for itself."""
    parts, depth = [""], 0
    for sign in arguments:
        depth += (sign in "([") - (sign in ")]")
        if sign == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += sign
    return [part.strip() for part in parts]


_WHOLE: Any = {"break_long_words": False, "break_on_hyphens": False}
"""Options of a wrap that leaves terms whole."""


def _short(line: str) -> str:
    """The line; where it is long, its expression in brackets, broken at blanks."""
    if len(line) <= WIDTH:
        return line
    if line.startswith("return vector("):
        parts = [f"{part}," for part in _parted(line[len("return vector(") : -1])]
        lines = [text for part in parts for text in textwrap.wrap(part, WIDTH - 8, subsequent_indent="    ", **_WHOLE)]
        return "\n".join(["return vector(", *(f"    {text}" for text in lines), ")"])
    begin = "return " if line.startswith("return ") else line[: line.index(" = ") + 3]
    wrapped = textwrap.wrap(line[len(begin) :], WIDTH - 4, **_WHOLE)
    return "\n".join([f"{begin}(", *(f"    {part}" for part in wrapped), ")"])


_HELPERS = '''
def vector(*components):
    """Components of one sample or of many, one below the other."""
    return np.array(np.broadcast_arrays(*components))


def added(a, b):
    return vector(*(one + other for one, other in zip(a, b)))


def aligned(*arrays):
    """The arrays as numbers, those of one sample beside those of many as one that holds for all."""
    arrays = [np.asarray(array, dtype=float) for array in arrays]
    most = max(array.ndim for array in arrays)
    return [array.reshape(array.shape + (1,) * (most - array.ndim)) for array in arrays]


def known_or(value, otherwise):
    """The value, or what stands for it where it is nan."""
    return np.where(np.isnan(value), otherwise, value)


def to_world(attitude, body):
    """A vector in body axes, turned into world axes."""
    (w, x, y, z), (a, b, c) = attitude, body
    t_x, t_y, t_z = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return vector(
        a + w * t_x + y * t_z - z * t_y,
        b + w * t_y + z * t_x - x * t_z,
        c + w * t_z + x * t_y - y * t_x,
    )


def to_body(attitude, world):
    """A vector in world axes, turned into body axes."""
    w, x, y, z = attitude
    return to_world((w, -x, -y, -z), world)
'''

_HOW_OBSERVED = "observed finds rotor states, slow forces and moments in the past; roll_out goes on with them."
_OBSERVED = '''
def sent(u):
    """Commands as the rotors get them, after the delay, shape (rotors, samples) as of u."""
    return delayed(np.asarray(u, dtype=float), COMMAND_DELAY_S, STEP_S)


def observed(x, u, p):
    """States of a flight with ROTOR_STATES and DISTURBANCES behind them, shape (states, samples).

    Each sample knows those before it, and needs two seconds of them. x: as in STATE, shape (13, samples), u: as `sent`
    gives it, shape (rotors, samples), both every STEP_S; p: as in PARAMETERS.
    """
    x, u, p = aligned(x, u, p)
    # rotors
    rate = x_dot_commanded(x, u, p)
    moved, by_model = (np.concatenate([of[3:6], of[10:13]]) for of in (x, rate))
    return np.concatenate([x, disturbances(moved, by_model, NOISE, STEP_S)])


def x_dot_disturbed(x, u, p):
    """Time derivative of x, as in STATE, ROTOR_STATES and DISTURBANCES, which fade; u and p: as x_dot_commanded."""
    at = len(STATE) + len(ROTOR_STATES)
    rate = x_dot_commanded(x[:at], u, p)
    quick, slow = x[at : at + 6], x[at + 6 :]
    rate[3:6] += quick[:3] + slow[:3]
    rate[10:13] += quick[3:] + slow[3:]
    return np.concatenate([rate, (-x[at:].T / LAGS_S[at - len(STATE) :]).T])


def x_dot_foreseen(x, u, p):
    """x_dot_disturbed as a forecast of flights under the same controller trusts it."""
    return foreseen(x_dot_disturbed(x, u, p), x, TRUSTED)


def roll_out(x, u, p):
    """States from x on, every STEP_S, shape (states, steps + 1) or (states, steps + 1, windows).

    u is what the controller of the fitted flights sent: of other commands x_dot_disturbed tells what they do.
    x: as `observed` gives it, shape (states,) or (states, windows); u: as `sent` gives it, at x and at each step,
    shape (rotors, steps + 1) or (rotors, steps + 1, windows); p: as in PARAMETERS.
    """
    return rolled_out(lambda x, u: x_dot_foreseen(x, u, p), np.asarray(x, dtype=float), np.asarray(u), LAGS_S, STEP_S)
'''
"""The observer, with a place for the states of the rotors."""
