"""Results that a report is made from."""

from typing import NamedTuple

from quadctl.lab.comparison.comparison import Comparison
from quadctl.lab.selection.addition import Addition
from quadctl.lab.selection.diagnosis import Diagnosis
from quadctl.lab.tracking.step_response import StepResponses
from quadctl.vehicle import Vehicle

ADDED = "with additions"
"""Name of the last model beside the first."""
BEFORE = "before anything was added"


class Shown(NamedTuple):
    """Numbers and words of the page that a report is saved from, and that it repeats."""

    said: tuple[str, ...] = ()
    """Verdict in words, the main sentence first; empty where there is none yet."""
    condition: Vehicle | None = None
    """Vehicle of which nobody has said that it flew, or that the flights contradict."""
    floor_m_s2: float | None = None
    """Lowest reference error of all steps of the model sequence."""
    errors_m_s2: tuple[float, float | None] | None = None
    """Errors of the first and of the current step; None for the second where there is only one step."""
    where: str = ""
    """Data that these errors are computed on."""
    on_unseen: bool = False
    """True where these are flights held out of all fits."""


class Results(NamedTuple):
    """Results that a page is made from."""

    comparison: Comparison
    diagnosis: Diagnosis | None = None
    addition: Addition | None = None
    before_unseen: Comparison | None = None
    after: Comparison | None = None
    steps: StepResponses | None = None
    shown: Shown = Shown()
    improved: Comparison | None = None
    """Model with what was added, on the flights of `comparison`; None without an addition."""
    floors: dict[str, float] | None = None
    """Reference error of the flights of the fit per axis and total, m/s^2; see `lowest_floors`."""

    def titled_last(self, title: str) -> str:
        """`title` of a section on the last model, which says so where the page also has the model given."""
        return title if self.addition is None else f"{title}: {self.comparison.model.name} {ADDED}"

    def titled(self, title: str) -> str:
        """`title` of a section on the model given, which says so where the page also has the model with what was
        added."""
        return title if self.addition is None else f"{title}: {self.comparison.model.name}, {BEFORE}"
