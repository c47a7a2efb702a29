"""A new start of the page in the same folder goes on with the session that is kept there, if it is the same one."""

from pathlib import Path

import pytest

from quadctl.effects.ground_effect import Exponential
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from quadctl.web.session.files import sha256_of
from quadctl.web.session.session import AUTOSAVED, Session, session_to_yaml
from quadctl.web.session.start import kept_session


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "flight.csv"
    path.write_text("a flight")
    return path


@pytest.fixture
def kept(log: Path, raptor: Vehicle) -> Session:
    """The session in the folder of the log: two steps."""
    session = Session(hashes={log: sha256_of(log)}).with_logs([log]).begun_with(Model(raptor))
    session = session.climbed(session.rungs[0]).judged(0.1)
    (log.parent / AUTOSAVED).write_text(session_to_yaml(session))
    return session


def begun(raptor: Vehicle, *logs: Path) -> Session:
    return Session().with_logs(logs).begun_with(Model(raptor))


def test_with_the_same_log_or_without_one_it_goes_on(kept: Session, log: Path, raptor: Vehicle) -> None:
    for start in (begun(raptor, log), begun(raptor)):
        found = kept_session(log.parent, start, model_given=False)
        assert found is not None
        assert (found.logs, found.current, found.rungs[1].error_m_s2) == ((log,), 1, 0.1)


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


@pytest.mark.parametrize("text", [None, "", "rungs: nonsense", "logs: []\nrungs: []\n"])
def test_a_folder_without_a_session_that_can_be_read_is_an_empty_one(
    text: str | None, tmp_path: Path, raptor: Vehicle
) -> None:
    if text is not None:
        (tmp_path / AUTOSAVED).write_text(text)
    assert kept_session(tmp_path, begun(raptor), model_given=False) is None
