"""All benchmarks, one table, on the terminal and in docs/benchmarks.md. Each time is also given relative to
another time of the same run, because machines differ.

make bench
"""

import os
import platform

from rich.console import Console
from rich.table import Table

from studies.benchmarks import control_tick, lab, lab_growth, simulator
from studies.page import DOCS, table, write_page

PAGE = DOCS / "benchmarks.md"
HEADINGS = ("what", "measured", "relative to another time of the same run")
ABOUT = """# Benchmarks

Written by `make bench` on one machine: {machine}.
Each row also gives the time relative to another time of the same run. A *control tick* is one computation of the
controller, without compensator, with the slowest effect of the catalogue, and with one effect of each family (*all*).
"""


def main() -> None:
    machine = f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}"
    shown = Table(*HEADINGS, title=machine)
    lines: list[tuple[str, ...]] = []
    benches = (lab.rows, lab_growth.rows, lab_growth.rows_of_one_log, simulator.rows, control_tick.rows)
    for rows in benches:
        for row in rows():
            shown.add_row(*row)
            lines.append(row)
    Console().print(shown)
    write_page(PAGE, f"{ABOUT.format(machine=machine)}\n{table(HEADINGS, lines, texts=range(3))}")


if __name__ == "__main__":
    main()
