"""Dena et al.: does the order of their models M1 to M4 and PM come out of a world that obeys PM?

Their flights are not public, and the k_s of their surfaces, the spacing of the heights and the noise are not printed.
So flights are drawn from the `surface` variant, on RAPTOR's geometry, and what is not known is scanned.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from quadctl.effects.ground_effect import Cheeseman, Danjun, Surface, quadrotor_ratio
from quadctl.logs.flight_log import Floats
from quadctl.vehicle import Vehicle
from studies.page import save

MODELS = ("M1", "M2", "M3", "M4", "PM")
SURFACES = ("turf", "dirt", "dry soil", "irregular dry soil")
FLIGHTS = 3
"""Number of flights over each surface: 12 data sets in all."""
HEIGHTS_M = np.linspace(1.0, 0.21, 13)
K_B = 0.4509
SPREADS = (0.1, 0.2, 0.4)
"""k_s of the four surfaces are spread evenly from minus this to this."""
NOISES = (0.0, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05)
"""Standard deviation of one hover's mean thrust over that far from the ground: 0.01 is 1 % of the weight."""
DRAWS = 400


def world(vehicle: Vehicle, spread: float, k_b: float = K_B) -> Floats:
    """True K at each height over each surface, shape (surfaces, heights)."""
    k_s = spread * np.linspace(-1.0, 1.0, len(SURFACES))
    return np.array([Surface(k_b, float(k)).at_height(HEIGHTS_M, vehicle) for k in k_s])


class Family(NamedTuple):
    """One-parameter models on a grid: the fit is the nearest of its curves."""

    parameter: Floats
    """Shape (n,)."""
    curves: Floats
    """K at each height, shape (n, heights)."""
    squares: Floats
    """Sum of the squares of each curve, shape (n,)."""

    @classmethod
    def of(cls, curve: Callable[[float], Floats], parameter: Floats) -> "Family":
        curves = np.array([curve(float(p)) for p in parameter])
        return cls(parameter, curves, (curves**2).sum(axis=1))

    def nearest(self, mean: Floats) -> int:
        """Which curve has the smallest squared error to `mean`, shape (heights,)."""
        return int(np.argmin(self.squares - 2.0 * self.curves @ mean))


class Rivals(NamedTuple):
    """The five models on one vehicle."""

    cheeseman: Floats
    danjun: Family
    fountain: Family

    @classmethod
    def of(cls, vehicle: Vehicle) -> "Rivals":
        return cls(
            np.asarray(Cheeseman().at_height(HEIGHTS_M, vehicle)),
            Family.of(lambda rho: np.asarray(Danjun(rho).at_height(HEIGHTS_M, vehicle)), np.linspace(0.0, 20.0, 4001)),
            Family.of(lambda k: np.asarray(quadrotor_ratio(HEIGHTS_M, vehicle, k)), np.linspace(0.0, 6.0, 6001)),
        )

    def fitted(self, model: str, seen: Floats) -> Floats:
        """K by a model fitted to `seen`, shape (flights, surfaces, heights); gives (surfaces, heights)."""
        over_flights: Floats = seen.mean(axis=0)
        if model == "PM":
            return np.array([self.fountain.curves[self.fountain.nearest(row)] for row in over_flights])
        over_all: Floats = over_flights.mean(axis=0)
        curve = self.cheeseman
        if model == "M2":
            curve = self.danjun.curves[self.danjun.nearest(over_all)]
        elif model in ("M3", "M4"):
            curve = self.fountain.curves[0 if model == "M3" else self.fountain.nearest(over_all)]
        return np.tile(curve, (len(over_flights), 1))


def errors(flights: Floats, rivals: Rivals) -> Floats:
    """RMSE of K on the flight of each surface that was not fitted, pooled, shape (models,)."""
    squares = np.zeros(len(MODELS))
    for held in range(len(flights)):
        seen = np.delete(flights, held, axis=0)
        for i, model in enumerate(MODELS):
            squares[i] += np.mean((rivals.fitted(model, seen) - flights[held]) ** 2)
    return np.sqrt(squares / len(flights))


class Outcome(NamedTuple):
    """Results at one noise level and spread, over many draws."""

    rmse: Floats
    """Mean over the draws, shape (models,)."""
    pm_best: float
    """Share of draws in which PM has the smallest error on unseen flights."""
    whole_order: float
    """Share in which M1 > M3 > M2 > M4 > PM comes out, the order without noise."""


ORDER = ("M1", "M3", "M2", "M4", "PM")
"""Largest error first."""


def simulate(
    vehicle: Vehicle, rivals: Rivals, spread: float, noise: float, draws: int = DRAWS, seed: int = 0
) -> Outcome:
    """Draw the 12 data sets again and again; without noise once is enough."""
    random = np.random.default_rng(seed)
    truth = world(vehicle, spread)
    shape = (draws if noise else 1, FLIGHTS, *truth.shape)
    rmse = np.array([errors(truth + noise * drawn, rivals) for drawn in random.standard_normal(shape)])
    ranked = rmse[:, [MODELS.index(model) for model in ORDER]]
    return Outcome(
        rmse.mean(axis=0),
        float(np.mean(rmse.argmin(axis=1) == MODELS.index("PM"))),
        float(np.mean(np.all(np.diff(ranked, axis=1) < 0.0, axis=1))),
    )


def names_in_order_below(vehicle: Vehicle, rivals: Rivals) -> float:
    """k_b below which M3 is better than M2, so that the errors fall in the order of the names M1, M2, M3, M4."""

    def gap(k_b: float) -> float:
        truth = world(vehicle, 0.0, k_b)[None]
        m2, m3 = (float(np.sum((rivals.fitted(model, truth) - truth[0]) ** 2)) for model in ("M2", "M3"))
        return m2 - m3

    return float(brentq(gap, 0.05, 1.5))


def section(vehicle: Vehicle, draws: int = DRAWS) -> str:
    """The part of the page."""
    rivals = Rivals.of(vehicle)
    outcomes = {(s, n): simulate(vehicle, rivals, s, n, draws) for s in SPREADS for n in NOISES}
    clean = outcomes[SPREADS[1], 0.0]
    rho = rivals.danjun.parameter[rivals.danjun.nearest(world(vehicle, 0.0)[0])]
    models = [f"{m} {rmse:.4f}" for m, rmse in zip(MODELS, clean.rmse, strict=True)]
    return f"""## Dena et al.: M1 to M4 and PM on four surfaces

Simulated, as the flights are not public: {len(SURFACES)} surfaces, {FLIGHTS} flights over each, 13 heights,
k_b = {K_B},
k_s evenly spaced.

RMSE of K on unseen flights without noise, k_s = ±{SPREADS[1]}: {", ".join(models)}.

{_figure(outcomes)}

- {_kept(outcomes)} With more noise 12 data sets cannot show that PM is the true model.
- M3 is better than M2 only if k_b is below {names_in_order_below(vehicle, rivals):.2f}. The fitted rho of M2 is
  {rho:.2f} (Dena et al.: 3.65).
"""


def _kept(outcomes: dict[tuple[float, float], Outcome]) -> str:
    parts = []
    for spread in SPREADS:
        kept = [noise for noise in NOISES if outcomes[spread, noise].pm_best >= 0.95]
        parts.append(f"{max(kept):.1%} for k_s = ±{spread}")
    return f"PM is best in 95 % of {DRAWS} draws up to a noise of one hover of {', '.join(parts)}."


def _figure(outcomes: dict[tuple[float, float], Outcome]) -> str:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 3.4), layout="constrained")
    axes = figure.subplots()
    for i, model in enumerate(MODELS):
        levels = NOISES[1:]
        axes.loglog(levels, [outcomes[SPREADS[1], noise].rmse[i] for noise in levels], "o-", label=model)
    axes.loglog(NOISES[1:], NOISES[1:], "k:", label="the noise itself")
    axes.set(xlabel="noise of one hover (of K)", ylabel=f"RMSE of K on unseen flights, k_s = ±{SPREADS[1]}")
    axes.legend(fontsize="small")
    axes.grid(alpha=0.3, which="both")
    return save(figure, "dena", "Error of M1 to M4 and PM on unseen flights over the noise")
