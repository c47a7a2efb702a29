"""Writing of a case: vehicle file, logs and truth."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from studies.worlds.open.draw import Drawn
from studies.worlds.open.sensors import Columns, log_columns
from studies.worlds.open.simulate import Record
from studies.worlds.open.vehicles import vehicle_file
from studies.worlds.open.verdicts import effect_rms, effect_sizes


def _format(name: str) -> str:
    if name.endswith("_rpm"):
        return "%.1f"
    return "%.3f" if name in {"battery_v", "roll_deg", "pitch_deg", "yaw_deg"} or name.startswith("imu") else "%.5f"


def write_log(path: Path, columns: Columns) -> None:
    """Write a log as CSV."""
    names = list(columns)
    rows = np.column_stack([columns[name] for name in names])
    np.savetxt(path, rows, fmt=",".join(map(_format, names)), header=",".join(names), comments="")


def _plain(value: Any) -> Any:
    """Value with the numbers of numpy turned into Python's, rounded."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(f"{float(value):.5g}")
    return value


def write_case(folder: Path, drawn: Drawn, records: Sequence[Record]) -> float:
    """Write the folder of a case and return the size of its effect."""
    case, craft = drawn.case, drawn.craft
    folder.mkdir(parents=True, exist_ok=True)
    content = vehicle_file(craft, craft.time_constant_s if case.lag_known else None, case.ceiling_m)
    (folder / "vehicle.yaml").write_text(yaml.safe_dump(content, sort_keys=False))
    for old in folder.glob("flight*.csv"):
        old.unlink()
    start = 0.0
    for number, record in enumerate(records, 1):
        columns, start = log_columns(record, drawn.hidden, craft, drawn.kit, drawn.generator(number))
        write_log(folder / f"flight{number}.csv", columns)
    if "payload" in drawn.parameters:
        drawn.parameters["payload"]["time_s"] = drawn.hidden.load_time_s - start
    for name, part in effect_sizes(drawn, records).items():
        drawn.parameters[name]["rms_m_s2"] = part
    size = effect_rms(drawn, records)
    truth = {
        "case": case.name,
        "families": list(case.effects),
        "indistinguishable": [list(pair) for pair in case.indistinguishable],
        "effect_rms_m_s2": round(size, 4),
        "parameters": _plain(drawn.parameters),
        "strength": drawn.strength,
        "notes": case.notes,
    }
    (folder / "truth.json").write_text(json.dumps(truth, indent=1))
    return size
