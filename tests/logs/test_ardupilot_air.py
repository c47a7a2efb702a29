"""Air density of ArduPilot's logs: removed from the outputs by the formula of the firmware that flew."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quadctl.export.ardupilot import ARDUPILOT
from quadctl.export.autopilot import parameters
from quadctl.lab.interface import add
from quadctl.logs.findings import Kind
from quadctl.logs.read import read_log
from quadctl.model import load_model
from tests.support.log_files import Message, mavlink, small_dataflash, telemetry, tlog_bytes
from tests.support.places import DATA

RECORDED = DATA / "real" / "ardupilot47"
CURVE = {"MOT_THST_EXPO": 0.65, "MOT_SPIN_MIN": 0.15, "MOT_SPIN_MAX": 0.95}
US = [5_000_000 + 20_000 * i for i in range(100)]
STANDARD_AT_700_M, BY_TEMPERATURE = 0.9344, 0.8912
"""Density ratio at 700 m, and that of 93.2 kPa at 24 °C."""


def flown(*more: Message, altitude_m: float | None = 700.0) -> bytes:
    """A log at 700 m on a warm day, whose height and pressure are those of the standard atmosphere."""
    pressure_pa = np.linspace(93200.0, 93170.0, 100)
    height_m = 29.2717 * 283.6 * np.log(93200.0 / pressure_pa)
    columns, letters = ("TimeUS,I,Alt,Press,GndTemp", "QBfff")
    rows: list[tuple[object, ...]] = [(t, 0, h, p, 24.0) for t, h, p in zip(US, height_m, pressure_pa, strict=True)]
    if altitude_m is not None:
        columns, letters = columns + ",AltAMSL", letters + "f"
        rows = [(*row, altitude_m) for row in rows]
    curve: Message = ("PARM", "QNf", "TimeUS,Name,Value", [(US[0], n.encode(), v) for n, v in CURVE.items()])
    return small_dataflash(curve, ("BARO", letters, columns, rows), *more, without="PARM")


def version(major: int, minor: int) -> Message:
    return ("VER", "QBB", "TimeUS,Maj,Min", [(US[0], major, minor)])


ORIGIN: Message = ("ORGN", "QBf", "TimeUS,Type,Alt", [(US[0], 0, 700.0), (US[0], 1, 690.0)])


def removed(path: Path) -> dict[str, Any]:
    """Part of the finding on the outputs that is about the density."""
    (chain,) = [found.figures for found in read_log(path).findings if found.kind == Kind.OUTPUT_CHAIN]
    return next((of for of in chain["removed"] if of["of"] == "density"), {})


@pytest.mark.parametrize(
    ("data", "atmosphere", "ratio"),
    [
        (flown(version(4, 7)), "standard", STANDARD_AT_700_M),
        (flown(version(4, 6), ORIGIN, altitude_m=None), "standard", STANDARD_AT_700_M),
        (flown(version(4, 5)), "ground", BY_TEMPERATURE),
        (flown(), "assumed", BY_TEMPERATURE),
    ],
    ids=["4.7", "4.6, which logs only its origin", "4.5", "of an unknown version"],
)
def test_the_density_is_that_of_the_version(tmp_path: Path, data: bytes, atmosphere: str, ratio: float) -> None:
    path = tmp_path / "flight.bin"
    path.write_bytes(data)
    found = removed(path)
    assert found["atmosphere"] == atmosphere
    assert found["density_ratio"] == pytest.approx(ratio, abs=3e-4)


def test_an_unknown_version_is_told(tmp_path: Path) -> None:
    path = tmp_path / "flight.bin"
    path.write_bytes(flown())
    told = "by pressure and temperature, as before version 4.6, as the version is not told"
    assert any(told in note for note in read_log(path).notes)


def test_where_no_altitude_is_logged_nothing_is_removed_for_the_density(tmp_path: Path) -> None:
    path = tmp_path / "flight.bin"
    path.write_bytes(flown(version(4, 7), altitude_m=None))
    assert removed(path) == {}


@pytest.mark.parametrize(
    ("number", "atmosphere", "ratio"), [(0x04070000, "standard", 0.9344), (0x04050000, "ground", 0.8912)]
)
def test_telemetry_tells_version_and_altitude(tmp_path: Path, number: int, atmosphere: str, ratio: float) -> None:
    none = [0] * 8
    said = [
        mavlink.MAVLink_autopilot_version_message(0, number, 0, 0, 0, none, none, none, 0, 0, 0),
        mavlink.MAVLink_scaled_pressure_message(4_000_000, 932.0, 0.0, 2400),
        mavlink.MAVLink_global_position_int_message(4_000_000, 0, 0, 700_000, 0, 0, 0, 0, 0),
        *(mavlink.MAVLink_param_value_message(n.encode(), v, 9, 3, i) for i, (n, v) in enumerate(CURVE.items())),
    ]
    path = tmp_path / "flight.tlog"
    path.write_bytes(tlog_bytes([*((0.0, message) for message in said), *telemetry()]))
    found = removed(path)
    assert found["atmosphere"] == atmosphere
    assert found["density_ratio"] == pytest.approx(ratio, abs=3e-4)


@pytest.mark.skipif(not RECORDED.is_dir(), reason="the recorded flights are not here")
class TestRecorded:
    """Copter 4.7 in SITL, 488 m above the sea; true throttle of hover: 0.364."""

    @pytest.mark.parametrize("name", ["47_h_none", "47_h_batt_sag", "47_h_payload15"])
    def test_outputs_are_the_commanded_thrust(self, name: str) -> None:
        log = read_log(RECORDED / f"{name}.bin")
        outputs = np.mean([log[f"motor{i}_output"] for i in range(1, 5)], axis=0)
        both = np.isfinite(outputs) & (log["throttle_cmd"] > 0.2)
        assert np.median(outputs[both] / log["throttle_cmd"][both]) == pytest.approx(1.0, abs=0.005)

    @pytest.mark.parametrize(("name", "hover"), [("47_h_none", 0.364), ("47_h_payload15", 0.364 * 3.45 / 3.0)])
    def test_the_throttle_of_hover_is_the_true_one(self, name: str, hover: float) -> None:
        rigid = load_model(DATA / "real" / "ardupilot" / "vehicle.yaml")
        model = add("thrust_scale", rigid, [RECORDED / f"{name}.bin"]).model
        (found,) = [row.estimate for row in parameters(model, ARDUPILOT) if row.name == "MOT_THST_HOVER"]
        assert found is not None
        assert found.low < hover < found.high
        assert found.high - found.low < 0.012
