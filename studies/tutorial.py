"""Write docs/find-the-missing-effect.md: run every command that it shows, capture what they print, draw the figures.

`make tutorial` runs this. The words are in find-the-missing-effect.md.j2; rendering it runs its commands in their
order, in a temporary folder that holds copies of `config/` and `missions/`.
"""

import io
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import cached_property
from pathlib import Path

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from matplotlib.figure import Figure
from PIL import Image

from quadctl.errors import QuadctlError
from quadctl.lab import add, compare, discover, plots
from quadctl.lab.comparison.comparison import Comparison
from quadctl.lab.effect_curves import effect_curves
from quadctl.lab.fitting.nuisances import KINDS
from quadctl.lab.selection.discovery import Discovery
from quadctl.lab.tracking.metrics import MetricsTable, Tracking, Window, metrics, tracking
from quadctl.logs.read import read_logs
from quadctl.sitl.vehicle.hidden import load_hidden, true_model
from studies.page import ROOT

DOCS = ROOT / "docs"
PAGE = DOCS / "find-the-missing-effect.md"
COLUMNS = 100
WIDE_PX, COLOURS = 900, 64
SHOWN_WIDTH_PX = 420
"""Width on the page of a figure that stands beside another."""
LOGS = ("staircase.csv", "runs.csv")
VEHICLE = "config/vehicles/raptor.yaml"
WHEN_FLOWN = re.compile(r"\b\d{8}_\d{6}_")


class Tutorial:
    """Functions that the template calls: commands, files, results, figures."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def run(self, commands: str, first: int | None = None, resume: str = "", until: str = "") -> str:
        """A block with the commands, one a line, and what they print.

        Of a long output the `first` lines are shown, then those from the one that begins with `resume`, none without;
        nothing from the line that begins with `until`.

        Raises
        ------
        QuadctlError
            A command failed, or no line begins with `resume` or `until`.
        """
        printed = "".join(self._output(command) for command in commands.splitlines())
        lines = [WHEN_FLOWN.sub("DATE_TIME_", line.rstrip()) for line in printed.rstrip().splitlines()]
        if until:
            lines = lines[: _line(lines, until)]
        if first is not None:
            rest = lines[_line(lines, resume) :] if resume else []
            lines = [*lines[:first], *(["[...]"] if first else []), *rest]
        return "\n".join(["```", *(f"$ {command}" for command in commands.splitlines()), *lines, "```"])

    def _output(self, command: str) -> str:
        programs = Path(sys.executable).parent
        env = {**os.environ, "PATH": f"{programs}:{os.environ['PATH']}", "COLUMNS": str(COLUMNS), "NO_COLOR": "1"}
        done = subprocess.run(
            command, shell=True, cwd=self.folder, env=env, capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise QuadctlError(f"'{command}' failed: {done.stderr.strip()}")
        return done.stdout

    def write(self, name: str, text: str) -> str:
        """A block with the text of a file, which is written."""
        (self.folder / name).write_text(text + "\n", encoding="utf-8")
        return f"```yaml\n{text}\n```"

    @cached_property
    def found(self) -> Discovery:
        """Discovery on the two flights."""
        return discover(self.folder / VEHICLE, [self.folder / name for name in LOGS])

    @cached_property
    def later(self) -> Comparison:
        """The fitted model on a flight that no fit has seen."""
        return compare(self.folder / "fitted.yaml", self.folder / "later.csv")

    @cached_property
    def steps(self) -> MetricsTable:
        """Step responses: without and with the compensator, and the reference."""
        flown, high = (sorted((self.folder / name).glob("*.csv")) for name in ("steps", "high"))
        return metrics(read_logs(flown), read_logs(high), window=Window(phase="step"))

    @property
    def trims(self) -> dict[str, float]:
        """Bound of each nuisance of a flight, by name."""
        return {kind.name: kind.bound for kind in KINDS}

    def parameter(self, name: str) -> dict[str, float]:
        """Parameter of the last model, such as `rotor_drag.linear d_x`: value, ends of its interval, hidden truth."""
        effect, _, symbol = name.partition(" ")
        model = self.found.model
        truth = true_model(model.vehicle, load_hidden(self.folder / "hidden.yaml"), "the hidden truth")
        item = next(item for item in model.stack if item.effect.name == effect)
        hidden = next(hidden for hidden in truth.effects if hidden.name == effect)
        low, high = item.fitted.ci95[symbol] if item.fitted else (np.nan, np.nan)
        return {"value": getattr(item.effect, symbol), "low": low, "high": high, "truth": getattr(hidden, symbol)}

    def figure(self, name: str, alt: str, width_px: int = SHOWN_WIDTH_PX) -> str:
        """The figure, saved beside the page, as the page shows it."""
        _save(_DRAWN[name](self), DOCS / f"tutorial-{name}.png")
        return f'<img src="tutorial-{name}.png" width="{width_px}" alt="{alt}">'

    def tracks(self) -> dict[str, Tracking]:
        """Heights of the step responses, by the model that was compensated with."""
        logs = read_logs(sorted((self.folder / "steps").glob("*.csv")))
        names = "without", "with fitted.yaml"
        return {name: tracking(log, Window(phase="step")) for name, log in zip(names, logs, strict=True)}

    def residual(self, variable: str, axis: str) -> Figure:
        """Residual of the rigid body over a variable."""
        before = self.found.before
        return plots.residual_over_variable(
            before, next(p for p in before.profiles if (p.variable, p.axis) == (variable, axis))
        )

    def drag(self) -> Figure:
        """The residual of the runs over forward speed, without and with rotor drag."""
        added = add("rotor_drag.linear", self.folder / "step1.yaml", self.folder / "runs.csv")
        return plots.effect_over_variable(effect_curves(added, len(added.model.effects) - 1)[0])


_DRAWN: dict[str, Callable[[Tutorial], Figure]] = {
    "compare": lambda t: t.found.before.plot(),
    "height": lambda t: t.residual("height_over_radius", "up"),
    "open-loop": lambda t: plots.open_loop_errors({"rigid body": t.found.before.open_loop}),
    "ranking": lambda t: t.found.diagnosis.plot(),
    "ratio": lambda t: plots.thrust_ratio(t.found.additions[0], 0),
    "drag": Tutorial.drag,
    "before-after": lambda t: t.found.additions[-1].plot(),
    "ladder": lambda t: t.found.plot(),
    "steps": lambda t: plots.step_heights(t.tracks()),
    "tail": lambda t: plots.step_tail(t.tracks()),
}


def _line(lines: list[str], beginning: str) -> int:
    """Number of the first line that begins with `beginning`."""
    for i, line in enumerate(lines):
        if line.startswith(beginning):
            return i
    raise QuadctlError(f"no line begins with '{beginning}' in:\n" + "\n".join(lines))


def _save(figure: Figure, path: Path) -> None:
    """Save a figure as a small PNG: `WIDE_PX` wide, with a palette."""
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=WIDE_PX / figure.get_figwidth())
    Image.open(drawn).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)


def main() -> None:
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent), undefined=StrictUndefined, keep_trailing_newline=True
    )
    environment.filters["number"] = lambda value: f"{value:#.3g}"
    environment.filters["percent"] = lambda share: f"{share:.0%}"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for part in ("config", "missions"):
            shutil.copytree(ROOT / part, folder / part)
        tutorial = Tutorial(folder)
        page = environment.get_template("tutorial.md.j2").render(t=tutorial)
    PAGE.write_text(page, encoding="utf-8")
    print(f"Written: {PAGE}")


if __name__ == "__main__":
    try:
        main()
    except QuadctlError as error:
        sys.exit(f"error: {error}")
