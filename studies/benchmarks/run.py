"""All benchmarks, one table, on the terminal and in docs/benchmarks.md. Each time is also given relative to
another time of the same run, because machines differ.

make bench
"""

import os
import platform
from pathlib import Path

from rich.console import Console
from rich.table import Table

from studies.benchmarks import control_tick, lab, lab_growth, simulator
from studies.benchmarks.page import write_page

PAGE = Path(__file__).parents[2] / "docs/benchmarks.md"
HEADINGS = ("what", "measured", "relative to another time of the same run")
ABOUT = """# Benchmarks

Written by `make bench` on one machine: {machine}.
Each row also gives the time relative to another time of the same run. A *control tick* is one computation of the
controller, without compensator, with the slowest effect of the catalogue, and with one effect of each family (*all*).
"""


def main() -> None:
    machine = f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}"
    table = Table(*HEADINGS, title=machine)
    lines = ["| " + " | ".join(HEADINGS) + " |", "| --- | --- | --- |"]
    benches = (lab.rows, lab_growth.rows, lab_growth.rows_of_one_log, simulator.rows, control_tick.rows)
    for rows in benches:
        for row in rows():
            table.add_row(*row)
            lines.append("| " + " | ".join(row) + " |")
    Console().print(table)
    write_page(PAGE, "\n".join([ABOUT.format(machine=machine), *lines]))


if __name__ == "__main__":
    main()
