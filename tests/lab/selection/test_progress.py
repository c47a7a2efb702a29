"""Progress of a search: it names what it fits, and fits a lag whatever it explains to first order."""

from quadctl.effects.ground_effect import Exponential, Hayden
from quadctl.effects.motor_lag import FirstOrderLag
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.lab.fitting.fitted_model import fit_model
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.search import search
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.support.flights import obedient


def test_what_is_fitted_and_tried_is_named(raptor: Vehicle) -> None:
    truth = Model(raptor).plus(Exponential(a=0.3, b=5.0)).plus(ConstantScale(0.97))
    flight = load_dataset([obedient(truth, 60.0, noise_m_s=0.01)], raptor)
    said: list[str] = []
    search(fit_model(Model(raptor), flight), [Exponential, Hayden, ConstantScale], said.append)
    assert said[0].startswith("fitting ground_effect.")
    assert "comparing with ground_effect.exponential + thrust_scale.constant" in said


def test_a_lag_is_fitted_in_any_case(raptor: Vehicle) -> None:
    """The flights are aligned again for a lag, which no linear problem knows; a drag that explains nothing is not."""
    flight = load_dataset([obedient(Model(raptor), 60.0, noise_m_s=0.01)], raptor)
    said: list[str] = []
    search(fit_model(Model(raptor), flight), [FirstOrderLag, Hayden], said.append)
    tried = [text.split()[1] for text in said if text.startswith("trying")]
    assert tried == ["motor_lag.first_order"]
