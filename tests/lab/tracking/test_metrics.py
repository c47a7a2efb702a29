"""Metrics worked out by hand on simple signals, and the published table 2 from the public flights."""

import io
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from quadctl.errors import LogError
from quadctl.lab.tracking import metrics as m
from quadctl.lab.tracking.metrics import Note, Window, metrics
from quadctl.lab.tracking.rendering import render
from quadctl.lab.tracking.steps import only_step
from quadctl.logs.contradictions import contradictions
from quadctl.logs.findings import worded
from quadctl.logs.flight_log import FlightLog, Floats
from quadctl.logs.read import read_logs
from quadctl.words import fact
from tests.support.places import DATA

RAPTOR = DATA / "raptor"


def flight(
    z_m: Floats,
    *,
    z_ref_m: Floats | float | None = None,
    phase: list[str] | None = None,
    name: str = "a.csv",
    dt: float = 0.5,
) -> FlightLog:
    columns = {"time_s": np.arange(len(z_m)) * dt, "z_m": np.asarray(z_m, dtype=float)}
    if z_ref_m is not None:
        columns["z_ref_m"] = np.broadcast_to(np.asarray(z_ref_m, dtype=float), len(z_m)).copy()
    return FlightLog(name, None, columns, None if phase is None else np.array(phase))


class TestOnArrays:
    time_s = np.array([0.5, 1.0, 2.0])
    error = np.array([2.0, -4.0, 1.0])

    def test_each_value_holds_from_the_sample_before(self) -> None:
        assert m.signed_integral(self.error, self.time_s) == 2.0 * 0.5 - 4.0 * 0.5 + 1.0 * 1.0

    def test_nothing_cancels_in_the_absolute_integral(self) -> None:
        assert m.absolute_integral(self.error, self.time_s) == 2.0 * 0.5 + 4.0 * 0.5 + 1.0 * 1.0

    def test_means_are_over_time(self) -> None:
        assert m.mean_absolute_error(self.error, self.time_s) == 4.0 / 2.0
        assert m.root_mean_square_error(self.error, self.time_s) == pytest.approx(np.sqrt((2.0 + 8.0 + 1.0) / 2.0))

    def test_largest_error_keeps_its_sign(self) -> None:
        assert m.largest_error(self.error) == -4.0


class TestOneFlight:
    def test_time_window_is_open_at_its_start_and_closed_at_its_end(self) -> None:
        log = flight(np.array([9.0, 9.0, 1.0, 2.0, 3.0, 9.0]))  # at 0, 0.5, ... 2.5 s
        result = metrics([log], window=Window(0.5, 2.0), setpoint_m=2.0).flights[0]
        assert result.n_samples == 3
        assert result.duration_s == 1.5
        assert (result.m_a_signed, result.m_a_absolute) == (0.0, 1.0)
        assert result.mae_m == pytest.approx(1.0 / 1.5)
        assert result.rmse_m == pytest.approx(np.sqrt(1.0 / 1.5))
        assert (result.m_b_signed, result.m_b_absolute) == (None, None)

    def test_own_reference_is_used_where_there_is_one(self) -> None:
        log = flight(np.array([1.0, 2.0, 3.0]), z_ref_m=np.array([1.0, 1.0, 2.5]))
        result = metrics([log], window=Window(0.0, 1.0)).flights[0]
        assert result.m_a_signed == 1.0 * 0.5 + 0.5 * 0.5

    def test_setpoint_takes_the_place_of_the_own_reference(self) -> None:
        log = flight(np.ones(3), z_ref_m=1.0)
        assert metrics([log], window=Window(0.0, 1.0), setpoint_m=0.0).flights[0].m_a_signed == 1.0

    def test_phase_named_step_is_the_default(self) -> None:
        phase = ["settle", "step", "step", "step", "land"]
        result = metrics([flight(np.array([9.0, 3.0, 1.0, 2.0, 9.0]), z_ref_m=0.0, phase=phase)]).flights[0]
        assert result.duration_s == 1.0
        assert result.m_a_signed == 1.0 * 0.5 + 2.0 * 0.5

    def test_other_phases_are_asked_for_by_name(self) -> None:
        log = flight(np.array([1.0, 1.0, 1.0, 7.0, 7.0]), z_ref_m=0.0, phase=["hover"] * 3 + ["step"] * 2)
        assert metrics([log], window=Window(phase="hover")).flights[0].m_a_signed == 1.0

    def test_missing_values_are_bridged(self) -> None:
        log = flight(np.array([1.0, 1.0, np.nan, 1.0, 1.0]), z_ref_m=0.0)
        result = metrics([log], window=Window(0.0, 2.0)).flights[0]
        assert (result.n_samples, result.m_a_signed) == (3, 2.0)

    def test_another_axis(self) -> None:
        log = flight(np.zeros(3))
        log.columns["x_m"] = np.ones(3)
        assert metrics([log], window=Window(0.0, 1.0), axis="x", setpoint_m=0.0).flights[0].m_a_signed == 1.0


class TestAgainstReferenceFlights:
    def test_what_both_flights_do_is_no_ground_effect(self) -> None:
        error = np.array([1.0, 0.5, 0.25, 0.0, 0.0])
        low = flight(0.2 + error, z_ref_m=0.2)
        high = flight(1.1 + error, z_ref_m=1.1, name="high.csv")
        result = metrics([low], [high], window=Window(0.0, 2.0)).flights[0]
        assert result.m_b_signed == pytest.approx(0.0, abs=1e-12)
        assert result.m_b_absolute == pytest.approx(0.0, abs=1e-12)
        assert result.m_a_signed == pytest.approx(0.375)

    def test_signed_cancels_and_absolute_does_not(self) -> None:
        low = flight(np.array([0.0, 0.1, 0.1, -0.1, -0.1]), z_ref_m=0.0)
        high = flight(np.full(5, 5.0), z_ref_m=5.0)
        result = metrics([low], [high], window=Window(0.0, 2.0)).flights[0]
        assert result.m_b_signed == pytest.approx(0.0)
        assert result.m_b_absolute == pytest.approx(0.2)

    def test_flights_are_aligned_at_the_start_of_the_phase_and_interpolated(self) -> None:
        ramp = np.arange(5.0)
        low = flight(np.concatenate([[9.0], 2.0 * ramp]), z_ref_m=0.0, phase=["settle", *["step"] * 5], dt=1.0)
        high = flight(
            np.concatenate([[9.0] * 3, np.arange(9.0)]), z_ref_m=0.0, phase=["settle"] * 3 + ["step"] * 9, dt=0.5
        )
        # At 1, 2, 3, 4 s the low one is at 2, 4, 6, 8 m and the high one too.
        result = metrics([low], [high]).flights[0]
        assert result.m_b_absolute == pytest.approx(0.0)
        assert result.m_a_signed == pytest.approx(20.0)

    def test_several_references_are_averaged(self) -> None:
        low = flight(np.full(3, 1.0), z_ref_m=0.0)
        highs = [flight(np.full(3, z), z_ref_m=0.0, name=f"high_{i}.csv") for i, z in enumerate((0.2, 0.4))]
        result = metrics([low], highs, window=Window(0.0, 1.0))
        assert result.flights[0].m_b_signed == pytest.approx(0.7)
        assert [f.m_b_signed for f in result.flights if f.is_reference] == pytest.approx([-0.1, 0.1])

    def test_reference_setpoint_is_told_from_where_they_settled(self) -> None:
        low = flight(np.full(13, 0.3))
        high = flight(np.concatenate([np.full(8, 2.0), np.full(5, 1.113)]))
        result = metrics([low], [high], window=Window(0.0, 6.0), setpoint_m=0.2)
        assert result.flights[1].m_a_signed == pytest.approx(0.9 * 3.5 + 0.013 * 2.5)
        assert result.notes == (fact(Note.SETTLED, setpoint_m=pytest.approx(1.1)),)

    def test_reference_setpoint_may_be_given(self) -> None:
        result = metrics(
            [flight(np.ones(3))], [flight(np.full(3, 2.0))], window=Window(0, 1), setpoint_m=1, reference_setpoint_m=2
        )
        assert result.flights[0].m_b_signed == 0.0
        assert result.notes == ()

    def test_a_shorter_reference_is_refused(self) -> None:
        low = flight(np.ones(9), z_ref_m=0.0, phase=["step"] * 9)
        high = flight(np.ones(6), z_ref_m=0.0, phase=["step"] * 6, name="high.csv")
        with pytest.raises(LogError, match=r"high\.csv: the reference lasts 2\.50 s, expected 4\.00 s"):
            metrics([low], [high])


class TestGroups:
    def test_runs_are_told_by_name(self) -> None:
        logs = [
            flight(np.full(3, z), name=name) for name, z in (("a_01.csv", 1.0), ("a_02.csv", 2.0), ("a_V_050.csv", 5.0))
        ]
        result = metrics(logs, window=Window(0.0, 1.0), setpoint_m=0.0)
        assert [(g.group, g.n_runs) for g in result.groups] == [("a", 2), ("a_V_050", 1)]
        assert result.group("a").mean["m_a_signed"] == 1.5
        assert result.group("a").std["m_a_signed"] == 0.5, "of the population"
        assert result.group("a").mean["m_b_signed"] is None

    def test_runs_are_told_by_mission_and_compensator_where_known(self) -> None:
        logs = [
            FlightLog(
                f"{i}.csv",
                None,
                {"time_s": np.arange(3.0), "z_m": np.ones(3)},
                None,
                {"mission": "step", "compensator": c},
            )
            for i, c in enumerate(("none", "fitted.yaml", "none"))
        ]
        result = metrics(logs, window=Window(0.0, 2.0), setpoint_m=0.0)
        assert [(g.group, g.n_runs) for g in result.groups] == [("step, none", 2), ("step, fitted.yaml", 1)]

    def test_noise_of_single_runs_averages_out_of_the_mean_flight(self) -> None:
        runs = [flight(np.full(3, z), name=f"low_{i}.csv") for i, z in enumerate((0.1, -0.1))]
        result = metrics(runs, [flight(np.zeros(3), name="high.csv")], window=Window(0.0, 1.0), setpoint_m=0.0)
        assert result.group("low").mean["m_b_absolute"] == pytest.approx(0.1)
        assert result.group("low").m_b_absolute_of_mean == pytest.approx(0.0)

    def test_unknown_group_is_named_with_the_nearest(self) -> None:
        result = metrics([flight(np.ones(3), name="hayden.csv")], window=Window(0.0, 1.0), setpoint_m=0.0)
        with pytest.raises(LogError, match=r"no flights are named 'haydn' \(did you mean 'hayden'\?\)"):
            result.group("haydn")


class TestRefusals:
    log = flight(np.ones(5), z_ref_m=0.0, phase=["settle", "step", "step", "land", "land"])

    @pytest.mark.parametrize(
        ("window", "sentence"),
        [
            (Window(phase="stepp"), "its phases are settle, step, land, expected 'stepp' (did you mean 'step'?)"),
            (Window(phase="settle"), "its phases are"),
            (Window(1.0, 30.0), "covers 0 to 2 s, expected it to cover 1 to 30 s"),
            (Window(1.1, 1.2), "0 samples of z in the time in (1.1, 1.2] s, expected at least two"),
        ],
    )
    def test_a_window_that_the_log_does_not_cover(self, window: Window, sentence: str) -> None:
        with pytest.raises(LogError) as caught:
            metrics([self.log], window=window)
        assert f"a.csv: {sentence}" in str(caught.value)

    def test_no_phase_and_no_window(self) -> None:
        """Nothing is asked for and no step is to be seen; a phase is asked for and none is there."""
        with pytest.raises(LogError, match=r"a\.csv: has no phases, and no step was found in the position along z"):
            metrics([flight(np.ones(3))])
        with pytest.raises(LogError, match=r"a\.csv: has no phases, expected a time window .* in place of --phase"):
            metrics([flight(np.ones(3))], window=Window(phase="down"))

    def test_a_log_or_reference_that_contradicts_itself(self) -> None:
        """In the words in which an analysis refuses it."""
        t = 0.02 * np.arange(3000)
        columns = {"time_s": t, "z_m": 3.28084 * (1.0 + 0.3 * np.sin(t)), "vz_m_s": 0.3 * np.cos(t)}
        feet, good = FlightLog("feet.csv", None, columns), flight(np.ones(3))
        assert contradictions(feet)
        for logs, references in (([feet], []), ([good], [feet])):
            with pytest.raises(LogError, match=f"^{re.escape(f'feet.csv: {worded(contradictions(feet)[0])}')}$"):
                metrics(logs, references, window=Window(0.0, 1.0), setpoint_m=1.0)

    def test_phase_flown_twice(self) -> None:
        with pytest.raises(LogError, match="step is flown more than once"):
            metrics([flight(np.ones(5), z_ref_m=0.0, phase=["step", "step", "up", "step", "step"])])

    def test_no_reference_and_no_setpoint(self) -> None:
        with pytest.raises(LogError, match=r"a\.csv: has no reference column 'z_ref_m', expected one or a --setpoint"):
            metrics([flight(np.ones(3))], window=Window(0.0, 1.0))

    @pytest.mark.parametrize(
        ("arguments", "sentence"),
        [
            ({"from_s": 1.0}, "one end only"),
            ({"from_s": 2.0, "to_s": 1.0}, "from 2 to 1 s"),
            ({"from_s": float("nan"), "to_s": 1.0}, "from nan"),
            ({"from_s": 1.0, "to_s": 2.0, "phase": "step"}, "expected one of them"),
        ],
    )
    def test_windows_that_are_none(self, arguments: dict[str, object], sentence: str) -> None:
        with pytest.raises(LogError, match=sentence):
            Window(**arguments)  # type: ignore[arg-type]

    def test_no_flight(self) -> None:
        with pytest.raises(LogError, match="no flight is given"):
            metrics([])


def stepping(
    high_m: float, low_m: float, *, reference: bool = True, name: str = "step.csv", end_s: float = 60.0
) -> FlightLog:
    """Take-off, at 20 s a step that takes some three seconds, landing 5 s before the end; without phases."""
    random = np.random.default_rng(1)
    t: Floats = 0.02 * np.arange(round(end_s / 0.02), dtype=np.float64)
    lands_s = end_s - 5.0
    told = np.where(t < 5.0, 0.0, np.where(t < 20.0, high_m, np.where(t < lands_s, low_m, 0.0)))
    z = np.zeros_like(t)
    for i in range(1, len(t)):
        z[i] = z[i - 1] + 0.02 * (told[i] - z[i - 1])
    columns: dict[str, Floats] = {"time_s": t, "z_m": z + 0.003 * random.standard_normal(len(t))}
    columns |= {f"motor{i}_rpm": np.where((t > 4.0) & (t < lands_s + 3.0), 5500.0, 0.0) for i in (1, 2, 3, 4)}
    if reference:
        columns["z_ref_m"] = np.where((t < 5.0) | (t >= lands_s), np.nan, told)
    return FlightLog(name, None, columns)


class TestStepsWithoutPhases:
    def test_the_jump_of_the_reference_is_the_window(self) -> None:
        """Digit by digit what the same flight gives with its phases."""
        log = stepping(1.2, 0.2)
        phase = np.where(log.time_s < 20.0, "settle", np.where(log.time_s < 55.0, "step", "land"))
        seen, told = metrics([log]), metrics([replace(log, phase=phase)])
        assert seen.flights == told.flights
        assert str(seen.notes[0]) == (
            "step.csv has no phases: measured is its step from 1.20 to 0.20 m at 20.00 s, as seen in the reference, "
            "for 34.98 s"
        )

    def test_the_position_shows_it_where_there_is_no_reference(self) -> None:
        result = metrics([stepping(1.2, 0.2, reference=False)], setpoint_m=0.2)
        step = only_step(stepping(1.2, 0.2, reference=False))
        assert step.start_s == pytest.approx(20.0, abs=0.3) and step.end_s == pytest.approx(55.0, abs=1.0)
        assert [step.from_m, step.to_m] == pytest.approx([1.2, 0.2], abs=0.05)
        assert result.notes[0].facts["source"] == "position"

    def test_all_flights_are_measured_for_as_long_as_the_shortest(self) -> None:
        low, high = stepping(1.2, 0.2, end_s=60.0), stepping(2.1, 1.1, end_s=50.0, name="high.csv")
        result = metrics([low], [high])
        assert [flight.duration_s for flight in result.flights] == pytest.approx([24.98, 24.98])
        assert result.flights[0].m_b_absolute is not None
        assert [note.facts["flight"] for note in result.notes] == ["step.csv", "high.csv"]

    def test_what_is_asked_for_goes_first(self) -> None:
        result = metrics([stepping(1.2, 0.2)], window=Window(30.0, 40.0))
        assert result.flights[0].duration_s == pytest.approx(10.0) and not result.notes

    def test_take_off_and_landing_are_no_steps(self) -> None:
        log = stepping(1.2, 1.2, reference=False)
        with pytest.raises(LogError, match="no step was found in the position along z, expected one, or a time window"):
            only_step(log)

    def test_of_several_steps_none_is_chosen(self) -> None:
        log = stepping(1.2, 0.2)
        log.columns["z_ref_m"][2000:2200] = 0.7
        with pytest.raises(
            LogError, match=r"3 steps were found in the reference along z \(from 1.20 to 0.20 m at 20.00"
        ):
            metrics([log])


def on_a_narrow_terminal(result: m.MetricsTable) -> str:
    terminal = io.StringIO()
    Console(width=80, file=terminal).print(render(result))
    return terminal.getvalue()


class TestOutput:
    result = metrics(
        [flight(np.full(3, z), name=f"low_{i}.csv") for i, z in enumerate((1.0, 2.0))],
        [flight(np.full(3, 1.25), name="high.csv")],
        window=Window(0.0, 1.0),
        setpoint_m=0.0,
        reference_setpoint_m=0.0,
    )

    def test_dict_is_json_and_labels_signed_and_absolute(self) -> None:
        data = json.loads(json.dumps(self.result.to_dict(), allow_nan=False))
        assert data["flights"][0]["m_b_signed"] == -0.25
        assert data["flights"][0]["m_b_absolute"] == 0.25
        assert data["groups"][0]["mean"]["m_b_signed"] == 0.25
        assert data["groups"][0]["mean"]["m_b_absolute"] == 0.5

    def test_the_flights_are_ranked_first_by_the_difference_from_the_reference_flight(self) -> None:
        worse, better = flight(np.full(3, 1.75), name="worse.csv"), flight(np.full(3, 1.5), name="better.csv")
        high = flight(np.full(3, 1.25), name="high.csv")
        window = Window(0.0, 1.0)
        ranked = metrics([worse, better], [high], window=window, setpoint_m=0.0, reference_setpoint_m=0.0)
        first = " ".join(on_a_narrow_terminal(ranked).split("Tracking")[0].split())
        assert first.endswith("M_B (m s): 'better' 0.250; 'worse' 0.500.")
        without = metrics([worse, better], window=window, setpoint_m=0.0)
        said = " ".join(on_a_narrow_terminal(without).split())
        assert "RMSE of the error (m): 'better' 1.500; 'worse' 1.750." in said

    def test_table_shows_every_number_on_a_narrow_terminal(self) -> None:
        shown = on_a_narrow_terminal(self.result)
        assert "…" not in shown
        lines = {line.split()[0]: line.split()[1:] for line in shown.splitlines() if line.strip()}
        assert lines["low_0"] == ["1.000", "1.000", "-0.250", "0.250", "1.000", "1.000", "1.000"]
        assert lines["low_1"] == ["2.000", "2.000", "0.750", "0.750", "2.000", "2.000", "2.000"]
        assert shown.count("signed") == shown.count("absolute") == 2

    def test_a_flight_is_one_line_on_a_narrow_terminal(self) -> None:
        """With the names that `quadctl simulate` gives, and 80 columns."""
        flown = ("step_response", "hayden"), ("step_response_high", "none")
        metas = [{"mission": mission, "compensator": compensator} for mission, compensator in flown]
        low, high = (replace(flight(np.full(3, 1.0), name=f"{i}.csv"), meta=meta) for i, meta in enumerate(metas))
        result = metrics([low], [high], window=Window(0.0, 1.0), setpoint_m=0.0, reference_setpoint_m=0.0)
        lines = on_a_narrow_terminal(result).splitlines()
        assert any(line.startswith("step_response, hayden ") and line.rstrip().endswith("1.000") for line in lines)
        below = lines[next(i for i, line in enumerate(lines) if line.startswith("reference flights:")) + 1]
        assert below.startswith("step_response_high, none ") and below.rstrip().endswith("1.000")

    def test_without_references_there_is_no_m_b(self) -> None:
        assert "M_B" not in on_a_narrow_terminal(metrics([flight(np.ones(3))], window=Window(0.0, 1.0), setpoint_m=0.0))


PUBLISHED = {  # table 2: M_A and M_B, signed, mean of three runs
    "NO_COMPENSATION": (1.441, 0.409),
    "CHEESEMAN": (1.36, 0.328),
    "HAYDEN": (1.301, 0.269),
    "SANCHEZ": (1.29, 0.258),
    "APPIUS": (1.12, 0.088),
    "HIGH_ALTITUDE": (1.032, 0.0),
}
RUN_SPREAD_M_S = 0.07
"""The largest distance between the two runs that are public (APPIUS)."""
ONE_MEAN_M_S = RUN_SPREAD_M_S / 3
"""A third run that far from the mean of the two public ones moves the mean of all three by a third of it."""


@pytest.fixture(scope="module")
def table() -> m.MetricsTable:
    logs = {name: read_logs(RAPTOR / f"{name}_0{run}.csv" for run in (1, 2)) for name in PUBLISHED}
    high = logs.pop("HIGH_ALTITUDE")
    return metrics([log for runs in logs.values() for log in runs], high, window=Window(15.0, 44.04), setpoint_m=0.2)


@pytest.mark.skipif(not RAPTOR.is_dir(), reason="the public RAPTOR logs are not here")
class TestPublishedTable:
    """Two of the three published runs are public, so the numbers come near and not out."""

    def test_window_holds_the_published_samples(self, table: m.MetricsTable) -> None:
        assert {flight.n_samples for flight in table.flights} == {1452}
        assert all(flight.duration_s == pytest.approx(29.04) for flight in table.flights)

    def test_reference_flights_are_0_9_m_higher(self, table: m.MetricsTable) -> None:
        assert table.notes == (fact(Note.SETTLED, setpoint_m=pytest.approx(1.1)),)

    @pytest.mark.parametrize("name", PUBLISHED)
    def test_signed_m_a(self, table: m.MetricsTable, name: str) -> None:
        assert table.group(name).mean["m_a_signed"] == pytest.approx(PUBLISHED[name][0], abs=ONE_MEAN_M_S)

    @pytest.mark.parametrize("name", PUBLISHED)
    def test_signed_m_b(self, table: m.MetricsTable, name: str) -> None:
        # The difference of two such means.
        assert table.group(name).mean["m_b_signed"] == pytest.approx(PUBLISHED[name][1], abs=np.sqrt(2) * ONE_MEAN_M_S)

    def test_compensators_come_in_the_published_order(self, table: m.MetricsTable) -> None:
        ours = [table.group(name).mean["m_b_signed"] or 0.0 for name in PUBLISHED]
        assert ours == sorted(ours, reverse=True)

    def test_absolute_error_tells_another_story(self, table: m.MetricsTable) -> None:
        def removed(of: dict[str, float]) -> float:
            return 1.0 - of["APPIUS"] / of["NO_COMPENSATION"]

        signed = {name: table.group(name).mean["m_b_signed"] or 0.0 for name in PUBLISHED}
        absolute = {name: table.group(name).m_b_absolute_of_mean or 0.0 for name in PUBLISHED}
        assert removed(signed) == pytest.approx(0.785, abs=0.08)
        # 0.55 and 0.33 over three runs; over two, more of the noise is left.
        assert absolute["NO_COMPENSATION"] == pytest.approx(0.55, abs=0.05)
        assert absolute["APPIUS"] == pytest.approx(0.33, abs=0.05)
        assert removed(absolute) == pytest.approx(0.41, abs=0.08)
