"""Tools for tests of the lab page: the command that serves it, its parts, and the steps of its model sequence."""

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.support.visitors import Visitor, command, free_tcp_port

PARTS = (
    ("What is missing", "h2:has-text('measured and predicted')"),
    ("Over time", "h2:has-text('The flight path')"),
    ("Where it fails", "h2:has-text('On the flight path')"),
    ("Compensator", "h2:has-text('Export')"),
    ("Flights", "h2:has-text('Vehicle')"),
)
"""Parts of the page, and what is there when they are drawn."""
CUT = "labels => labels.filter(l => l.scrollWidth > l.clientWidth + 1).map(l => l.innerText)"
"""Script: the texts that do not fit into their place."""


@contextmanager
def served(out: Path, *arguments: str, port: int | None = None) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """The lab's address, and the process that serves it."""
    port = port or free_tcp_port()
    options = ["--no-open", "--port", str(port), "--out", str(out)]
    with command(port, out.parent / f"{out.name}.log", "lab", *arguments, *options) as process:
        yield f"http://127.0.0.1:{port}", process


def stand_on(visitor: Visitor, step: str) -> None:
    """Go to a step of the model sequence, if the page does not stand there already."""
    named = f":has(.step-name:has-text('{step}'))"
    if not visitor.page.locator(f".step.here{named}").count():
        visitor.clicks_until_it_sees(f".step.here{named}", f".step-button{named}")
    visitor.waits_until_done()
