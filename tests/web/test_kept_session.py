"""A new start of the page in the same folder goes on with the session that is kept there, if it is the same one."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from quadctl.effects.ground_effect import Exponential
from quadctl.logs.flight_log import FlightLog
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from quadctl.web.session.earlier import MOST, earlier_sessions, set_aside
from quadctl.web.session.files import sha256_of
from quadctl.web.session.session import AUTOSAVED, Session, session_to_yaml
from quadctl.web.session.start import first_session, kept_session
from quadctl.web.work.doubts import names_its_vehicle


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "flight.csv"
    path.write_text("a flight")
    return path


@pytest.fixture
def kept(log: Path, raptor: Vehicle) -> Session:
    """The session in the folder of the log: two steps."""
    session = Session(hashes={log: sha256_of(log)}).with_logs([log]).begun_with(Model(raptor))
    session = session.extended(session.sequence[0]).judged(0.1)
    (log.parent / AUTOSAVED).write_text(session_to_yaml(session))
    return session


def begun(raptor: Vehicle, *logs: Path) -> Session:
    return Session().with_logs(logs).begun_with(Model(raptor))


def test_with_the_same_log_or_without_one_it_goes_on(kept: Session, log: Path, raptor: Vehicle) -> None:
    for start in (begun(raptor, log), begun(raptor)):
        found = kept_session(log.parent, start, model_given=False)
        assert found is not None
        assert (found.logs, found.current, found.sequence[1].error_m_s2) == ((log,), 1, 0.1)


def test_with_another_log_another_session_begins(kept: Session, log: Path, raptor: Vehicle) -> None:
    other = log.with_name("other.csv")
    other.write_text("another flight")
    assert kept_session(log.parent, begun(raptor, log, other), model_given=False) is None


def test_a_log_that_was_written_again_is_another_one(kept: Session, log: Path, raptor: Vehicle) -> None:
    log.write_text("a later flight")
    assert kept_session(log.parent, begun(raptor, log), model_given=False) is None


def test_a_model_that_is_given_is_the_one_it_must_have_begun_with(kept: Session, log: Path, raptor: Vehicle) -> None:
    assert kept_session(log.parent, begun(raptor, log), model_given=True) is not None
    other = Session().with_logs([log]).begun_with(Model(raptor).plus(Exponential(a=0.3, b=5.0)))
    assert kept_session(log.parent, other, model_given=True) is None


class TestAnotherBegins:
    """The session before is not lost."""

    def test_the_one_of_the_folder_is_kept_in_a_file_of_its_own(self, kept: Session, log: Path) -> None:
        text = (log.parent / AUTOSAVED).read_text()
        (log.parent / "previous.lab.yaml").write_text("the one before that")
        path = set_aside(log.parent)
        assert path == log.parent / "previous-2.lab.yaml" and path.read_text() == text
        assert not (log.parent / AUTOSAVED).exists()

    def test_one_that_cannot_be_read_is_kept_too(self, tmp_path: Path) -> None:
        """It may be of another version of quadctl."""
        (tmp_path / AUTOSAVED).write_text("rungs: nonsense")
        assert set_aside(tmp_path) == tmp_path / "previous.lab.yaml"

    @pytest.mark.parametrize("text", [None, "logs: []\nrungs: []\n"])
    def test_one_without_a_flight_is_not(self, text: str | None, tmp_path: Path) -> None:
        if text is not None:
            (tmp_path / AUTOSAVED).write_text(text)
        assert set_aside(tmp_path) is None
        assert [path.name for path in tmp_path.iterdir()] == ([AUTOSAVED] if text is not None else [])


class TestVehicleThatNobodyHasNamed:
    """It is that of config/flight.yaml; the page asks whether it flew, and the session keeps the answer."""

    def test_a_session_begun_without_a_model_has_assumed_its_vehicle(self, log: Path, raptor_path: Path) -> None:
        assert first_session([], None, None).vehicle_assumed
        assert not first_session([], raptor_path, None).vehicle_assumed

    def test_a_vehicle_that_is_chosen_is_not_assumed(self, raptor: Vehicle) -> None:
        assert not replace(Session(), vehicle_assumed=True).begun_with(Model(raptor)).vehicle_assumed

    @pytest.mark.parametrize("assumed", [True, False])
    def test_the_answer_is_kept_with_the_session(self, assumed: bool, kept: Session, log: Path) -> None:
        (log.parent / AUTOSAVED).write_text(session_to_yaml(replace(kept, vehicle_assumed=assumed)))
        again = kept_session(log.parent, Session(), model_given=False)
        assert again is not None and again.vehicle_assumed is assumed

    def test_a_model_that_is_given_answers_it(self, kept: Session, log: Path, raptor: Vehicle) -> None:
        (log.parent / AUTOSAVED).write_text(session_to_yaml(replace(kept, vehicle_assumed=True)))
        again = kept_session(log.parent, begun(raptor, log), model_given=True)
        assert again is not None and not again.vehicle_assumed

    def test_only_a_log_that_names_neither_vehicle_nor_mass_leaves_it_open(self) -> None:
        silent = FlightLog("a.csv", None, {"time_s": np.zeros(1)})
        assert not names_its_vehicle(silent)
        for vehicle in ({"name": "raptor"}, {"mass_kg": 1.5}, "raptor"):
            assert names_its_vehicle(replace(silent, meta={"vehicle": vehicle}))


@pytest.mark.parametrize("text", [None, "", "rungs: nonsense", "logs: []\nrungs: []\n"])
def test_a_folder_without_a_session_that_can_be_read_is_an_empty_one(
    text: str | None, tmp_path: Path, raptor: Vehicle
) -> None:
    if text is not None:
        (tmp_path / AUTOSAVED).write_text(text)
    assert kept_session(tmp_path, begun(raptor), model_given=False) is None


class TestEarlierSessions:
    """Those that are kept beside the present one, by what a person knows them by."""

    def test_each_is_known_by_its_flights_its_model_and_its_error(self, kept: Session, log: Path) -> None:
        model = kept.sequence[0].model.plus(Exponential(a=0.3, b=5.0))
        session = kept.extended(replace(kept.sequence[0], model=model)).judged(0.0312)
        (log.parent / "previous.lab.yaml").write_text(session_to_yaml(session))
        (one,) = earlier_sessions(log.parent)  # the present one is none of them
        assert (one.path.name, one.title) == ("previous.lab.yaml", "flight.csv")
        assert one.details.endswith(": raptor, ground effect, error 0.0312 m/s²")
        assert f"{one.saved:%Y}" in one.details

    def test_the_latest_comes_first_and_what_is_no_session_is_left_out(self, kept: Session, log: Path) -> None:
        for number in range(MOST + 3):
            path = log.parent / f"previous-{number}.lab.yaml"
            path.write_text(session_to_yaml(kept))
            os.utime(path, (1000.0 + number, 1000.0 + number))
        for name, text in {"bad.lab.yaml": "rungs: [", "other.lab.yaml": "rungs: 3", "empty.lab.yaml": ""}.items():
            (log.parent / name).write_text(text)
            os.utime(log.parent / name, (500.0, 500.0))
        assert [one.path.name for one in earlier_sessions(log.parent)] == [
            f"previous-{number}.lab.yaml" for number in range(MOST + 2, 2, -1)
        ]

    def test_none_of_their_own_effects_is_run_before_one_is_opened(self, kept: Session, log: Path) -> None:
        ran = log.parent / "ran"
        (log.parent / "own.py").write_text(f"open({str(ran)!r}, 'w')")
        text = session_to_yaml(kept).replace("    effects: []", "    effects: []\n    effect_files: [own.py]")
        assert "own.py" in text
        (log.parent / "previous.lab.yaml").write_text(text)
        assert len(earlier_sessions(log.parent)) == 1
        assert not ran.exists()
