"""The flight from above on the live view: the vehicle is where the record says, and the space holds it."""

import math

import numpy as np
import pytest

from quadctl.flight.record.view_link import Record
from quadctl.frames import quaternion_from_euler
from quadctl.web.elements.space import Box
from quadctl.web.elements.theme import LIGHT
from quadctl.web.live.history import Brief, History, Row
from quadctl.web.live.space import NO_BOX, additions, box_for, moving, place, space_figure
from tests.support.in_process import plan
from tests.web.test_live_view import first_tick, taken

VEHICLE = plan().body.vehicle
BOX = Box(0.0, 0.0, 1.8, 2.0)


@pytest.fixture
def record() -> Record:
    link, tick, _, viewer = first_tick()
    link(tick)
    (sent,) = taken(viewer)
    return sent._replace(
        armed=True, north_m=1.0, east_m=0.5, height_m=0.7, north_ref_m=1.2, east_ref_m=0.4, height_ref_m=0.8
    )


def rows_of(*records: Record) -> list[Row]:
    history = History(Brief(plan().mission, plan().settings.guards, VEHICLE, "none"))
    for each in records:
        history.take(each)
    return list(history.rows)


def test_a_record_holds_the_place_and_the_attitude_of_its_tick() -> None:
    link, tick, _, viewer = first_tick()
    link(tick)
    (sent,) = taken(viewer)
    assert (sent.north_m, sent.east_m) == tick.state.position_ned_m[:2]
    assert sent.attitude == tick.state.attitude


def test_the_vehicle_is_drawn_where_it_is_with_a_line_to_its_setpoint(record: Record) -> None:
    _, nose, line = moving(record, VEHICLE, BOX)
    assert nose[0] == pytest.approx([0.5, 1.0, 0.7])
    assert line == pytest.approx(np.array([[0.5, 1.0, 0.7], [0.4, 1.2, 0.8]]))


def test_the_nose_rises_with_the_pitch_and_turns_with_the_yaw(record: Record) -> None:
    east_and_up = quaternion_from_euler(0.0, 0.3, math.pi / 2.0)
    _, nose, _ = moving(record._replace(attitude=east_and_up), VEHICLE, BOX)
    east, north, up = np.diff(nose, axis=0)[0]
    assert north == pytest.approx(0.0, abs=1e-9)
    assert up / east == pytest.approx(math.tan(0.3))


def test_a_place_that_is_not_known_is_drawn_nowhere(record: Record) -> None:
    for points in (*moving(None, VEHICLE, BOX), *moving(record._replace(north_m=math.nan), VEHICLE, BOX)):
        assert np.isnan(points).all()


def test_standing_before_the_flight_is_no_part_of_the_path(record: Record) -> None:
    standing, flying = rows_of(record._replace(armed=False), record)
    assert math.isnan(place(standing)[0])
    assert place(flying) == (0.5, 1.0, 0.7)


def test_the_path_grows_by_the_new_rows_and_the_vehicle_is_replaced(record: Record) -> None:
    rows = rows_of(record, record._replace(north_m=1.1))
    points, most = additions(rows, record, VEHICLE, BOX, 600)
    assert points["y"][0] == [1.0, 1.1]
    assert most["x"][0] == 600
    drawn = space_figure(rows, record, VEHICLE, BOX, LIGHT)
    for curve in (1, 2, 3):
        assert most["y"][curve] == len(points["y"][curve]) == len(drawn["data"][curve]["y"])


def test_the_space_stays_while_the_vehicle_is_in_it_and_then_grows_to_hold_it() -> None:
    box = box_for(NO_BOX, [(3.0, -2.0, 0.1)])
    assert (box.east, box.north) == (3.0, -2.0)
    assert box_for(box, [(3.1, -2.2, 0.4), (math.nan, math.nan, 9.0)]) == box
    for far in ((5.0, -2.0, 0.1), (3.0, -9.0, 0.1), (3.0, -2.0, 4.0)):
        larger = box_for(box, [far])
        assert box_for(larger, [far, (3.0, -2.0, 0.1)]) == larger
        assert larger.up - larger.half < 0.0 < larger.half < 10.0


def test_without_a_known_place_the_space_waits_for_one() -> None:
    assert box_for(NO_BOX, []) == box_for(NO_BOX, [(math.nan, math.nan, 0.0)]) == NO_BOX
