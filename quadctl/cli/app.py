"""The one application that the commands register with, and the console that they print on."""

from rich.console import Console

from quadctl.cli.overwriting import App

app = App(
    name="quadctl",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
console = Console()
