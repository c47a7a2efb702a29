"""The table `what your autopilot adds` to the thrust that is commanded, among the findings of a check."""

from collections.abc import Sequence

from quadctl.flight.preflight.findings import Finding, judged
from quadctl.thrust_chain.chain import TABLE_TILT_DEG, Addition

TOPIC = "thrust chain"


def thrust_findings(additions: Sequence[Addition]) -> list[Finding]:
    """Rows of the table, after a row that says what its columns are."""
    width = max((len(addition.parameters) for addition in additions), default=0)
    heading = f"{'your autopilot adds':{width}} at hover  at {TABLE_TILT_DEG:g} deg"
    rows = [f"{a.parameters:{width}} {a.at_hover:+8.1%} {a.at_tilt:+10.1%}  {a.remark}" for a in additions]
    return [judged(TOPIC, text) for text in (heading, *rows)]
