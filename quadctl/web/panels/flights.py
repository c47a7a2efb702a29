"""The flights and the vehicle: open, look at their quality, choose which are held out; choose or edit the vehicle."""

from pathlib import Path
from typing import TYPE_CHECKING

import yaml
from nicegui import ui
from nicegui.events import GenericEventArguments, MultiUploadEventArguments

from quadctl.model import Model
from quadctl.web.elements.html import heading, tag
from quadctl.web.session.files import LOG_SUFFIXES, MAX_UPLOAD_BYTES, SETTINGS_SUFFIXES
from quadctl.web.work.jobs import OpenedLog

if TYPE_CHECKING:
    from quadctl.web.page.page import Page

_NAMES_AND_SIZES = "(entries) => emit(entries.map(e => [e.file.name, e.file.size, e.failedPropValidation]))"


def draw_flights(page: "Page") -> None:
    opened = page.bench.opened
    if opened is not None:
        with tag("section", "card"):
            heading("Flights", "Held out: no fit sees it, and the error on top is the error on it.")
            for log in opened.logs:
                _log(page, log)
            if len(opened.usable) > 1:
                _hold_out(page)


def draw_intake(page: "Page") -> None:
    """A part of its own that is never drawn again: a drop zone that is replaced loses what is being dropped."""
    with tag("section", "card"):
        heading("Open flight logs")
        drop_zone(page)


def drop_zone(page: "Page") -> None:
    """Where files are dropped, or chosen with a click."""
    with tag("div", "drop"):
        upload = ui.upload(
            multiple=True,
            auto_upload=True,
            max_file_size=MAX_UPLOAD_BYTES,
            label="Drop flight logs here",
        )
        upload.props(f'accept="{",".join((*LOG_SUFFIXES, *SETTINGS_SUFFIXES))}" flat bordered color="transparent"')
        upload.on_multi_upload(lambda event: _uploaded(page, upload, event))
        upload.on("rejected", lambda event: _rejected(page, event), js_handler=_NAMES_AND_SIZES)
        with tag("div", "line wrap"):
            choose = ui.button("Choose files", icon="folder_open").props("no-caps unelevated")
            # In the browser itself: only there does a click open the window in which files are chosen.
            choose.on("click", js_handler=f"() => getElement({upload.id}).pickFiles()")
            tag("span", "muted grow", "CSV, PX4 ULog (.ulg), ArduPilot DataFlash (.bin), MAVLink (.tlog).")


async def _uploaded(page: "Page", upload: ui.upload, event: MultiUploadEventArguments) -> None:
    await page.take_files(event.files)
    upload.reset()  # what became of them stands above


def _rejected(page: "Page", event: GenericEventArguments) -> None:
    for name, size, why in event.args:
        page.refuse_file(str(name), float(size), why == "max-file-size")


def _log(page: "Page", log: OpenedLog) -> None:
    bench = page.bench
    with tag("div", "flight") as row:
        row.props["data-log"] = log.path.name
        with tag("div", "line wrap"):
            ui.icon("error" if log.problem else "check_circle").classes("bad" if log.problem else "good")
            tag("span", "effect-name grow", log.path.name)
            if not log.problem and bench.opened is not None and len(bench.opened.usable) > 1:
                unseen = log.path in bench.session.unseen
                held = ui.switch(
                    "held out", value=unseen, on_change=lambda e: page.act(bench.hold_out_log(log.path, e.value))
                )
                page.when_idle(held.props("dense"))
            away = ui.button(icon="close", on_click=lambda: page.act(bench.forget_log(log.path)))
            away.props["aria-label"] = f"Leave out {log.path.name}"
            page.when_idle(away.props("flat dense round size=sm"))
        if log.problem:
            tag("p", "problem", f"{log.problem}.")
        if log.quality is None:
            return
        report = log.quality
        source = f"thrust from {report.thrust_source}" if report.thrust_source else "thrust unknown"
        tag("p", "muted", f"{report.duration_s:.0f} s, of it {report.flight_s:.0f} s in flight; {source}.")
        with ui.expansion("Quality report").props("dense"), tag("div", "scroll"), tag("table", "small"):
            with tag("tr"):
                for head in ("channel", "updates", "rate / Hz", "longest gap / s", "missing / %"):
                    tag("th", "" if head == "channel" else "number", head)
            for channel in report.channels:
                with tag("tr"):
                    tag("td", "", channel.name)
                    several = channel.n_updates > 1
                    tag("td", "number", str(channel.n_updates))
                    tag("td", "number", f"{channel.rate_hz:.1f}" if several else "\u2013")
                    tag("td", "number", f"{channel.longest_gap_s:.2f}" if several else "\u2013")
                    tag("td", "number", f"{100.0 * channel.nan_share:.1f}")
        for note in report.notes:
            tag("p", "muted", f"Note: {note}.")


def _hold_out(page: "Page") -> None:
    with tag("div", "line wrap"):
        tag("span", "muted grow", "Of the flights that are fitted, what does each fit not see when it is judged?")
        choice = ui.toggle(
            {"blocks": "blocks of time", "flights": "whole flights"},
            value=page.bench.session.hold_out,
            on_change=lambda e: page.act(page.bench.hold_out_by(e.value)),
        )
        page.when_idle(choice.props("dense no-caps unelevated"))


def draw_vehicle(page: "Page") -> None:
    """The vehicle in use, as the text of its file; others to choose from."""
    model = page.bench.session.rungs[0].model if page.bench.session.rungs else None
    with tag("section", "card vehicle"):
        heading("Vehicle" if model is None else f"Vehicle: {model.vehicle.name}")
        if model is None:
            tag("p", "muted", "Choose the vehicle that flew, or write down its numbers.")
        if page.vehicles:
            with tag("div", "line wrap"):
                for path in page.vehicles:
                    _choice(page, path)
        text = page.template if model is None else _as_text(model)
        with ui.expansion("Edit its numbers").props("dense"):
            box = ui.textarea("Vehicle file (YAML)", value=text).props("outlined autogrow").classes("yaml")
            use = ui.button("Use this vehicle", on_click=lambda: page.use_vehicle(box.value))
            page.when_idle(use.props("no-caps outline"))


def _choice(page: "Page", path: Path) -> None:
    button = ui.button(path.stem, icon="flight", on_click=lambda: page.act(page.bench.begin_with(path)))
    page.when_idle(button.props("no-caps outline"))


def _as_text(model: Model) -> str:
    content = model.vehicle.model_dump(mode="json", exclude_none=True)
    return yaml.safe_dump(content, sort_keys=False, default_flow_style=None)
