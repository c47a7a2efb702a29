"""Findings of a check: one line each, with a verdict."""

import enum
from collections.abc import Iterable
from typing import Any, NamedTuple

from quadctl.words import Fact


class Verdict(enum.Enum):
    OK = "ok"
    WARNING = "warning"
    REFUSED = "refused"


class Finding(NamedTuple):
    verdict: Verdict
    topic: str
    fact: Fact
    """Result, with the numbers that it was judged by."""
    objection: Fact | None = None

    @property
    def text(self) -> str:
        """Result and objection in words."""
        return str(self.fact) if self.objection is None else f"{self.fact}: {self.objection}"

    def __str__(self) -> str:
        return f"{self.topic}: {self.text}"

    def to_dict(self) -> dict[str, Any]:
        objection = {} if self.objection is None else {"objection": self.objection.to_dict()}
        verdict = {"verdict": self.verdict.value, "topic": self.topic, "text": self.text}
        return {**verdict, **self.fact.to_dict(), **objection}


def judged(topic: str, fact: Fact, *, refused: Fact | None = None, warning: Fact | None = None) -> Finding:
    """Finding with the most severe objection; `refused` and `warning` are None without one."""
    if refused is not None:
        return Finding(Verdict.REFUSED, topic, fact, refused)
    return Finding(Verdict.OK if warning is None else Verdict.WARNING, topic, fact, warning)


def of_verdict(findings: Iterable[Finding], verdict: Verdict) -> list[Finding]:
    return [finding for finding in findings if finding.verdict is verdict]
