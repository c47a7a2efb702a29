"""Write a log in another format: CSV (docs/log-format.md), Parquet for tables, MCAP for PlotJuggler and Foxglove."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from quadctl import __version__
from quadctl.errors import LogError
from quadctl.files import written_aside
from quadctl.logs.channel_groups import channel_groups, updates_of_any
from quadctl.logs.columns import PHASE_COLUMN
from quadctl.logs.flight_log import FlightLog
from quadctl.logs.formats import CONVERTERS, writer
from quadctl.logs.sidecar import meta_path


def convert(log: FlightLog, to: str, directory: Path | None = None) -> Path:
    """Write `log` as `<its name>.<to>` and return the path.

    Parameters
    ----------
    to
        One of `quadctl.logs.formats.CONVERTERS`.
    directory
        Folder to write to; the log's own if None.

    Raises
    ------
    LogError
        There is no such format, the file is there already, or it cannot be written.
    """
    if to not in CONVERTERS:
        raise LogError(f"'{to}' is no format to convert to, expected one of {', '.join(CONVERTERS)}")
    source = log.path or Path(log.name)
    target = (source.parent if directory is None else directory) / f"{source.stem}.{to}"
    for path in (target, *([meta_path(target)] if to == "csv" and log.meta else [])):
        if path.exists():
            raise LogError(f"{path}: is there already and would be overwritten, expected another directory")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise LogError(f"{target.parent}: cannot be made ({error.strerror})") from None
    writer(to)(log, target)
    return target


def write_parquet(log: FlightLog, path: Path) -> None:
    """Write all columns, missing values as nulls; `meta` and `notes` as JSON in the file's metadata.

    Raises
    ------
    LogError
        The file cannot be written there.
    """
    table = pl.DataFrame(log.columns).fill_nan(None)
    if log.phase is not None:
        table = table.with_columns(pl.Series(PHASE_COLUMN, log.phase.tolist(), dtype=pl.String))
    about = {"quadctl.meta": json.dumps(log.meta, default=str), "quadctl.notes": json.dumps(log.notes)}
    with written_aside(path) as part:
        table.write_parquet(part, metadata=about)


def write_mcap(log: FlightLog, path: Path) -> None:
    """Write one topic of JSON messages for each channel, at the channel's own updates; log time is `time_s`.

    Raises
    ------
    LogError
        The file cannot be written there.
    """
    with written_aside(path) as part:
        _write_mcap(log, part)


def _write_mcap(log: FlightLog, path: Path) -> None:
    from mcap.writer import Writer

    messages: list[tuple[int, int, dict[str, Any]]] = []
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="", library=f"quadctl {__version__}")
        for name, columns in channel_groups(log).items():
            topic = name.replace(" ", "_")
            schema = writer.register_schema(topic, "jsonschema", _schema(columns, "number"))
            channel = writer.register_channel(f"/{topic}", "json", schema)
            rows = updates_of_any(log, columns)
            values = np.column_stack([log[column][rows] for column in columns]).tolist()
            for row, parts in zip(rows.tolist(), values, strict=True):
                # JSON knows no NaN: a part that is missing is left out.
                messages.append((row, channel, {c: v for c, v in zip(columns, parts, strict=True) if np.isfinite(v)}))
        if log.phase is not None:
            schema = writer.register_schema(PHASE_COLUMN, "jsonschema", _schema((PHASE_COLUMN,), "string"))
            channel = writer.register_channel(f"/{PHASE_COLUMN}", "json", schema)
            begins = np.flatnonzero(np.concatenate([[True], log.phase[1:] != log.phase[:-1]]))
            messages += [(row, channel, {PHASE_COLUMN: str(log.phase[row])}) for row in begins.tolist()]
        times = np.rint(1e9 * log.time_s).astype(np.int64).tolist()
        for sequence, (row, channel, content) in enumerate(sorted(messages, key=lambda message: message[0])):
            data = json.dumps(content).encode()
            writer.add_message(channel, log_time=times[row], publish_time=times[row], data=data, sequence=sequence)
        writer.add_metadata("quadctl", {"log": log.name, "meta": json.dumps(log.meta, default=str)})
        writer.add_metadata("notes", {str(i): note for i, note in enumerate(log.notes, 1)})
        writer.finish()


def _schema(columns: tuple[str, ...], kind: str) -> bytes:
    properties = {column: {"type": kind} for column in columns}
    return json.dumps({"type": "object", "properties": properties}).encode()
