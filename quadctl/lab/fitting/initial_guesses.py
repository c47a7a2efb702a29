"""Initial guesses for the fit of one more effect: the objective has several minima, and some parameters are not
fitted."""

from functools import cached_property

import numpy as np

from quadctl.effects import Effect
from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.fitted_model import FittedModel
from quadctl.lab.fitting.form_errors import FormErrors
from quadctl.lab.fitting.linearisation import Tangent
from quadctl.lab.fitting.noise import noise_scale
from quadctl.lab.flights.dataset import AlignedDataset, Dataset
from quadctl.model import Model


class Unmodelled:
    """Part of the data that a fitted model does not explain, whatever its parameters and the nuisances of the
    flights."""

    def __init__(self, fit: FittedModel) -> None:
        self.model: Model = fit.model
        self.dataset: Dataset = fit.dataset
        self.residual = fit.held_out_residual
        self.unusual_moments = fit.unusual_moments
        self.scale = _trusted(noise_scale(self.residual), fit.dataset)
        self.forms = FormErrors.of(fit)
        self._explained: dict[Effect, float] = {}

    def explained_by(self, effect: Effect) -> float:
        """Squared error, in units of the noise, that `effect` times a fitted factor explains.

        Negative where the factor is negative and the effect is not reversible. It is computed once for each effect.
        """
        if effect not in self._explained:
            change = self._tangent.rest(self._change(effect))
            along = float(np.vdot(change, self._left))
            squared = along * (along if effect.reversible else abs(along))
            self._explained[effect] = squared / max(float(np.vdot(change, change)), 1e-12)
        return self._explained[effect]

    def _change(self, effect: Effect) -> Floats:
        """Change of the predicted targets by `effect`, in units of the noise, shape (n, axes)."""
        return (self._aligned.predicted_targets(self.model.plus(effect)) - self._predicted) / self.scale

    @cached_property
    def _aligned(self) -> AlignedDataset:
        return self.dataset.aligned_for(self.model)

    @cached_property
    def _tangent(self) -> Tangent:
        return Tangent(self.model, self._aligned, self.scale)

    @cached_property
    def _predicted(self) -> Floats:
        return self._aligned.predicted_targets(self.model)

    @cached_property
    def _left(self) -> Floats:
        return self._tangent.rest((self.dataset.targets - self._predicted) / self.scale)


LEAST_SHARE_OF_MOMENT = 0.1
"""Least noise of a moment, as a share of that of all three: a yaw moment that is right to a thousandth of the others
would decide alone which rotor is weak, and a damaged propeller loses another share of its drag than of its thrust."""


def _trusted(scale: Floats, dataset: Dataset) -> Floats:
    """Noise scale of each axis, shape (axes,), with `LEAST_SHARE_OF_MOMENT` for the moments."""
    found = scale.copy()
    if "turning" in dataset.groups:
        first = 3 * dataset.groups.index("turning")
        moments = found[first : first + 3]
        found[first : first + 3] = np.maximum(moments, LEAST_SHARE_OF_MOMENT * np.linalg.norm(moments))
    return found


TIED = 0.02
"""Starts that explain less than the best by no more than this share are all fitted, up to `MAX_GUESSES`."""
MAX_GUESSES = 6


def best_guesses(effect: type[Effect], left: Unmodelled) -> tuple[list[Effect], int]:
    """Guesses that explain most of the unexplained part, and the number of independent guesses that they were chosen
    from."""
    dataset = left.dataset
    flights = [flight.conditions for flight in dataset.flights]
    starts = effect.starts(flights, left.model.vehicle)
    # Of a few rotors each is fitted: beside moments at the bounds of a trim, what explains most to first order may be
    # one that keeps these trims, rather than the one that needs none.
    if len(starts) == 1 or (effect.affects_moment and len(starts) <= MAX_GUESSES):
        return list(starts), len(starts)
    explained = {start: left.explained_by(start) for start in starts}
    joined = effect.joined(explained)
    explained |= {start: left.explained_by(start) for start in joined}
    first = max(explained, key=explained.__getitem__)
    explained |= {start: left.explained_by(start) for start in first.closer(flights)}
    joined = [*joined, *effect.joined(explained)]
    explained |= {start: left.explained_by(start) for start in joined}
    best = sorted(explained, key=lambda start: -explained[start])[:MAX_GUESSES]
    tied = [start for start in best if explained[start] >= explained[best[0]] - TIED * abs(explained[best[0]])]
    independent = min(len(explained), len(np.unique(dataset.block)))
    # One that was joined from the best of each flight is the best of all their combinations.
    return tied, independent ** len(flights) if best[0] in joined else independent
