"""Findings of a check: one line each, with a verdict."""

import enum
from collections.abc import Iterable
from typing import Any, NamedTuple


class Verdict(enum.Enum):
    OK = "ok"
    WARNING = "warning"
    REFUSED = "refused"


class Finding(NamedTuple):
    verdict: Verdict
    topic: str
    text: str
    """Result, with the numbers that it was judged by."""

    def __str__(self) -> str:
        return f"{self.topic}: {self.text}"

    def to_dict(self) -> dict[str, Any]:
        return {"verdict": self.verdict.value, "topic": self.topic, "text": self.text}


def judged(topic: str, text: str, *, refused: str | None = None, warning: str | None = None) -> Finding:
    """Finding with the most severe objection; `refused` and `warning` are None without one."""
    if refused is not None:
        return Finding(Verdict.REFUSED, topic, f"{text}: {refused}")
    if warning is not None:
        return Finding(Verdict.WARNING, topic, f"{text}: {warning}")
    return Finding(Verdict.OK, topic, text)


def of_verdict(findings: Iterable[Finding], verdict: Verdict) -> list[Finding]:
    return [finding for finding in findings if finding.verdict is verdict]
