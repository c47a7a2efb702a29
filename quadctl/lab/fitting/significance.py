"""Significance tests of held-out errors, with the autocorrelation of the residual accounted for."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy import special
from scipy.fft import rfft

from quadctl.lab.arrays import Floats
from quadctl.lab.fitting.form_errors import FormErrors
from quadctl.lab.fitting.noise import LEAST_VARIANCE, Noise
from quadctl.lab.flights.dataset import Dataset

NO_CHANGE = 1e-3
"""Least change of the prediction relative to the residual that is tested; a smaller change comes from the convergence
of the fit."""
FEW_BLOCKS = 3.0
"""Number of blocks of time, by their shares of the evidence, below which it may be a burst of noise."""
LEAST_FLIGHTS = 4
"""Least number of flights whose differences are the noise; fewer say nothing of an effect in one of them."""


def improvement_p_value(
    before: Floats, predicted_change: Floats, dataset: Dataset, forms: FormErrors | None = None
) -> float:
    """One-sided p-value of the hypothesis that a candidate's change of the prediction does not explain the residual.

    `before` is the residual without the candidate and `predicted_change` the held-out change of the prediction by the
    candidate, both of shape (n, axes), for the first axes of the `targets` of `dataset`. For an irrelevant candidate
    their product has mean zero (Clark & West 2007, J. Econometrics 138, test for nested models), but for what errors of
    the logged inputs give, which is subtracted (see `_attenuation`). The variance of the sum comes from the residual
    with the candidate (see `_variance_of_sum`), and from `forms`, the errors of the forms of the effects that the model
    holds without the candidate.
    """
    after = before - predicted_change
    used = [
        axis
        for axis in range(before.shape[1])
        if np.mean(predicted_change[:, axis] ** 2) >= NO_CHANGE**2 * _power(after[:, axis])
    ]
    if not used:
        return 1.0
    weights = predicted_change[:, used] / np.array([_power(after[:, axis]) for axis in used])
    score = float(np.sum(weights * before[:, used]))
    predicted = (dataset.targets[:, : before.shape[1]] - before)[:, used]
    by_errors = sum(_attenuation(weights[part], predicted[part], after[part][:, used]) for part in dataset.parts)
    variance, degrees = _variance_of_sum(weights, after[:, used], dataset)
    if forms is not None:
        every = np.zeros(before.shape)
        every[:, used] = weights
        of_noise, variance = variance, variance + forms.variance_of_sum(every)
        # Welch & Satterthwaite: the size of a form's error is not estimated from these data.
        degrees *= (variance / of_noise) ** 2
    return float(special.stdtr(degrees, (by_errors - score) / math.sqrt(variance)))


def _attenuation(weights: Floats, predicted: Floats, noise: Floats) -> float:
    """Largest mean of sum(weights * noise) that errors of the logged inputs give in one flight, shape (n, axes) each.

    Noise of a rotor speed or an attitude is in the prediction and, with the opposite sign, in the residual; so is the
    answer of a controller to a disturbance. Whatever lowers the gain of the prediction then lowers the residual, too:
    the errors in variables of a regression. The power of such errors is at most that of the residual and that of the
    prediction, at each frequency (the bound of Klepper & Leamer 1984, Econometrica 52, for one regressor; octave by
    octave, as the share of noise differs). Constant parts belong to the biases.
    """
    change, gain, error = (rfft(values, axis=0) for values in (weights, predicted, noise))
    largest = 0.0
    begin = 1
    while begin < len(change):
        octave = slice(begin, 2 * begin)
        begin *= 2
        power, left = (np.sum(np.abs(part[octave]) ** 2, axis=0) for part in (gain, error))
        lowered = -np.sum((change[octave] * np.conj(gain[octave])).real, axis=0)
        share = np.minimum(left / np.maximum(power, LEAST_VARIANCE), 1.0)
        largest += 2.0 * float(np.maximum(lowered, 0.0) @ share) / len(noise)
    return largest


def _variance_of_sum(weights: Floats, noise: Floats, dataset: Dataset) -> tuple[float, float]:
    """Variance of sum(weights * noise), shape (n, axes) each, and its degrees of freedom.

    Residuals of flights stay correlated for tens of seconds, so the variance comes from the spectrum of the noise (see
    `spectrum`). Where flights differ by more than that tells (F test), they are the unit; so are blocks of time where
    all evidence is in a few of them: noise has bursts, and what explains one of them is seen once only.
    """
    spectral = Noise(noise, dataset.parts, fitted=weights)
    variance, degrees = float(spectral.variances_of_sum(weights).sum()), float(spectral.degrees)
    by_block, by_flight = (_batch_variance(weights, noise, unit) for unit in (dataset.block, dataset.flight_index))
    units = [by_block] if by_block[1] < FEW_BLOCKS - 1.0 else []
    units += [by_flight] if len(dataset.flights) >= LEAST_FLIGHTS else []
    for between, seen in units:
        if between > variance * float(special.fdtri(seen, degrees, 0.95)):
            variance, degrees = between, seen
    return variance, degrees


def _batch_variance(weights: Floats, noise: Floats, batch: NDArray[np.int64]) -> tuple[float, float]:
    """Variance of sum(weights * noise) from its parts in each batch of samples, and its degrees of freedom.

    A batch counts by its share of the weights' power (Bell & McCaffrey 2002, Surv. Methodol. 28, for batches that are
    independent and equally noisy).
    """
    number = np.unique(batch, return_inverse=True)[1]
    sums = np.bincount(number, np.sum(weights * noise, axis=1))
    power = np.bincount(number, np.sum(weights**2 * np.mean(noise**2, axis=0), axis=1))
    batches = float(power.sum() ** 2 / max(float(np.sum(power**2)), LEAST_VARIANCE))
    seen = max(batches - 1.0, 1.0)
    return float(sums @ sums) * len(sums) / max(len(sums) - 1, 1), seen


def difference_p_value(better: Floats, other: Floats, dataset: Dataset) -> float:
    """Two-sided p-value of the difference of two held-out residuals, by blocks of time (paired t test).

    Used for candidates that do not contain each other; axes are weighted by their noise in `better`.
    """
    power = np.array([_power(better[:, axis]) for axis in range(better.shape[1])])
    gain = ((other**2 - better**2) / power).sum(axis=1)
    blocks = np.unique(dataset.block, return_inverse=True)[1]
    per_block = np.bincount(blocks, gain)
    if len(per_block) < 3 or np.ptp(per_block) < 1e-12:
        return 1.0
    count = len(per_block)
    t = per_block.mean() / (per_block.std(ddof=1) / math.sqrt(count))
    return float(2.0 * special.stdtr(count - 1, -abs(t)))


def _power(values: Floats) -> float:
    return max(float(np.mean(values**2)), 1e-12)
