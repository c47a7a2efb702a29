"""`quadctl tune` proposes gains from a log, keeps the old ones, and `check --log` compares its lag."""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from quadctl.cli import app
from quadctl.errors import QuadctlError
from quadctl.flight.pilot.settings import load_flight_settings
from quadctl.logs.columns import STATE_COLUMNS
from tests.support.places import ROOT

TIME_S = np.arange(0.0, 40.0, 0.02)
LAG_S = 0.2


def log_of(where: Path, lean_deg: float = 6.0, age_s: float = 0.0) -> Path:
    """A flight whose angles, `age_s` old, follow their setpoints by two first orders of half of LAG_S each."""
    rng = np.random.default_rng(3)
    waves = [np.sin(w * TIME_S + p) for w, p in zip(rng.uniform(0.5, 6.0, 6), rng.uniform(0, 6, 6), strict=True)]
    setpoint = lean_deg / 3.0 * np.sum(waves, axis=0)
    angle = np.zeros((2, len(TIME_S)))
    for k in range(1, len(TIME_S)):
        first, second = angle[:, k - 1]
        for _ in range(20):
            first += 0.001 / (0.5 * LAG_S) * (setpoint[k - 1] - first)
            second += 0.001 / (0.5 * LAG_S) * (first - second)
        angle[:, k] = first, second
    seen = np.interp(TIME_S - age_s, TIME_S, angle[1])
    columns = {name: np.zeros_like(TIME_S) for name in STATE_COLUMNS}
    columns |= {"time_s": TIME_S, "z_m": np.where(TIME_S < 1.0, 0.05, 1.3), "roll_deg": seen, "pitch_deg": seen}
    columns |= {"roll_cmd_deg": setpoint, "pitch_cmd_deg": setpoint, "telemetry_age_s": age_s + 0.0 * TIME_S}
    path = where / "flown.csv"
    np.savetxt(path, np.column_stack(list(columns.values())), "%.6f", ",", header=",".join(columns), comments="")
    return path


def config_in(where: Path) -> Path:
    path = where / "flight.yaml"
    vehicle = ROOT / "config/vehicles/raptor.yaml"
    path.write_text((ROOT / "config/flight.yaml").read_text().replace("vehicles/raptor.yaml", str(vehicle)))
    return path


def run(*arguments: object) -> str:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if isinstance(result.exception, QuadctlError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result.output


def test_gains_of_a_log_are_proposed_and_written_with_the_comments_kept(tmp_path: Path) -> None:
    """0.2 s of attitude and 0.05 s of link: Kv = 2; the file is not touched before it is asked for."""
    config, out = config_in(tmp_path), tmp_path / "out.json"
    before = config.read_text()
    shown = run("tune", log_of(tmp_path, age_s=0.05), "--config", config, "--json", out)
    assert config.read_text() == before
    assert "velocity_horizontal.p" in shown
    result = json.loads(out.read_text())
    assert result["new"]["gains"]["velocity_horizontal.p"] == pytest.approx(2.0, abs=0.1)
    assert result["new"]["margins"]["horizontal"]["stable"]
    run("tune", tmp_path / "flown.csv", "--config", config, "--write")
    written = load_flight_settings(config).controller
    assert written.position_p == pytest.approx(0.4 * written.velocity_horizontal.p, abs=0.002)
    assert "# for a lag of 0.25 s" in config.read_text()
    assert (tmp_path / "flight.yaml.before_tune").read_text() == before
    run("tune", tmp_path / "flown.csv", "--config", config, "--write")
    assert (tmp_path / "flight.yaml.before_tune").read_text() == before
    assert (tmp_path / "flight.yaml.before_tune2").exists()


def test_a_log_that_shows_no_lag_names_the_flight_to_fly(tmp_path: Path) -> None:
    with pytest.raises(QuadctlError, match=r"flown.csv: shows no lag of the attitude, .* fly missions/excitation.yaml"):
        run("tune", log_of(tmp_path, lean_deg=0.01), "--config", config_in(tmp_path))


def test_a_configuration_without_gains_to_replace_says_where_they_go(tmp_path: Path) -> None:
    config = tmp_path / "flight.yaml"
    config.write_text(yaml.safe_dump({"vehicle": str(ROOT / "config/vehicles/raptor.yaml")}))
    with pytest.raises(QuadctlError, match=r"holds no controller.position_p"):
        run("tune", log_of(tmp_path), "--config", config, "--write")
    assert list(tmp_path.glob("*before_tune*")) == []


def test_check_compares_the_lag_of_a_log(tmp_path: Path) -> None:
    shown = run("check", "figure8", "--config", config_in(tmp_path), "--log", log_of(tmp_path))
    assert "attitude lag 0.20 s [0.19, 0.21] in flown.csv, configured none" in " ".join(shown.split())
