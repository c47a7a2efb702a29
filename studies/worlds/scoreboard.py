"""Scoreboard of a world of hidden cases: `python -m studies.worlds.scoreboard FOLDER ... --page docs/worlds.md`.

Each folder holds the cases of one world at one strength. The lab gets the vehicle file and the logs of a case; its
answer is compared with the truth beside them, which no command of quadctl reads.
"""

import argparse
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from joblib import Parallel, delayed

from quadctl.errors import QuadctlError
from quadctl.lab import diagnose, load_model
from studies.page import share, table, write_page
from studies.reliability import Named, names_in, reliability


@dataclass(frozen=True)
class Answer:
    """One case: its truth, and what the lab said."""

    case: str
    families: tuple[str, ...]
    indistinguishable: tuple[frozenset[str], ...]
    effect_rms_m_s2: float
    """Root mean square of the acceleration by the hidden effect."""
    missing: tuple[str, ...]
    verdict: str
    confounded: tuple[frozenset[str], ...]
    small: tuple[str, ...] = ()
    """Families that the lab says are measured, but too small to be called missing."""
    named: tuple[Named, ...] = ()
    also: tuple[str, ...] = ()
    """Families that an error of the record shows: right where they are named, and not asked for."""

    @property
    def exact(self) -> bool:
        """True where the lab names the hidden families and nothing else; where nothing is hidden, where it says so.

        A family stands for another one where the truth says that these flights do not separate them, and a drag for
        the inflow that the lab says it cannot tell it from.
        """
        said = set(self.missing) - set(self.also)
        if not self.families:
            excused = bool(self.also) and not said | (set(self.small) - set(self.also))
            return self.verdict == "none" or (excused and self.verdict in ("missing", "small"))
        alike = (*self.indistinguishable, *(c for c in self.confounded if "inflow" in c))
        hidden = set(self.families)
        return said == hidden or any(
            said ^ hidden <= pair and said & pair and hidden & pair and said - pair == hidden - pair for pair in alike
        )

    @property
    def says_false(self) -> bool:
        """True of a wrong answer that names a family which is not hidden."""
        return not self.exact and bool(set(self.missing) - set(self.families) - set(self.also))

    @property
    def right_first(self) -> bool:
        """True where the first family named is a hidden one."""
        return bool(self.missing) and self.missing[0] in self.families


def judge(folder: Path) -> Answer:
    """Diagnose one case and compare the answer with its truth."""
    truth: dict[str, Any] = json.loads((folder / "truth.json").read_text())
    missing: tuple[str, ...]
    small: tuple[str, ...]
    named: tuple[Named, ...]
    verdict: str
    indistinguishable = tuple(frozenset(pair) for pair in truth["indistinguishable"])
    also = tuple(family for family in truth.get("also", ()) if family not in truth["families"])
    try:
        found = diagnose(load_model(folder / "vehicle.yaml"), sorted(folder.glob("*.csv")))
        missing, verdict, confounded = tuple(found.missing), found.verdict, found.confounded
        small = tuple(group[0].family for group in found.small)
        named = names_in(found, (*truth["families"], *also), indistinguishable)
    except QuadctlError as error:
        missing, small, named, verdict, confounded = (), (), (), f"refused: {error}", []
    return Answer(
        case=folder.name,
        families=tuple(truth["families"]),
        indistinguishable=indistinguishable,
        effect_rms_m_s2=float(truth["effect_rms_m_s2"]),
        missing=missing,
        verdict=verdict,
        confounded=tuple(frozenset(pair) for pair in confounded),
        small=small,
        named=named,
        also=also,
    )


def cases_of(folder: Path) -> list[Path]:
    """Folders of the cases of a world."""
    return sorted(path.parent for path in folder.glob("*/truth.json"))


def judge_world(folder: Path, jobs: int) -> list[Answer]:
    """Answers to all cases of a folder."""
    return list(Parallel(n_jobs=jobs)(delayed(judge)(case) for case in cases_of(folder)))


def section(title: str, answers: Sequence[Answer]) -> str:
    """Lines for the terminal on one world at one strength, with every wrong answer."""
    single, several, nothing = ([a for a in answers if len(a.families) in n] for n in ((1,), (2, 3), (0,)))
    rows = [
        ("one effect: right family first", share([a.right_first for a in single])),
        ("one effect: named, and nothing else", share([a.exact for a in single])),
        (
            "one effect: nothing named, and the right family first of those that are small",
            share([not a.missing and a.small[:1] == a.families for a in single]),
        ),
        ("one effect: verdict none", share([a.verdict == "none" for a in single])),
        ("two effects: both named, and nothing else", share([a.exact for a in several])),
        ("false alarms where nothing is hidden", f"{sum(not a.exact for a in nothing)} of {len(nothing)}"),
    ]
    wrong = "\n".join(
        f"- {a.case} ({' + '.join(a.families) or 'nothing'}, {a.effect_rms_m_s2:g} m/s²): "
        f"{', '.join(a.missing) or a.verdict}" + ("; small: " + ", ".join(a.small) if a.small else "")
        for a in answers
        if not a.exact
    )
    return f"## {title}\n\n{table(('cases', 'result'), rows, range(2))}\n\nWrong:\n\n{wrong}\n"


GOALS = ("98 / 95 / 75 %", "95 / 85 / 60 %")
"""Goals for one and for two effects, at strengths 1, 0.5 and 0.3."""


def side_by_side(worlds: Mapping[str, Sequence[Answer]]) -> str:
    """Table of all worlds and strengths, by their titles."""
    rows = []
    for title, answers in worlds.items():
        single, several, nothing = ([a for a in answers if len(a.families) in n] for n in ((1,), (2, 3), (0,)))
        rows.append(
            (
                title,
                share([a.exact for a in single]),
                share([a.exact for a in several]),
                share([a.says_false for a in (*single, *several)]),
                f"{sum(not a.exact for a in nothing)} of {len(nothing)}",
            )
        )
    rows.append(("goal at strength 1 / 0.5 / 0.3", *GOALS, "", "0"))
    headings = ("world", "one effect: named, and nothing else", "two effects", "named, and not there", "false alarms")
    return table(headings, rows, range(5)) + "\n"


MOST = 3
"""Number of families that the page names for each world."""


def wrong_families(worlds: Mapping[str, Sequence[Answer]]) -> str:
    """The most frequent hidden families of the wrong answers, by the titles of the worlds."""
    lines = ["Wrong answers, the most frequent by what was hidden:", ""]
    for title, answers in worlds.items():
        counts = Counter(" + ".join(a.families) or "nothing" for a in answers if not a.exact)
        lines.append(f"- {title}: {', '.join(f'{family} {n}' for family, n in counts.most_common(MOST)) or 'none'}")
    return "\n".join([*lines, ""])


INTRODUCTION = """# Worlds that share nothing with the lab

Written by `python -m studies.worlds.scoreboard`. Each world (`studies/worlds`) generates flights with hidden effects.
`blade` was written from published descriptions by somebody who had not read the lab. `rotorpy` and `drone models` fly
in simulators of others, [RotorPy](https://github.com/spencerfolk/rotorpy) and
[drone-models](https://github.com/utiasDSL/drone-models): what these lack is injected as forces and moments, in
published forms. A row is a world, its seed and the strength of the effects; 1 is that of real vehicles.
[What was tuned on what](#what-was-tuned-on-what).

"""

RELIABILITY = """Share of the families named that are hidden, or not separable from a hidden one by these flights:
"""


def main() -> None:
    """Judge the worlds in the folders that are given and write the page."""
    parser = argparse.ArgumentParser(prog="python -m studies.worlds.scoreboard", description=__doc__)
    parser.add_argument("folders", type=Path, nargs="+", help="folders of cases; their names are the titles")
    parser.add_argument("--page", type=Path, required=True, help="page to write")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    arguments = parser.parse_args()
    for folder in arguments.folders:
        if not cases_of(folder):
            parser.error(f"{folder}: holds no cases, expected folders with a truth.json in each")
    worlds = {}
    for folder in arguments.folders:
        title = folder.name.replace("_", " ")
        worlds[title] = judge_world(folder, arguments.jobs)
        print(section(title, worlds[title]), flush=True)
    names = {title: [name for answer in answers for name in answer.named] for title, answers in worlds.items()}
    pieces = (side_by_side(worlds), wrong_families(worlds), RELIABILITY, reliability(names))
    write_page(arguments.page, INTRODUCTION + "\n".join(pieces))


if __name__ == "__main__":
    main()
