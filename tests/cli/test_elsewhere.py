"""All commands on a computer that is no Linux: without MAVSDK, without what POSIX alone has, on a console of cp1252.

What needs none of it works, and what does says in one sentence what is missing.
"""

import http.client
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from quadctl.effects.ground_effect import Exponential
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.frames import GRAVITY_M_S2
from quadctl.logs.csv_log import write_csv
from quadctl.model import Model, Provenance, save_model
from quadctl.vehicle import Vehicle
from quadctl.web.session.session import AUTOSAVED, load_session
from tests.support.commands import Result, commands
from tests.support.flights import obedient
from tests.support.places import ROOT
from tests.support.thrust_stand import measured

ELSEWHERE = ROOT / "tests" / "support" / "elsewhere"
NOBODY = "udpin://127.0.0.1:1"
LIGHT = """
init copy
mission list
mission show figure8
vehicle show config/vehicles/raptor.yaml --plot vehicle.png
vehicle new new.yaml --mass 1.5 --propeller 0.24 --frame quad-x --arm 0.18 --hover-throttle 0.4
check missions/short_hop.yaml
simulate missions/short_hop.yaml --log-dir flown --json flown.json
ports
logs one.csv --to mcap -o converted --plot consistency.png
logs one.csv --guess
compare config/vehicles/raptor.yaml one.csv
add exponential config/vehicles/raptor.yaml one.csv -o fitted.yaml
fit fitted.yaml one.csv -o again.yaml
verify fitted.yaml two.csv
remove exponential fitted.yaml -o less.yaml
export drag.yaml --to px4 -o drag.params
export fitted.yaml --to numpy -o dynamics.py
tune leaning.csv --config config/flight.yaml
rotation config/vehicles/raptor.yaml one.csv
metrics one.csv --setpoint 0.6 --from 5 --to 20
report fitted.yaml one.csv --paper paper
thrust-stand config/vehicles/raptor.yaml --from stand.csv -o stand.yaml --plot stand.png
fleet vehicles --model config/vehicles/raptor.yaml
"""
"""Lines of commands that run here, in their order: later ones read what earlier ones write."""
HEAVY = """
ground-curve heights.csv --vehicle config/vehicles/raptor.yaml -o curve.yaml --plot curve.png
compare config/vehicles/raptor.yaml one.csv --html compared.html
diagnose curved.yaml one.csv --html diagnosed.html
discover curved.yaml one.csv -o found.yaml --jobs 2
surfaces curved.yaml one.csv two.csv -o surfaces.yaml
suggest drag.yaml one.csv --missions few
demo
"""
"""Further lines, of some seconds each; the last leaves out a flight in real time."""
REFUSED = f"""
fly missions/short_hop.yaml
fly missions/short_hop.yaml --link {NOBODY} --config copy/config/flight.yaml
fly missions/short_hop.yaml --sitl
check missions/short_hop.yaml --link {NOBODY}
export drag.yaml --to px4 --link {NOBODY}
thrust-stand config/vehicles/raptor.yaml --link {NOBODY} --unit g --yes-props-are-safe -o measured.yaml
mocap --source udp://127.0.0.1:5005 --link {NOBODY} --body raptor
"""
"""Lines that need MAVSDK."""
SERVED = ("lab",)
"""Commands that do not end by themselves."""
PATIENCE_S = 60.0


def words(lines: str) -> list[list[str]]:
    return [line.split() for line in lines.split("\n") if line]


def environment() -> dict[str, str]:
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    path = os.pathsep.join(map(str, (ELSEWHERE, ROOT)))
    return inherited | {"PYTHONPATH": path, "PYTHONIOENCODING": "cp1252", "COLUMNS": "130", "OPENBLAS_NUM_THREADS": "1"}


def run(lines: list[list[str]], folder: Path) -> dict[str, Result]:
    """Run lines one after the other in one process; their results by line."""
    done = subprocess.run(
        [sys.executable, str(ELSEWHERE / "run_lines.py"), str(folder)],
        cwd=folder,
        env=environment(),
        input=json.dumps(lines),
        capture_output=True,
        text=True,
        check=True,
    )
    results = (Result(*result) for result in json.loads(done.stdout))
    return {" ".join(line): result for line, result in zip(lines, results, strict=True)}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, raptor: Vehicle) -> Path:
    """A folder with flights and measurements."""
    made = tmp_path_factory.mktemp("elsewhere")
    truth = Model(raptor).plus(Exponential(a=0.3, b=6.0))
    for name, seed in (("one.csv", 1), ("two.csv", 2), ("vehicles/a/1.csv", 3)):
        (made / name).parent.mkdir(parents=True, exist_ok=True)
        write_csv(obedient(truth, 30.0, noise_m_s=0.01, seed=seed, name=name), made / name)
        (made / name).with_suffix(".meta.yaml").write_text(f"surface: {'sand' if seed == 1 else 'grass'}\n")
    flown = obedient(truth, 30.0, name="leaning.csv")
    told, seen = (4.0 * np.sin(2.1 * (flown.time_s - late_s)) for late_s in (0.0, 0.2))
    leaning = {"roll_cmd_deg": told, "pitch_cmd_deg": told, "roll_deg": seen, "pitch_deg": seen}
    write_csv(replace(flown, columns=flown.columns | leaning), made / "leaning.csv")
    drag = Model(raptor).plus(LinearDrag(0.4, 0.4, 0.0), Provenance(logs=("one.csv",), ci95={"d_x": (0.35, 0.45)}))
    save_model(drag, made / "drag.yaml")
    save_model(truth, made / "curved.yaml")
    (made / "few").mkdir()
    for name in ("forward_runs.yaml", "vertical_runs.yaml"):
        shutil.copy(ROOT / "missions" / name, made / "few")
    heights = (0.1, 0.14, 0.19, 0.27, 0.4, 0.55, 0.8, 1.2)
    rows = (f"{z},{1.0 + 0.3 * 2.718 ** (-6.0 * z)}\n" for z in heights for _ in range(2))
    (made / "heights.csv").write_text("height_m,thrust_ratio\n" + "".join(rows))
    points = (f"{p.throttle},{p.rpm},{1000.0 * p.thrust_n / GRAVITY_M_S2}\n" for p in measured())
    (made / "stand.csv").write_text("throttle,rpm,thrust_g\n" + "".join(points))
    return made


@pytest.fixture(scope="module")
def done(folder: Path) -> dict[str, Result]:
    """Results of the lines that take a moment each."""
    return run(words(LIGHT) + words(REFUSED), folder)


def test_no_command_is_forgotten() -> None:
    lines = [*words(LIGHT), *words(HEAVY), *words(REFUSED), SERVED]
    unknown = {command.words for command in commands()}
    unknown -= {tuple(line[:n]) for line in lines for n in (1, 2)}
    assert not unknown, "what does it do without MAVSDK?"


@pytest.mark.parametrize("line", [" ".join(line) for line in words(LIGHT)])
def test_a_command_that_flies_nothing_works(done: dict[str, Result], line: str) -> None:
    result = done[line]
    assert result.status == 0 and result.out and not result.err, result


@pytest.mark.parametrize("line", [" ".join(line) for line in words(REFUSED)])
def test_a_command_that_needs_mavsdk_says_so_in_one_sentence(done: dict[str, Result], line: str) -> None:
    result = done[line]
    assert result.status == 1 and result.err.count("\n") == 1, result
    assert "needs MAVSDK" in result.err and "macOS 15" in result.err


def test_characters_that_the_console_lacks_are_replaced(done: dict[str, Result]) -> None:
    drawn = done["mission show figure8"].out
    assert drawn.count("*") > 20 and "?" not in drawn


@pytest.mark.long
@pytest.mark.timeout(900)
def test_a_command_of_many_seconds_works(folder: Path) -> None:
    for line, result in run(words(HEAVY), folder).items():
        assert result.status == 0 and result.out and not result.err, (line, result)
        if line == "demo":
            assert "7. Over MAVLink: left out, as a flight in real time needs MAVSDK" in result.out


def test_the_page_is_served_and_its_worker_works(folder: Path) -> None:
    with served(folder, "lab", "one.csv", "--no-open", "--out", "page") as port:
        connection = http.client.HTTPConnection("127.0.0.1", port)
        connection.request("GET", "/")
        assert connection.getresponse().status == 200
        until_s = time.monotonic() + PATIENCE_S
        while not errors_of(folder / "page" / AUTOSAVED):
            assert time.monotonic() < until_s, "the flight has not been compared"
            time.sleep(0.1)


def errors_of(session: Path) -> list[float]:
    """Errors of the steps of a saved session, as far as they are known."""
    if not session.is_file():
        return []
    errors = (step.error_m_s2 for step in load_session(session).sequence)
    return [error for error in errors if error is not None]


@contextmanager
def served(folder: Path, *line: str) -> Iterator[int]:
    """Start a command that serves a page, at the port that it gives."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    command = [sys.executable, "-m", "quadctl", *line, "--port", str(port)]
    with subprocess.Popen(
        command, cwd=folder, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="cp1252"
    ) as process:
        assert process.stdout is not None
        try:
            assert any(f"127.0.0.1:{port}" in said for said in process.stdout), "it has ended"
            yield port
        finally:
            process.send_signal(signal.SIGINT)
