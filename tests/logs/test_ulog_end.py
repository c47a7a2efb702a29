"""A PX4 ULog that was cut says so, wherever it was cut and whatever is damaged in it; a whole one never does."""

import struct
from pathlib import Path

import numpy as np

from quadctl.errors import LogError
from quadctl.logs.findings import Kind, of_kind
from quadctl.logs.read import read_log
from quadctl.logs.ulog_end import HEADER_BYTES, LAST_BYTES, is_cut_short
from tests.support.log_files import PX4, Topic, needs_px4, small_ulog


def ends(data: bytes) -> list[int]:
    """Places at which the messages end."""
    found, at = [], HEADER_BYTES
    while at < len(data):
        at += 3 + struct.unpack_from("<H", data, at)[0]
        found.append(at)
    return found


def told(folder: Path, data: bytes) -> bool:
    path = folder / "a.ulg"
    path.write_bytes(data)
    return is_cut_short(path)


def info_multiple(name: str) -> bytes:
    body = b"\0" + bytes([len(f"char[4] {name}")]) + f"char[4] {name}".encode() + b"some"
    return struct.pack("<H", len(body)) + b"M" + body


def with_appended(data: bytes, more: bytes) -> bytes:
    """The log with data that a later start of the autopilot appended."""
    at = HEADER_BYTES + 3
    flags = bytes(8) + b"\x01" + bytes(7) + struct.pack("<3Q", len(data), 0, 0)
    return data[:at] + flags + data[at + 40 :] + more


def with_damage(data: bytes, at: int, size: int, random: np.random.Generator) -> bytes:
    return data[:at] + random.bytes(size) + data[at + size :]


class TestCut:
    def test_within_a_message_it_is_told_between_two_it_cannot_be(self, tmp_path: Path) -> None:
        whole = small_ulog()
        between = {HEADER_BYTES, *ends(whole)}
        for at in range(HEADER_BYTES, len(whole), 7):
            assert told(tmp_path, whole[:at]) == (at not in between), at

    def test_behind_damage_it_is_told_too(self, tmp_path: Path) -> None:
        random = np.random.default_rng(11)
        whole = small_ulog()
        edges = ends(whole)
        for _ in range(40):
            end = int(random.integers(len(whole) // 2, len(whole)))
            before = max(edge for edge in edges if edge <= end)
            damaged = with_damage(whole, int(random.integers(2000, before - 600)), int(random.integers(1, 60)), random)
            assert told(tmp_path, damaged[:end]) == (end != before)
            assert not told(tmp_path, damaged)

    def test_before_and_in_appended_data(self, tmp_path: Path) -> None:
        whole, more = small_ulog(), info_multiple("hardfault_plain") * 20
        assert not told(tmp_path, with_appended(whole, more))
        assert told(tmp_path, with_appended(whole[:-9], more))
        assert told(tmp_path, with_appended(whole, more)[:-9])
        assert told(tmp_path, with_appended(whole, more)[: len(whole) // 2])

    def test_of_a_long_log_the_end_is_enough(self, tmp_path: Path) -> None:
        rows = [(1000 * i, *[float(i)] * 16) for i in range(25_000)]
        fields = "uint64_t timestamp;" + ";".join(f"float value{i}" for i in range(16))
        whole = small_ulog(Topic("vehicle_status", fields, rows))
        assert len(whole) > 1.5 * LAST_BYTES
        assert not told(tmp_path, whole)
        assert told(tmp_path, whole[:-5])

    @needs_px4
    def test_of_real_logs(self, tmp_path: Path) -> None:
        for path in sorted(PX4.glob("*.ulg")):
            assert not is_cut_short(path)
            whole = path.read_bytes()
            between = set(ends(whole))
            for share in np.linspace(0.05, 0.99, 12):
                at = int(share * len(whole))
                assert told(tmp_path, whole[:at]) == (at not in between)


class TestLog:
    def test_damaged_and_cut_are_both_said(self, tmp_path: Path) -> None:
        whole = small_ulog()
        path = tmp_path / "a.ulg"
        middle = ends(whole)[len(ends(whole)) // 2]
        path.write_bytes(whole[:middle] + b"\x00\x00\x00\xffgarbage" + whole[middle:-5])
        kinds = {found.kind for found in read_log(path).findings}
        assert {Kind.CUT_SHORT, Kind.DAMAGED} <= kinds

    def test_a_logger_that_was_stopped_by_the_loss_of_power_is_told_by_what_it_writes_last(
        self, tmp_path: Path
    ) -> None:
        path = tmp_path / "a.ulg"
        begun = small_ulog() + info_multiple("perf_counter_preflight")
        path.write_bytes(begun)
        log = read_log(path)
        (found,) = of_kind(log.findings, Kind.CUT_SHORT)
        assert found.figures == {"of": "logger"}
        assert "the file ends without what PX4's logger writes last: it was cut, or the power was" in log.notes
        path.write_bytes(begun + info_multiple("perf_counter_postflight"))
        assert not of_kind(read_log(path).findings, Kind.CUT_SHORT)
        path.write_bytes(small_ulog(parameters={"SDLOG_MODE": 1}) + info_multiple("perf_counter_preflight"))
        assert not of_kind(read_log(path).findings, Kind.CUT_SHORT)  # it logs until the power is off

    def test_cut_anywhere_it_is_a_log_or_one_sentence(self, tmp_path: Path) -> None:
        whole = small_ulog()
        path = tmp_path / "a.ulg"
        outcomes = set()
        for at in range(8, len(whole), 331):
            path.write_bytes(whole[:at])
            try:
                log = read_log(path)
            except LogError as error:
                assert "\n" not in str(error)
                outcomes.add(False)
            else:
                outcomes.add(True)
                assert bool(of_kind(log.findings, Kind.CUT_SHORT)) == (at not in ends(whole))
        assert outcomes == {True, False}
