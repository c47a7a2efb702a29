"""Progress of a search: it names its round, and says no time that is not known."""

from quadctl.effects.ground_effect import Exponential, Hayden
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.lab.fitting.fitted_model import fit_model
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.search import begun_at, forward, tried_in_words
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.support.flights import obedient


def test_each_round_is_named(raptor: Vehicle) -> None:
    truth = Model(raptor).plus(Exponential(a=0.3, b=5.0)).plus(ConstantScale(0.97))
    flight = load_dataset([obedient(truth, 60.0, noise_m_s=0.01)], raptor)
    said: list[str] = []
    forward(begun_at(fit_model(Model(raptor), flight)), [Exponential, Hayden, ConstantScale], said.append)
    assert [text.partition(":")[0] for text in said[:3]] == ["round 1"] * 3
    assert said[3].startswith("round 2: ") and "1 of 1" in said[3]
    assert not any("about 0 s" in text for text in said)


def test_at_the_end_of_a_round_no_time_is_said() -> None:
    assert tried_in_words("a", 10, 10, 0.0) == "tried a, 10 of 10"
    assert tried_in_words("a", 3, 10, 7.2) == "tried a, 3 of 10; about 7 s left of this round, another may follow"
