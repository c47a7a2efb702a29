"""Identification of a formula for the unexplained residual: a sparse expression, then a compact form.

The sparse expression is found by sparse identification of dynamics (SINDy; Brunton, Proctor & Kutz 2016, PNAS 113),
with terms chosen one by one by orthogonal least squares (Billings 2013, as in pysindy) from `library`. The number of
terms, and the decision whether there is a law at all, come from held-out data.
"""

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgWarning

from quadctl.frames import rotate_inverse
from quadctl.lab.arrays import Floats, Mask
from quadctl.lab.fitting.significance import improvement_p_value
from quadctl.lab.flights.dataset import Dataset
from quadctl.lab.symbolic.compact_forms import FittedForm, fit_form, usable_forms
from quadctl.lab.symbolic.formula import FRAME_AXES, Formula, Frame, Law, Symbolic
from quadctl.lab.symbolic.library import Term, library, variables_of
from quadctl.lab.threads import one_blas_thread

MOST_TERMS = 5
MOST_SAMPLES = 2000
"""Largest number of samples in the search for terms; of more, evenly spaced ones are used."""
LAW_P_VALUE = 0.001
"""Largest p-value of a law, after multiplication by the number of axes and lengths tried (Bonferroni). It is stricter
than for a physical effect: terms are chosen from about a hundred, and slow noise resembles some of them."""
TRIED = MOST_TERMS * sum(len(axes) for axes in FRAME_AXES.values())
LAW_SHARE = 0.1
"""Least share of the axis' squared error explained on held-out data: 5 % of its RMSE, as in `diagnose`."""
VARIES = 1e-6
"""Least variation of a term in a part of the data, over that in all of it, by which it can be chosen there."""
DRAWS = 1000


@one_blas_thread
def explain(residual: Floats, dataset: Dataset) -> Symbolic | None:
    """Find a formula for `residual`, measured minus predicted, m/s^2; its first three columns are north, east, up.

    Return None where no term of the library helps significantly on held-out data.
    """
    variables = variables_of(dataset)
    if not variables:
        return None
    terms = library(variables)
    frames = in_frames(residual[:, :3], dataset)
    laws = []
    frame = max(frames, key=lambda name: _reach(frames[name], terms))
    rows = frames[frame]
    for i, axis in enumerate(FRAME_AXES[frame]):
        law = _law(axis, rows, i, terms, variables, dataset)
        if law is not None:
            laws.append((law, law.sparse.held_out_share * float(np.mean(rows[:, i] ** 2))))
    if not laws:
        return None
    ordered = tuple(law for law, _ in sorted(laws, key=lambda pair: -pair[1]))
    ranges = {name: (float(x.min()), float(x.max())) for name, x in variables.items()}
    return Symbolic(frame, ordered, ranges)


def in_frames(residual: Floats, dataset: Dataset) -> dict[Frame, Floats]:
    """Residual along the `FRAME_AXES` of each frame, shape (n, 3)."""
    attitude = [
        np.concatenate([np.interp(f.time_s, f.grid_s, f.conditions.attitude[i]) for f in dataset.flights])
        for i in range(4)
    ]
    length = np.sqrt(sum(q**2 for q in attitude))
    w, x, y, z = (q / length for q in attitude)
    forward, right, down = rotate_inverse((w, x, y, z), (residual[:, 0], residual[:, 1], -residual[:, 2]))
    return {"world": residual, "body": np.column_stack([forward, right, -down])}


def _law(
    axis: str, rows: Floats, i: int, terms: list[Term], variables: dict[str, Floats], dataset: Dataset
) -> Law | None:
    """Law of column `i` of `rows`, or None where held-out data do not support more than a constant."""
    y = rows[:, i]
    held_out = _held_out_paths(y, terms, dataset)
    count = _fewest_as_good([(y - predicted) ** 2 for predicted in held_out], dataset)
    if count == 0:
        return None
    before, change = rows.copy(), np.zeros_like(rows)
    before[:, i] -= held_out[0]
    change[:, i] = held_out[count] - held_out[0]
    p = min(1.0, improvement_p_value(before, change, dataset) * TRIED)
    share = _share(y, held_out[count])
    if p > LAW_P_VALUE or share < LAW_SHARE:
        return None
    chosen = [terms[j] for j in _paths(y, terms, np.ones(len(y), dtype=bool))[count]]
    sparse = _sparse_formula(y, chosen, share, dataset)
    return Law(axis, sparse, _compact_formula(y, sparse.variables, variables, dataset), p)


def _paths(y: Floats, terms: list[Term], used: Mask) -> list[list[int]]:
    """Indices of the best 0, 1, 2, ... terms beside a constant for the samples `used`, chosen one after the other.

    A term that does not vary in these samples, as one that fades with height high above the ground, cannot be chosen.
    Where fewer terms are independent than are asked for, the longest choice stands for those that are missing.
    """
    rows = np.flatnonzero(used)
    rows = rows[:: max(1, len(rows) // MOST_SAMPLES)]
    columns = np.column_stack([term.values[rows] for term in terms])
    columns -= columns.mean(axis=0)
    size = np.linalg.norm(columns, axis=0)
    everywhere = np.array([np.linalg.norm(term.values - term.values.mean()) for term in terms])
    varies = np.flatnonzero(size > VARIES * everywhere)
    target = y[rows] - y[rows].mean()
    target /= max(float(np.linalg.norm(target)), 1e-12)
    # Columns of equal length: the choice must not depend on units, and tiny coefficients must not count as zero.
    chosen = _chosen(columns[:, varies] / size[varies], target)
    paths = [[int(varies[j]) for j in path] for path in chosen]
    most = min(MOST_TERMS, len(terms)) + 1
    return [*paths, *[paths[-1]] * (most - len(paths))]


def _chosen(columns: Floats, target: Floats) -> list[list[int]]:
    """Indices of the best 0, 1, 2, ... columns, as many as are independent."""
    from pysindy import FROLS

    for count in range(min(MOST_TERMS, columns.shape[1]), 0, -1):
        try:
            with warnings.catch_warnings():  # terms that are nearly multiples of each other are equivalent
                warnings.simplefilter("ignore", LinAlgWarning)
                history = FROLS(max_iter=count, alpha=0.0, unbias=False).fit(columns, target).history_
        except ValueError:  # the last columns chosen depend on those before
            continue
        return [[int(j) for j in np.flatnonzero(coefficients[0])] for coefficients in history]
    return [[]]


def _reach(rows: Floats, terms: list[Term]) -> float:
    """Squared residual, summed over the axes, that expressions with the largest number of terms explain in all data."""
    everything = np.ones(len(rows), dtype=bool)
    found = 0.0
    for y in rows.T:
        chosen = [terms[j] for j in _paths(y, terms, everything)[-1]]
        found += float(np.sum(y**2) - np.sum((y - _columns(chosen, len(y)) @ _weights(y, chosen, everything)) ** 2))
    return found


def _held_out_paths(y: Floats, terms: list[Term], dataset: Dataset) -> list[Floats]:
    """Held-out predictions by 0, 1, 2, ... terms and a constant, selected and fitted on the other folds, shape (n,)
    each."""
    predicted: list[Floats] = []
    for number in dataset.folds:
        held = dataset.fold == number
        paths = _paths(y, terms, ~held)
        predicted = predicted or [np.zeros_like(y) for _ in paths]
        for k, path in enumerate(paths):
            chosen = [terms[j] for j in path]
            predicted[k][held] = _columns(chosen, len(y))[held] @ _weights(y, chosen, ~held)
    return predicted


def _columns(chosen: Sequence[Term], n: int) -> Floats:
    """Values of the terms, and a constant as the last column, shape (n, p + 1)."""
    return np.column_stack([*(term.values for term in chosen), np.ones(n)])


def _weights(y: Floats, chosen: Sequence[Term], used: Mask) -> Floats:
    """Least-squares coefficients from the samples `used`; the constant is the last."""
    columns = _columns(chosen, len(y))[used]
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
    return np.asarray(np.linalg.lstsq(columns / size, y[used], rcond=None)[0] / size)


def _fewest_as_good(errors: Sequence[Floats], dataset: Dataset) -> int:
    """Index of the first of these held-out squared errors, simple to complex, within one standard error of the
    smallest.

    The standard error is that of the difference to the smallest, over blocks of time (one-standard-error rule of
    Breiman et al. 1984, paired).
    """
    best = min(range(len(errors)), key=lambda k: float(errors[k].sum()))
    block = np.unique(dataset.block, return_inverse=True)[1]
    for k in range(best):
        excess = np.bincount(block, errors[k] - errors[best])
        if excess.sum() <= np.std(excess, ddof=1) * np.sqrt(len(excess)):
            return k
    return best


def _share(y: Floats, predicted: Floats) -> float:
    return 1.0 - float(np.sum((y - predicted) ** 2) / np.sum(y**2))


def _sparse_formula(y: Floats, chosen: list[Term], share: float, dataset: Dataset) -> Formula:
    weights = _weights(y, chosen, np.ones(len(y), dtype=bool))
    names = [*(f"k{i}" for i in range(1, len(chosen) + 1)), "c"]
    parts = [f"{{{name}}}*{term.text}" for name, term in zip(names, chosen, strict=False)]
    jacobian = _columns(chosen, len(y))
    predicted = jacobian @ weights
    return Formula(
        parts=(*(part.replace("*1/", "/") for part in parts), "{c}"),
        variables=tuple(dict.fromkeys(name for term in chosen for name in term.variables)),
        coefficients=dict(zip(names, map(float, weights), strict=True)),
        ci95=_intervals(names, weights, jacobian, y - predicted, dataset.block),
        bounds={name: _wide(weight) for name, weight in zip(names, weights, strict=True)},
        held_out_share=share,
        predicted=predicted,
    )


def _compact_formula(y: Floats, names: Sequence[str], variables: dict[str, Floats], dataset: Dataset) -> Formula:
    """Fit a compact form of that variable of `names` on which it comes closest."""
    closest = {
        name: min(_error(fit_form(f, variables[name], y), variables[name], y) for f in usable_forms(variables[name]))
        for name in names
    }
    name = min(closest, key=lambda n: closest[n])
    x = variables[name]
    forms = usable_forms(x)
    held_out = []
    for form in forms:
        predicted = np.zeros_like(y)
        for number in dataset.folds:
            held = dataset.fold == number
            predicted[held] = form(x[held], fit_form(form, x[~held], y[~held]).values)
        held_out.append(predicted)
    best = _fewest_as_good([(y - predicted) ** 2 for predicted in held_out], dataset)
    fitted = fit_form(forms[best], x, y)
    own = fitted.form.names
    predicted = fitted.form(x, fitted.values)
    middle = (float(x.min()), float(x.max()))
    return Formula(
        parts=(fitted.form.template.replace("{x}", name), "{c}"),
        variables=(name,),
        coefficients=dict(zip(own, map(float, fitted.values), strict=True)),
        ci95=_intervals(own, fitted.values, fitted.jacobian, y - predicted, dataset.block),
        bounds={n: middle if n == "m" else _wide(v, n in "bw") for n, v in zip(own, fitted.values, strict=True)},
        held_out_share=_share(y, held_out[best]),
        predicted=predicted,
    )


def _error(fitted: FittedForm, x: Floats, y: Floats) -> float:
    return float(np.sum((y - fitted.form(x, fitted.values)) ** 2))


def _wide(value: float, of_one_sign: bool = False) -> tuple[float, float]:
    """Bounds of a coefficient in a refit, up to about five times its value."""
    ends = (value / 5.0, 5.0 * value) if of_one_sign else (-5.0 * abs(value) - 0.01, 5.0 * abs(value) + 0.01)
    return min(ends), max(ends)


def _intervals(
    names: Sequence[str], values: Floats, jacobian: Floats, left: Floats, block: NDArray[np.int64]
) -> dict[str, tuple[float, float]]:
    """95 % intervals by bootstrap over blocks of time, with least squares to first order.

    `jacobian`: d prediction / d value at the samples, shape (n, p); `left`: residual of the fit, shape (n,).
    """
    size = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-12)
    j = jacobian / size
    place = np.unique(block, return_inverse=True)[1]
    count = int(place.max()) + 1
    normal, gradient = np.zeros((count, len(values), len(values))), np.zeros((count, len(values)))
    np.add.at(normal, place, j[:, :, None] * j[:, None, :])
    np.add.at(gradient, place, j * left[:, None])
    random = np.random.default_rng(0)
    times = random.multinomial(count, np.full(count, 1.0 / count), DRAWS).astype(float)
    ridge = 1e-9 * np.eye(len(values))
    steps = np.linalg.solve(np.tensordot(times, normal, axes=1) + ridge, (times @ gradient)[..., None])[..., 0]
    low, high = np.percentile(values + steps / size, [2.5, 97.5], axis=0)
    return {name: (float(a), float(b)) for name, a, b in zip(names, low, high, strict=True)}
