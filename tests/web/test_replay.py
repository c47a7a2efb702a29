"""The vehicle in the replay of a flight stands where, and as, it was."""

from dataclasses import replace

import numpy as np
import pytest

from quadctl.frames import quaternion_from_euler
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.flights.flight import Flight
from quadctl.model import Model
from quadctl.vehicle import Vehicle
from quadctl.web.elements.theme import LIGHT
from quadctl.web.figures.replay import MOST_FRAMES, frame_times, replay_figure
from tests.support.flights import obedient


@pytest.fixture(scope="module")
def flight(raptor: Vehicle) -> Flight:
    return load_dataset([obedient(Model(raptor), 30.0)], raptor).flights[0]


def test_every_frame_has_its_time(flight: Flight) -> None:
    times = frame_times(flight)
    drawn = replay_figure(flight, 0.0 * flight.measured, None, LIGHT)
    assert len(drawn["frames"]) == len(times) <= MOST_FRAMES
    assert (times[0], times[-1]) == (flight.time_s[0], flight.time_s[-1])


def test_the_vehicle_begins_at_the_begin_of_the_path_and_each_frame_moves_it(flight: Flight) -> None:
    drawn = replay_figure(flight, 0.0 * flight.measured, None, LIGHT)
    path = drawn["data"][0]
    for frame, sample in ((drawn["frames"][0], 0), (drawn["frames"][-1], -1)):
        nose = frame["data"][1]
        assert [nose[axis][0] for axis in "xyz"] == pytest.approx([path[axis][sample] for axis in "xyz"], abs=1e-3)


def test_the_nose_points_to_where_the_yaw_says_and_rises_with_the_pitch(flight: Flight) -> None:
    up_and_east = tuple(np.full(len(flight.grid_s), part) for part in quaternion_from_euler(0.0, 0.3, np.pi / 2.0))
    turned = replace(flight, conditions=replace(flight.conditions, attitude=up_and_east))
    nose = replay_figure(turned, 0.0 * flight.measured, None, LIGHT)["frames"][0]["data"][1]
    east, north, up = (float(np.diff(nose[axis])[0]) for axis in "xyz")
    assert north == pytest.approx(0.0, abs=1e-3)
    assert up / east == pytest.approx(np.tan(0.3), abs=0.01)


def test_the_arrow_is_the_residual_to_scale(flight: Flight) -> None:
    residual = np.tile([0.0, 0.0, 2.0], (len(flight.measured), 1))
    drawn = replay_figure(flight, residual, None, LIGHT)
    arrow = drawn["frames"][0]["data"][2]
    assert np.diff(arrow["x"])[0] == np.diff(arrow["y"])[0] == 0.0
    name = next(trace["name"] for trace in drawn["data"] if trace["name"].startswith("residual"))
    metres = float(name.split("scale: ")[1].split(" m")[0])
    assert np.diff(arrow["z"])[0] == pytest.approx(2.0 * metres, rel=0.05)


def test_a_ceiling_far_away_does_not_make_the_flight_small(flight: Flight) -> None:
    def planes(ceiling_m: float) -> set[str]:
        vehicle = flight.vehicle.model_copy(update={"ceiling_m": ceiling_m})
        drawn = replay_figure(replace(flight, vehicle=vehicle), 0.0 * flight.measured, None, LIGHT)
        return {trace["name"] for trace in drawn["data"]} & {"ground", "ceiling"}

    assert "ceiling" in planes(float(np.max(flight.conditions.height_m)) + 0.1)
    assert "ceiling" not in planes(100.0)
