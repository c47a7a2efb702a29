"""Form errors: changes of the prediction where the effects of a fitted model have another form than the true one.

The form of an effect is never exactly the true one, and what it leaves is a function of the same variables: a battery
whose thrust falls a little differently leaves a function of the voltage, which in a descent is a function of the height
as well. So an effect that is found beside a larger one must explain more than that. The error of a form is taken for a
random smooth function (Kennedy & O'Hagan 2001, J. R. Stat. Soc. B 63, on the discrepancy of a model).
"""

import math
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.consider_parameters import FORM
from quadctl.lab.fitting.fitted_model import FittedModel
from quadctl.lab.flights.velocity_scale import velocity_scale_errors

WAVES = np.arange(1, 7)
"""Numbers of half-waves over the range of a variable: the smooth functions."""
SHARES = 1.0 / WAVES / math.sqrt(float(np.sum(1.0 / WAVES**2)))
"""Standard deviation of each: the shorter the wave, the smaller; together they have a variance of 1."""


@dataclass(frozen=True, eq=False)
class FormErrors:
    """Errors of the forms of a model's effects: random functions of the variables on which each depends.

    Their standard deviation is `FORM` of the effect, and at least of its root mean square. The errors of the axes are
    independent of each other. An effect that depends on no variable has no form. The measured acceleration is among
    them: it may be off by as much as the velocity is (see `velocity_scale_errors`).
    """

    sizes: tuple[Floats, ...]
    """Standard deviation of each effect's error, shape (n, 3 * groups)."""
    waves: tuple[Floats, ...]
    """Smooth functions of the variables of each effect, of a mean square of about 1 together, shape (n, functions)."""

    @classmethod
    def of(cls, fit: FittedModel, known: Collection[str] = ()) -> "FormErrors":
        """Form errors of a fitted model; effects whose names are `known` have none."""
        dataset, model = fit.fitter.dataset, fit.model
        sizes, waves = [], []
        for effect in model.effects:
            varied = [x for name in effect.depends_on if (x := dataset.variable(name)) is not None and np.ptp(x) > 0.0]
            if not varied or effect.name in known:
                continue
            does = dataset.predicted_targets(model) - dataset.predicted_targets(model.without(effect))
            sizes.append(FORM * np.hypot(does, np.sqrt(np.mean(does**2, axis=0))))
            waves.append(np.concatenate([_waves(x) for x in varied], axis=1) / math.sqrt(len(varied)))
        of_acceleration = np.zeros(dataset.targets.shape)
        of_acceleration[:, :3] = np.concatenate([f.measured * velocity_scale_errors(f) for f in dataset.flights])
        sizes.append(of_acceleration)
        waves.append(np.ones((len(dataset.targets), 1)))
        return cls(tuple(sizes), tuple(waves))

    def variance_of_sum(self, weights: Floats) -> float:
        """Variance of sum(weights * error); `weights` are those of the first axes, shape (n, axes)."""
        axes = weights.shape[1]
        sums = [(weights * size[:, :axes]).T @ waves for size, waves in zip(self.sizes, self.waves, strict=True)]
        return float(sum(np.sum(one**2) for one in sums))


def _waves(x: Floats) -> Floats:
    """Smooth functions of a variable that varies, shape (n, waves)."""
    along = (x - x.min()) / np.ptp(x)
    return np.asarray(math.sqrt(2.0) * SHARES * np.cos(math.pi * along[:, None] * WAVES))
