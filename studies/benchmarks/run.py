"""All benchmarks, one table, on the terminal and in docs/benchmarks.md. Each figure stands beside one of the same run,
because machines differ.

make bench
"""

import os
import platform
from pathlib import Path

from rich.console import Console
from rich.table import Table

from studies.benchmarks import control_tick, lab, lab_growth, simulator

PAGE = Path(__file__).parents[2] / "docs/benchmarks.md"
HEADINGS = ("what", "figure", "beside it, in the same run")


def main() -> None:
    machine = f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}"
    table = Table(*HEADINGS, title=machine)
    lines = ["| " + " | ".join(HEADINGS) + " |", "| --- | --- | --- |"]
    for bench in (lab, lab_growth, simulator, control_tick):
        for row in bench.rows():
            table.add_row(*row)
            lines.append("| " + " | ".join(row) + " |")
    Console().print(table)
    about = f"# Benchmarks\n\nWritten by `make bench` on one machine: {machine}. Run it on yours.\n"
    PAGE.write_text("\n".join([about, *lines, ""]), encoding="utf-8")


if __name__ == "__main__":
    main()
