"""Words of findings: every kind has a template, and every fact its place in the sentence."""

from collections.abc import Iterator
from string import Formatter

import pytest

from quadctl.effects.rotor_fault import WeakRotor
from quadctl.lab.comparison.wording import on_terminal
from quadctl.lab.finding import Finding, Kind, parameters_of
from quadctl.lab.words import TEMPLATES, in_words
from quadctl.vehicle import Vehicle
from quadctl.words import Template

parse = Formatter().parse

WEAK = parameters_of(WeakRotor(0.05, 3.0), {"loss": (0.04, 0.06)})


def test_every_kind_has_a_template() -> None:
    assert set(TEMPLATES) == set(Kind)


@pytest.mark.parametrize(
    ("finding", "words"),
    [
        (
            Finding(Kind.MISSING, {"families": ["ground_effect", "rotor_drag"]}),
            "Missing: ground effect and rotor drag.",
        ),
        (Finding(Kind.EFFECT, WEAK), "rotor_fault.weak: loss = 0.050 [0.040, 0.060], rotor = 3 (chosen)"),
        (
            Finding(Kind.ERROR, {"before": 1.208, "after": 0.4797, "drop": 0.603}),
            "Held-out acceleration error, per-flight bias removed: 1.21 → 0.480 m/s² (\u221260%).",
        ),
        (
            Finding(
                Kind.SMALL,
                {
                    **WEAK,
                    "alternatives": ["thrust_tilt.fixed"],
                    **{"before": 0.2, "after": 0.15, "unit": "m/s^2", "off_m": 0.1, "off_after_s": 2.3},
                    "depends_on": ["height_over_radius", "climb_rate"],
                },
            ),
            "Measured, but small in these flights: rotor_fault.weak, loss = 0.050 [0.040, 0.060], rotor = 3 (chosen); "
            "or, explaining as much, thrust_tilt.fixed. Held-out error: 0.200 → 0.150 m/s²; alone it moves the vehicle "
            "0.1 m off after 2.3 s. It matters more over larger ranges of rotor height and climb rate. "
            "`quadctl add rotor_fault.weak MODEL.yaml LOG... -o NEW.yaml` adds it.",
        ),
        (
            Finding(Kind.UNTRIED, {"effect": "a.b", "variable": "speed", "needed": 1.0, "unit": "m/s", "span": 0.069}),
            "a.b (it needs speed over a range of 1 m/s; in these data 0.069)",
        ),
        (
            Finding(Kind.NOT_SIGNIFICANT, {"p": 0.3, "limit": 0.01}),
            "its gain is not significant: p 0.30, expected below 0.01",
        ),
        (Finding(Kind.ZERO, {"parameters": ["d_x", "d_y"]}), "these data do not show that d_x or d_y differs from 0"),
    ],
)
def test_a_finding_is_said_with_its_numbers(finding: Finding, words: str) -> None:
    assert in_words(finding) == words


def texts(template: Template) -> Iterator[str]:
    """Texts of a template that are said whatever the facts are."""
    if isinstance(template, str):
        yield template
    elif isinstance(template, tuple):
        for part in template:
            yield from texts(part)


def test_no_fact_of_a_template_is_optional() -> None:
    """A fact that is forgotten is an error, and no gap in a sentence."""
    needing = [
        kind for kind, template in TEMPLATES.items() for text in texts(template) if [n for _, n, *_ in parse(text) if n]
    ]
    assert len(needing) > 20
    for kind in needing:
        with pytest.raises(KeyError):
            in_words(Finding(kind))


def test_a_verdict_may_hold_only_if_it_was_that_vehicle(raptor: Vehicle) -> None:
    said = "No missing effect is found, if the vehicle is raptor (1.5 kg)."
    assert in_words(Finding(Kind.NOTHING_SIGNIFICANT), raptor) == said


def test_a_terminal_gets_signs_that_it_has() -> None:
    assert on_terminal("1 → 2 m/s² (\u22123%)") == "1 -> 2 m/s^2 (-3%)"
