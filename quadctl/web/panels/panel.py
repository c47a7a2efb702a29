"""A panel: its fields are all that it shows; it is drawn again when one of them changes, and only then.

So a figure that a person has zoomed into stays as it is while work goes on elsewhere, and no figure is ever stale.
"""

from abc import ABC, abstractmethod
from collections.abc import Awaitable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple, Protocol, Self

from nicegui.elements.mixins.disableable_element import DisableableElement
from nicegui.elements.upload_files import FileUpload

from quadctl.lab.flights.dataset import HoldOut
from quadctl.vehicle_draft.draft import Answers
from quadctl.web.panels.view import Brush, View


class Bench(Protocol):
    """Actions on the analysis, which all tabs share."""

    async def go(self, step: int) -> None: ...
    async def switch(self, effect: str) -> None: ...
    async def add(self, *effects: str) -> None: ...
    async def add_expression(self) -> None: ...
    async def remove(self, effect: str) -> None: ...
    async def refit(self) -> None: ...
    async def look(self) -> None: ...
    async def suggest(self) -> None: ...
    async def check(self) -> None: ...
    async def fly(self) -> None: ...
    async def open_sample(self) -> None: ...
    async def forget_log(self, path: Path) -> None: ...
    async def hold_out_log(self, path: Path, unseen: bool) -> None: ...
    async def hold_out_by(self, hold_out: HoldOut) -> None: ...
    async def begin_with(self, path: Path) -> None: ...
    def cancel(self) -> None: ...
    def cancel_search(self) -> None: ...
    def dismiss(self) -> None: ...


class Controls(Protocol):
    """Actions of one tab. There is nothing to read from them: a panel shows its own fields and no more."""

    @property
    def bench(self) -> Bench: ...

    async def act(self, work: Awaitable[None]) -> None:
        """Do some work of the bench, which says by itself why where it cannot."""

    def when_idle(self, element: DisableableElement, allowed: bool = True) -> None:
        """Enable `element` only while no work is done, and only where it is `allowed`."""

    def nest(self, panel: "type[Panel]", classes: str = "") -> None:
        """Put a panel here that is drawn again by itself, without the one around it."""

    def look_at(self, flight: str | None = None, axis: str | None = None) -> None: ...
    def choose_channels(self, channels: Sequence[str], over_each_other: bool) -> None: ...
    def select(self, ranges: Brush, axis: str) -> None: ...
    def clear_brush(self) -> None: ...
    def toggle_theme(self) -> None: ...
    def save_session(self) -> None: ...
    def export_model(self) -> None: ...
    async def save_report(self) -> None: ...
    async def take_files(self, files: Sequence[FileUpload]) -> None: ...
    def refuse_file(self, name: str, size: float, too_large: bool) -> None: ...
    async def use_vehicle(self, text: str) -> None: ...
    async def use_new_vehicle(self, answers: Answers) -> None: ...


@dataclass(frozen=True)
class Panel(ABC):
    """A piece of the page. Each field of a subclass has the name, and the type, of an attribute of `View`."""

    @classmethod
    def of(cls, view: View) -> Self:
        """The panel filled with what it asks for."""
        return cls(**{field.name: getattr(view, field.name) for field in fields(cls)})

    def shows_the_same_as(self, other: "Panel | None") -> bool:
        """Compare all fields with those of the last drawing."""
        if type(other) is not type(self):
            return False
        return all(_same(getattr(self, field.name), getattr(other, field.name)) for field in fields(self))

    @abstractmethod
    def draw(self, do: Controls) -> None:
        """Draw the fields, and nothing else, at the present place of the page."""


def _same(one: Any, other: Any) -> bool:
    return one is other or bool(one == other)


class Tab(NamedTuple):
    """One part of the page that is looked at alone."""

    name: str
    """As it stands in the address of the page."""
    title: str
    icon: str
    panels: tuple[type[Panel], ...]
    """From top to bottom."""
