"""Write docs/tracking.md and its figure: `python -m studies.tracking`, or `make tracking`."""

import math
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from studies.autopilots.measured import mock
from studies.page import DOCS, table, wrapped

from . import ground, never_worse
from .comparison import BEATEN, DEFECTS, HALF, ROBUST_MOCKS, Results, compared
from .figure import figure
from .flights import BEFORE, COURSES, FOUND, LAWS, MOCKS, OWN, STEP, UNKNOWN, Mock, planned, unknown_model
from .margins import Transfer, margins, of_autopilot, of_quadctl

PAGE = DOCS / "tracking.md"
FIGURE = "tracking.png"
TITLES = {BEFORE: "thesis' law", UNKNOWN: "quadctl, nothing known", FOUND: "quadctl", OWN: "autopilot's own"}
LAWS_OF_GROUND = {"now": TITLES[FOUND], "before": TITLES[BEFORE]}
HEAD = """# Tracking, beside the autopilots' own control

Written by `make tracking`, in lockstep on the simulated autopilots ([as measured](autopilots.md)). The same references
are flown by the thesis' law (`config/flight_thesis.yaml`; *before* in the figure), by quadctl's without and with the
lag and the drag that `quadctl fit` finds in another flight, and by the autopilot itself, which is sent position,
velocity and acceleration.

These are mocks: their own control is built from the firmwares' sources, without a delay of the link. The real ones
(Copter 4.7-dev, PX4 main of March 2026) flew the courses in the order of the tables with 9.4, 20.5, 13.3, 9.7, 9.0 cm
and, from the second on, with 44.0, 58.6, 44.0, 36.3 cm, so the goals here are no easier.
"""
RMSE = f"""3D RMSE in cm of the autopilot's estimate against the reference of its time. Goals: at most {HALF:g}
times the thesis' law, and at most {BEATEN:g} times the autopilot's own. The step is 1 m: overshoot in
cm, and time until within 10 cm.
"""
STOCK = """The IMU of the stock SIH puts the estimated velocity off by 0.3 m/s for seconds, which no controller can
see.
"""
ROBUST = """The figure 8 with defects: states and setpoints 80 ms late each (the autopilot's own control: setpoints
only); 15 % more mass than in the vehicle file; a fifth of all states and setpoints lost. Margins are
those of linear models along the horizontal axes. The law lowers its gains with a delay that it
measures, which is not counted: without lag and drag it is then worse on PX4 than the thesis' law.
"""
GROUND = """In a world with a drag and a ground effect of no catalogue; both models hold drag and lag as found, one
also an exponential ground effect. M_B in m s as in [the papers](papers.md), RMSE in cm.
"""
NEVER = """Tracking in a world with one effect of each family, without a model of it and with the true one, over
waves in three axes at 0.5 m. Beside a drag both models know the drag. Worse means by more than 2 %.
"""


def main() -> None:
    """Fly, compute, and write the page and its figure."""
    with tempfile.TemporaryDirectory() as folder:
        results = compared(Path(folder))
        grounds = ground.results(Path(folder) / "ground")
    write(results, grounds, [never_worse.compare(effect) for effect in never_worse.TRUTHS])


def write(results: Results, grounds: Sequence[ground.Ground], pairs: Sequence[never_worse.Compared]) -> None:
    """Write the page and its figure."""
    loops = open_loops()
    figure(results, loops).savefig(PAGE.with_name(FIGURE), dpi=110, metadata={"Software": None})
    parts = [
        HEAD,
        "## Courses\n",
        RMSE,
        *(f"### {where.title}\n\n{courses(results, where)}\n" for where in MOCKS),
        STOCK,
        "## Robustness and margins\n",
        ROBUST,
        robustness(results) + "\n",
        margins_said(loops) + "\n",
        f"![Sensitivity of the loops, and the distance from the reference along the figure 8]({FIGURE})\n",
        *((f"Broken off: {'; '.join(results.broken_off)}.\n",) if results.broken_off else ()),
        "## In ground effect\n",
        GROUND,
        ground_said(grounds) + "\n",
        "## Never worse than no model\n",
        NEVER,
        never_said(pairs) + "\n",
        never_words(),
    ]
    PAGE.write_text(wrapped("\n".join(parts)), encoding="utf-8")


def courses(results: Results, where: Mock) -> str:
    """Table of one mock: the courses and the step; and the goals."""
    judged_ = {name: [*judged(results, where.title, name)] for name in COURSES}
    rows = [[name, *cells[: len(LAWS)]] for name, cells in judged_.items()]
    steps = (results.steps[where.title, law] for law in LAWS)
    rows.append(["step", *(f"{100.0 * step.overshoot_m:.0f}, {seconds(step.settled_s)}" for step in steps)])
    return f"{table(['', *(TITLES[law] for law in LAWS)], rows)}\n\n{goals(judged_)}"


def goals(judged_: Mapping[str, Sequence[str]]) -> str:
    """Sentence on the goals: the courses and defects that meet both, and the shares of those that do not."""
    parts = []
    for other, cell in (("thesis' law", len(LAWS)), ("autopilot's own", len(LAWS) + 1)):
        missed = [f"{name} {cells[cell].split()[-1]}" for name, cells in judged_.items() if "not met" in cells[cell]]
        parts.append(f"Goal against the {other}: {'**not met** by ' + ', '.join(missed) if missed else 'met'}.")
    return " ".join(parts)


def judged(results: Results, mock_title: str, name: str) -> Iterator[str]:
    """Cells: the error of each law, and whether the goals are met."""
    errors = {law: results.rmse_m[mock_title, name, law] for law in LAWS}
    yield from (f"{100.0 * error:.1f}" for error in errors.values())
    for met, other in zip(results.is_met(mock_title, name), (BEFORE, OWN), strict=True):
        yield f"{'met' if met else '**not met**'} ({errors[FOUND] / errors[other]:.2f})"


def seconds(time_s: float) -> str:
    return "never" if math.isinf(time_s) else f"{time_s:.1f} s"


def robustness(results: Results) -> str:
    """Errors with each defect, of quadctl and of the autopilot's own control, and whether the goals are met."""
    judged_ = {f"{w.title}: {name}": [*judged(results, w.title, name)] for w in ROBUST_MOCKS for name in DEFECTS}
    found, own = (list(LAWS).index(law) for law in (FOUND, OWN))
    errors = "; ".join(f"{name} {cells[found]} and {cells[own]}" for name, cells in judged_.items())
    return f"RMSE of quadctl and the autopilot's own: {errors}.\n\n{goals(judged_)}"


def open_loops() -> Mapping[tuple[str, str], Transfer]:
    """Linear models of the loops by mock and law, with the attitude's lag of the mock."""
    loops: dict[tuple[str, str], Transfer] = {}
    for where in ROBUST_MOCKS:
        autopilot = mock(where.name)
        for law in (BEFORE, FOUND):
            controller = planned(STEP, where, law, unknown_model(where)).settings.controller
            loops[where.title, law] = of_quadctl(controller, autopilot.vehicle)
        loops[where.title, OWN] = of_autopilot(autopilot.position_law, autopilot.vehicle)
    return loops


def margins_said(loops: Mapping[tuple[str, str], Transfer]) -> str:
    """Peak of the sensitivity, gain, phase and delay margin of the horizontal loops."""
    words = []
    for (title, law), loop in loops.items():
        m = margins(loop)
        figures = f"{m.sensitivity_peak:.2f}, {m.gain:.1f}, {m.phase_deg:.0f} deg, {1e3 * m.delay_s:.0f} ms"
        words.append(f"{title}, {TITLES[law]} {figures}")
    return f"Peak of the sensitivity, gain, phase and delay margin: {'; '.join(words)}."


def ground_said(grounds: Sequence[ground.Ground]) -> str:
    lines = []
    for row in grounds:
        step = f"M_B {row.m_b_signed:.3f} signed, {row.m_b_absolute:.3f} absolute"
        swoop = f"swoop {100.0 * row.swoop_m:.2f}, its height {100.0 * row.swoop_up_m:.2f}"
        lines.append(f"- {LAWS_OF_GROUND[row.law]}, {row.model}: {step}; {swoop}")
    return "\n".join(lines)


def never_said(pairs: Sequence[never_worse.Compared]) -> str:
    """The families whose true model makes tracking worse, and the change of the error by the true models."""
    alone = {pair.effect.name: pair.alone for pair in pairs}
    beside = {pair.effect.name: pair.beside_drag for pair in pairs if pair.beside_drag}
    worse = {f"`{name}`": None for found in (alone, beside) for name, pair in found.items() if pair.worse}
    said = f"Worse with the true model, of {len(pairs)} families: {', '.join(worse) or 'none'}."
    for where, found in (("alone", alone), ("beside a drag", beside)):
        change = {name: pair.with_m / pair.without_m - 1.0 for name, pair in found.items()}
        best, least = min(change, key=change.__getitem__), max(change, key=change.__getitem__)
        said += f" The error changes {where} by {change[best]:+.0%} (`{best}`) to {change[least]:+.1%} (`{least}`)."
    return said


def never_words() -> str:
    """Words on the case in which a true model is worse."""
    pair = never_worse.late_drag()
    return f"""
One case is worse: where the estimate is 20 ms old and nothing tells it, the small drag of `body_drag.quadratic` beside
a known one makes {100.0 * pair.without_m:.2f} cm without its model and {100.0 * pair.with_m:.2f} cm with it."""


if __name__ == "__main__":
    main()
