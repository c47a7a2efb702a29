"""The equations of motion of a model as one Python file that needs NumPy and nothing else.

The instructions of the CasADi function, one line each: the same numbers, without quadctl and without CasADi.
"""

import casadi as ca

from quadctl.errors import SettingsError
from quadctl.export.dynamics import PARAMETERS, STATE, Dynamics
from quadctl.model import Model

_UNARY = {
    ca.OP_ASSIGN: "{0}", ca.OP_NEG: "-{0}", ca.OP_EXP: "np.exp({0})", ca.OP_LOG: "np.log({0})",
    ca.OP_SQRT: "np.sqrt({0})", ca.OP_SQ: "{0} * {0}", ca.OP_TWICE: "2.0 * {0}", ca.OP_INV: "1.0 / {0}",
    ca.OP_SIN: "np.sin({0})", ca.OP_COS: "np.cos({0})", ca.OP_TAN: "np.tan({0})", ca.OP_ASIN: "np.arcsin({0})",
    ca.OP_ACOS: "np.arccos({0})", ca.OP_ATAN: "np.arctan({0})", ca.OP_FABS: "np.abs({0})", ca.OP_SIGN: "np.sign({0})",
    ca.OP_NOT: "1.0 * ({0} == 0.0)", ca.OP_FLOOR: "np.floor({0})", ca.OP_CEIL: "np.ceil({0})",
    ca.OP_TANH: "np.tanh({0})",
}  # fmt: skip
_BINARY = {
    ca.OP_ADD: "{0} + {1}", ca.OP_SUB: "{0} - {1}", ca.OP_MUL: "{0} * {1}", ca.OP_DIV: "{0} / {1}",
    ca.OP_POW: "{0} ** {1}", ca.OP_CONSTPOW: "{0} ** {1}", ca.OP_FMIN: "np.fmin({0}, {1})",
    ca.OP_FMAX: "np.fmax({0}, {1})", ca.OP_ATAN2: "np.arctan2({0}, {1})", ca.OP_LT: "1.0 * ({0} < {1})",
    ca.OP_LE: "1.0 * ({0} <= {1})", ca.OP_EQ: "1.0 * ({0} == {1})", ca.OP_NE: "1.0 * ({0} != {1})",
    ca.OP_AND: "1.0 * (({0} != 0.0) & ({1} != 0.0))", ca.OP_OR: "1.0 * (({0} != 0.0) | ({1} != 0.0))",
    ca.OP_IF_ELSE_ZERO: "np.where({0} != 0.0, {1}, 0.0)", ca.OP_HYPOT: "np.hypot({0}, {1})",
}  # fmt: skip


def numpy_code(model: Model, equations: Dynamics, title: str) -> str:
    """Text of the Python file; `title` says where the model comes from."""
    function = equations.function
    body = [line for i in range(function.n_instructions()) if (line := _line(function, i))]
    outputs = ", ".join(f"d{i}" for i in range(len(STATE)))
    left_out = [f"Not in these equations: {reason}." for reason in equations.left_out]
    effects = ", ".join(effect.name for effect in model.effects) or "none: the rigid body"
    return "\n".join(
        [
            f'"""Equations of motion of {title}, written by quadctl. Effects: {effects}.',
            *left_out,
            '"""',
            "",
            "import numpy as np",
            "",
            f"STATE = {STATE!r}",
            f"PARAMETERS = {PARAMETERS!r}",
            f"N_ROTORS = {model.vehicle.n_rotors}",
            f"THRUST_N_PER_RPM2 = {model.vehicle.rotor.thrust_n_per_rpm2!r}",
            "",
            "",
            "def x_dot(x, u, p):",
            '    """Time derivative of the state x, as in STATE, shape (13,) or (13, samples).',
            "",
            "    u: nominal thrust of each rotor, THRUST_N_PER_RPM2 rpm squared, N; p: as in PARAMETERS.",
            "    World axes are north, east, down; body axes forward, right, down.",
            '    """',
            "    inputs = (x, u, p)",
            '    with np.errstate(all="ignore"):  # both sides of a choice are computed',
            *(f"        {line}" for line in body),
            f"    return np.array(np.broadcast_arrays({outputs}))",
            "",
        ]
    )


def _line(function: ca.Function, i: int) -> str:
    """One instruction, or nothing where it has no effect."""
    kind, inputs, outputs = function.instruction_id(i), function.instruction_input(i), function.instruction_output(i)
    if kind == ca.OP_CONST:
        return f"a{outputs[0]} = {function.instruction_constant(i)!r}"
    if kind == ca.OP_INPUT:
        return f"a{outputs[0]} = inputs[{inputs[0]}][{inputs[1]}]"
    if kind == ca.OP_OUTPUT:
        return f"d{outputs[1]} = a{inputs[0]}"
    form = _UNARY.get(kind) or _BINARY.get(kind)
    if form is None:
        raise SettingsError(
            f"an effect of the model uses instruction {kind} of CasADi, which has no form in NumPy, expected those of "
            "quadctl.numeric: export to casadi instead"
        )
    return f"a{outputs[0]} = {form.format(*(f'a{k}' for k in inputs))}"
