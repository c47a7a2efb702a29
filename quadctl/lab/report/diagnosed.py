"""The section on what is missing."""

from quadctl.lab import plots
from quadctl.lab.comparison.wording import (
    UNIT,
    change_in_words,
    count,
    held_out,
    listed,
    number,
    p_in_words,
    parameters_in_text,
    percent,
    plain,
    quantity,
)
from quadctl.lab.report.parts import Cell, Results, Section, Table, figure
from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.selection.rule import MATERIAL, SIGNIFICANT, is_supported

SHOWN_CANDIDATES = 8


def missing(r: Results) -> Section | None:
    d = r.diagnosis
    if d is None:
        return None
    floor = r.comparison.noise_floor["total"]
    figures = []
    if d.ranking:
        figures.append(
            figure(
                plots.ranking(d, floor),
                "ranking",
                "Error drop on held-out parts of the flights analysed: what is missing, each on top of those before "
                "it, then the rest on top of what was found. Dark blue: missing; light blue: did well too, but is not "
                "needed; grey: not supported.",
            )
        )
    if len(d.steps) > 1:
        caption = "The error ladder: held-out error of the model as it is, then with each family added, all refitted."
        figures.append(figure(plots.ladder(d, floor), "ladder", caption))
    tables = [_verdict_table(d)]
    if d.ranking:
        tables.append(_ranking_table(d))
    return Section(
        "missing", "What is missing", _diagnosis_text(d, floor), figures, tables=tables, after_text=_look_alikes(d)
    )


def _diagnosis_text(d: Diagnosis, floor: float) -> list[str]:
    tried = count(len(d.ranking), "effect")
    text = [
        f"{tried} of the catalogue were fitted on top of {d.model.name}, each judged on {held_out(d.dataset)}. "
        "p counts autocorrelation and the number of candidates tried."
    ]
    if d.verdict == "missing":
        first, last = d.steps[0].rmse["total"], d.steps[-1].rmse["total"]
        them = "it" if len(d.steps) == 2 else "them"
        families = listed([f"{plain(step.family)} ({step.effect})" for step in d.steps[1:]])
        text.append(
            f"Missing, in the order of adding: {families}. With {them} in, the held-out error goes "
            f"from {quantity(first)} to {quantity(last)}, {percent(1.0 - last / first)} less; the noise floor is "
            f"{quantity(floor)}."
        )
        if d.unexplained:
            text.append("Even so, something is left that the logged variables explain and these effects do not.")
    elif d.verdict == "none":
        text.append("No effect earns its place on unseen data: nothing significant is missing, what is left is noise.")
    else:
        text.append(
            "No effect earns its place on unseen data, yet the logged variables explain part of what is left: "
            "something is there that the catalogue does not hold."
        )
    return text


def _verdict_table(d: Diagnosis) -> Table:
    finding = f"yes: {listed([step.effect for step in d.steps[1:]])}" if d.missing else "no effect does"
    explained = "explain a part that matters" if d.unexplained else "explain nothing that matters"
    left = f"the variables {explained} of what {'these leave' if d.missing else 'the model leaves'}"
    test = f"an effect has p < {SIGNIFICANT:g} and takes more than {MATERIAL:.0%} off one axis, on unseen data"
    rows = {
        "missing": [Cell("missing", test), Cell(finding)],
        "none": [Cell("none", "no effect does, and the logged variables explain nothing of what is left"), Cell(left)],
        "unexplained": [
            Cell("unexplained", "no effect does, yet the variables explain some of what is left"),
            Cell(left),
        ],
    }
    marked = frozenset({list(rows).index(d.verdict)})
    return Table(["possible verdict", "what these data say"], list(rows.values()), words=2, marked=marked)


def _ranking_table(d: Diagnosis) -> Table:
    shown = [c for i, c in enumerate(d.ranking) if i < SHOWN_CANDIDATES or is_supported(c)]
    first_of_family = {c.family: c for c in reversed(shown)}
    rows = [
        [
            Cell(c.effect.name, _candidate_note(c, with_physics=c is first_of_family[c.family])),
            Cell(parameters_in_text(c.effect, c.ci95)),
            Cell(f"{number(c.before['total'])} → {number(c.after['total'])}"),
            Cell(change_in_words(c.held_out_drop)),
            Cell(p_in_words(c.p_value)),
        ]
        for c in shown
    ]
    marked = frozenset(i for i, c in enumerate(shown) if c.effect.name in plots.chosen(d))
    head = ["effect", "parameters [95% interval]", f"held-out error / {UNIT}", "change", "p"]
    return Table(head, rows, words=2, marked=marked)


def _candidate_note(c: Candidate, with_physics: bool) -> str:
    said = [c.effect.physics] if with_physics else []
    return " ".join([*said, *(f"Note: {remark}." for remark in c.remarks)])


def _look_alikes(d: Diagnosis) -> list[str]:
    by_family = {c.family: c.effect for c in reversed(d.ranking)}
    text = []
    for pair in d.confounded:
        known = [by_family[family] for family in pair if family in by_family]
        how = "; ".join(f"{plain(effect.family())} is told by {effect.told_apart_by}" for effect in known)
        text.append(
            f"Look-alikes: these data cannot tell {' from '.join(plain(family) for family in pair)}"
            + (f" ({how})." if how else ".")
        )
    if not d.confounded and d.verdict == "missing":
        text.append("Look-alikes: none; no other effect did as well as those found.")
    if d.suggested_mission:
        text.append(f"To tell more, fly {d.suggested_mission}.")
    return text
