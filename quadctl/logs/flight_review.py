"""Folders of PX4's Flight Review 2 (`flight-review-rs`, `ulog-convert`): a ULog as one Parquet file for each topic.

`TOPIC.parquet` holds the first instance of a topic and `TOPIC_N.parquet` the others, with the fields of the ULog by
their flattened names (`q[0]`); `metadata.json` holds the parameters. Both are as its converter.rs and metadata.rs write
them.
"""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from quadctl.errors import LogError
from quadctl.logs.events import Event, said
from quadctl.logs.findings import Finding, Kind, finding
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.parameter_history import ParameterHistory
from quadctl.logs.ulog import TOPICS, log_of_instances

METADATA = "metadata.json"
MAX_INSTANCES = 10
DEBUG = "DEBUG"
"""Level of messages that are left out."""


class _About(NamedTuple):
    """Contents of `metadata.json` that a log needs."""

    release: object
    history: ParameterHistory
    messages: list[Event]


def read_flight_review(folder: Path) -> FlightLog:
    """Read a folder.

    Raises
    ------
    LogError
        A file in it cannot be read, or there is no position, velocity or attitude.
    """
    about = _about(folder)
    findings: list[Finding] = []
    if not about.history.last:
        findings.append(finding(Kind.NO_PARAMETERS, file=METADATA))
    return log_of_instances(folder, _instances(folder), about.history, about.release, findings, about.messages)


def parameters_in_flight_review(folder: Path) -> dict[str, float]:
    """Last value of each parameter in a folder; {} where it does not hold them.

    Raises
    ------
    LogError
        Its metadata cannot be read.
    """
    return _about(folder).history.last


def _instances(folder: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    for topic in TOPICS:
        names = [topic, *(f"{topic}_{i}" for i in range(1, MAX_INSTANCES))]
        for path in (folder / f"{name}.parquet" for name in names):
            if path.is_file():
                yield topic, _columns(path)


def _columns(path: Path) -> dict[str, Any]:
    import polars as pl  # not needed for the parameters

    try:
        table = pl.read_parquet(path)
    except (OSError, pl.exceptions.PolarsError) as error:
        raise LogError(f"{path}: cannot be read as Parquet ({str(error).splitlines()[0]}), expected a topic") from None
    return {name: table[name].to_numpy() for name in table.columns if table[name].dtype != pl.String}


def _history(found: Mapping[str, Any]) -> ParameterHistory:
    changes = (
        (1e-6 * change.get("timestamp_us", 0.0), change["name"], float(change["value"]))
        for change in found.get("changed_parameters", [])
    )
    return ParameterHistory(changes, {name: float(value) for name, value in found.get("parameters", {}).items()})


def _about(folder: Path) -> _About:
    path = folder / METADATA
    if not path.is_file():
        return _About(None, ParameterHistory(), [])
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        told = [message for message in found.get("logged_messages", []) if message["level"].upper() != DEBUG]
        return _About(
            found.get("ver_sw_release"),
            _history(found),
            said([1e-6 * message["timestamp_us"] for message in told], [message["message"] for message in told]),
        )
    except OSError as error:
        raise LogError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        reason = f"{type(error).__name__}: {error}"
        raise LogError(f"{path}: cannot be understood ({reason}), expected a file of Flight Review") from None
