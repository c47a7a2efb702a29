"""Compact forms: a constant plus one function of one variable, whose few parameters are fitted together.

The form a exp(b z) + c is that of the thesis by Appius; the others are alternatives to it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from quadctl.lab.arrays import Floats

Shape = Callable[..., Floats]


_overflow_allowed = np.errstate(over="ignore", invalid="ignore", divide="ignore")
"""Decorator that permits overflow: an exponential of a variable far from 0 overflows, and such a parameter is rejected
because its error is infinite. scipy's solver divides by the derivative of a parameter that no longer matters."""


@dataclass(frozen=True)
class Form:
    """Compact form a * shape(x, *parameters) + c."""

    template: str
    """Python text of a * shape with the parameters in braces, and `{x}` for the variable."""
    shape: Shape
    parameters: tuple[str, ...] = ()
    """Names of the nonlinear parameters, those of the shape."""
    positive: bool = False
    """True where the variable must be above 0."""

    @property
    def names(self) -> tuple[str, ...]:
        return ("a", *self.parameters, "c")

    @_overflow_allowed
    def __call__(self, x: Floats, values: Floats) -> Floats:
        """Value at `x` for the parameters in the order of `names`."""
        return np.asarray(values[0] * self.shape(x, *values[1:-1]) + values[-1])


FORMS = (
    Form("{a}*{x}", lambda x: x),
    Form("{a}*{x}*abs({x})", lambda x: x * np.abs(x)),
    Form("{a}/{x}**2", lambda x: 1.0 / x**2, positive=True),
    Form("{a}*exp(-{b}*{x})", lambda x, b: np.exp(-b * x), ("b",)),
    Form("{a}*exp(-(({x} - {m})/{w})**2)", lambda x, m, w: np.exp(-(((x - m) / w) ** 2)), ("m", "w")),
    Form("{a}*({x} - {m})/(({x} - {m})**2 + {w}**2)", lambda x, m, w: (x - m) / ((x - m) ** 2 + w**2), ("m", "w")),
)
"""Forms, sorted by their number of parameters; the last two are a bump, and attraction to or repulsion from a point."""


@dataclass(frozen=True, eq=False)
class FittedForm:
    """Form with its fitted parameters, in the order of `Form.names`, and its Jacobian at the samples, shape (n, p)."""

    form: Form
    values: Floats
    jacobian: Floats


def usable_forms(x: Floats) -> list[Form]:
    return [form for form in FORMS if not form.positive or x.min() > 0.1]


@_overflow_allowed
def fit_form(form: Form, x: Floats, y: Floats) -> FittedForm:
    """Fit `form` to `y` by least squares, from the best initial guess of the shape's parameters on a grid.

    Initial guesses and steps at which the form is not finite at all samples are rejected.
    """
    low, high = _bounds(form, x)
    best, least = np.zeros(len(form.names)), np.inf
    for start in _starts(form, x):
        columns = np.column_stack([form.shape(x, *start), np.ones_like(x)])
        if not np.isfinite(columns).all():
            continue
        (a, c), *_ = np.linalg.lstsq(columns, y, rcond=None)
        values = np.clip(np.array([a, *start, c]), low, high)
        error = float(np.sum((y - form(x, values)) ** 2))
        if error < least:
            best, least = values, error

    def left(values: Floats) -> Floats:
        return form(x, values) - y

    scale = np.maximum(np.abs(best), 1e-6)
    # The solver shortens a step that leads to where the residual is not finite.
    result = least_squares(left, best, bounds=(low, high), x_scale=scale, max_nfev=50)
    return FittedForm(form, np.asarray(result.x), np.asarray(result.jac))


def _starts(form: Form, x: Floats) -> list[tuple[float, ...]]:
    low, high = np.percentile(x, [1.0, 99.0])
    reach = float(high - low)
    if form.parameters == ("b",):
        return [(sign * rate / reach,) for rate in (1.0, 3.0, 10.0) for sign in (1.0, -1.0)]
    if form.parameters == ("m", "w"):
        places = (*np.linspace(low, high, 9), *np.quantile(x, np.linspace(0.1, 0.9, 5)))
        return [(float(m), part * reach) for m in places for part in (0.08, 0.2, 0.5)]
    return [()]


def _bounds(form: Form, x: Floats) -> tuple[Floats, Floats]:
    """Bounds of the parameters: no feature narrower than a thirtieth of the range, and no bump outside the data."""
    low, high = np.percentile(x, [1.0, 99.0])
    reach = float(high - low)
    limits = {
        "b": (-30.0 / reach, 30.0 / reach),
        "m": (float(x.min()), float(x.max())),
        "w": (reach / 30.0, 2.0 * reach),
    }
    ends = np.array([limits.get(name, (-np.inf, np.inf)) for name in form.names])
    return ends[:, 0], ends[:, 1]
