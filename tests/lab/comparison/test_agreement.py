"""Agreement of flights: a clear sentence whether a model predicts one flight as well as another."""

import numpy as np
import pytest

from quadctl.effects.ground_effect import Exponential
from quadctl.lab.comparison.agreement import Agreement, Errors, Fitted, agreement, least_alike, of_one_model
from quadctl.lab.comparison.comparison import compare
from quadctl.lab.comparison.wording import agreement_in_short, agreement_in_words
from quadctl.lab.flights.dataset import load_dataset
from quadctl.model import Model, Provenance
from quadctl.vehicle import Vehicle
from tests.support.flights import obedient

PER_BLOCK = 10


def errors(name: str, sizes_m_s2: float, blocks: int = 30, seed: int = 0) -> Errors:
    """Errors of that size, m/s^2, of noise that is independent from block to block."""
    random = np.random.default_rng(seed)
    residual = sizes_m_s2 * random.standard_normal((blocks, 1)) * np.ones((1, PER_BLOCK))
    squares = residual.ravel() ** 2
    block = np.repeat(np.arange(blocks), PER_BLOCK)
    return Errors((name,), squares, block, np.zeros(len(squares), dtype=np.int64))


def together(*parts: Errors) -> Errors:
    squares = np.concatenate([part.squares for part in parts])
    flight = np.repeat(np.arange(len(parts)), [len(part.squares) for part in parts])
    block = np.concatenate([1000 * i + part.block for i, part in enumerate(parts)])
    return Errors(tuple(part.flights[0] for part in parts), squares, block, flight)


def said(judged_m_s2: float, ci95: tuple[float, float] | None, fitted: Fitted = "these") -> str:
    return agreement_in_words(Agreement(("a.csv",), ("b.csv",), 0.4, judged_m_s2, ci95, fitted))


class TestSentence:
    def test_as_well(self) -> None:
        assert said(0.41, (-0.03, 0.05)) == (
            "The model fitted to a.csv predicts b.csv as well as a.csv: its error is 0.410 m/s² on b.csv and "
            "0.400 m/s² on a.csv; the difference is from \u22120.03 to +0.05 m/s² (95%), less than the 0.100, 25% "
            "of the error on a.csv, that count as none."
        )

    def test_worse_by_so_much(self) -> None:
        assert said(0.52, (0.05, 0.19)) == (
            "The model fitted to a.csv predicts b.csv worse than a.csv, by 0.120 m/s² [0.0500, 0.190]: its error is "
            "0.520 m/s² on b.csv and 0.400 m/s² on a.csv."
        )

    def test_better(self) -> None:
        assert "predicts b.csv better than a.csv, by 0.100 m/s² [0.0500, 0.150]" in said(0.3, (-0.15, -0.05))

    def test_a_wide_interval_around_none_is_no_agreement(self) -> None:
        assert said(0.41, (-0.3, 0.32)) == (
            "Whether the model fitted to a.csv predicts b.csv as well as a.csv is not known from these flights: "
            "its error is 0.410 m/s² on b.csv and 0.400 m/s² on a.csv; the difference is anything from \u22120.3 to "
            "+0.32 m/s² (95%), which may be more than the 0.100, 25% of the error on a.csv, that count as none."
        )

    def test_nor_are_flights_too_short_for_an_interval(self) -> None:
        assert "is not known" in said(0.41, None)
        assert "one of them is too short for an interval." in said(0.41, None)

    def test_the_model_is_called_what_it_is(self) -> None:
        assert said(0.41, (-0.03, 0.05), "").startswith("The model predicts b.csv")
        assert said(0.41, (-0.03, 0.05), "others").startswith("The model fitted to the other flights each time")


class TestAnswer:
    @pytest.mark.parametrize(
        ("judged_m_s2", "ci95", "answer"),
        [
            (0.41, (-0.03, 0.05), "Under this model the flights agree."),
            (0.52, (0.05, 0.19), "Under this model the flights differ."),
            (0.30, (-0.15, -0.05), "Under this model the flights differ."),
            (0.41, (-0.3, 0.32), "Whether the flights agree under this model cannot be told."),
            (0.41, None, "Whether the flights agree under this model cannot be told."),
        ],
    )
    def test_is_a_few_words(self, judged_m_s2: float, ci95: tuple[float, float] | None, answer: str) -> None:
        assert agreement_in_short(Agreement(("a.csv",), ("b.csv",), 0.4, judged_m_s2, ci95, "these")) == answer


class TestAgreement:
    def test_flights_with_the_same_noise_agree_in_about_95_of_100(self) -> None:
        found = [agreement(errors("a", 0.4, 60, i), errors("b", 0.4, 60, 1000 + i)).ci95 for i in range(400)]
        covered = [ci is not None and ci[0] <= 0.0 <= ci[1] for ci in found]
        assert np.mean(covered) == pytest.approx(0.95, abs=0.025)

    def test_a_flight_that_is_predicted_worse_is_told_from_noise(self) -> None:
        found = agreement(errors("a", 0.4, 60), errors("b", 0.8, 60, 1))
        assert found.verdict == "worse" and found.difference_m_s2 == pytest.approx(0.4, abs=0.15)

    def test_a_few_seconds_tell_nothing(self) -> None:
        assert agreement(errors("a", 0.4), errors("b", 4.0, blocks=3)).verdict == "not known"

    def test_the_spread_of_several_flights_counts_for_the_next_one(self) -> None:
        sizes = (0.2, 0.3, 0.5, 0.7)
        known = together(*(errors(str(i), size, 200, i) for i, size in enumerate(sizes)))
        one, new = known.some([2]), errors("new", 0.75, 200, 9)
        assert agreement(one, new).verdict == "worse"
        assert agreement(known, new).verdict == "not known"

    def test_the_flight_that_differs_most_is_named_and_the_choice_is_allowed_for(self) -> None:
        three = together(errors("a", 0.4, 60), errors("b", 0.41, 60, 1), errors("c", 0.9, 60, 2))
        found = least_alike(three)
        assert found is not None and found.judged == ("c",) and found.differs_most
        alone = agreement(three.some([0, 1]), three.some([2]))
        assert found.ci95 is not None and alone.ci95 is not None and found.ci95[0] < alone.ci95[0]

    def test_of_two_flights_the_one_with_the_larger_error_is_judged(self) -> None:
        found = least_alike(together(errors("a", 0.6, 60), errors("b", 0.4, 60, 1)))
        assert found is not None and (found.judged, found.reference) == (("a",), ("b",))
        assert least_alike(errors("a", 0.4)) is None


def test_a_comparison_says_whether_the_model_holds_on_the_flight_that_it_was_not_fitted_to(raptor: Vehicle) -> None:
    model = Model(raptor).plus(Exponential(a=0.3, b=5.0), Provenance(logs=("a.csv",)))
    changed = Model(raptor).plus(Exponential(a=0.1, b=5.0))
    a, same = (obedient(model, 60.0, noise_m_s=0.01, seed=i, name=name) for i, name in enumerate(("a.csv", "b.csv")))
    other = obedient(changed, 60.0, noise_m_s=0.01, seed=2, name="b.csv")
    alike, unlike = (compare(model, load_dataset([a, b], raptor)) for b in (same, other))
    assert alike.agreement is not None and unlike.agreement is not None
    assert (unlike.agreement.judged, unlike.agreement.verdict) == (("b.csv",), "worse")
    assert alike.agreement.verdict == "as well"
    assert "The model fitted to a.csv predicts b.csv worse than a.csv, by" in str(unlike)
    assert unlike.to_dict()["agreement"]["verdict"] == "worse"
    assert compare(model, load_dataset([a], raptor)).agreement is None


def test_a_model_that_was_fitted_to_both_flights_is_not_said_to_predict_one_of_them(raptor: Vehicle) -> None:
    model = Model(raptor).plus(Exponential(a=0.3, b=5.0), Provenance(logs=("a", "b")))
    found = of_one_model(model, together(errors("a", 0.4), errors("b", 0.4, 30, 1)))
    assert found is not None and found.fitted == "all"
