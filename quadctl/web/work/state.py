"""What the page shows besides the session: what is being done, what is said, what is known of the current model."""

from dataclasses import dataclass
from typing import Literal

from quadctl.lab.planning.suggestion import Suggestion
from quadctl.lab.tracking.step_response import StepResponses
from quadctl.web.session.findings import Diagnosed
from quadctl.web.work import jobs


@dataclass
class Work:
    """What is being done now."""

    title: str
    detail: str = ""


@dataclass(frozen=True)
class Message:
    """One sentence for the person at the page."""

    kind: Literal["error", "done"]
    text: str


@dataclass
class Results:
    """What is known of the current model; emptied when it changes."""

    evaluation: jobs.Evaluation | None = None
    found: Diagnosed | None = None
    before: Diagnosed | None = None
    """What the search for an earlier model of this ladder found, until there is one for this."""
    suggestion: Suggestion | None = None
    steps: StepResponses | None = None
    checked: list[str] | None = None
    """What the check of the compensator warns of; None where it has not been asked."""
    refused: str = ""
    """Why the compensator must not fly."""
