"""Report as one HTML file."""

import os
from datetime import UTC, datetime
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, StrictUndefined

from quadctl import __version__
from quadctl.errors import SettingsError
from quadctl.lab.comparison.comparison import Comparison, compare
from quadctl.lab.report.added import before_and_after, fitted_effects
from quadctl.lab.report.compared import (
    flights,
    open_loop_section,
    over_time,
    over_variables,
    where_it_fails,
    where_it_still_fails,
)
from quadctl.lab.report.diagnosed import missing
from quadctl.lab.report.flown import step_section
from quadctl.lab.report.numbers import lowest_floors
from quadctl.lab.report.origin import origin
from quadctl.lab.report.results import Results
from quadctl.lab.report.top import headline
from quadctl.lab.selection.addition import Addition
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.tracking.step_response import StepResponses


def write_report(
    path: Path,
    *,
    comparison: Comparison,
    diagnosis: Diagnosis | None = None,
    addition: Addition | None = None,
    before_unseen: Comparison | None = None,
    after: Comparison | None = None,
    steps: StepResponses | None = None,
) -> None:
    """Write the page to `path`, completely or not at all.

    Parameters
    ----------
    after
        The improved model on flights that no fit has seen.
    before_unseen
        The model of `comparison` on the same flights; it is worked out where it is not given.

    Raises
    ------
    SettingsError
        `path` cannot be written.
    """
    text = render_report(Results(comparison, diagnosis, addition, before_unseen, after, steps))
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(path)
    except OSError as error:
        raise SettingsError(f"{path}: the report cannot be written ({error.strerror}), expected a file name") from None
    finally:
        _remove(temporary)


def _remove(temporary: Path) -> None:
    try:
        temporary.unlink(missing_ok=True)
    except OSError:  # its folder is a file, or gone: then so is this
        return


def render_report(results: Results) -> str:
    """Render the page as HTML."""
    if results.addition is not None:
        results = results._replace(improved=compare(results.addition.model, results.comparison.dataset))
    results = results._replace(floors=lowest_floors(results))
    sections = [section for make in _SECTIONS if (section := make(results)) is not None]
    template = files("quadctl.lab.report").joinpath("report.html.j2").read_text(encoding="utf-8")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string(template).render(
        model=results.comparison.model.name,
        vehicle=results.comparison.model.vehicle.name,
        headline=headline(results),
        origin=origin(results),
        sections=sections,
        software=f"quadctl {__version__}",
        written=f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
    )


_SECTIONS = (
    flights,
    over_time,
    open_loop_section,
    over_variables,
    where_it_fails,
    missing,
    before_and_after,
    fitted_effects,
    where_it_still_fails,
    step_section,
)
