"""Answers about sensors in words and tables."""

from collections.abc import Iterator
from enum import unique

from rich.table import Table

from quadctl.lab.sensors.comparison import UNITS, SensorComparison
from quadctl.lab.sensors.diagnosis import Named, NoAnswer, SensorDiagnosis, Verdict
from quadctl.lab.sensors.heights import Heights, NoReference, Reference
from quadctl.words import Fact, Kinds, When, fact

REFERENCES = {
    Reference.POSITION: "the logged position, taken for independent of it",
    Reference.RANGE: "the range finder",
    Reference.DOPPLER: "GPS's climb rate, integrated",
    Reference.ESTIMATE: "the estimated height, freed of the barometer's corrections",
}
MISSING_REFERENCE = {
    NoReference.NONE: "needs a range finder, GPS's climb rate or motion capture beside the barometer",
    NoReference.LEANS: (
        "the estimated height leans on the barometer itself: needs a range finder or GPS's climb rate in the log"
    ),
}
SPANS = {
    "speed": "runs of 3 m/s and more",
    "height": "hovers below 1 m and above",
    "thrust": "climbs that change the thrust",
}


def comparison_table(compared: SensorComparison) -> Table:
    """The difference over each variable."""
    table = Table(box=None, pad_edge=False)
    for heading in (f"{compared.sensor} over", "from", "to", "reads beyond, m", "+-"):
        table.add_column(heading, justify="left" if not table.columns else "right", no_wrap=True)
    last = ""
    for found in compared.bins:
        name = "" if found.variable == last else f"{found.variable} {UNITS[found.variable]}".rstrip()
        last = found.variable
        ends = (f"{found.low:.2f}", f"{found.high:.2f}")
        table.add_row(name, *ends, f"{found.mean_m:+.3f}", f"{1.96 * found.std_error_m:.3f}")
    return table


@unique
class Said(Kinds):
    """Parts of an answer about a sensor, each with its template."""

    MISSING = "The {sensor} has an error: {names:list}."
    NONE = "The {sensor} has no error that these flights show."
    PARAMETERS = "  {parameters}"
    FALLS = (
        "Beside a slow wander, its difference from {references} falls from {before_cm:.1f} to {after_cm:.1f} cm on "
        "parts of the flights that no fit saw."
    )
    DIFFERS = "Beside a slow wander it differs from {references} by {after_cm:.1f} cm."
    SMALL = "There, but at most {largest_cm:.1f} cm in these flights: {name}, {parameters}"
    ABSENT = "Not distinguished from zero: {name}, {parameters}"
    NOT_TRIED = "Not tried: {name}, which needs {span}."
    NO_REFERENCE = "{log}: nothing tells the {sensor}'s error: {reason}"
    VALUE = ("{name} = {value:.3g} [{low:.3g}, {high:.3g}]", When("zero", " (not distinguished from zero)"))
    SCALE = "{name} = {value:.3g}"
    UNKNOWN = "these flights do not identify {names:list}"


def answer(found: SensorDiagnosis) -> Iterator[Fact]:
    """The answer first, then what it stands on."""
    missing = [one.name for one in found.missing]
    yield fact(Said.MISSING if found.verdict is Verdict.MISSING else Said.NONE, sensor=found.sensor, names=missing)
    yield from (fact(Said.PARAMETERS, parameters=parameters(one)) for one in found.missing)
    errors = {"before_cm": 100.0 * found.before_m, "after_cm": 100.0 * found.after_m}
    yield fact(Said.FALLS if missing else Said.DIFFERS, references=references(found.flights), **errors)
    for one in found.small:
        yield fact(Said.SMALL, name=one.name, parameters=parameters(one), largest_cm=100.0 * one.largest_m)
    yield from (fact(Said.ABSENT, name=one.name, parameters=parameters(one)) for one in found.absent)
    yield from (fact(Said.NOT_TRIED, name=name, span=SPANS[span]) for name, span in found.not_tried.items())


def no_reference(found: NoAnswer) -> Iterator[Fact]:
    """Needs of the logs that have no reference."""
    for name, reason in found.reasons:
        yield fact(Said.NO_REFERENCE, log=name, sensor=found.sensor, reason=MISSING_REFERENCE[reason])


def parameters(one: Named) -> str:
    """Parameters with their intervals, and what of them is not distinguished from zero."""
    values = one.error.values()
    each = [
        fact(Said.VALUE, name=name, value=told.value, low=told.low, high=told.high, zero=not told.is_identified)
        for name, told in one.parameters.items()
    ]
    scales = [
        fact(Said.SCALE, name=name, value=values[name]) for name in one.error.scales if name not in one.parameters
    ]
    unknown = [fact(Said.UNKNOWN, names=one.unknown)] if one.unknown else []
    return ", ".join(map(str, [*each, *scales, *unknown]))


def references(flights: tuple[Heights, ...]) -> str:
    return " and ".join(dict.fromkeys(REFERENCES[flight.reference] for flight in flights))
