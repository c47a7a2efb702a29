"""Every interval holds its value, wherever the two stand together: text, JSON, the page, a saved session."""

import json
import re
from collections.abc import Iterator
from typing import Any

import pytest
from rich.console import Console

from quadctl.effects.ground_effect import Exponential
from quadctl.effects.inflow import AxialInflow
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.tether import HangingTether
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.lab.comparison.wording import parameters_in_text, parameters_in_words
from quadctl.lab.finding import parameters_of
from quadctl.lab.flights.dataset import Dataset, load_dataset
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.selection.discovery import Discovery, discover
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from quadctl.web.session.findings import Findings
from quadctl.words import estimate
from tests.support.flights import obedient, to_and_fro

CANDIDATES = (ConstantScale, Exponential, LinearDrag, AxialInflow, HangingTether)
NUMBER = r"(-?[\d.]+(?:e[+-]?\d+)?)"
TWO_ENDS = re.compile(rf"= {NUMBER}[^\[(=,]*\[{NUMBER}, {NUMBER}\]")
ONE_END = re.compile(rf"= {NUMBER}[^\[(=,]*\(at (most|least) {NUMBER}\)")


@pytest.fixture(scope="module")
def data(raptor: Vehicle) -> Dataset:
    """Runs over the ground: what the first step of the search finds is far from what all steps together find."""
    truth = Model(raptor).plus(ConstantScale(0.93)).plus(Exponential(a=0.3, b=6.0)).plus(AxialInflow(0.4))
    return load_dataset([to_and_fro(obedient(truth, 90.0, noise_m_s=0.01), 1.0)], raptor)


@pytest.fixture(scope="module")
def found(raptor: Vehicle, data: Dataset) -> Discovery:
    return discover(Model(raptor), data, CANDIDATES)


@pytest.fixture(scope="module")
def saved(found: Discovery, data: Dataset) -> Diagnosis:
    """The diagnosis after a session with it was written and read."""
    text = Findings.of(found.diagnosis, {}).to_json()
    return Findings.from_json(text, found.diagnosis.model).diagnosed(found.diagnosis.model, data).diagnosis


def entries(found: Any) -> Iterator[dict[str, Any]]:
    """All parts of a result in JSON that hold intervals."""
    if isinstance(found, dict):
        if "ci95" in found and "parameters" in found:
            yield found
        for inside in found.values():
            yield from entries(inside)
    elif isinstance(found, list):
        for inside in found:
            yield from entries(inside)


def require_inside(text: str) -> int:
    """Number of parameters in a text, each inside its interval as printed."""
    text = text.replace("\u2212", "-")
    for value, low, high in TWO_ENDS.findall(text):
        assert float(low) <= float(value) <= float(high), text
    for value, side, end in ONE_END.findall(text):
        assert (float(value) < float(end)) == (side == "most"), text
    return len(TWO_ENDS.findall(text)) + len(ONE_END.findall(text))


def printed(diagnosis: Diagnosis) -> str:
    """Output of `diagnose --all`."""
    console = Console(width=120)
    with console.capture() as capture:
        console.print(diagnosis, diagnosis.details())
    return capture.get()


def test_all_effects_are_found(found: Discovery) -> None:
    assert sorted(found.diagnosis.missing) == ["ground_effect", "inflow", "thrust_scale"]


def test_in_json(found: Discovery) -> None:
    told = list(entries(json.loads(json.dumps(found.to_dict()))))
    assert len(told) > 8
    for entry in told:
        for name, (low, high) in entry["ci95"].items():
            assert low <= entry["parameters"][name] <= high, entry
            assert low < high, entry


def test_in_the_text_of_diagnose_and_discover(found: Discovery) -> None:
    assert require_inside(printed(found.diagnosis)) > 8
    assert require_inside(str(found)) >= 3


def test_on_the_cards_of_the_page_and_in_a_saved_session(saved: Diagnosis, found: Discovery) -> None:
    for kept, c in zip(saved.ranking, found.diagnosis.ranking, strict=True):
        assert parameters_in_text(kept.effect, kept.ci95) == parameters_in_text(c.effect, c.ci95)
        for name, (low, high) in kept.ci95.items():
            assert low <= kept.effect.values()[name] <= high, (kept.effect.name, name)
        require_inside(parameters_in_text(kept.effect, kept.ci95))


def test_the_stack_of_a_candidate_is_that_of_the_fit_of_its_parameters(found: Discovery) -> None:
    first = found.diagnosis.ranking[: len(found.diagnosis.missing)]
    for place, candidate in enumerate(first, start=1):
        assert candidate.model.effects[-1] == candidate.effect
        assert candidate.model.effects == first[-1].model.effects[:place]


@pytest.mark.parametrize(
    ("value", "ci95", "shown"),
    [
        (0.86344, (0.82, 0.86345), ("0.863", "[0.820, 0.863]")),
        (0.37891, (0.32, 0.4298), ("0.379", "[0.320, 0.430]")),  # by another fit 0.3791: below what the data tell
        (604.3, (489.0, 712.0), ("600", "[490, 710]")),
        (-0.00041, (-0.09, 0.11), ("0.00", "[-0.09, 0.11]")),
        (6.841, (0.3, 100.0), ("6.8", "[0.3, 100.0]")),
        (9.80665, (9.8066, 9.8067), ("9.807", "[9.807, 9.807]")),
        (2.5e-8, (1.1e-8, 4.2e-8), ("2.5e-08", "[1.1e-08, 4.2e-08]")),
        (23456.0, (20000.0, 26000.0), ("2.35e+04", "[2e+04, 2.6e+04]")),
        (0.0, (0.0, 0.12), ("0", "(at its bound; at most 0.120)")),
    ],
)
def test_an_estimate_has_the_digits_that_its_interval_leaves(
    value: float, ci95: tuple[float, float], shown: tuple[str, str]
) -> None:
    assert estimate(value, ci95) == shown


def test_a_parameter_at_a_bound_has_one_end() -> None:
    drag = LinearDrag(0.3, 0.0, 3.0)
    ci95 = {"d_x": (0.2, 0.4), "d_y": (0.0, 0.12), "d_z": (2.5, 3.0)}
    expected = (
        "d_x = 0.30 1/s [0.20, 0.40], d_y = 0 1/s (at its bound; at most 0.120), "
        "d_z = 3.00 1/s (at its bound; at least 2.50)"
    )
    assert parameters_in_words(parameters_of(drag, ci95)["parameters"]) == expected
    assert "d_y = 0 1/s (at its bound; at most 0.120)" in parameters_in_text(drag, ci95)
