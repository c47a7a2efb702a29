"""Section on missing effects."""

from quadctl.lab import plots
from quadctl.lab.comparison.reservations import is_of_the_thrust, thrust_reservation
from quadctl.lab.comparison.wording import (
    UNIT,
    change_in_words,
    held_out,
    listed,
    number,
    p_in_words,
    parameters_in_text,
)
from quadctl.lab.finding import Finding, Kind
from quadctl.lab.flights.flight import VARIABLE_NAMES
from quadctl.lab.report.numbers import floor_total
from quadctl.lab.report.parts import Cell, Section, Table, figure
from quadctl.lab.report.results import Results
from quadctl.lab.selection.candidate import Candidate
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.selection.rule import RULE, is_supported
from quadctl.lab.selection.unseen import of_unseen
from quadctl.lab.words import Answer, in_words
from quadctl.words import Fact, fact

SHOWN_CANDIDATES = 8
_OTHER_UNITS = {"turning": " N m"}
"""Unit of an error that is none of an acceleration."""


def missing(r: Results) -> Section | None:
    d = r.diagnosis
    if d is None:
        return None
    floor = floor_total(r)
    figures = []
    if any(c.fitted for c in d.ranking):
        figures.append(
            figure(
                plots.ranking(d, floor),
                "ranking",
                "Drop of the held-out error by each candidate that was fitted. Dark blue: missing effects, each added "
                "to those before it; light blue: alternatives to these; grey: not supported. Alternatives and effects "
                "not supported are each added to the missing effects of other families.",
            )
        )
    if len(d.steps) > 1:
        caption = "Model sequence: held-out error of the given model, then with each missing family added."
        figures.append(figure(plots.model_sequence(d, floor), "ladder", caption))
    tables = [_verdict_table(d)]
    if any(c.fitted for c in d.ranking):
        tables.append(_ranking_table(d))
    return Section(
        "missing",
        r.titled("What is missing"),
        [in_words(said) for said in _diagnosis_text(d, floor)],
        figures,
        tables=tables,
        after_text=[in_words(said) for said in (*d.not_fitted, *_confounded(d))],
    )


def _diagnosis_text(d: Diagnosis, floor: float) -> list[Finding | Fact]:
    said: list[Finding | Fact] = [f for f in d.answer if f.kind not in (Kind.EFFECT, Kind.CONFOUNDED, Kind.NEXT_FLIGHT)]
    said += of_unseen(d.unseen, any_missing=True) if d.verdict == "missing" else []
    said.append(
        fact(
            Answer.TRIED,
            tried=len(d.ranking),
            fitted=sum(c.fitted for c in d.ranking),
            model=d.model.name,
            held_out=held_out(d.dataset),
        )
    )
    return [*said, *([fact(Answer.REFERENCE, floor_m_s2=floor)] if d.verdict == "missing" else [])]


def _verdict_table(d: Diagnosis) -> Table:
    finding = f"yes: {listed([step.effect for step in d.steps[1:]])}" if d.missing else "no"
    explains = "yes: the logged variables explain a" if d.unexplained else "no: the logged variables explain no"
    error = "remaining error" if d.missing else "error"
    left = f"{explains} significant part of the {error}{_left_out(d)}"
    test = (
        f"an effect has p < {RULE.significant:g} and lowers the held-out error of one axis by more than "
        f"{RULE.material:.0%} and explains more than {RULE.least_m_s2:g} m/s² of it, or explains more than "
        f"{RULE.material_m_s2:g} m/s²"
    )
    rows = {
        "missing": [Cell("missing", test), Cell(finding)],
        "small": [
            Cell("small", f"no effect is missing, but one has p < {RULE.significant:g} and is too small for that"),
            Cell(f"yes: {listed([group[0].effect.name for group in d.small])}" if d.small else "no"),
        ],
        "none": [
            Cell("none", "no effect is missing or small, and the logged variables explain nothing"),
            Cell("yes" if d.verdict == "none" else "no"),
        ],
        "unexplained": [
            Cell("unexplained", "the logged variables explain a part of the error that no effect explains"),
            Cell(left),
        ],
    }
    marked = frozenset({list(rows).index(d.verdict)})
    return Table(["possible verdict", "what these data say"], list(rows.values()), words=2, marked=marked)


def _left_out(d: Diagnosis) -> str:
    """The variables that are left out where it is said what the error depends on."""
    left_out = [VARIABLE_NAMES[name] for name in d.dataset.followers] if d.dataset.flights else []
    return f" ({listed(left_out)} left out: a controller changes these to counter it)" if left_out else ""


def _ranking_table(d: Diagnosis) -> Table:
    fitted = [c for c in d.ranking if c.fitted]
    shown = [c for i, c in enumerate(fitted) if i < SHOWN_CANDIDATES or is_supported(c)]
    first_of_family = {c.family: c for c in reversed(shown)}
    rows = [
        [
            Cell(c.effect.name, _candidate_note(c, d, with_physics=c is first_of_family[c.family])),
            Cell(parameters_in_text(c.effect, c.ci95)),
            Cell(f"{number(c.before[c.measure])} → {number(c.after[c.measure])}{_OTHER_UNITS.get(c.measure, '')}"),
            Cell(change_in_words(c.held_out_drop)),
            Cell(p_in_words(c.p_value)),
        ]
        for c in shown
    ]
    marked = frozenset(i for i, c in enumerate(shown) if c.effect.name in plots.chosen(d))
    head = ["effect", "parameters [95% interval]", f"held-out error / {UNIT}", "change", "p"]
    return Table(head, rows, words=2, marked=marked)


def _candidate_note(c: Candidate, d: Diagnosis, with_physics: bool) -> str:
    said: list[str | Fact] = [c.effect.physics] if with_physics else []
    said += [fact(Answer.NOTE, remark=remark) for remark in c.remarks]
    reservation = thrust_reservation(d.model.vehicle, d.dataset) if is_of_the_thrust(c.effect) else None
    return " ".join([*map(str, said), *([] if reservation is None else [f"{reservation}."])])


def _confounded(d: Diagnosis) -> list[Finding | Fact]:
    by_family = {c.family: c.effect for c in reversed(d.ranking)}
    found: list[Finding | Fact] = []
    for pair in d.confounded:
        known = [by_family[family] for family in pair if family in by_family]
        how = [fact(Answer.DISTINGUISHED, family=e.family(), distinguished_by=e.distinguished_by) for e in known]
        finding = in_words(Finding(Kind.CONFOUNDED, {"family": pair[0], "others": pair[1:]}))
        found.append(fact(Answer.OTHERS_THAN, finding=finding, distinguished=how))
    if not d.confounded and d.verdict == "missing":
        found.append(fact(Answer.NONE_AS_WELL))
    return [*found, *(f for f in d.answer if f.kind is Kind.NEXT_FLIGHT)]
