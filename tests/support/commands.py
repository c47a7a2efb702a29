"""Commands: all of them, as typer knows them, and their results as a user meets them."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import typer

from quadctl.cli import app


class Result(NamedTuple):
    status: int
    out: str
    err: str


class Known(NamedTuple):
    """A command as typer knows it."""

    words: tuple[str, ...]
    function: Callable[..., Any]
    parameters: list[Any]


def commands(of: typer.Typer = app, before: tuple[str, ...] = ()) -> Iterator[Known]:
    """All commands, those of groups too."""
    for info in of.registered_commands:
        assert info.callback is not None
        click: Any = typer.main.get_command_from_info(info, pretty_exceptions_short=False, rich_markup_mode=None)
        yield Known((*before, click.name), info.callback, click.params)
    for group in of.registered_groups:
        assert group.typer_instance is not None
        yield from commands(group.typer_instance, (*before, str(group.name)))
