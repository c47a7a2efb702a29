"""A panel: its fields are all that it shows; it is drawn again when one of them changes, and only then.

So a figure that a person has zoomed into stays as it is while work goes on elsewhere, and no figure is ever stale.
"""

from abc import ABC, abstractmethod
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple, Protocol, Self

from nicegui import ui
from nicegui.elements.mixins.disableable_element import DisableableElement

from quadctl.web.elements.upload import SentFile
from quadctl.web.panels.view import View
from quadctl.web.workbench.intake import Intake
from quadctl.web.workbench.workbench import Workbench


class Controls(Protocol):
    """Actions of one tab, of the workbench and of its intake. A panel reads nothing from them: it shows its own fields
    and no more."""

    @property
    def bench(self) -> Workbench: ...
    @property
    def intake(self) -> Intake: ...

    async def act(self, work: Awaitable[None]) -> None:
        """Do some work of the bench or the intake, which says by itself why where it cannot."""

    def when_idle(self, element: DisableableElement, allowed: bool = True) -> None:
        """Enable `element` only while no work is done, and only where it is `allowed`."""

    def nest(self, panel: "type[Panel]", classes: str = "") -> None:
        """Put a panel here that is drawn again by itself, without the one around it."""

    def choose(self, **changes: Any) -> None:
        """Change fields of `Choices`."""

    def show_evidence(self, effect: str) -> None: ...
    def show_vehicles(self) -> None: ...
    def show_help(self) -> None: ...
    def toggle_theme(self) -> None: ...
    async def start_anew(self) -> None: ...
    def save_session(self) -> None: ...
    def export_model(self) -> None: ...
    async def save_report(self) -> None: ...
    async def take_files(self, files: Sequence[SentFile]) -> None: ...
    async def take_model(self, file: SentFile) -> None: ...


@dataclass(frozen=True)
class Panel(ABC):
    """A piece of the page. Each field of a subclass has the name, and the type, of an attribute of `View` or a part."""

    @classmethod
    def of(cls, view: View) -> Self:
        """The panel filled with what it asks for."""
        return cls(**{field.name: view.value(field.name) for field in fields(cls)})

    def shows_the_same_as(self, other: "Panel | None") -> bool:
        """Compare all fields with those of the last drawing."""
        if type(other) is not type(self):
            return False
        return all(_same(getattr(self, field.name), getattr(other, field.name)) for field in fields(self))

    @abstractmethod
    def draw(self, do: Controls) -> None:
        """Draw the fields, and nothing else, at the present place of the page."""


def work_button(
    do: Controls,
    label: str,
    work: Callable[[], Awaitable[None]],
    props: str,
    icon: str | None = None,
    allowed: bool = True,
) -> None:
    """Draw a button that begins some work: it is enabled only while none is done, and only where it is `allowed`."""
    button = ui.button(label, icon=icon, on_click=lambda: do.act(work()))
    do.when_idle(button.props(f"no-caps {props}"), allowed)


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
