"""`quadctl thrust-stand`: a motor of the mock runs over MAVLink, and a scale at a pseudo terminal weighs its thrust."""

import asyncio
import csv
import os
import signal
import subprocess
import sys
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from quadctl.cli import app
from quadctl.errors import QuadctlError
from quadctl.frames import GRAVITY_M_S2
from quadctl.settings_text import with_numbers
from quadctl.sitl.rules.copter import SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.server.server import MavlinkMock
from quadctl.sitl.vehicle.body import Battery
from quadctl.thrust_stand.motor import StandMotor
from quadctl.thrust_stand.scale import SerialScale
from quadctl.vehicle import Vehicle, load_vehicle
from tests.support.links import RAPTOR, TIMEOUT_S, free_port, mock
from tests.support.places import ROOT
from tests.support.thrust_stand import VEHICLE, K

pytestmark = pytest.mark.realtime


def run(*words: str | Path) -> Result:
    return CliRunner().invoke(app, ["thrust-stand", *map(str, words)])


# --- the scale -----------------------------------------------------------------------------------------------------


@contextmanager
def fake_scale(line: Callable[[], bytes]) -> Iterator[str]:
    """A serial port that sends a line fifty times a second."""
    ours, theirs = os.openpty()
    tty.setraw(theirs)
    stopping = threading.Event()

    def talk() -> None:
        while not stopping.wait(0.02):
            os.write(ours, line())

    thread = threading.Thread(target=talk)
    thread.start()
    try:
        yield os.ttyname(theirs)
    finally:
        stopping.set()
        thread.join()
        os.close(ours)
        os.close(theirs)


@pytest.mark.parametrize(
    ("line", "unit", "sentence"),
    [
        (b"", None, "sends nothing"),
        (b"\xf3\x07\xe1\r\n", None, "expected lines such as '123.4 g': check its baud rate"),
        (b"123.4\r\n", None, "sends '123.4' without a unit: say --unit g, kg or n"),
        (b"123.4 g\r\n", "n", "sends '123.4 g', but --unit says n"),
    ],
)
def test_a_scale_that_cannot_be_used_says_why(
    line: bytes, unit: str | None, sentence: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("quadctl.thrust_stand.scale.SILENCE_S", 0.2)
    with (
        fake_scale(lambda: line) as port,
        SerialScale(port, unit) as scale,
        pytest.raises(QuadctlError) as error,
    ):
        asyncio.run(scale.thrust_n(0.1))
    assert sentence in str(error.value)


# --- the measurement, over MAVLink -----------------------------------------------------------------------------------


def weighed(px: MavlinkMock, rotor: int) -> Callable[[], bytes]:
    """Readings of a scale, in grams, on which there is also a mount of 50 g."""
    return lambda: b"%.2f g\r\n" % (50.0 + 1000.0 * K * px.autopilot.body.rpm[rotor] ** 2 / GRAVITY_M_S2)


QUICK = ("--yes-props-are-safe", "--steps", "6", "--lowest", "30", "--settle", "0.3", "--average", "0.2")


@pytest.mark.parametrize(("kind", "motor"), [(SimulatedAutopilot, 1), (SimulatedCopter, 2)])
def test_a_motor_is_measured_and_its_numbers_go_into_the_vehicle_file(
    kind: type[SimulatedAutopilot], motor: int, tmp_path: Path
) -> None:
    """The mock obeys the vehicle file, but for the battery that sags; what is asked for is known to be wrong."""
    wrong = tmp_path / "wrong.yaml"
    values = {("rotor", "thrust_n_per_rpm2"): 1.4e-7, ("throttle", "per_newton"): 0.03}
    wrong.write_text(with_numbers(RAPTOR, values, Vehicle, "vehicle file"))
    port, raw, out = free_port(), tmp_path / "raw.csv", tmp_path / "new.yaml"
    with mock(kind(VEHICLE), port) as px, fake_scale(weighed(px, motor - 1)) as scale:
        link = f"udpin://127.0.0.1:{port}"
        words = ("--link", link, "--scale", scale, "--motor", motor, "--raw", raw, "-o", out, *QUICK)
        result = run(wrong, *map(str, words))
        assert result.exit_code == 0, (result.output, result.exception)
        assert px.wait_until(lambda: max(px.autopilot.body.rpm) < 100.0, TIMEOUT_S)
        assert not px.autopilot.armed
    with raw.open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 6
    volts = sum(float(row["voltage_v"]) for row in rows) / len(rows)
    stronger = (1.0 + 0.5 * (volts / Battery.REFERENCE_V - 1.0)) ** 2  # the mock's battery is full
    new = load_vehicle(out)
    assert new.rotor.thrust_n_per_rpm2 == pytest.approx(K, rel=0.02)
    hover = VEHICLE.throttle.offset + VEHICLE.throttle.per_newton * VEHICLE.weight_n / stronger
    assert new.throttle.offset + new.throttle.per_newton * VEHICLE.weight_n == pytest.approx(hover, abs=0.01)


def test_outputs_that_no_flight_uses_are_not_measured() -> None:
    """ArduPilot flies between MOT_SPIN_MIN and MOT_SPIN_MAX, a motor test goes past both."""
    port = free_port()
    motor = StandMotor(f"udpin://127.0.0.1:{port}", VEHICLE, 1)
    with mock(SimulatedCopter(VEHICLE), port):
        asyncio.run(motor.prepare())
        try:
            assert motor.on_scale([5, 10, 50, 95, 97, 100]) == [15, 50, 95]
            assert motor.throttle(15) == 0.0
            assert motor.throttle(95) == pytest.approx(0.9016, abs=4e-3)  # the rest is spent on thin air
        finally:
            asyncio.run(motor.close())


class Stand:
    """The command in a process of its own, in the middle of its first step."""

    def __init__(self, px: MavlinkMock, port: int, scale: str, where: Path) -> None:
        command = ["thrust-stand", str(RAPTOR), "--link", f"udpin://127.0.0.1:{port}", "--scale", scale]
        slow = ["--yes-props-are-safe", "--settle", "20", "--lowest", "40", "--raw", str(where / "raw.csv")]
        self.px = px
        self.process = subprocess.Popen(
            [sys.executable, "-c", "from quadctl.cli import main; main()", *command, *slow],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert px.wait_until(lambda: px.autopilot.body.rpm[0] > 1000.0, 4 * TIMEOUT_S), self.process.poll()

    def stopped_after_s(self) -> float:
        """Time of the mock from now until the rotor has nearly stopped."""
        begin_s = self.px.autopilot.time_s
        assert self.px.wait_until(lambda: self.px.autopilot.body.rpm[0] < 500.0, TIMEOUT_S)
        return self.px.autopilot.time_s - begin_s


@pytest.fixture
def stand(tmp_path: Path) -> Iterator[Stand]:
    port = free_port()
    with mock(SimulatedAutopilot(VEHICLE), port) as px, fake_scale(weighed(px, 0)) as scale:
        running = Stand(px, port, scale, tmp_path)
        yield running
        running.process.kill()
        running.process.communicate()


def test_ctrl_c_stops_the_motor_at_once(stand: Stand) -> None:
    stand.process.send_signal(signal.SIGINT)
    assert stand.stopped_after_s() < 0.6
    out, err = stand.process.communicate(timeout=TIMEOUT_S)
    assert "raw.csv" in out
    assert "interrupted after 0 steps: the motor is stopped" in err
    assert stand.process.returncode == 1


def test_a_program_that_hangs_leaves_no_motor_running(stand: Stand) -> None:
    stand.process.send_signal(signal.SIGSTOP)
    assert stand.stopped_after_s() < 1.6
    stand.process.send_signal(signal.SIGCONT)
    assert "held up for" in stand.process.communicate(timeout=TIMEOUT_S)[1]
    assert stand.px.autopilot.body.rpm[0] < 500.0  # and it did not start again


@contextmanager
def running(*words: str, where: Path) -> Iterator[tuple[MavlinkMock, Callable[[], Result]]]:
    """A mock, and the command that measures on it."""
    port = free_port()
    with mock(SimulatedAutopilot(VEHICLE), port) as px, fake_scale(weighed(px, 0)) as scale:
        link = f"udpin://127.0.0.1:{port}"
        yield px, lambda: run(RAPTOR, "--link", link, "--scale", scale, "--raw", where / "raw.csv", *QUICK, *words)


def test_a_motor_that_draws_too_much_is_stopped(tmp_path: Path) -> None:
    with running("--max-current", "5", where=tmp_path) as (px, measure):
        assert "A, more than 5 A: stopped" in str(measure().exception)
        stopped_s = px.autopilot.time_s
        assert px.wait_until(lambda: px.autopilot.body.rpm[0] < 500.0, TIMEOUT_S)
        assert px.autopilot.time_s - stopped_s < 0.6
    steps = (tmp_path / "raw.csv").read_text().splitlines()
    assert 1 < len(steps) < 7  # what was measured until then is kept


def test_a_lost_link_ends_the_measurement(tmp_path: Path) -> None:
    with running("--settle", "20", where=tmp_path) as (px, measure):

        def cut() -> None:
            assert px.wait_until(lambda: px.autopilot.body.rpm[0] > 1500.0, TIMEOUT_S)
            px.faults.silent = px.faults.deaf = True
            cut_s = px.autopilot.time_s
            assert px.wait_until(lambda: px.autopilot.body.rpm[0] < 500.0, TIMEOUT_S)
            stopped_after_s.append(px.autopilot.time_s - cut_s)

        stopped_after_s: list[float] = []
        cutter = threading.Thread(target=cut)
        cutter.start()
        assert "has gone silent" in str(measure().exception)
        cutter.join()
        assert stopped_after_s[0] < 1.6


def test_nothing_turns_without_confirmation_or_on_an_armed_vehicle(tmp_path: Path) -> None:
    port = free_port()
    with mock(SimulatedAutopilot(VEHICLE), port) as px:
        link = f"udpin://127.0.0.1:{port}"
        assert "say --yes-props-are-safe" in str(run(RAPTOR, "--link", link).exception)
        assert px.autopilot.request_arm() is None
        words = ("--link", link, "--scale", "typed", "--raw", tmp_path / "raw.csv")
        armed = run(RAPTOR, *words, *QUICK)
        assert "is armed, expected a disarmed vehicle" in str(armed.exception)
        assert px.motor_tests_received == 0
