"""Colours that a browser asks for: those chosen on the page before, else those of its system."""

from collections.abc import Callable

from nicegui import ui

from quadctl.web.elements.theme import DARK, LIGHT, Theme

ANSWER_S = 10.0
"""Longest time to wait for the answer of a browser."""
_WANTS_DARK = (
    "const kept = localStorage.getItem('quadctl-theme');"
    "return kept ? kept === 'dark' : matchMedia('(prefers-color-scheme: dark)').matches;"
)


async def wanted_theme() -> Theme:
    """Ask the browser in which the page is being drawn."""
    try:
        return DARK if await ui.run_javascript(_WANTS_DARK, timeout=ANSWER_S) else LIGHT
    except TimeoutError:  # a browser that is very busy; the page is worth more than its colours
        return LIGHT


def keep_theme(theme: Theme) -> None:
    ui.run_javascript(f"localStorage.setItem('quadctl-theme', '{theme.name}')")


def theme_button(theme: Theme, toggle: Callable[[], object]) -> None:
    """Draw the button that changes to the other colours."""
    dark = theme is DARK
    name = "Light colours" if dark else "Dark colours"
    ui.button(icon="light_mode" if dark else "dark_mode", on_click=toggle).props(
        f'flat round aria-label="{name}" title="{name}"'
    )
