"""Words of the page's own statements: one table of templates; those of the lab's results stand in `quadctl.lab`."""

from enum import unique

from quadctl.lab.comparison.wording import FORMATS, plain
from quadctl.words import By, Kinds, Template, When, Words

_ERROR: Template = "Acceleration error of the model (RMSE): {error_m_s2:m/s²}, {error_m_s2:of_g} of g, "


_WORDS = Words({**FORMATS, "family": plain, "any": lambda names: " or ".join(map(plain, names))})


@unique
class Said(Kinds, words=_WORDS):
    """Statements of the panels, each with its template."""

    ERROR_KNOWN = (_ERROR, "on {flights:listed}; the model was fitted to {fitted:listed} before it was held out.")
    ERROR_ON = (_ERROR, "{where}.")
    ERROR_AS_IT_STANDS = (
        _ERROR,
        "{where}; ",
        When("fitted", "it is fitted to {fitted:listed}", "its parameters are those of the model file"),
        ".",
    )
    ERROR_CROSS_VALIDATED = (_ERROR, "{bias}", When("refitted", ", the other effects refitted"), ": on {held_out}.")
    CROSS_VALIDATED = "cross-validated, {bias}"
    AS_IT_STANDS = "of the model as it stands, {bias}"
    HELD_OUT = "of the model as it is exported, per-flight bias not removed"
    DRAWN_WITHOUT_BIAS = (
        "The plotted lines keep the per-flight bias, as the controller does not know it: with it, the error of the "
        "current model is {off_m_s2:m/s²} {axis}."
    )
    NO_ACCELERATION_IS_CLOSER = (
        "A prediction of zero would be closer here: the measured acceleration is {moves_m_s2:m/s²} {axis} (RMS)."
    )
    APART = "Parameters that are fitted to each flight separately also differ: {differences:listed}."
    APART_BY = "{name} by {least}{size:.2g}{unit}"
    AT_LIMIT = "The per-flight bias reaches its bound: {nuisances:listed}."
    OF_FLIGHTS = "{name} ({flights:listed})"
    MORE_IS = "A missing {family:family} does not explain this (p {p:p}); another missing effect may."
    FACTOR_ONE = "Far from the ground the thrust of the model is that of the vehicle file: factor 1."
    FACTOR = (
        "Far from the ground the thrust of the model is {factor:.3f} times that of the vehicle file. The curve "
        "over height is relative to that; the compensator divides by both."
    )
    WHICH_OF_THEM = (
        "The flights do not tell whether it is {families:any}. The compensator corrects for {family:family}: if it is "
        "not that, the correction is wrong in other flights. Which flight next? (What is missing) looks for one that "
        "tells them apart."
    )
    NO_GROUND = (
        "This model has no effect of the ground: the compensator corrects nothing that this flight shows. What differs "
        "between the flights is chance, or what the rest of the model does to them."
    )
    COMPENSATED = (
        By("better", {True: "Better"}, "Not better"),
        " with the compensator: the part of the error that the ground causes (M_B, the difference from the same step "
        "flown high up) changes by {drop:change}, from {without_m_s:.3f} to {compensated_m_s:.3f} m s. The RMSE of the "
        "whole tracking error, which includes the step itself, changes by {rmse_drop:change}.",
    )
    SHARE = "explains {share:percent} of the squared error of this axis, {of_all:percent} of that of all axes, p {p:p}"
    FITTED_TOGETHER = (
        "The figures are of one fit of the effect together with ",
        When("beside", "{beside:families} and the per-flight bias", "the per-flight bias"),
        "; where they leave the effect out, nothing is fitted again. The errors without it are of another fit, without "
        "it.",
    )
    BESIDE = When("families", "{families:families}", "the rigid body")
