"""The file of changed parameters: an entry for each vehicle, which goes when all of it is restored."""

from pathlib import Path

import pytest

from quadctl.errors import SettingsError
from quadctl.flight.preflight.changed_parameters import FILE_NAME, Change, ChangedParameters

SET = Change(was=0.0, set_to=8.0)


def test_each_vehicle_has_an_entry_of_its_own(tmp_path: Path) -> None:
    one, other = (ChangedParameters(tmp_path, f"system 1, hardware {number}") for number in "ab")
    one.note("GUID_OPTIONS", SET)
    other.note("GUID_TIMEOUT", Change(was=3.0, set_to=0.5))
    assert one.read() == {"GUID_OPTIONS": SET}
    assert (one.others, other.others) == ([other.vehicle], [one.vehicle])
    one.forget("GUID_OPTIONS")
    assert one.read() == {}
    assert other.read().keys() == {"GUID_TIMEOUT"}


def test_the_file_goes_with_its_last_entry(tmp_path: Path) -> None:
    kept = ChangedParameters(tmp_path / "logs", "system 1")
    kept.note("GUID_OPTIONS", SET)
    assert (tmp_path / "logs" / FILE_NAME).is_file()
    kept.forget("GUID_OPTIONS")
    assert not (tmp_path / "logs" / FILE_NAME).exists()


def test_a_file_of_another_kind_is_refused_in_a_sentence(tmp_path: Path) -> None:
    (tmp_path / FILE_NAME).write_text("parameters: {GUID_OPTIONS: {was: 0, set_to: 8}}\n")
    with pytest.raises(SettingsError, match=FILE_NAME):
        ChangedParameters(tmp_path, "system 1").read()
