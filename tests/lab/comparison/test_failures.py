"""Failures of a model in words: in which flight, when, and the largest error among them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.signal import lfilter

from quadctl.effects.ground_effect import Exponential
from quadctl.lab.comparison.comparison import compare
from quadctl.lab.comparison.failures import (
    Failure,
    _adjusted,
    failures,
    followed,
    profiles,
    stretches,
    told,
    unexplained,
)
from quadctl.lab.fitting.flexible_regression import flexible_residual
from quadctl.lab.fitting.noise import Noise
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from tests.support.flights import obedient


@pytest.fixture(scope="module")
def two(raptor: Vehicle) -> Dataset:
    model = Model(raptor)
    return load_dataset([obedient(model, 60.0, noise_m_s=0.01, seed=i, name=f"{i}.csv") for i in range(2)], raptor)


def test_sigma_counts_noise_that_drifts_for_long(raptor: Vehicle) -> None:
    """Noise with a time constant of 10 s in flights of two minutes: its means are no failures."""
    data = load_dataset([obedient(Model(raptor), 120.0, noise_m_s=0.01)], raptor)
    random, keep = np.random.default_rng(3), np.exp(-1.0 / (50.0 * 10.0))
    sigmas = []
    for _ in range(30):
        noise = lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], random.standard_normal((2 * len(data.measured), 3)), 0)
        noise = noise[-len(data.measured) :]
        error = Noise(noise, data.parts).errors_of_means(np.zeros(len(noise), dtype=np.intp), 1)[0]
        sigmas += list(noise.mean(axis=0) / error)
    assert 0.5 < np.sqrt(np.mean(np.square(sigmas))) < 2.0


def test_noise_that_drifts_goes_with_no_variable(raptor: Vehicle) -> None:
    """Hardly any of twenty flights without an error in the model, noise of 3 s, has such a sentence."""
    data = load_dataset([obedient(Model(raptor), 60.0, noise_m_s=0.01)], raptor)
    random, keep = np.random.default_rng(5), np.exp(-1.0 / (7.5 * 3.0))
    told_of = 0
    for _ in range(20):
        noise = lfilter([1.0], [1.0, -keep], random.standard_normal((len(data.measured) + 200, 3)), 0)[200:]
        found = failures(noise, noise, data, profiles(noise, noise, data))
        told_of += any(failure.kind == "dependence" for failure in found)
    assert told_of <= 3


def test_what_follows_disturbances_is_said_to_be_no_sure_cause(raptor: Vehicle, two: Dataset) -> None:
    """In waves the thrust makes the motion; in a hover it answers whatever disturbs."""
    up = Failure("up", "thrust", 10.0, 12.0, 0.3, 9.0, 100, "range", 9.0)
    height = replace(up, variable="height_over_radius")
    assert followed([up, height], two) is None
    t = np.arange(0.0, 60.0, 0.02)
    hover = obedient(Model(raptor), 60.0, noise_m_s=0.01)
    still = {"z_m": 1.0 + 0.01 * np.sin(0.3 * t), "vz_m_s": 0.003 * np.cos(0.3 * t)}
    answer = 1.0 + 0.02 * np.sin(2.0 * t) * np.sin(0.3 * t)
    still |= {name: np.mean(hover[name]) * answer for name in hover.columns if name.endswith("_rpm")}
    data = load_dataset([replace(hover, columns={**hover.columns, **still})], raptor)
    said = followed([up, height], data)
    assert said is not None and said.facts["variables"] == ["thrust"]
    assert "In this flight the thrust changes mostly because the controller counters disturbances" in str(said)
    assert str(said) in " ".join(str(compare(Model(raptor), data)).split())


def test_an_axis_with_much_of_the_error_is_told_of_even_where_nothing_goes_with_it() -> None:
    up = Failure("up", "thrust", 10.0, 12.0, 0.3, 9.0, 100, "range", 9.0)
    errors = {"north": 0.03, "east": 0.3, "up": 0.4, "total": 0.5}
    east = unexplained([up], errors)
    assert (
        str(east) == "Along east (0.300 m/s², 36% of the squared error) no logged variable explains much of the error."
    )
    assert unexplained([up, replace(up, axis="east")], errors) is None
    many = [replace(up, axis="up", n=100 + i) for i in range(6)]  # more than are shown come before it
    assert unexplained([*many, replace(up, axis="east", n=50)], errors) is None
    assert unexplained([up, replace(up, axis="east", square_m2_s4=1e-4)], errors) == east  # next to nothing
    assert "north" not in str(unexplained([], errors))
    assert unexplained([], dict.fromkeys(errors, 0.0)) is None


class TestStretches:
    def test_an_error_in_one_part_of_one_flight_is_found_there(self, two: Dataset) -> None:
        first, second = two.parts
        values = np.full(len(two.measured), 0.01)
        time_s = two.flights[1].time_s
        wrong = (time_s > 20.0) & (time_s < 30.0)
        values[second] += 0.5 * wrong
        (found,) = stretches(values, np.ones(len(values), dtype=bool), two)
        assert found.flight == "1.csv" and not found.whole
        assert found.begin_s >= 19.0 and found.end_s <= 31.0 and found.end_s - found.begin_s > 7.0
        assert first.stop == second.start

    def test_only_the_samples_of_the_range_count(self, two: Dataset) -> None:
        values = np.ones(len(two.measured))
        inside = np.zeros(len(values), dtype=bool)
        inside[two.parts[0]] = two.flights[0].time_s < 10.0
        (found,) = stretches(values, inside, two)
        assert found.flight == "0.csv" and found.end_s < 10.0

    def test_an_error_that_is_everywhere_is_in_all_flights_from_begin_to_end(self, two: Dataset) -> None:
        found = stretches(np.ones(len(two.measured)), np.ones(len(two.measured), dtype=bool), two)
        assert sorted(stretch.flight for stretch in found) == ["0.csv", "1.csv"]
        assert all(stretch.whole for stretch in found)


def test_a_sentence_names_the_flight_and_when_most_of_it_was(raptor: Vehicle) -> None:
    """The waves over height swell and fade within 25 s: the lowest heights are reached in the middle."""
    log = obedient(Model(raptor).plus(Exponential(a=0.4, b=5.0)), 25.0, noise_m_s=0.01, name="low.csv")
    found = compare(Model(raptor), load_dataset([log], raptor)).fails_where
    assert found
    at_a_height = [
        f for f in found if (f.kind, f.variable, f.at_edge) == ("range", "height_over_radius", (True, False))
    ]
    assert at_a_height
    for failure in at_a_height:
        (stretch,) = failure.stretches
        assert 4.0 < stretch.begin_s < stretch.end_s < 21.0
        assert failure.to_dict()["most_in"] == [{"flight": "low.csv", "from_s": stretch.begin_s, "to_s": stretch.end_s}]


def test_the_variable_that_the_error_goes_with_comes_first(raptor: Vehicle) -> None:
    """Three quarters of the error follow the climb rate; what is left of it is an offset."""
    data = load_dataset([obedient(Model(raptor), 60.0, noise_m_s=0.01, name="a.csv")], raptor)
    rate = data.flights[0].variables["climb_rate"]
    residual = np.random.default_rng(1).normal(0.0, 0.05, data.measured.shape)
    residual[:, 2] += 0.5 * (rate - rate.mean()) / rate.std() + 0.2
    noise = residual - flexible_residual(residual, data, data.causes)
    found = told(failures(residual, noise, data, profiles(residual, noise, data)), 6)
    sizes = [failure.square_m2_s4 for failure in found]
    assert sizes[:2] == sorted(sizes[:2], reverse=True)
    assert (found[0].kind, found[0].axis, found[0].variable) == ("dependence", "up", "climb_rate")
    (_, least), (_, largest) = found[0].extremes
    assert least < 0.0 < largest
    assert 0.6 < found[0].share < 0.95
    inside = (rate >= found[0].low) & (rate <= found[0].high)
    assert 0.0 < inside.mean() < 0.6
    (offset,) = (failure for failure in found if failure.kind == "offset")
    assert offset.mean_residual == pytest.approx(0.2, abs=0.02)


def test_a_range_is_told_beside_a_dependence_where_it_has_a_cause_of_its_own(raptor: Vehicle) -> None:
    """The thrust goes with the climb rate, on which the error depends; low flight has a cause of its own."""
    data = load_dataset([obedient(Model(raptor), 60.0, noise_m_s=0.01, name="a.csv")], raptor)
    variables = data.flights[0].variables
    rate, height = variables["climb_rate"], variables["height_over_radius"]
    random = np.random.default_rng(2)
    variables["thrust"] = 14.0 + rate + random.normal(0.0, 0.02, len(rate))
    residual = random.normal(0.0, 0.05, data.measured.shape)
    residual[:, 2] += 0.5 * (rate > 0.5 * rate.max())

    def ranges() -> tuple[set[str], set[str]]:
        noise = residual - flexible_residual(residual, data, data.causes)
        found = failures(residual, noise, data, profiles(residual, noise, data))
        (depend,) = (failure for failure in found if failure.kind == "dependence" and failure.axis == "up")
        assert {depend.variable, *depend.also} >= {"climb_rate", "thrust"}
        own = {f.variable for f in found if f.kind == "range" and f.axis == "up"} - {depend.variable}
        return own, {depend.variable, *depend.also}

    own, same = ranges()
    assert not own & same
    residual[:, 2] += 0.3 * (height < np.quantile(height, 0.3))
    own, same = ranges()
    assert "height_over_radius" in own - same and not own & {"climb_rate", "thrust"}


def test_the_largest_error_is_told_even_where_others_hold_more_of_the_squared_error() -> None:
    def failure(mean: float, n: int) -> Failure:
        return Failure("up", "time", 0.0, 1.0, mean, 9.0, n, "offset", n * mean**2)

    wide, short = [failure(0.1 + 0.001 * i, 1000) for i in range(6)], failure(-0.9, 3)
    assert told([*wide, short], 4) == [*reversed(wide[3:]), short]
    assert told(wide, 4) == list(reversed(wide[2:]))
    assert told([], 4) == []


def test_ranges_of_a_dependence_are_parts_of_it_but_an_offset_is_not() -> None:
    offset = Failure("up", "time", 0.0, 9.0, 0.1, 9.0, 100, "offset", 1.0)
    late = Failure("up", "time", 5.0, 9.0, 0.5, 9.0, 40, "range", 8.0)
    whole = replace(late, square_m2_s4=20.0, kind="dependence")
    assert told([offset, whole, late], 4) == [whole, offset]
    assert told([offset, late], 4) == [late, offset]
    proxy = replace(late, variable="battery", square_m2_s4=30.0)
    assert told([offset, whole, late, proxy], 4) == [whole, offset, proxy]


@given(st.lists(st.floats(0.0, 1.0), max_size=30))
def test_the_false_discovery_rate_is_that_of_the_library(p_values: list[float]) -> None:
    expected = stats.false_discovery_control(p_values) if p_values else []
    assert _adjusted(np.array(p_values)) == pytest.approx(np.array(expected))
