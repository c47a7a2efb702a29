"""Errors of the forms of effects: what they are, and how much they let another effect explain."""

import numpy as np
import pytest

from quadctl.effects.ground_effect import Exponential
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.lab.fitting.consider_parameters import FORM
from quadctl.lab.fitting.fitted_model import FittedModel, fit_model
from quadctl.lab.fitting.form_errors import FormErrors
from quadctl.lab.fitting.significance import improvement_p_value
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model

UP = 2


@pytest.fixture(scope="module")
def dataset(rigid: Model, staircases: list[FlightLog]) -> Dataset:
    return load_dataset(staircases, rigid.vehicle)


@pytest.fixture(scope="module")
def over_the_ground(rigid: Model, dataset: Dataset) -> FittedModel:
    return fit_model(rigid.plus(Exponential(a=0.3, b=5.0)), dataset)


@pytest.fixture(scope="module")
def forms(over_the_ground: FittedModel) -> FormErrors:
    return FormErrors.of(over_the_ground)


def test_an_effect_that_depends_on_no_variable_has_no_form(rigid: Model, dataset: Dataset) -> None:
    forms = FormErrors.of(fit_model(rigid.plus(ConstantScale()), dataset))
    assert forms.variance_of_sum(np.ones((len(dataset.targets), 3))) == 0.0


def test_the_error_of_a_form_is_a_tenth_of_the_effect(over_the_ground: FittedModel, forms: FormErrors) -> None:
    data = over_the_ground.fitter.dataset
    does = data.predicted(over_the_ground.model) - data.predicted(Model(data.flights[0].vehicle))
    deviation = forms.sizes[0] * np.sqrt(np.sum(forms.waves[0] ** 2, axis=1))[:, None]
    # of the effect here, and of its root mean square
    expected = FORM * np.hypot(does[:, UP], np.sqrt(np.mean(does[:, UP] ** 2)))
    assert np.sqrt(np.mean(deviation[:, UP] ** 2)) == pytest.approx(np.sqrt(np.mean(expected**2)), rel=0.3)


def test_it_is_a_function_of_the_variables_of_the_effect(over_the_ground: FittedModel, forms: FormErrors) -> None:
    height = over_the_ground.fitter.dataset.variable("height_over_radius")
    assert height is not None
    order = np.argsort(height)
    steps = np.abs(np.diff(forms.waves[0][order], axis=0)).max(axis=1)
    assert np.all(steps <= 40.0 * np.diff(height[order]) / np.ptp(height) + 1e-9)


@pytest.mark.parametrize(("share", "significant"), [(0.5, False), (10.0, True)])
def test_what_the_form_of_a_larger_effect_may_leave_is_no_effect_of_its_own(
    dataset: Dataset, forms: FormErrors, share: float, significant: bool
) -> None:
    """A wave of the height, as large as one standard deviation of the form's error times `share`."""
    change = np.zeros((len(dataset.targets), 3))
    change[:, UP] = share * forms.sizes[0][:, UP] * forms.waves[0][:, 1]
    noise = 0.02 * np.random.default_rng(0).standard_normal(change.shape)
    assert improvement_p_value(change + noise, change, dataset) < 1e-6
    assert (improvement_p_value(change + noise, change, dataset, forms) < 0.01) is significant


def test_what_has_nothing_to_do_with_its_variables_is_found_as_before(dataset: Dataset, forms: FormErrors) -> None:
    random = np.random.default_rng(1)
    change = np.zeros((len(dataset.targets), 3))
    change[:, UP] = 0.05 * np.sign(random.standard_normal(len(change)))
    noise = 0.1 * random.standard_normal(change.shape)
    alone, beside = (improvement_p_value(change + noise, change, dataset, f) for f in (None, forms))
    assert beside < 1e-6
    assert alone < 1e-6
