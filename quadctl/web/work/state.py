"""State of the analysis besides the session, as values: work in progress, the last message, results for the model."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from quadctl.lab.evaluation import Evaluation
from quadctl.lab.evidence import Evidence
from quadctl.lab.planning.suggestion import Suggestion
from quadctl.lab.tracking.step_response import StepResponses
from quadctl.web.session.findings import Diagnosed

LOOKING = "Looking for what is missing"
"""Title of the search."""


@dataclass(frozen=True)
class Work:
    """Work in progress: its title, and the step that it is at."""

    title: str
    detail: str = ""


@dataclass(frozen=True)
class Message:
    """One sentence for the person at the page."""

    kind: Literal["error", "done", "found"]
    """`found` says what a search has found, which the part of the page on it shows, too."""
    text: str
    undo: bool = False
    """True of a change of the model that can be taken back."""
    go_back: bool = False
    """True of a new session, from which there is a way back to the one before."""


@dataclass(frozen=True, eq=False)
class Gathered:
    """The evidence for an effect, and the search that tried it beside others; None where none on these
    flights did."""

    evidence: Evidence
    search: Diagnosed | None


@dataclass(frozen=True, eq=False)
class Results:
    """Results for the current model; emptied when the model or the flights change."""

    evaluation: Evaluation | None = None
    found: Diagnosed | None = None
    before: Diagnosed | None = None
    """Findings for an earlier model of this sequence, shown until there are some for this one."""
    evidence: Mapping[str, Gathered | None] = field(default_factory=dict)
    """Evidence for the effects that it was asked for, by their names; None where it is not there yet."""
    suggestion: Suggestion | None = None
    steps: StepResponses | None = None
    checked: tuple[str, ...] | None = None
    """Warnings of the check of the compensator; None before the check."""
    refused: str = ""
    """Reason why the compensator must not fly."""
