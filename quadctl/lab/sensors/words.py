"""Answers about sensors in words and tables."""

from collections.abc import Iterator

from rich.table import Table

from quadctl.lab.sensors.comparison import UNITS, SensorComparison
from quadctl.lab.sensors.diagnosis import Named, SensorDiagnosis, Untold, Verdict
from quadctl.lab.sensors.heights import Heights, NoReference, Reference

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


def answer(found: SensorDiagnosis) -> Iterator[str]:
    """The answer first, then what it stands on, one sentence each."""
    if found.verdict is Verdict.MISSING:
        names = ", ".join(one.name for one in found.missing)
        yield f"The {found.sensor} has an error: {names}."
    else:
        yield f"The {found.sensor} has no error that these flights show."
    for one in found.missing:
        yield f"  {parameters(one)}"
    if found.missing:
        yield (
            f"Beside a slow wander, its difference from {references(found.flights)} falls from "
            f"{100.0 * found.before_m:.1f} to {100.0 * found.after_m:.1f} cm on parts of the flights that no fit saw."
        )
    else:
        yield f"Beside a slow wander it differs from {references(found.flights)} by {100.0 * found.after_m:.1f} cm."
    for one in found.small:
        yield f"There, but at most {100.0 * one.largest_m:.1f} cm in these flights: {one.name}, {parameters(one)}"
    for one in found.absent:
        yield f"Not told from zero: {one.name}, {parameters(one)}"
    for name, span in found.not_tried.items():
        yield f"Not tried: {name}, which needs {SPANS[span]}."


def untold(found: Untold) -> Iterator[str]:
    """Needs of the logs that have no reference, a clause each."""
    for name, reason in found.reasons:
        yield f"{name}: nothing tells the {found.sensor}'s error: {MISSING_REFERENCE[reason]}"


def parameters(one: Named) -> str:
    """Parameters with their intervals, and what of them is not told from zero."""
    scales = [f"{name} = {one.error.values()[name]:.3g}" for name in one.error.scales if name not in one.parameters]
    each = [
        f"{name} = {told.value:.3g} [{told.low:.3g}, {told.high:.3g}]{'' if told.is_told else ' (not told from zero)'}"
        for name, told in one.parameters.items()
    ]
    unknown = [f"these flights do not tell {', '.join(one.unknown)}"] if one.unknown else []
    return ", ".join([*each, *scales, *unknown])


def references(flights: tuple[Heights, ...]) -> str:
    return " and ".join(dict.fromkeys(REFERENCES[flight.reference] for flight in flights))
