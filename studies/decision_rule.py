"""Write docs/decision-rule.md: verdicts on hidden-effect cases with each threshold of the decision rule moved.

`make decision-rule` runs this on cases of the set `tuning`, whose flights are kept in build/hidden.
"""

import argparse
import multiprocessing
import os
import random
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

from quadctl.lab.fitting import fitted_model
from quadctl.lab.fitting.fitted_model import fit_model
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection import choice, diagnosis, rule, search
from quadctl.logs.read import read_logs
from quadctl.model import load_model
from studies.blind_cases.cases import Case, all_cases
from studies.blind_cases.fly import fly_case, generator_digest
from studies.blind_cases.judge import Result
from studies.page import DOCS, ROOT, table

PAGE = DOCS / "decision-rule.md"
MOVED: dict[str, tuple[float, ...]] = {
    "SIGNIFICANT": (0.003, 0.03),
    "MATERIAL": (0.03, 0.08),
    "MATERIAL_M_S2": (0.05, 0.2),
    "LEAST_M_S2": (0.015, 0.06),
    "MOST_OF_ERROR": (0.3, 0.7),
    "TRIM_M_S2": (0.035, 0.14),
    "HARMLESS": (0.003, 0.03),
    "HARMLESS_BESIDE": (0.1, 0.4),
    "LEAST_SHARE_OF_MOMENT": (0.05, 0.2),
    "SHOWN": (0.003, 0.03),
    "SHOWN_ALONE": (0.1, 0.4),
    "SHOWN_BESIDE": (0.1, 0.4),
    "ALIKE": (0.01, 0.2),
    "EQUAL_SCORE": (0.003, 0.03),
    "REPLACED": (0, 3),
    "LARGE": (0.07, 0.15),
    "DRIFT": (0.3, 0.7),
    "MOSTLY": (0.3, 0.7),
}
"""Thresholds of `quadctl.lab.selection.rule`, and the values that are tried instead of theirs."""
KINDS = {"single": "one effect", "pair": "two effects", "unexplained": "unexplained", "none": "nothing hidden"}
STRENGTHS = (1.0, 0.3)
SEED = 1
"""Seed of the draw of `--cases`."""
Setting = tuple[str, float]
Cell = tuple[str, float]
"""Kind of case, and strength."""

HEAD = """# The decision rule, and what its thresholds do

Written by `make decision-rule`. The rule by which an effect is called missing is one file,
`quadctl/lab/selection/rule.py`, which says for each threshold what it is and why. Here each threshold is changed
alone, to about half and about twice its value, on {count} hidden-effect cases of the set `tuning` at strengths 1
and 0.3 ([hidden effects](hidden-effects.md)). The columns count the right verdicts for each kind of case at each
strength; numbers in bold differ from those of the unchanged rule. The lab was tuned on these seeds, so the
first row says nothing about other data; the other rows show how much the verdicts depend on each threshold.

Not moved is what stands elsewhere: the share of the vertical error that a motor lag may leave (`LEFT_BY_A_LAG` in
`selection/trial.py`), how far a variable must move to count as a cause (`MOVED` and `MANOEUVRES` in
`flights/dataset.py`), the share of drag along body z that may be an inflow (`LIKE_THE_OTHERS` in
`selection/diagnosis.py`), and what an effect calls believable.
"""


def verdicts(case: Case, folder: Path) -> dict[Setting, bool]:
    """True for each setting of the rule that leads to the right verdict on a case."""
    flown = fly_case(case, folder)
    model = load_model(case.vehicle_path)
    fit = fit_model(model, load_dataset(read_logs(flown.seen), model.vehicle))
    found = {}
    with remembered():
        for name, value in settings():
            with patch.object(rule, name, value) if name else ExitStack():
                said = diagnosis.diagnose_fit(fit)
            result = Result(case, said.verdict, list(said.missing), [], 0.0, None, [])
            found[name, value] = result.right
    return found


def settings() -> list[Setting]:
    """The rule as it stands, then every threshold at its other values."""
    return [("", 0.0), *((name, value) for name, values in MOVED.items() for value in values)]


@contextmanager
def remembered() -> Iterator[None]:
    """Within it, a trial or a fit that another setting of the rule asked for already is not computed again."""
    known: dict[Any, Any] = {}

    def kept(function: Callable[..., Any], key: Callable[..., Any]) -> Callable[..., Any]:
        def wrapped(*args: Any, **options: Any) -> Any:
            name = (function.__name__, key(*args), *options.items())
            if name not in known:
                known[name] = function(*args, **options)
            return known[name]

        return wrapped

    def by_model(model: Any, dataset: Any) -> Any:
        return model.effects

    def by_residual(residual: Any, *others: Any) -> Any:
        return residual.tobytes()

    with ExitStack() as stack:
        for module, name, key in (
            (search, "try_effect", lambda effect, left, n: (effect, left.model.effects, n)),
            (search, "promise", lambda effect, left: (effect, left.model.effects)),
            (search, "fit_model", by_model),
            (fitted_model, "fit_model", by_model),
            (diagnosis, "held_out_errors", lambda before, after: (before.model.effects, after.model.effects)),
            (choice, "flexible_residual", by_residual),
            (choice, "explain", by_residual),
        ):
            stack.enter_context(patch.object(module, name, kept(getattr(module, name), key)))
        yield


def page(right: Mapping[Setting, Counter[Cell]], totals: Mapping[Cell, int]) -> str:
    """The page, with one row for each setting."""
    rows = []
    for name, value in settings():
        cells = []
        for kind in KINDS:
            now, standing = ([right[setting][kind, s] for s in STRENGTHS] for setting in ((name, value), ("", 0.0)))
            counts = [str(n) if n == before else f"**{n}**" for n, before in zip(now, standing, strict=True)]
            strengths = STRENGTHS[:1] if kind == "none" else STRENGTHS
            cells.append(", ".join(f"{n} of {totals[kind, s]}" for n, s in zip(counts, strengths, strict=False)))
        words = f"`{name}`" if name else "unchanged"
        moved = f"{getattr(rule, name):g} -> {value:g}" if name else ""
        rows.append([words, moved, *cells])
    shown = table(["threshold", "value", *KINDS.values()], rows, texts=(0, 1))
    return f"{HEAD.format(count=sum(totals.values()))}\n{shown}\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--cases", type=int, help="so many of them, drawn at random: each takes half a minute")
    options = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # for the processes: two of them have two cores
    cases = [case for case in all_cases("tuning") if case.strength in STRENGTHS]
    if options.cases:
        cases = random.Random(SEED).sample(cases, options.cases)
    folder = ROOT / "build" / "hidden" / generator_digest()
    right: dict[Setting, Counter[Cell]] = {setting: Counter() for setting in settings()}
    with ProcessPoolExecutor(options.jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        for number, (case, found) in enumerate(
            zip(cases, pool.map(verdicts, cases, [folder] * len(cases)), strict=True)
        ):
            for setting, is_right in found.items():
                right[setting][case.kind, case.strength] += is_right
            print(f"{number + 1}/{len(cases)} {case.name}", flush=True)
    PAGE.write_text(page(right, Counter((case.kind, case.strength) for case in cases)), encoding="utf-8")
    print(f"written: {PAGE}")


if __name__ == "__main__":
    main()
