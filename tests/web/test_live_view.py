"""The live view without a browser: what the flight sends costs it nothing."""

import importlib.util
import socket

import pytest

from quadctl.cli import main
from quadctl.flight.pilot.tick import Event, Stage, Tick
from quadctl.flight.record.view_link import (
    EVENTS_KEPT,
    SEND_S,
    Record,
    ViewEnd,
    ViewLink,
    connected_ends,
    next_record,
)
from quadctl.web.live.history import ROWS_KEPT, Brief, History
from quadctl.web.live.land import CONFIRM_S, LandButton
from quadctl.web.live.nearness import guards
from tests.flight.pilot.test_guards import BEYOND, LIMITS, MISSION, verdict
from tests.support.in_process import InProcess, plan
from tests.support.places import ROOT

MORE_THAN_FITS = 5000


def taken(end: ViewEnd) -> list[Record]:
    """Records that wait at the viewer's end."""
    found = []
    while (record := next_record(end)) is not None:
        found.append(record)
    return found


def first_tick() -> tuple[ViewLink, Tick, ViewEnd, ViewEnd]:
    flight, viewer = connected_ends()
    pilot = plan().pilot()
    return ViewLink(flight, pilot), pilot.tick(InProcess().state(), 0.001), flight, viewer


class TestWhatGoesOut:
    def test_a_tick_arrives_as_it_was(self) -> None:
        link, tick, _, viewer = first_tick()
        link(tick)
        (record,) = taken(viewer)
        assert (record.stage, record.phase, record.late_s) == (tick.stage.name, tick.phase, 0.001)
        assert record.height_m == tick.ground_down_m - tick.state.position_ned_m[2]

    def test_a_viewer_that_does_not_read_costs_records_but_not_the_worst_lateness(self) -> None:
        link, tick, _, viewer = first_tick()
        for i in range(MORE_THAN_FITS):
            link(tick._replace(time_s=SEND_S * i))
        link(tick._replace(time_s=SEND_S * MORE_THAN_FITS, late_s=0.2))
        assert 0 < len(taken(viewer)) < MORE_THAN_FITS
        for i in (1, 2):
            link(tick._replace(time_s=SEND_S * (MORE_THAN_FITS + i)))
        assert [record.late_s for record in taken(viewer)] == [0.2, tick.late_s]

    def test_between_two_records_ticks_cost_nothing_and_what_happens_is_told_with_the_next(self) -> None:
        link, tick, _, viewer = first_tick()
        event = Event(1.0, "the tilt is 60 deg", "hand over")
        link(tick)
        link(tick._replace(time_s=tick.time_s + 0.02, late_s=0.1, events=(event,)))
        assert len(taken(viewer)) == 1
        link(tick._replace(time_s=tick.time_s + SEND_S))
        assert [(record.late_s, record.events) for record in taken(viewer)] == [(0.1, (event,))]

    def test_the_last_tick_is_told_at_once(self) -> None:
        link, tick, _, viewer = first_tick()
        link(tick)
        link(tick._replace(time_s=tick.time_s + 0.02, stage=Stage.DONE))
        assert taken(viewer)[-1].stage == Stage.DONE.name

    def test_an_end_that_is_closed_raises_nothing(self) -> None:
        link, tick, flight, viewer = first_tick()
        for end in (viewer, flight):
            end.close()
            for _ in range(3):
                link(tick)

    def test_a_defect_of_the_view_stays_in_the_view(self) -> None:
        link, tick, _, _ = first_tick()
        link(tick._replace(state=None))  # type: ignore[arg-type]

    def test_events_come_again_with_later_records(self) -> None:
        link, tick, _, viewer = first_tick()
        event = Event(1.0, "the tilt is 60 deg", "hand over")
        link(tick._replace(events=(event,)))
        link(tick._replace(time_s=tick.time_s + SEND_S))
        assert [record.events for record in taken(viewer)] == [(event,), (event,)]
        for _ in range(2 * EVENTS_KEPT):
            link(tick._replace(events=(event,)))
        link(tick._replace(time_s=tick.time_s + 2.0 * SEND_S))
        assert len(taken(viewer)[-1].events) == EVENTS_KEPT


@pytest.fixture
def record() -> Record:
    link, tick, _, viewer = first_tick()
    link(tick)
    return taken(viewer)[0]


class TestGuards:
    BRIEF = Brief(plan().mission._replace(limits=MISSION), LIMITS, plan().body.vehicle, "none")
    TOLD_BY_EVENTS_ALONE = ("disarmed", "mode taken", "mode unknown", "no attitude at all", "position aid lost")

    @pytest.mark.parametrize("name", BEYOND)
    def test_the_guard_that_acted_is_marked_and_no_other(self, name: str, record: Record) -> None:
        state, where, answer, _ = BEYOND[name]
        breach = verdict(state, **where)
        assert breach is not None
        after = record._replace(events=(Event(1.0, str(breach.reason), answer.value, breach.guard or ""),))
        low = self.BRIEF._replace(mission=self.BRIEF.mission._replace(limits=MISSION.model_copy(update={"min_z_m": 1})))
        marked = [guard.acted(after) for guard in guards(after, low)]
        assert [m for m in marked if m] == ([] if name in self.TOLD_BY_EVENTS_ALONE else [answer.value])

    def test_at_the_limit_there_is_no_way_left(self, record: Record) -> None:
        at = record._replace(tilt_deg=50.0, speed_m_s=8.0, state_age_s=0.2, battery_v=14.0, height_m=1.5, late_s=0.2)
        share = {guard.guard: guard.share for guard in guards(at, self.BRIEF)}
        for name in ("tilt", "speed", "state age", "battery", "height", "tick lateness"):
            assert share[name] == pytest.approx(1.0), name


class TestHistory:
    def test_what_is_new_since_a_row_is_given_and_no_more_than_is_wanted(self, record: Record) -> None:
        history = History(TestGuards.BRIEF)
        for i in range(ROWS_KEPT + 10):
            history.take(record._replace(time_s=0.1 * i))
        rows = list(history.rows)
        assert len(rows) == ROWS_KEPT
        assert history.since(history.n_rows - 3, 600) == rows[-3:]
        assert history.since(0, 600) == rows[-600:]

    def test_a_flight_that_is_over_cannot_land(self, record: Record) -> None:
        history = History(TestGuards.BRIEF)
        assert not history.can_land
        for stage, can in (("FLY", True), ("LAND", False), ("DONE", False)):
            history.take(record._replace(stage=stage))
            assert history.can_land is can


def test_only_a_second_press_in_time_lands() -> None:
    button = LandButton()
    assert not button.press(10.0)
    button.asks(10.1)
    assert button.waits(10.0 + CONFIRM_S)
    assert not button.press(10.2 + CONFIRM_S)
    assert button.press(10.3 + CONFIRM_S)


def test_a_slow_browser_leaves_as_much_time_for_the_second_press() -> None:
    button = LandButton()
    button.press(10.0)
    assert button.waits(11.0 + CONFIRM_S)
    button.asks(12.0 + CONFIRM_S)
    assert button.press(12.0 + 2.0 * CONFIRM_S)


def test_what_is_asked_after_the_vehicle_landed_asks_for_no_press() -> None:
    button = LandButton()
    button.press(10.0)
    assert button.press(10.5)
    button.asks(11.0)
    assert not button.waits(11.0)


class TestCommand:
    def fails(self, monkeypatch: pytest.MonkeyPatch, *words: str) -> int | str | None:
        mission = str(ROOT / "missions" / "short_hop.yaml")
        monkeypatch.setattr("sys.argv", ["quadctl", "fly", mission, "--sitl", *words])
        with pytest.raises(SystemExit) as ended:
            main()
        return ended.value.code

    @pytest.mark.parametrize("words", [("--view-token", "long-enough"), ("--view", "--view-token", "short")])
    def test_a_token_needs_a_view_and_some_length(
        self, words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert self.fails(monkeypatch, *words) == 2
        assert "--view-token" in capsys.readouterr().err

    def test_a_taken_port_is_one_sentence(
        self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        with socket.create_server(("127.0.0.1", 0)) as other:
            port = str(other.getsockname()[1])
            assert self.fails(monkeypatch, "--view", "--view-port", port) == 1
        assert f"port {port} is taken, expected a free one: name another with --view-port" in capsys.readouterr().err

    def test_a_lean_install_says_what_it_lacks(
        self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
        assert self.fails(monkeypatch, "--view") == 1
        assert "pip install 'quadctl[web]'" in capsys.readouterr().err
