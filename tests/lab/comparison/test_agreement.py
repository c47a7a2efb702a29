"""Agreement of flights: a clear sentence whether a model predicts one flight as well as another."""

import numpy as np
import pytest

from quadctl.effects.ground_effect import Exponential
from quadctl.lab.comparison.agreement import Agreement, Errors, Fitted, agreement, least_alike, of_one_model
from quadctl.lab.comparison.comparison import compare
from quadctl.lab.comparison.wording import Said
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


def found(judged_m_s2: float, ci95: tuple[float, float] | None, fitted: Fitted = "these") -> Agreement:
    return Agreement(("a.csv",), ("b.csv",), 0.4, judged_m_s2, ci95, fitted)


class TestFacts:
    @pytest.mark.parametrize(
        ("judged_m_s2", "ci95", "answer", "verdict", "reason"),
        [
            (0.41, (-0.03, 0.05), Said.AGREE, "as well", Said.IS_LESS),
            (0.52, (0.05, 0.19), Said.DIFFER, "worse", Said.ERRORS),
            (0.30, (-0.15, -0.05), Said.DIFFER, "better", Said.ERRORS),
            (0.41, (-0.3, 0.32), Said.MAY_AGREE, "not known", Said.MAY_BE_MORE),
            (0.41, None, Said.MAY_AGREE, "not known", Said.TOO_SHORT),
        ],
    )
    def test_a_wide_interval_or_none_is_no_agreement(
        self, judged_m_s2: float, ci95: tuple[float, float] | None, answer: Said, verdict: str, reason: Said
    ) -> None:
        agreement = found(judged_m_s2, ci95)
        assert (agreement.answer.kind, agreement.verdict, agreement.parts[-1].kind) == (answer, verdict, reason)

    def test_are_said_with_their_numbers(self) -> None:
        assert str(found(0.41, (-0.03, 0.05)).said) == (
            "The model fitted to a.csv predicts b.csv as well as a.csv: its error is 0.410 m/s² on b.csv and "
            "0.400 m/s² on a.csv; the difference, from \u22120.03 to +0.05 m/s² (95%), is less than 0.100, 25% of the "
            "error on a.csv."
        )
        assert str(found(0.52, (0.05, 0.19), "others").parts[0]) == (
            "The model fitted to the other flights each time predicts b.csv worse than a.csv, by 0.120 m/s² "
            "[0.0500, 0.190]"
        )


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
