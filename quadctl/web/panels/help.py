"""The help of the page: its keys, and its words."""

from nicegui import ui

from quadctl.web.elements.html import tag
from quadctl.web.panels.glossary import GLOSSARY

KEYS = {
    "1 to 5": "the parts of the page, from left to right",
    "A": "add what is missing",
    "Z": "undo the last change of the model",
    "Shift Z": "redo it",
    "R": "refit all parameters to all flights",
    "?": "this help",
    "Esc": "close it",
}


def help_dialog() -> ui.dialog:
    """The help, closed."""
    with ui.dialog() as dialog, tag("section", "card help").props('aria-label="Help"'):
        with tag("div", "line"):
            tag("h2", "title grow", "Keys")
            ui.button(icon="close", on_click=dialog.close).props('flat dense round aria-label="Close the help"')
        with tag("dl", "keys"):
            for key, meaning in KEYS.items():
                with tag("dt"):
                    tag("kbd", "", key)
                tag("dd", "", meaning)
        tag("h2", "title", "Words")
        with tag("dl", "words"):
            for word, meaning in GLOSSARY.items():
                tag("dt", "", word)
                tag("dd", "muted", meaning)
    return dialog
