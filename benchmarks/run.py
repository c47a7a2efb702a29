"""All benchmarks, one table. Each figure stands beside one of the same run, because machines differ.

make bench
"""

import os
import platform

import control_loop
import lab
import simulator
from rich.console import Console
from rich.table import Table


def main() -> None:
    table = Table(title=f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}")
    for name in ("what", "figure", "beside it, in the same run"):
        table.add_column(name)
    for bench in (lab, simulator, control_loop):
        for row in bench.rows():
            table.add_row(*row)
    Console().print(table)


if __name__ == "__main__":
    main()
