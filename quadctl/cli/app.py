"""The one application that the commands register with, and the console that they print on."""

from contextlib import suppress

from rich.console import Console

from quadctl.cli.overwriting import App


class _LastingConsole(Console):
    """Console that goes on without a reader, as in `quadctl ... | head`: no file is lost, and no flight ends by it."""

    def on_broken_pipe(self) -> None:
        """Write to nowhere from now on."""
        with suppress(SystemExit):
            super().on_broken_pipe()


app = App(
    name="quadctl",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
console = _LastingConsole()
