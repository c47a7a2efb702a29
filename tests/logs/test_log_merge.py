"""Channels of different rates become one table: held, averaged, never invented."""

from pathlib import Path

import numpy as np
import pytest

from quadctl.errors import LogError
from quadctl.logs.columns import STATE_COLUMNS
from quadctl.logs.flight_log import ATTITUDE, POSITION
from quadctl.logs.merge import ROW_TOLERANCE_S, Channel, Origin, averaged, held, merge, row_times


class TestMerge:
    nan = np.nan

    def test_a_value_is_held_until_the_next_and_missing_before_the_first(self) -> None:
        rows = held(np.arange(6.0), np.array([1.0, 3.5]), np.array([7.0, 8.0]))
        np.testing.assert_array_equal(rows, [self.nan, 7.0, 7.0, 7.0, 8.0, 8.0])

    def test_an_update_a_moment_after_a_row_belongs_to_it(self) -> None:
        late = 0.5 * ROW_TOLERANCE_S
        assert held(np.array([1.0, 2.0]), np.array([1.0 + late]), np.array([5.0])).tolist() == [5.0, 5.0]

    def test_of_several_updates_in_a_row_the_last_counts(self) -> None:
        assert held(np.array([1.0, 2.0]), np.array([0.5, 1.2, 1.8]), np.array([1.0, 2.0, 3.0])).tolist() == [1.0, 3.0]

    def test_an_average_counts_every_sample_once(self) -> None:
        samples = np.array([9.0, 1.0, 2.0, 3.0, 4.0, self.nan, 6.0])
        rows = averaged(np.array([0.1, 1.0, 2.0, 3.0]), np.array([0.0, 0.1, 0.4, 0.8, 1.5, 1.6, 2.5]), samples)
        assert rows.tolist() == [1.0, 2.5, 4.0, 6.0]

    def test_an_average_is_held_where_no_sample_came(self) -> None:
        rows = averaged(np.arange(4.0), np.array([1.0, 3.0]), np.array([5.0, 6.0]))
        np.testing.assert_array_equal(rows, [self.nan, 5.0, 5.0, 6.0])

    def test_rows_are_all_updates_and_near_ones_share_a_row(self) -> None:
        assert row_times(np.array([0.02, 0.0, 0.0201, 0.01, 0.0005])).tolist() == [0.0, 0.01, 0.02]

    def test_updates_of_the_table_are_the_updates_of_the_channels(self) -> None:
        slow, fast = np.arange(0.0, 2.0, 0.1), np.arange(0.003, 2.0, 0.02)
        names = [name for name in STATE_COLUMNS[1:] if name not in ATTITUDE]
        channels = [
            Channel("slow", slow, {name: np.sin(slow) for name in names}),
            Channel("fast", fast, {name: np.cos(fast) for name in ATTITUDE}),
        ]
        log = merge(channels, Origin(Path("a.x"), "", {}, [], []))
        np.testing.assert_allclose(log.time_s[log.updates(*POSITION)], slow, atol=ROW_TOLERANCE_S)
        np.testing.assert_allclose(log.time_s[log.updates(*ATTITUDE)], fast, atol=ROW_TOLERANCE_S)
        assert log.notes == []

    def test_messages_whose_time_goes_back_are_left_out_and_said(self) -> None:
        time = np.array([0.0, 1.0, 0.5, 2.0])
        channels = [Channel("odd", time, {name: np.arange(4.0) for name in STATE_COLUMNS[1:]})]
        log = merge(channels, Origin(Path("a.x"), "", {}, [], []))
        assert len(log) == 3
        assert log.notes == ["1 of 4 odd messages left out: their time does not increase"]

    def test_what_is_missing_is_named_with_what_was_expected(self) -> None:
        channels = [Channel("odd", np.arange(3.0), {name: np.ones(3) for name in (*POSITION, *ATTITUDE)})]
        with pytest.raises(LogError, match=r"a\.x: holds no values of vx_m_s, vy_m_s, vz_m_s, expected messages A and"):
            merge(channels, Origin(Path("a.x"), "A and B", {}, [], []))
