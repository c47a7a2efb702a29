"""Specification of the scoreboard of worlds: when an answer is right."""

import dataclasses
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from studies.reliability import Named, names_in, reliability
from studies.worlds.scoreboard import Answer, main, section, side_by_side


def answer(
    families: str, missing: str, verdict: str = "missing", alike: tuple[str, ...] = (), confounded: tuple[str, ...] = ()
) -> Answer:
    """Answer with families as words; each pair is two words."""
    pairs = [tuple(frozenset(pair.split()) for pair in each) for each in (alike, confounded)]
    return Answer("case", tuple(families.split()), pairs[0], 0.1, tuple(missing.split()), verdict, pairs[1])


@pytest.mark.parametrize(
    ("right", "given"),
    [
        (True, answer("wind", "wind")),
        (False, answer("wind", "")),
        (False, answer("wind", "wind tether")),
        (True, answer("wind tether", "tether wind")),
        (False, answer("wind tether", "wind")),
        (True, answer("", "", "none")),
        (False, answer("", "", "unexplained")),
        (False, answer("", "wind")),
        # The truth says that these flights do not separate the two.
        (True, answer("thrust_scale", "tether", alike=("thrust_scale tether",))),
        (False, answer("wind", "tether", alike=("thrust_scale tether",))),
        # The lab says that it cannot tell a drag from the inflow; of another pair it must decide.
        (True, answer("rotor_drag inflow", "rotor_drag", confounded=("rotor_drag inflow",))),
        (False, answer("rotor_drag wind", "rotor_drag", confounded=("rotor_drag wind",))),
    ],
)
def test_an_answer_is_right_where_it_names_what_is_hidden_and_nothing_else(right: bool, given: Answer) -> None:
    assert given.exact is right


def test_a_family_that_an_error_of_the_record_shows_is_right_where_it_is_named_and_where_it_is_not() -> None:
    def also(given: Answer, small: tuple[str, ...] = ()) -> Answer:
        return dataclasses.replace(given, also=("imu_bias",), small=small)

    assert also(answer("", "imu_bias")).exact and also(answer("", "", "none")).exact
    assert also(answer("", "", "small"), ("imu_bias",)).exact
    assert not also(answer("", "imu_bias wind")).exact and not also(answer("", "", "unexplained")).exact
    assert not also(answer("", "", "small"), ("wind",)).exact
    assert not also(answer("", "", "refused: damaged")).exact
    assert also(answer("wind", "imu_bias wind")).exact and also(answer("wind", "wind")).exact
    missed = also(answer("wind", "imu_bias"))
    assert not missed.exact and not missed.says_false
    assert also(answer("wind", "imu_bias tether")).says_false


def test_a_section_counts_and_lists_what_is_wrong() -> None:
    text = section("a world", [answer("wind", "wind"), answer("wind", "tether"), answer("", "", "none")])
    assert "| one effect: named, and nothing else | 1/2 = 50% |" in text
    assert "| false alarms where nothing is hidden | 0 of 1 |" in text
    assert text.count("\n- case") == 1
    assert "- case (wind, 0.1 m/s²): tether" in text


def test_worlds_stand_side_by_side_with_what_was_named_and_is_not_there() -> None:
    """An effect that is overlooked says nothing false; one that is named in the place of another does."""
    answers = [
        answer("wind", "wind"),
        answer("wind", ""),
        answer("wind", "tether"),
        answer("wind tether", "wind tether payload"),
        answer("", "", "none"),
    ]
    assert "| open 2 1.0 | 1/3 = 33% | 0/1 = 0% | 2/4 = 50% | 0 of 1 |" in side_by_side({"open 2 1.0": answers})


def test_what_is_small_is_counted_by_itself() -> None:
    small = dataclasses.replace(answer("wind", "", "small"), small=("wind", "tether"))
    text = section("a world", [small, answer("wind", "", "none"), answer("wind", "wind"), answer("wind", "tether")])
    assert "| one effect: named, and nothing else | 1/4 = 25% |" in text
    assert "| one effect: nothing named, and the right family first of those that are small | 1/4 = 25% |" in text
    assert "| one effect: verdict none | 1/4 = 25% |" in text
    assert "- case (wind, 0.1 m/s²): small; small: wind, tether" in text


def test_what_is_small_where_nothing_is_hidden_is_a_false_alarm() -> None:
    alarm = dataclasses.replace(answer("", "", "small"), small=("tether",))
    assert "| false alarms where nothing is hidden | 1 of 2 |" in section("a world", [alarm, answer("", "", "none")])


def test_a_folder_without_cases_is_one_sentence_and_leaves_the_page_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "worlds.md"
    page.write_text("as it was")
    monkeypatch.setattr(sys, "argv", ["scoreboard", str(tmp_path / "nothing"), "--page", str(page)])
    with pytest.raises(SystemExit):
        main()
    assert f"{tmp_path / 'nothing'}: holds no cases" in capsys.readouterr().err
    assert page.read_text() == "as it was"


def test_reliability_counts_by_p_value_the_names_that_are_there() -> None:
    named = [
        Named("wind", 1e-12, True),
        Named("tether", 1e-5, False),
        Named("drag", 1e-5, True),
        Named("lag", 1e-3, True),
    ]
    rows = reliability({"a world": named, "no flight": []}).splitlines()[2:]
    assert rows == [
        "| below 1e-8 | 1/1 = 100% | - |",
        "| 1e-8 to 1e-4 | 1/2 = 50% | - |",
        "| 1e-4 to 0.01 | 1/1 = 100% | - |",
        "| all | 3/4 = 75% | - |",
    ]


def test_a_name_counts_as_there_where_the_flights_do_not_separate_it_from_one_that_is() -> None:
    diagnosis = SimpleNamespace(
        missing=["tether", "wind"],
        ranking=[SimpleNamespace(family="tether", p_value=1e-3), SimpleNamespace(family="wind", p_value=1e-9)],
    )
    alike = (frozenset({"thrust_scale", "tether"}), frozenset({"wind", "tilt"}))
    assert names_in(diagnosis, {"thrust_scale"}, alike) == (Named("tether", 1e-3, True), Named("wind", 1e-9, False))
