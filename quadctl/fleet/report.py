"""Report of a fleet as one HTML file."""

from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, StrictUndefined

from quadctl import __version__
from quadctl.errors import SettingsError
from quadctl.files import write_text
from quadctl.fleet.changes import by_quantity
from quadctl.fleet.figures import small_multiples
from quadctl.fleet.summary import Fleet, Kind
from quadctl.lab.plots.svg import to_svg
from quadctl.words import Fact, fact


def write_report(path: Path, fleet: Fleet, folder: Path, model: Path) -> None:
    """Write the page to `path`.

    Raises
    ------
    SettingsError
        It cannot be written.
    """
    template = files("quadctl.fleet").joinpath("report.html.j2").read_text(encoding="utf-8")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    text = environment.from_string(template).render(
        folder=str(folder),
        model=str(model),
        lines=[str(found) for found in fleet.changed()],
        counted=[str(found) for found in fleet.counted()],
        spreads=fleet.spreads,
        panels=_panels(fleet),
        software=f"quadctl {__version__}",
        written=f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
    )
    write_text(path, text, SettingsError, "a file name")


def _panels(fleet: Fleet) -> list[tuple[str, str, Fact]]:
    """Quantity, figure and a sentence of its values; quantities that changed come first."""
    populations = {spread.quantity: spread.population for spread in fleet.spreads}
    panels = []
    for number, (quantity, series) in enumerate(by_quantity(fleet.series).items()):
        changes = [change for change in fleet.changes if change.quantity == quantity]
        population = populations.get(quantity)
        figure = small_multiples(series, changes, population)
        facts = {"mean": population and f"{population.mean:.3g}", "changed": [change.vehicle for change in changes]}
        caption = fact(Kind.FIGURE, quantity=quantity, vehicles=len(series), **facts)
        panels.append((bool(not changes), (quantity, to_svg(figure, f"fleet{number}"), caption)))
    return [panel for _, panel in sorted(panels, key=lambda item: item[0])]
