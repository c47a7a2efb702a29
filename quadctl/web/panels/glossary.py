"""Words that a page explains where they stand: with the mouse over them, or with a tap."""

import re

from nicegui import ui

from quadctl.web.elements.html import tag

GLOSSARY = {
    "fold": (
        "One part of the flights, a few seconds or a whole flight, that is set aside: the model is fitted to the rest "
        "and predicts this part. Every part is set aside once, so no error is computed on data that the fit has seen."
    ),
    "reference error": (
        "What remains, on data not used in its fit, when a flexible regression predicts the residual from all "
        "that was logged: sensor noise, vibration, gusts that nobody measured. A good model comes close to it; one "
        "that holds the right physics can be below it."
    ),
    "sigma": (
        "How many standard errors a mean is away from zero, or from the mean of the flight: it says how certain a "
        "difference is, not how large. 2 sigma happen by chance once in twenty times. The residual drifts for minutes, "
        "so that its samples are not independent; that is counted."
    ),
    "M_A": (
        "Deviation from the commanded position, with its sign, added up over the step: metres times seconds. "
        "0 where it is as long above as below."
    ),
    "M_B": (
        "How far the step near the ground was from the same step flown high up, added up over time: metres times "
        "seconds. It leaves out the lag of the controller itself; 0 means that the ground no longer shows."
    ),
    "per-flight bias": (
        "Offsets that are fitted to each flight: thrust, thrust axis, height, delays, attitude. The battery is not "
        "where it was, the autopilot's level is off by a fraction of a degree. Within 1.5% of the thrust and 0.8°; "
        "anything larger must be an effect."
    ),
    "far from the ground": (
        "So high, 30 rotor radii, that the ground changes the thrust by less than 0.01%. If the factor there is "
        "not 1, the thrust is off by it at every height: thrust coefficient, mass or battery are not those of the "
        "vehicle file. Curve and measured dots over height are divided by it, so that they show the ground alone."
    ),
    "enough to matter": (
        "An effect is called missing where its gain is significant (p below 0.01, for all effects tried together) "
        "and on one axis it either lowers the held-out error by more than 5% and explains more than 0.03 m/s² (root of "
        "the drop of the mean square), or explains more than 0.1 m/s² (1% of g). What is within the per-flight "
        "bias of any flight is listed as not missing, unless it explains half of the error of an axis."
    ),
    "tilt error in acceleration": (
        "An attitude estimator that levels itself by its accelerometer shows too little lean while the vehicle "
        "accelerates: the true lean is larger by this share, or smaller where it is negative. At its limit, the "
        "attitude in the log is doubtful."
    ),
    "over seconds": (
        "Many estimators average their accelerometer over seconds: a long acceleration makes them wrong, also for "
        "some seconds after it has ended. Without this, the error of such an estimator would look like a drag."
    ),
    "windows": (
        "Every window and tab of a browser at this address shows the same session, so that what is changed in one "
        "changes in all. Only what is looked at (part, flight, axis, selection) belongs to each. For another session "
        "beside it, run quadctl lab with another --out folder and --port."
    ),
}
_FORMS = {"folds": "fold", "Sigma": "sigma", "Far from the ground": "far from the ground"}
_WORD = re.compile(rf"\b({'|'.join(map(re.escape, sorted([*GLOSSARY, *_FORMS], key=len, reverse=True)))})\b")


def explained(text: str) -> None:
    """Write `text`; the first of each word of the glossary in it can be asked for its meaning."""
    told: set[str] = set()
    for i, part in enumerate(_WORD.split(text)):
        word = _FORMS.get(part, part)
        if i % 2 and word not in told:
            told.add(word)
            _draw_term(part, GLOSSARY[word])
        elif part:
            ui.label(part).style("display:contents")


def _draw_term(word: str, meaning: str) -> None:
    """Draw a word with its meaning: a tooltip under a mouse, a box after a tap, a click or Enter."""
    with tag("button", "term", word) as term:
        term.props('type="button" aria-haspopup="dialog"').props["aria-label"] = f"{word}: what does it mean?"
        ui.tooltip(meaning).classes("meaning")
        with ui.menu().props("max-width=320px"):
            tag("p", "meaning", meaning)
