"""The help of the page: how to begin, its keys, and its words."""

from nicegui import ui

from quadctl.web.elements.html import tag
from quadctl.web.panels.glossary import GLOSSARY

STEPS = (
    "Drop a flight log: the large number is the acceleration error of the model; the text below says on which data.",
    "What is missing names the effects that the model lacks, with their evidence; Add fits one, and the number falls.",
    "Where it fails and Over time show where, and when, an error is left.",
    "Compensator gives the model as a file, and flies it in simulation.",
)
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
            tag("h2", "title grow", "From a flight to a better model")
            ui.button(icon="close", on_click=dialog.close).props('flat dense round aria-label="Close the help"')
        with tag("ol", "muted"):
            for step in STEPS:
                tag("li", "", step)
        tag("h2", "title", "Keys")
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
