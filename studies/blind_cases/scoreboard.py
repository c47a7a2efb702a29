"""The scoreboard of the blind proof: `python -m studies.blind_cases.scoreboard`, or `make hidden`.

Flies all hidden cases (flights are kept under build/hidden), has the lab diagnose them, and prints how often it was
right, beside the goals. The set `tuning` may be looked at while the lab is worked on; `final` is for the report.
"""

import argparse
import dataclasses
import json
import multiprocessing
import os
import statistics
import textwrap
from collections import Counter
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

from rich.console import Console

from studies.page import share, table, write_page

from .cases import HERE, STRENGTHS, Case, all_cases
from .fly import generator_digest
from .judge import Result, judge

ROOT = HERE.parents[1]
GOALS = {"single": (0.98, 0.95, 0.75), "pair": (0.95, 0.85, 0.60)}
"""Share of right cases at strength 1, 0.5 and 0.3."""
FALSE_ALARMS, UNEXPLAINED = 0, (5, 6)
ERROR_LEFT, COVERAGE, SECONDS = 1.10, (0.90, 0.99), 5.0
PAGE = ROOT / "docs" / "hidden-effects.md"
HEAD = """# Hidden effects: how often the lab is right

Written by `make hidden`. Flights are simulated in worlds whose hidden physics is not the code of the catalogue
(`studies/blind_cases`); the lab gets the logs and the vehicle file. Strength 1 is that of real vehicles. Every world
also has rotor coefficients off by 1 %, an attitude bias of up to 0.3 degrees, a height datum off by up to 1 cm, sloping
ground, gusts, an estimator that lags by 20 to 40 ms, slow rotor speeds and lost samples. The seeds are of the set
`final`, run for this report only; the lab was tuned on the set `tuning`.
"""
HEADINGS = ("cases", "strength 1", "0.5", "0.3", "goal")


def main() -> None:
    options = _options()
    cases = [case for case in all_cases(options.set) if _wanted(case, options)]
    folder = ROOT / "build" / "hidden" / generator_digest()
    console = Console(width=150)
    results = run(cases, folder, options.jobs, console)
    rows = scores(results)
    title = f"Hidden effects, seeds of the set '{options.set}'"
    console.print(title, table(HEADINGS, rows, range(5)), sep="\n", markup=False, highlight=False, soft_wrap=True)
    wrong = [line for result in results for line in _wrong(result)]
    console.print(f"{len(wrong)} of {len(results)} cases are wrong:", *wrong, sep="\n", markup=False, soft_wrap=True)
    (folder / f"{options.set}.json").write_text(json.dumps([_as_json(result) for result in results], indent=1))
    if options.set == "final" and len(cases) == len(all_cases(options.set)):
        write_page(PAGE, page(rows, results))
        console.print(f"written: {PAGE}")


def run(cases: Sequence[Case], folder: Path, jobs: int, console: Console) -> list[Result]:
    """All results, in the order of the cases."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # for the processes: two of them have two cores
    results: dict[Case, Result] = {}
    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        pending = {pool.submit(judge, case, folder): case for case in cases}
        for done in as_completed(pending):
            result = done.result()
            results[result.case] = result
            mark = "ok   " if result.right else "WRONG"
            found = result.problem or ", ".join(result.missing) or result.verdict
            console.print(
                f"{len(results):3d}/{len(cases)} {mark} {result.case.name}: {found} ({result.seconds:.1f} s)",
                markup=False,
                highlight=False,
            )
    return [results[case] for case in cases]


def scores(results: Sequence[Result]) -> list[tuple[str, ...]]:
    """Rows of the table: what, at each strength, goal."""
    rows = []
    for kind, goals in GOALS.items():
        label = {
            "single": "one effect: named, and nothing else",
            "pair": "two effects: the same",
        }[kind]
        shares = [share([r.right for r in results if _is(r, kind, s)]) for s in STRENGTHS]
        rows.append((label, *shares, " / ".join(f">= {goal:.0%}" for goal in goals)))
    single = [[r for r in results if _is(r, "single", s)] for s in STRENGTHS]
    small = [share([r.right_but_small for r in group]) for group in single]
    rows.append(("one effect: nothing named, and the right one first of what is small", *small, ""))
    none = [share([r.verdict == "none" for r in group]) for group in single]
    rows.append(("one effect: verdict none", *none, ""))
    kinds = [[r for r in results if _is(r, "unexplained", s)] for s in STRENGTHS]
    shares = [share([r.right for r in group]) for group in kinds]
    rows.append(("outside of the catalogue: called unexplained", *shares, f">= {UNEXPLAINED[0]} of {UNEXPLAINED[1]}"))
    nameless = [share([r.right for r in results if _is(r, "nameless", s)]) for s in STRENGTHS]
    rows.append(("inertia off by 20 %, centre of mass by 4 mm: nothing named", *nameless, ""))
    clean = [r for r in results if r.case.kind == "none"]
    alarms = f"{sum(not r.right for r in clean)} of {len(clean)}" if clean else "-"
    rows.append(("false alarms where nothing is hidden", alarms, "", "", f"{FALSE_ALARMS} of 24"))
    for label, quantile in (("median", 0.5), ("9 of 10 cases", 0.9)):
        left = [
            [r.error_left for r in results if r.case.strength == s and r.case.kind in GOALS and r.error_left]
            for s in STRENGTHS
        ]
        cells = [f"{_quantile(values, quantile):.3f}" if values else "-" for values in left]
        rows.append((f"held-out error over the true effect's, {label}", *cells, f"<= {ERROR_LEFT:.2f}"))
    inside = [[c for r in results if r.case.strength == s for c in r.covered] for s in STRENGTHS]
    low, high = COVERAGE
    rows.append(("true parameters inside their intervals", *map(share, inside), f"{low:.0%} to {high:.0%}"))
    seconds = [[r.seconds for r in results if r.case.strength == s] for s in STRENGTHS]
    cells = [f"{statistics.median(values):.1f} s" if values else "-" for values in seconds]
    rows.append(("processor time per case, median", *cells, f"<= {SECONDS:g} s"))
    return rows


def _is(result: Result, kind: str, strength: float) -> bool:
    return result.case.kind == kind and result.case.strength == strength


def _quantile(values: Sequence[float], q: float) -> float:
    return sorted(values)[min(int(q * len(values)), len(values) - 1)]


def _wrong(result: Result) -> Iterable[str]:
    if not result.right:
        found = result.problem or f"{result.verdict}: {', '.join(result.effects or result.small) or 'nothing'}"
        yield f"- {result.case.name} (expected {_expected(result)}): {found}"


def _as_json(result: Result) -> dict[str, object]:
    return {
        **dataclasses.asdict(result),
        "name": result.case.name,
        "kind": result.case.kind,
        "families": result.case.families,
        "right": result.right,
    }


def page(rows: Sequence[tuple[str, ...]], results: Sequence[Result]) -> str:
    """Markdown of the study, without its notes."""
    return "\n".join([HEAD, table(HEADINGS, rows, range(5)), "", wrong_families(results)])


def wrong_families(results: Sequence[Result]) -> str:
    """Single effects of the wrong answers, with their number at each strength."""
    wrong = [result for result in results if not result.right]
    counts = Counter((_expected(result), result.case.strength) for result in wrong if result.case.kind == "single")
    words = [
        f"{family} {' / '.join(str(counts[family, strength]) for strength in STRENGTHS)}"
        for family in dict.fromkeys(family for family, _ in counts)
    ]
    said = f"{len(wrong)} of {len(results)} cases are wrong; of single effects, at the three strengths: "
    return textwrap.fill(f"{said}{', '.join(words)}.", 120, break_long_words=False, break_on_hyphens=False)


def _expected(result: Result) -> str:
    return " + ".join(result.case.families) or str(result.case.kind)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--set", choices=("tuning", "final"), default="tuning", help="which seeds")
    parser.add_argument("--strength", type=float, choices=STRENGTHS, nargs="*", help="these strengths only")
    parser.add_argument("--family", nargs="*", help="cases that hide one of these families (or truths) only")
    parser.add_argument(
        "--kind", choices=("single", "pair", "none", "unexplained", "nameless"), nargs="*", help="these kinds only"
    )
    parser.add_argument("--vehicle", nargs="*", help="these vehicles only")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    return parser.parse_args()


def _wanted(case: Case, options: argparse.Namespace) -> bool:
    return (
        (not options.strength or case.strength in options.strength)
        and (not options.family or bool({*case.families, *case.truths} & {*options.family}))
        and (not options.kind or case.kind in options.kind)
        and (not options.vehicle or case.vehicle in options.vehicle)
    )


if __name__ == "__main__":
    main()
