"""The flights: open them, look at their quality, choose which are held out."""

from dataclasses import dataclass
from pathlib import Path

from nicegui import ui
from nicegui.events import GenericEventArguments

from quadctl.lab.comparison.wording import ended
from quadctl.lab.flights.dataset import HoldOut
from quadctl.logs.formats import labels
from quadctl.logs.quality import ChannelQuality
from quadctl.web.elements.html import heading, table, tag
from quadctl.web.elements.upload import StreamedUpload, choose_button
from quadctl.web.panels.glossary import explained
from quadctl.web.panels.panel import Controls, Panel, Tab, work_button
from quadctl.web.panels.vehicle import VehicleChoice, WhichVehicle
from quadctl.web.session.files import LOG_SUFFIXES, MAX_UPLOAD_BYTES, SETTINGS_SUFFIXES
from quadctl.web.work.jobs import Opened
from quadctl.web.work.reading import OpenedLog

_NAMES_AND_SIZES = "(entries) => emit(entries.map(e => [e.file.name, e.file.size, e.failedPropValidation]))"


@dataclass(frozen=True)
class Flights(Panel):
    """The logs, each with its quality report and its role: for fitting, or held out."""

    opened: Opened
    unseen: frozenset[Path]
    hold_out: HoldOut

    def draw(self, do: Controls) -> None:
        if not self.opened.logs:
            return
        several = len(self.opened.usable) > 1
        with tag("section", "card"):
            held = "A flight that you hold out is used by no fit; the error of the model is then computed on it."
            heading("Flights", held if several else "")
            do.nest(WhichVehicle)
            for log in self.opened.logs:
                held_out = log.path in self.unseen if several and log.path in self.opened.usable else None
                _draw_log(do, log, held_out)
            if several:
                self._draw_hold_out(do)

    def _draw_hold_out(self, do: Controls) -> None:
        with tag("div", "line wrap"):
            with tag("span", "muted grow"):
                explained("Cross-validation holds out in turn:")
            choice = ui.toggle(
                {"blocks": "blocks of time", "flights": "whole flights"},
                value=self.hold_out,
                on_change=lambda e: do.act(do.bench.hold_out_by(e.value)),
            )
            do.when_idle(choice.props("dense no-caps unelevated"))


def _sign(log: OpenedLog) -> tuple[str, str]:
    """Icon and colour of a log that cannot be used, that is asked about, or that is used."""
    if log.problem:
        return "error", "bad"
    return ("help", "warn") if log.doubt else ("check_circle", "good")


def _draw_log(do: Controls, log: OpenedLog, held_out: bool | None) -> None:
    """Draw one log; `held_out`: None where there is nothing to choose."""
    with tag("div", "flight") as row:
        row.props["data-log"] = log.path.name
        with tag("div", "line wrap"):
            icon, colour = _sign(log)
            ui.icon(icon).classes(colour)
            tag("span", "effect-name grow", log.path.name)
            if held_out is not None:
                held = ui.switch(
                    "held out", value=held_out, on_change=lambda e: do.act(do.bench.hold_out_log(log.path, e.value))
                )
                do.when_idle(held.props("dense"))
            props = f'flat dense round size=sm aria-label="Leave out {log.path.name}"'
            work_button(do, "", lambda: do.bench.forget_log(log.path), props, "close")
        if log.doubt:
            tag("p", "", f"Not used yet. {log.doubt}.")
        if log.problem:
            tag("p", "problem", ended(log.problem))
        if log.quality is None:
            return
        report = log.quality
        source = f"thrust from {report.thrust_source}" if report.thrust_source else "thrust unknown"
        used = "" if log.flight is None else f", {log.flight.duration_s:.0f} s used (in the air, without gaps)"
        tag("p", "muted", f"{report.duration_s:.0f} s{used}; {source}.")
        with ui.expansion("Quality report").props("dense"), tag("div", "scroll"):
            numbers = dict.fromkeys(("updates", "rate / Hz", "longest gap / s", "missing / %"), "number")
            table("small", {"channel": "", **numbers}, map(_row, report.channels))
        for note in report.notes:
            tag("p", "muted", f"Note: {note}.")


def _row(channel: ChannelQuality) -> tuple[str, ...]:
    several = channel.n_updates > 1
    rate, gap = (f"{channel.rate_hz:.1f}", f"{channel.longest_gap_s:.2f}") if several else ("\u2013", "\u2013")
    return channel.name, str(channel.n_updates), rate, gap, f"{100.0 * channel.nan_share:.1f}"


@dataclass(frozen=True)
class DropZone(Panel):
    """A place to drop flight logs. Without fields it is never drawn again: that would lose what is being dropped."""

    def draw(self, do: Controls) -> None:
        with tag("section", "card"):
            heading("Open flight logs")
            drop_zone(do)


def drop_zone(do: Controls) -> None:
    """Draw a box in which files are dropped, or chosen with a click."""
    with tag("div", "drop"):
        upload = StreamedUpload(multiple=True, max_file_size=MAX_UPLOAD_BYTES, label="Drop flight logs here")
        do.intake.receive(upload, do.take_files)
        upload.props(f'accept="{",".join((*LOG_SUFFIXES, *SETTINGS_SUFFIXES))}" flat bordered color="transparent"')
        # The list of flights says what becomes of them: a tick here would say that a file is used before it was read.
        # In the browser itself: only when it has its answer is a file one that was sent.
        upload.on("uploaded", js_handler=f"() => runMethod({upload.id}, 'removeUploadedFiles', [])")
        upload.on("rejected", lambda event: _refuse(do, event), js_handler=_NAMES_AND_SIZES)
        with tag("div", "line wrap"):
            choose_button(upload, "Choose files", "folder_open", "unelevated")
            tag("span", "muted grow", f"{labels()}; or a vehicle, a model or a session (.yaml).")


def _refuse(do: Controls, event: GenericEventArguments) -> None:
    for name, size, why in event.args:
        do.intake.refuse(str(name), float(size), why == "max-file-size")


TAB = Tab("flights", "Flights", "folder_open", (Flights, DropZone, VehicleChoice))
