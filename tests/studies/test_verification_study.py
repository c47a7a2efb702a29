"""The study of `quadctl verify`: it goes on where it was stopped, and writes its table into the page."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from studies.page import write_part
from studies.verification import BEGIN, CASES, END, PAGE, UNCHANGED, Job, Outcome, outcomes, section, share

JOBS = [Job(UNCHANGED, seed) for seed in range(4)]


def verdict(job: Job) -> Outcome:
    """A false alarm on the flight with seed 2."""
    return Outcome(job.case.name, job.seed, ("a of ground_effect.exponential",) if job.seed == 2 else ())


class Runs:
    """Run of jobs that notes them, and is stopped after some."""

    def __init__(self, stopped_after: int = 1000) -> None:
        self.seeds: list[int] = []
        self.stopped_after = stopped_after

    def __call__(self, jobs: Sequence[Job]) -> Iterator[Outcome]:
        for job in jobs:
            if len(self.seeds) == self.stopped_after:
                raise KeyboardInterrupt
            self.seeds.append(job.seed)
            yield verdict(job)


def test_a_run_that_was_stopped_goes_on_where_it_was(tmp_path: Path) -> None:
    kept = tmp_path / "outcomes.jsonl"
    with pytest.raises(KeyboardInterrupt):
        outcomes(JOBS, kept, Runs(stopped_after=3))
    again = Runs()
    found = outcomes(JOBS, kept, again)
    assert again.seeds == [3]
    assert list(found.values()) == [verdict(job) for job in JOBS]


def test_a_line_that_was_cut_short_is_run_again(tmp_path: Path) -> None:
    kept = tmp_path / "outcomes.jsonl"
    outcomes(JOBS, kept, Runs())
    kept.write_text(kept.read_text()[:-9])
    again = Runs()
    assert list(outcomes(JOBS, kept, again).values()) == [verdict(job) for job in JOBS]
    assert again.seeds == [3]
    assert len(kept.read_text().splitlines()) == len(JOBS)


def test_the_table_says_the_rate_with_its_interval() -> None:
    text = section({UNCHANGED: [verdict(job) for job in JOBS], CASES[1]: [Outcome(CASES[1].name, 0, ("x missing",))]})
    assert "| nothing | 1 of 4 | 25 % [0.63, 80.6] | a of ground_effect.exponential: 1 |" in text
    assert f"| {CASES[1].name} | 1 of 1 | 100 % [2.5, 100] | x missing: 1 |" in text
    assert text.endswith("1 false alarms in 4 flights are 25 % [0.63, 80.6]; nominal are 5 % at most.")
    assert share(2, 250) == "0.8 % [0.097, 2.86]"


def test_it_is_written_into_the_page_and_leaves_the_rest(tmp_path: Path) -> None:
    page = tmp_path / "verify.md"
    page.write_text(PAGE.read_text())
    write_part(page, BEGIN, END, "the table")
    before, after = PAGE.read_text().partition(BEGIN)[0], PAGE.read_text().partition(END)[2]
    assert page.read_text() == f"{before}{BEGIN}\n\nthe table\n\n{END}{after}"
