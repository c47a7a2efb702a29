"""Large arrays between the processes of the page: in one file for all, not sent twice, gone with the last of them."""

import asyncio
import gc
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quadctl.web.work.exchange import LARGE_BYTES, Exchange, Place
from quadctl.web.work.worker import Worker

N = LARGE_BYTES // 8


@pytest.fixture
def owner() -> Exchange:
    return Exchange()


@pytest.fixture
def other(owner: Exchange) -> Exchange:
    return Exchange(owner.folder)


def files(exchange: Exchange) -> list[str]:
    return [path.name for path in exchange.folder.iterdir()]


def test_a_value_arrives_as_it_was_and_small_arrays_need_no_file(owner: Exchange, other: Exchange) -> None:
    value = {"name": "flight", "large": [np.arange(N, dtype=float), np.ones((3, N))], "small": np.arange(3)}
    message, file = other.pack(value)
    got = owner.unpack(message)
    assert len(message) < LARGE_BYTES and files(owner) == [file]
    assert got["name"] == "flight"
    for one, same in zip([*value["large"], value["small"]], [*got["large"], got["small"]], strict=True):
        np.testing.assert_array_equal(one, same)
    assert other.pack(np.arange(3))[1] == ""


def test_what_came_out_of_a_file_goes_on_as_its_place(owner: Exchange, other: Exchange) -> None:
    got = owner.unpack(other.pack(np.arange(2 * N, dtype=float))[0])
    message, file = owner.pack({"again": got, "a part": got[N:]})
    assert file == "" and len(files(owner)) == 1
    back = Exchange(owner.folder).unpack(message)
    np.testing.assert_array_equal(back["a part"], np.arange(N, 2 * N))


def test_a_change_of_what_was_received_is_seen_by_nobody_else(owner: Exchange, other: Exchange) -> None:
    message, _ = other.pack(np.zeros(N))
    one, two = owner.unpack(message), other.unpack(message)
    one[0] = 1.0
    assert two[0] == 0.0


def test_a_file_is_removed_with_the_last_array_in_it(owner: Exchange, other: Exchange) -> None:
    got = owner.unpack(other.pack([np.zeros(N), np.ones(N)])[0])
    last = got.pop()
    del got
    gc.collect()
    assert len(files(owner)) == 1 and last[0] == 1.0
    del last
    gc.collect()
    assert files(owner) == []


def test_a_full_disk_costs_memory_but_no_value(owner: Exchange, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any) -> tuple[str, list[Place]]:
        raise OSError("no space left on device")

    monkeypatch.setattr(Exchange, "_written", full)
    message, file = owner.pack(np.arange(N))
    assert file == ""
    np.testing.assert_array_equal(owner.unpack(message), np.arange(N))


def doubled(values: np.ndarray, progress: Any) -> list[np.ndarray]:
    return [values, 2.0 * values]


def test_two_workers_share_what_one_of_them_made() -> None:
    exchange = Exchange()
    quick, slow = Worker(__name__, exchange), Worker(__name__, exchange)

    async def work() -> None:
        given, made = await quick.run(doubled, np.ones(N))
        before = set(files(exchange))
        again, four = await slow.run(doubled, made)
        assert (given[0], made[0], again[0], four[0]) == (1.0, 2.0, 2.0, 4.0)
        assert len(set(files(exchange)) - before) == 1  # of what the second made, and of nothing else

    try:
        asyncio.run(work())
    finally:
        quick.close()
        slow.close()


def test_arrays_outlive_the_folder(owner: Exchange, other: Exchange) -> None:
    got = owner.unpack(other.pack(np.ones(N))[0])
    other.close()
    assert owner.folder.is_dir()
    owner.close()
    assert not owner.folder.exists() and got[-1] == 1.0


def test_the_folder_goes_with_the_exchange_that_made_it() -> None:
    exchange = Exchange()
    folder = Path(exchange.folder)
    assert folder.is_dir()
    del exchange
    gc.collect()
    assert not folder.exists()
