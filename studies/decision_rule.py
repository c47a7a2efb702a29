"""Write docs/decision-rule.md: verdicts on hidden-effect cases with each threshold of the decision rule moved.

`make decision-rule` runs this on cases of the set `tuning`, whose flights are kept in build/hidden.
"""

import argparse
import multiprocessing
import os
import random
import textwrap
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

from quadctl.lab.fitting import fitted_model
from quadctl.lab.fitting.fitted_model import fit_model
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection import choice, diagnosis, search, subsets
from quadctl.lab.selection.rule import RULE, Rule
from quadctl.logs.read import read_logs
from quadctl.model import load_model
from studies.blind_cases.cases import Case, all_cases
from studies.blind_cases.fly import fly_case, generator_digest
from studies.blind_cases.judge import Result
from studies.page import DOCS, ROOT

PAGE = DOCS / "decision-rule.md"
MOVED: dict[str, tuple[float, ...]] = {
    "significant": (0.003, 0.03),
    "material": (0.03, 0.08),
    "material_m_s2": (0.05, 0.2),
    "least_m_s2": (0.015, 0.06),
    "most": (0.3, 0.7),
    "visible": (0.003, 0.03),
    "beside": (0.1, 0.4),
    "least_share_of_moment": (0.05, 0.2),
    "alike": (0.01, 0.2),
    "equal_score": (0.003, 0.03),
    "trim_m_s2": (0.035, 0.14),
    "large": (0.07, 0.15),
}
"""Thresholds of `quadctl.lab.selection.rule.Rule`, all of them, and the values that are tried instead of theirs."""
KINDS = {"single": "one effect", "pair": "two effects", "unexplained": "unexplained", "none": "nothing hidden"}
STRENGTHS = (1.0, 0.3)
SEED = 1
"""Seed of the draw of `--cases`."""
Setting = tuple[str, float]
Cell = tuple[str, float]
"""Kind of case, and strength."""

HEAD = """# The decision rule, and what its thresholds do

Written by `make decision-rule`. The rule by which an effect is called missing is `quadctl/lab/selection/rule.py`, which
says for each threshold what it is and why. Each is changed alone, to about half and about twice its value, on {count}
[hidden-effect cases](hidden-effects.md) of the set `tuning` at strengths 1 and 0.3. The columns count right verdicts at
each strength; bold differs from the unchanged rule. The lab was tuned on these seeds.

| threshold | value | {kinds} |
|---|---|{dashes}|
"""


def verdicts(case: Case, folder: Path) -> dict[Setting, bool]:
    """True for each setting of the rule that leads to the right verdict on a case."""
    flown = fly_case(case, folder)
    model = load_model(case.vehicle_path)
    fit = fit_model(model, load_dataset(read_logs(flown.seen), model.vehicle))
    found = {}
    with remembered():
        for name, value in settings():
            said = diagnosis.diagnose_fit(fit, rule=moved_rule(name, value))
            result = Result(case, said.verdict, list(said.missing), [], 0.0, None, [])
            found[name, value] = result.right
    return found


def moved_rule(name: str, value: float) -> Rule:
    """The rule with one threshold moved; without a name, as it stands."""
    changed: dict[str, Any] = {name: value} if name else {}
    return replace(RULE, **changed)


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
            (subsets, "fit_on_top", lambda effect, left: (effect, left.model.effects)),
            (search, "FirstOrder", lambda fit, pool, rule: (fit.model.effects, tuple(pool), rule)),
            (search, "fit_model", by_model),
            (fitted_model, "fit_model", by_model),
            (diagnosis, "held_out_errors", lambda before, after: (before.model.effects, after.model.effects)),
            (choice, "flexible_residual", by_residual),
            (choice, "explain", by_residual),
        ):
            stack.enter_context(patch.object(module, name, kept(getattr(module, name), key)))
        yield


def page(right: Mapping[Setting, Counter[Cell]], totals: Mapping[Cell, int]) -> str:
    """The page, with a row for each setting that changes a verdict."""
    kinds, dashes = " | ".join(KINDS.values()), "|".join(["---:"] * len(KINDS))
    rows: list[str] = []
    without_effect: dict[str, list[str]] = defaultdict(list)
    for name, value in settings():
        cells = []
        for kind in KINDS:
            now, standing = ([right[setting][kind, s] for s in STRENGTHS] for setting in ((name, value), ("", 0.0)))
            counts = [str(n) if n == before else f"**{n}**" for n, before in zip(now, standing, strict=True)]
            strengths = STRENGTHS[:1] if kind == "none" else STRENGTHS
            cells.append(", ".join(f"{n} of {totals[kind, s]}" for n, s in zip(counts, strengths, strict=False)))
        if name and right[name, value] == right["", 0.0]:
            without_effect[name].append(f"{value:g}")
            continue
        words = f"`{name}`" if name else "unchanged"
        moved = f"{getattr(RULE, name):g} -> {value:g}" if name else ""
        rows.append(f"| {words} | {moved} | {' | '.join(cells)} |")
    return HEAD.format(count=sum(totals.values()), kinds=kinds, dashes=dashes) + "\n".join(
        [*rows, "", without(without_effect)]
    )


def without(values: Mapping[str, Sequence[str]]) -> str:
    """Sentence on the settings that change no verdict."""
    listed = ", ".join(f"`{name}` {' or '.join(tried)}" for name, tried in values.items())
    said = f"No verdict changes with {listed}."
    return textwrap.fill(said, 120, break_long_words=False, break_on_hyphens=False) + "\n"


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
