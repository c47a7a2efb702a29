"""First page of a report: the equation of the model, and the data that it was found with."""

from typing import NamedTuple

from quadctl.effects.base import Effect
from quadctl.lab.report.results import Results
from quadctl.model import Model

HASH_CHARACTERS = 12
RIGID_BODY = "m a = m g \u2212 R (T\u2081 + T\u2082 + \u2026) e"
"""Mass times acceleration: weight, and the thrusts along the body's axis, turned into the world by R."""


class Data(NamedTuple):
    """A flight, and the beginning of the SHA-256 hash of its file; empty for a log without a file."""

    flight: str
    sha256: str


class Origin(NamedTuple):
    """The equation of the last model of a report, its terms, and the data."""

    equation: str
    terms: list[str]
    data: list[Data]


def origin(r: Results) -> Origin:
    model = last_model(r)
    equation = RIGID_BODY if not model.effects else "m a = m g \u2212 R (K T\u2081 + K T\u2082 + \u2026) e + R f"
    flights = [*r.comparison.dataset.flights, *([] if r.after is None else r.after.dataset.flights)]
    hashes = {flight.name: flight.sha256[:HASH_CHARACTERS] for flight in flights}
    return Origin(equation, [_term(effect) for effect in model.effects], [Data(*item) for item in hashes.items()])


def last_model(r: Results) -> Model:
    """The model that the report ends with."""
    if r.after is not None:
        return r.after.model
    if r.addition is not None:
        return r.addition.model
    if r.diagnosis is not None and r.diagnosis.verdict == "missing":
        return r.diagnosis.best
    return r.comparison.model


def _term(effect: Effect) -> str:
    """Name, formula in one line, and values of an effect."""
    formula = (effect.__doc__ or "").strip().split("\n\n")[0].replace("\n", " ").replace("`", "").rstrip(".")
    units = {p.name: p.unit for p in effect.parameters()}
    values = ", ".join(f"{name} = {value:.4g} {units[name]}".strip() for name, value in effect.values().items())
    return f"{effect.name}: {' '.join(formula.split())}" + (f", with {values}" if values else "")
