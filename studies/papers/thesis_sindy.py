"""Thesis, eq. 13: which terms does sparse identification (SINDy) pick from HOVERING, and would it pick them again?

The target is the thrust ratio K of `thesis_ground_effect`; the functions are of z, the height in rotor radii, w, the
climb rate, and v, the horizontal speed.
"""

import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from quadctl.lab.flights.dataset import FOLDS
from quadctl.lab.flights.flight import Flight
from quadctl.logs.flight_log import Floats
from studies.page import table
from studies.papers.thesis_ground_effect import Points, fit_exponential, of_flight

NAMES = ("z", "w", "v")
TERMS = {
    "1": lambda z, w, v: np.ones_like(z),
    "z": lambda z, w, v: z,
    "z²": lambda z, w, v: z**2,
    "z³": lambda z, w, v: z**3,
    "1/z": lambda z, w, v: 1.0 / z,
    "1/z²": lambda z, w, v: 1.0 / z**2,
    "e^(-z/2)": lambda z, w, v: np.exp(-0.5 * z),
    "e^(-z)": lambda z, w, v: np.exp(-z),
    "w": lambda z, w, v: w,
    "w abs(w)": lambda z, w, v: w * np.abs(w),
    "v²": lambda z, w, v: v**2,
    "w e^(-z)": lambda z, w, v: w * np.exp(-z),
    "v² e^(-z)": lambda z, w, v: v**2 * np.exp(-z),
}
MOST_TERMS = 8
THRESHOLDS = np.geomspace(0.01, 10.0, 16)
RIDGE = 1e-6
DRAWS = 300


class Data(NamedTuple):
    """Features and target at the samples of a flight."""

    features: Floats
    """z/R, climb rate, horizontal speed, shape (n, 3)."""
    ratio: Floats
    block: NDArray[np.int64]

    @property
    def fold(self) -> NDArray[np.int64]:
        return self.block % FOLDS


class Identified(NamedTuple):
    """The sparse expression, and how sure its terms are."""

    coefficients: dict[str, float]
    """Coefficients of the selected terms."""
    frequency: dict[str, float]
    """Share of the resampled flights in which each term of the library is picked."""
    both_exponentials: float
    """Share in which e^(-z/2) and e^(-z) are both picked."""
    same_terms: float
    """Share in which exactly the same terms are picked."""
    rmse: dict[str, tuple[float, float]]
    """Held-out RMSE of K and its standard error over the folds, of each kind of model."""
    thresholded_terms: int
    """Number of terms that sequential thresholding keeps when its threshold is chosen in the same way."""


def data_of(flight: Flight) -> Data:
    """Thrust ratio and features of a prepared flight."""
    points = of_flight(flight)
    u, v, w = (flight.filtered(part) for part in flight.conditions.velocity_body_m_s)
    features = np.column_stack([points.z_m / flight.vehicle.rotor.radius_m, -w, np.hypot(u, v)])
    return Data(features, points.ratio, points.block)


def greedy(terms: float) -> Any:
    """Sparsity as a (whole) number of terms: forward orthogonal least squares."""
    import pysindy

    return pysindy.FROLS(max_iter=int(terms), alpha=RIDGE, normalize_columns=True)


def thresholded(threshold: float) -> Any:
    """Sparsity as a threshold on coefficients of columns of unit length: SINDy's first optimizer."""
    import pysindy

    return pysindy.STLSQ(threshold=threshold, alpha=RIDGE, normalize_columns=True)


def fit(data: Data, optimizer: Any) -> Any:
    """pysindy's model of the thrust ratio."""
    import pysindy

    library = pysindy.CustomLibrary(list(TERMS.values()), [lambda *_, name=name: name for name in TERMS])
    model = pysindy.SINDy(feature_library=library, optimizer=optimizer)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that a threshold leaves no term is an answer here
        model.fit(data.features, t=1.0, x_dot=data.ratio[:, None], feature_names=list(NAMES))
    return model


def coefficients(model: Any) -> Floats:
    """Coefficients of all terms of the library, 0 for those not selected."""
    return np.asarray(model.coefficients()[0], dtype=float)


def part(data: Data, rows: NDArray[Any]) -> Data:
    return Data(data.features[rows], data.ratio[rows], data.block[rows])


def held_out(data: Data, predict: Callable[[Data, Floats], Floats]) -> Floats:
    """RMSE on each fold of what `predict` makes of the other folds, for the features of this one; shape (folds,)."""
    found = []
    for number in range(FOLDS):
        unseen = data.fold == number
        predicted = predict(part(data, ~unseen), data.features[unseen])
        found.append(_rms(predicted - data.ratio[unseen]))
    return np.array(found)


def sparse(optimizer: Callable[[float], Any], sparsity: float) -> Callable[[Data, Floats], Floats]:
    """A rule for `held_out`."""
    return lambda seen, features: np.asarray(fit(seen, optimizer(sparsity)).predict(features)[:, 0])


def sparsest(scores: Floats) -> int:
    """Which of the rows, densest first, is the last within one standard error of the best; scores (rows, folds)."""
    mean = scores.mean(axis=1)
    best = int(np.argmin(mean))
    return int(np.flatnonzero(mean <= mean[best] + _standard_error(scores[best]))[-1])


def identify(data: Data, radius_m: float, draws: int = DRAWS, seed: int = 0) -> Identified:
    """Choose the number of terms on unseen data, fit, and fit again to resampled blocks of time."""
    counts = range(MOST_TERMS, 0, -1)
    terms = counts[sparsest(np.array([held_out(data, sparse(greedy, n)) for n in counts]))]
    by_threshold = np.array([held_out(data, sparse(thresholded, float(t))) for t in THRESHOLDS])
    threshold = float(THRESHOLDS[sparsest(by_threshold)])
    chosen = coefficients(fit(data, greedy(terms)))
    random = np.random.default_rng(seed)
    blocks = [np.flatnonzero(data.block == number) for number in np.unique(data.block)]
    picked = np.array(
        [
            coefficients(fit(part(data, np.concatenate([blocks[i] for i in drawn])), greedy(terms))) != 0.0
            for drawn in random.integers(0, len(blocks), (draws, len(blocks)))
        ]
    )

    names = list(TERMS)

    def compact(seen: Data, features: Floats) -> Floats:
        a, b, c, *_ = fit_exponential(Points(radius_m * seen.features[:, 0], seen.ratio, seen.block), draws=1)
        return np.asarray(a * np.exp(-b * radius_m * features[:, 0]) + c)

    scores = {
        "a constant": held_out(data, lambda seen, features: np.full(len(features), seen.ratio.mean())),
        "the sparse expression": held_out(data, sparse(greedy, terms)),
        "a e^(-b z) + c": held_out(data, compact),
        f"all {len(TERMS)} terms": held_out(data, sparse(thresholded, 0.0)),
    }
    return Identified(
        {name: float(value) for name, value in zip(TERMS, chosen, strict=True) if value},
        {name: float(share) for name, share in zip(TERMS, picked.mean(axis=0), strict=True)},
        float(np.mean(picked[:, names.index("e^(-z/2)")] & picked[:, names.index("e^(-z)")])),
        float(np.mean(np.all(picked == (chosen != 0.0), axis=1))),
        {name: (float(s.mean()), _standard_error(s)) for name, s in scores.items()},
        int(np.count_nonzero(coefficients(fit(data, thresholded(threshold))))),
    )


def _standard_error(scores: Floats) -> float:
    return float(scores.std(ddof=1) / len(scores) ** 0.5)


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def section(flight: Flight) -> str:
    """The part of the page, from the prepared HOVERING log."""
    radius_m = flight.vehicle.rotor.radius_m
    found = identify(data_of(flight), radius_m)
    exponential = found.frequency["e^(-z/2)"] + found.frequency["e^(-z)"] - found.both_exponentials
    terms = [
        [name, f"{found.coefficients[name]:+.4f}" if name in found.coefficients else "", f"{share:.0%}"]
        for name, share in found.frequency.items()
    ]
    scores = [[name, f"{mean:.4f} ± {error:.4f}"] for name, (mean, error) in found.rmse.items()]
    parts = [f"{value:+.3f} {'' if name == '1' else name}".strip() for name, value in found.coefficients.items()]
    expression = " ".join(parts)
    return f"""## Thesis: SINDy on HOVERING (eq. 13)

The thesis finds the form of its equation by SINDy with the functions of its table 1; the functions used here may differ
from those. pysindy (forward orthogonal least squares) selects terms for the thrust ratio K from powers, inverse powers
and exponentials of the height z (in rotor radii), the climb rate w, the horizontal speed v and products of them. The
number of terms is the smallest whose error on held-out blocks of 5 s is within one standard error of the best.

**K = {expression.lstrip("+")}**

{table(["term", "coefficient", f"selected in {DRAWS} resampled flights"], terms)}

Error of K on held-out blocks, ± one standard error over {FOLDS} folds:

{table(["model", "RMSE of K"], scores)}

- Sequential thresholding, SINDy's first optimizer, does not give a sparse expression here: with its threshold chosen in
  the same way, {found.thresholded_terms} of {len(TERMS)} terms remain, with large coefficients of opposite sign that
  cancel each other.
- An exponential of the height is selected in {exponential:.0%} of the resampled flights, which supports the form
  a e^(-b z) + c of the thesis: e^(-z/2) means b = {0.5 / radius_m:.1f} per metre, e^(-z) means
  b = {1.0 / radius_m:.1f} per metre. Neither fitting b nor adding terms lowers the held-out error further.
- Exactly these terms are selected in {found.same_terms:.0%} of the resampled flights. The term of the climb rate is
  uncertain: the climb rate in HOVERING is small, and a delay between height and rotor speed would have the same effect
  on K.
"""
