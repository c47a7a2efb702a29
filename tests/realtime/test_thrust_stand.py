"""`quadctl thrust-stand`: a motor of the mock runs over MAVLink, and a scale at a pseudo terminal weighs its thrust."""

import asyncio
import csv
import json
import math
import os
import signal
import subprocess
import sys
import threading
import tty
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy import stats
from typer.testing import CliRunner, Result

from quadctl.cli import app
from quadctl.errors import QuadctlError
from quadctl.frames import GRAVITY_M_S2
from quadctl.sitl.rules.copter import SimulatedCopter
from quadctl.sitl.rules.px4 import SimulatedAutopilot
from quadctl.sitl.server.server import MavlinkMock
from quadctl.sitl.vehicle.body import Battery
from quadctl.thrust_stand.curves import fit_throttle_line, fit_thrust_curve
from quadctl.thrust_stand.measurement import Point, check_plausible
from quadctl.thrust_stand.motor import StandMotor, clockwise_place
from quadctl.thrust_stand.scale import SerialScale, TypedScale, parse_reading
from quadctl.thrust_stand.student import t_95, two_sided_p
from quadctl.thrust_stand.vehicle_file import with_values
from quadctl.vehicle import load_vehicle
from tests.support.links import RAPTOR, TIMEOUT_S, free_port, mock
from tests.support.places import ROOT

pytestmark = pytest.mark.realtime

VEHICLE = load_vehicle(RAPTOR)
K = VEHICLE.rotor.thrust_n_per_rpm2
THROTTLES = np.linspace(0.25, 0.9, 14)


# --- the fits ------------------------------------------------------------------------------------------------------


def measured(exponent: float = 2.0, offset_n: float = 0.0, noise_n: float = 0.02, seed: int = 0) -> list[Point]:
    """The vehicle's own throttle line; thrust that grows with rpm^exponent and is right at 8000 rpm."""
    random = np.random.default_rng(seed)
    points = []
    for u in THROTTLES:
        thrust = (u - VEHICLE.throttle.offset) / (VEHICLE.throttle.per_newton * 4)
        rpm = 8000.0 * (thrust / (K * 8000.0**2)) ** (1.0 / exponent)
        points.append(Point(float(u), float(rpm), float(thrust + offset_n + noise_n * random.standard_normal())))
    return points


@pytest.mark.parametrize("freedom", [1, 2, 3, 6, 11, 40])
def test_students_distribution_is_that_of_scipy(freedom: int) -> None:
    assert t_95(freedom) == pytest.approx(stats.t.ppf(0.975, freedom), rel=1e-7)
    for t in (0.0, 0.7, -2.0, 9.0):
        assert two_sided_p(t, freedom) == pytest.approx(2.0 * stats.t.sf(abs(t), freedom), abs=1e-13)


def test_intervals_hold_the_truth_in_95_of_100_measurements() -> None:
    held = {"k": 0, "per_newton": 0, "offset": 0}
    for seed in range(150):
        points = measured(seed=seed)
        curve, line = fit_thrust_curve(points, VEHICLE), fit_throttle_line(points, VEHICLE)
        assert curve is not None
        for name, estimate, truth in (
            ("k", curve.k, K),
            ("per_newton", line.per_newton, VEHICLE.throttle.per_newton),
            ("offset", line.offset, VEHICLE.throttle.offset),
        ):
            low, high = estimate.ci95
            held[name] += low <= truth <= high
    assert all(0.9 < count / 150 <= 1.0 for count in held.values()), held


def test_one_k_is_called_too_little_only_where_it_is() -> None:
    def verdict(points: Sequence[Point]) -> str:
        curve = fit_thrust_curve(points, VEHICLE)
        assert curve is not None
        return "enough" if curve.better is None else curve.better.law

    assert [verdict(measured(seed=seed)) for seed in range(200)].count("enough") >= 196
    assert {verdict(measured(exponent=2.3, seed=seed)) for seed in range(20)} == {"power"}
    assert {verdict(measured(offset_n=0.6, seed=seed)) for seed in range(20)} == {"offset"}
    # Sure, but too small to matter
    assert verdict(measured(exponent=2.01, noise_n=1e-5)) == "enough"


def test_where_thrust_follows_another_power_the_exponent_is_found_and_k_is_right_in_hover() -> None:
    curve = fit_thrust_curve(measured(exponent=2.3, noise_n=0.01), VEHICLE)
    assert curve is not None
    assert curve.better is not None
    low, high = curve.better.parameter.ci95
    assert low < 2.3 < high < 2.4
    hover_n = VEHICLE.weight_n / 4
    hover_rpm = 8000.0 * (hover_n / (K * 8000.0**2)) ** (1 / 2.3)
    assert curve.k_to_fly * hover_rpm**2 == pytest.approx(hover_n, rel=5e-3)


def test_the_throttle_line_is_of_all_rotors_together_and_of_the_thrusts_that_are_flown() -> None:
    # The curve bends below and above: only what is flown counts.
    bent = [Point(0.05, math.nan, 0.0), Point(0.1, math.nan, 0.01), *measured(noise_n=0.0), Point(1.0, math.nan, 8.0)]
    line = fit_throttle_line(bent, VEHICLE)
    assert line.per_newton.value == pytest.approx(VEHICLE.throttle.per_newton)
    assert line.offset.value == pytest.approx(VEHICLE.throttle.offset)
    assert (line.max_thrust_per_rotor_n, line.reached_full) == (8.0, True)


# --- files ---------------------------------------------------------------------------------------------------------


def run(*words: str | Path) -> Result:
    return CliRunner().invoke(app, ["thrust-stand", *map(str, words)])


def as_csv(path: Path, header: str, rows: Sequence[Sequence[object]]) -> Path:
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n")
    return path


def test_a_former_measurement_goes_into_a_copy_of_the_vehicle_file(tmp_path: Path) -> None:
    points = measured()
    former = as_csv(
        tmp_path / "former.csv",
        "throttle, rpm, thrust_g",
        [(p.throttle, p.rpm * 1.1, p.thrust_n / GRAVITY_M_S2 * 1000) for p in points],
    )
    out, picture = tmp_path / "new.yaml", tmp_path / "stand.png"
    result = run(RAPTOR, "--from", former, "-o", out, "--plot", picture, "--json", tmp_path / "out.json")
    assert result.exit_code == 0, result.output
    assert "One k is enough" in result.output
    new = load_vehicle(out)
    assert new.rotor.thrust_n_per_rpm2 == pytest.approx(K / 1.21, rel=0.01)
    assert new.throttle.per_newton == pytest.approx(VEHICLE.throttle.per_newton, rel=0.02)
    assert (new.mass_kg, new.rotors) == (VEHICLE.mass_kg, VEHICLE.rotors)
    assert "# first-order motor lag" in out.read_text()
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert json.loads((tmp_path / "out.json").read_text())["one_k_is_enough"] is True
    again = run(RAPTOR, "--from", former, "-o", out)
    assert "is there already" in str(again.exception)
    assert run(RAPTOR, "--from", former, "-o", out, "--force").exit_code == 0
    assert "is read by this command" in str(run(out, "--from", former, "-o", out, "--force").exception)


@pytest.mark.parametrize(
    "throttle",
    [
        "throttle: {per_newton: 0.02, max_thrust_per_rotor_n: 9}  # flow, no offset",
        "throttle:\n  per_newton: 0.02  # block, no offset\n  max_thrust_per_rotor_n: 9",
    ],
)
def test_the_edit_of_a_vehicle_file_adds_a_key_that_it_had_not(throttle: str, tmp_path: Path) -> None:
    lines = RAPTOR.read_text().splitlines()
    path = tmp_path / "vehicle.yaml"
    path.write_text("\n".join(throttle if line.startswith("throttle:") else line for line in lines))
    text = with_values(path, {("throttle", "offset"): 0.125, ("rotor", "thrust_n_per_rpm2"): 1.2e-7})
    new = yaml.safe_load(text)
    assert (new["throttle"]["offset"], new["rotor"]["thrust_n_per_rpm2"]) == (0.125, 1.2e-7)
    assert throttle.partition("#")[2].partition("\n")[0] in text


GOOD = [(p.throttle, p.rpm, p.thrust_n) for p in measured()]
HEADER = "throttle,rpm,thrust_n"


@pytest.mark.parametrize(
    ("header", "rows", "sentence"),
    [
        ("throtle,rpm,thrust_n", GOOD, "unknown column 'throtle' (did you mean 'throttle'?)"),
        ("time,value", [(0, 1)], "its columns are time, value; expected throttle, rpm, thrust_n"),
        ("throttle,thrust_n,thrust_g", GOOD, "has thrust_n and thrust_g, expected one column of thrust"),
        (HEADER, GOOD[:2], "holds 2 throttle steps, expected 3 or more"),
        (HEADER, [], "holds 0 throttle steps"),
        (HEADER, [*GOOD, (0.95, 9000, "OL")], "line 16: thrust_n is 'OL', expected a number"),
        (HEADER, [*GOOD, (0.95, 9000)], "line 16: thrust_n is '', expected a number"),
        (HEADER, [(100 * u, r, t) for u, r, t in GOOD], "line 2: throttle is 25, expected a share from 0 to 1"),
        (HEADER, [(u, r, 102 * t) for u, r, t in GOOD], "are these grams (thrust_g, or --unit g)?"),
        ("throttle,rpm,thrust_g", GOOD, "expected newtons (or thrust_g, thrust_kg, --unit), and a motor that turns"),
        (HEADER, [(u, r, 8 - t) for u, r, t in GOOD], "thrust falls from"),
        (HEADER, [(u, 9000 - r, t) for u, r, t in GOOD], "the rotor speed falls from"),
    ],
)
def test_a_measurement_that_cannot_be_true_is_one_sentence(
    header: str, rows: Sequence[Sequence[object]], sentence: str, tmp_path: Path
) -> None:
    path = as_csv(tmp_path / "bad.csv", header, rows)
    result = run(RAPTOR, "--from", path)
    assert isinstance(result.exception, QuadctlError)
    assert str(result.exception).startswith(str(path))
    assert sentence in str(result.exception)


def test_numbers_that_no_vehicle_has_are_not_written(tmp_path: Path) -> None:
    fast = as_csv(tmp_path / "fast.csv", HEADER, [(u, 100 * rpm, thrust) for u, rpm, thrust in GOOD])
    result = run(RAPTOR, "--from", fast, "-o", tmp_path / "new.yaml", "--json", tmp_path / "out.json")
    assert "raptor.yaml with the measured numbers: rotor.thrust_n_per_rpm2 is 1.1" in str(result.exception)
    assert not (tmp_path / "new.yaml").exists()


@pytest.mark.parametrize("content", [b"\xff\xfe\x00\x01", None])
def test_what_is_no_csv_is_one_sentence(content: bytes | None, tmp_path: Path) -> None:
    path = tmp_path / "bad.csv"
    if content is not None:
        path.write_bytes(content)
    assert isinstance(run(RAPTOR, "--from", path).exception, QuadctlError)


def test_noise_at_idle_is_no_fall_of_thrust() -> None:
    check_plausible([Point(0.1, 1010.0, 0.03), Point(0.15, 1000.0, -0.03)], VEHICLE, "idle")


# --- the scale -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "reading"),
    [
        ("123.4 g", (123.4, "g")),
        ("ST,GS,+0123.4g", (123.4, "g")),
        ("- 0.5 kg", (-0.5, "kg")),
        ("12,5 N", (12.5, "n")),
        ("17", (17.0, "")),
        ("OL", None),
        ("a8f7x", None),
        ("\x007\ufffd", None),
    ],
)
def test_lines_of_scales(line: str, reading: tuple[float, str] | None) -> None:
    assert parse_reading(line) == reading


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


def test_a_person_is_asked_again_after_what_is_no_number() -> None:
    answers = iter(["", "many", "250 kg", "250"])
    scale = TypedScale("g", lambda _: next(answers))
    asyncio.run(scale.tare(0.0))
    assert asyncio.run(scale.thrust_n(0.0)) == pytest.approx(0.25 * GRAVITY_M_S2)


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
    wrong.write_text(with_values(RAPTOR, {("rotor", "thrust_n_per_rpm2"): 1.4e-7, ("throttle", "per_newton"): 0.03}))
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


def test_ardupilot_counts_motors_clockwise_from_the_front() -> None:
    assert [clockwise_place(VEHICLE, number) for number in (1, 2, 3, 4)] == [1, 3, 4, 2]


def test_outputs_that_no_flight_uses_are_not_measured() -> None:
    """ArduPilot flies between MOT_SPIN_MIN and MOT_SPIN_MAX, a motor test goes past both."""
    port = free_port()
    motor = StandMotor(f"udpin://127.0.0.1:{port}", VEHICLE, 1)
    with mock(SimulatedCopter(VEHICLE), port):
        asyncio.run(motor.prepare())
        try:
            assert motor.on_scale([5, 10, 50, 95, 97, 100]) == [15, 50, 95]
            assert (motor.throttle(15), motor.throttle(95)) == (0.0, 1.0)
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
        assert px.wait_until(lambda: px.autopilot.body.rpm[0] > 1000.0, TIMEOUT_S), self.process.poll()

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
