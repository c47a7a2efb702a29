"""`quadctl fleet`: each flight is measured once, vehicles that change are named, bad logs get a sentence."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from quadctl.cli import app
from quadctl.effects.rotor_drag import LinearDrag
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.errors import LogError, SettingsError
from quadctl.fleet.changes import FALSE_DISCOVERIES, Series, find_changes
from quadctl.fleet.figures import small_multiples
from quadctl.fleet.index import Index, find_logs
from quadctl.fleet.measurement import FlightRecord, measure
from quadctl.fleet.summary import Kind, summarise
from quadctl.fleet.work import measure_fleet
from quadctl.logs.csv_log import write_csv
from quadctl.logs.read import read_log
from quadctl.model import Model, save_model
from quadctl.words import fact
from tests.support.flights import obedient, to_and_fro
from tests.support.links import RAPTOR

NOISE_M_S = 0.005


def series(values: np.ndarray, vehicle: str = "a", quantity: str = "rotor 1") -> Series:
    names = tuple(f"{vehicle}/{i}.csv" for i in range(len(values)))
    return Series(vehicle, quantity, names, np.arange(len(values), dtype=float), values)


def logged(
    model: Model, path: Path, seed: int, duration_s: float = 30.0, weak_rotor: int = 1, loss: float = 0.0
) -> Path:
    """Write a log; a weak rotor turns faster, for the vehicle does not turn."""
    path.parent.mkdir(parents=True, exist_ok=True)
    log = obedient(model, duration_s, noise_m_s=NOISE_M_S, seed=seed, name=path.name)
    log.columns[f"motor{weak_rotor}_rpm"] = log.columns[f"motor{weak_rotor}_rpm"] / (1.0 - loss) ** 0.5
    write_csv(log, path)
    return path


@pytest.fixture
def fleet(rigid: Model, tmp_path: Path) -> Path:
    for vehicle in ("a", "b"):
        for flight in (1, 2, 10):
            logged(rigid, tmp_path / vehicle / f"flight_{flight}.csv", flight)
    return tmp_path


class TestChanges:
    def test_a_drift_is_found_among_steady_vehicles_and_comes_per_ten_flights(self) -> None:
        random = np.random.default_rng(1)
        steady = [series(random.normal(1.0, 0.004, 20), f"v{i}") for i in range(49)]
        worn = series(random.normal(1.0, 0.004, 20) - 0.001 * np.arange(20), "worn")
        (change,) = find_changes([*steady, worn])
        assert (change.vehicle, change.kind) == ("worn", "drift")
        assert change.ci95[0] <= -0.01 <= change.ci95[1]

    def test_a_jump_is_found_with_its_flight_give_or_take_one(self) -> None:
        random = np.random.default_rng(2)
        values = random.normal(0.3, 0.01, 24) + 0.06 * (np.arange(24) >= 15)
        (change,) = find_changes([series(values, quantity="rotor_drag d_x")])
        assert change.kind == "jump"
        assert change.since in ("a/14.csv", "a/15.csv", "a/16.csv")

    def test_a_jump_of_one_vehicle_of_many_is_sure_where_before_and_after_do_not_overlap(self) -> None:
        random = np.random.default_rng(7)
        steady = [series(random.normal(0.3, 0.001, 20), f"v{i}") for i in range(200)]
        (change,) = find_changes([*steady, series(random.normal(0.3, 0.001, 20) + 0.06 * (np.arange(20) >= 10))])
        assert (change.vehicle, change.kind, change.since) == ("a", "jump", "a/10.csv")
        assert change.ci95[0] <= 0.06 <= change.ci95[1]

    def test_of_steady_fleets_at_most_the_stated_share_shows_a_change(self) -> None:
        """Every finding is false where nothing changes: fleets with one are as rare as the rate says."""
        random = np.random.default_rng(3)
        fleets = [[series(random.standard_normal(12), f"v{i}") for i in range(10)] for _ in range(60)]
        wrong = sum(bool(find_changes(fleet)) for fleet in fleets)
        assert wrong / 60 <= FALSE_DISCOVERIES + 2.0 * (0.05 * 0.95 / 60) ** 0.5

    def test_one_strange_flight_is_no_change(self) -> None:
        values = np.random.default_rng(4).normal(1.0, 0.004, 20)
        values[-1] = 3.0
        assert find_changes([series(values)]) == []

    @pytest.mark.parametrize("values", [np.ones(20), np.arange(7.0)])
    def test_equal_values_and_few_flights_show_nothing(self, values: np.ndarray) -> None:
        assert find_changes([series(values)]) == []


class TestMeasurement:
    def test_a_flight_shows_the_strength_of_each_rotor(self, rigid: Model, tmp_path: Path) -> None:
        path = logged(rigid.plus(ConstantScale(0.97)), tmp_path / "1.csv", 1, weak_rotor=2, loss=0.02)
        found = measure("a", "a/1.csv", "key", path, rigid)
        rotors = [found.values[f"rotor {i}"] for i in (1, 2, 3, 4)]
        assert rotors == pytest.approx([0.97, 0.97 * 0.98, 0.97, 0.97], abs=0.002)

    def test_an_effect_that_the_flight_does_not_show_keeps_its_parameters(self, rigid: Model, tmp_path: Path) -> None:
        """Straight up and down shows no sideward drag, so its value is none of this flight's; to and fro shows it."""
        model, moved = rigid.plus(LinearDrag(0.3, 0.3, 0.2)), tmp_path / "2.csv"
        upward = logged(model, tmp_path / "1.csv", 1)
        write_csv(to_and_fro(read_log(upward), 3.0), moved)
        found = measure("a", "a/1.csv", "key", upward, model)
        assert not any(name.startswith("rotor_drag") for name in found.values)
        assert found.values["thrust_scale factor"] == pytest.approx(1.0, abs=0.01)
        assert "rotor_drag d_x" in measure("a", "a/2.csv", "key", moved, model).values

    def test_a_damaged_log_says_why(self, rigid: Model, tmp_path: Path) -> None:
        path = tmp_path / "1.csv"
        path.write_text("time_s,x_m\n0.0,1.0\n0.1,oops\n")
        found = measure("a", "a/1.csv", "key", path, rigid)
        assert "1.csv" in found.problem
        assert found.values == {}


class TestIndex:
    def test_work_that_was_stopped_goes_on_where_it_was(self, fleet: Path) -> None:
        logs = find_logs(fleet, RAPTOR)
        assert [log.flight for log in logs][:3] == ["a/flight_1.csv", "a/flight_2.csv", "a/flight_10.csv"]
        index = Index(fleet / "fleet.jsonl")
        measure_fleet(logs[:4], index)
        with (fleet / "fleet.jsonl").open("a") as file:
            file.write('{"vehicle": "b", "fli')  # cut off in the middle of a line
        again = Index(fleet / "fleet.jsonl")
        assert again.missing(logs) == logs[4:]
        measure_fleet(logs, again)
        whole = Index(fleet / "fleet.jsonl")
        assert whole.missing(logs) == []
        assert not any(record.problem for record in whole.of(logs))

    def test_another_file_of_the_same_name_is_measured_again(self, fleet: Path, rigid: Model) -> None:
        logs = find_logs(fleet, RAPTOR)
        index = Index(fleet / "fleet.jsonl")
        index.append([FlightRecord(log.vehicle, log.flight, log.key) for log in logs])
        logged(rigid, fleet / "a/flight_2.csv", 7, 40.0)
        assert [log.flight for log in index.missing(find_logs(fleet, RAPTOR))] == ["a/flight_2.csv"]

    def test_a_vehicle_may_have_a_model_of_its_own(self, fleet: Path, rigid: Model) -> None:
        save_model(rigid.plus(ConstantScale(0.9)), fleet / "b/model.yaml")
        models = {log.vehicle: log.model.effects for log in find_logs(fleet, RAPTOR)}
        assert models == {"a": (), "b": (ConstantScale(0.9),)}

    def test_a_folder_without_logs_and_a_file_are_one_sentence(self, tmp_path: Path) -> None:
        with pytest.raises(LogError, match="holds no flight logs, expected files that end with"):
            find_logs(tmp_path, RAPTOR)
        with pytest.raises(LogError, match="is no folder, expected one with a folder of flight logs for each vehicle"):
            find_logs(tmp_path / "none", RAPTOR)

    def test_what_is_no_index_is_refused(self, tmp_path: Path) -> None:
        path = tmp_path / "fleet.jsonl"
        path.write_text("time_s,x_m\n0,1\n1,2\n")
        with pytest.raises(SettingsError, match="is no index of a fleet"):
            Index(path)


class TestSummary:
    def test_the_spread_between_vehicles_is_told_from_that_between_flights(self) -> None:
        random = np.random.default_rng(5)
        records = [
            FlightRecord(f"v{i}", f"v{i}/{k}.csv", values={"rotor 1": level + random.normal(0.0, 0.004)})
            for i, level in enumerate(random.normal(1.0, 0.02, 30))
            for k in range(10)
        ]
        (spread,) = summarise(records).spreads
        assert spread.population.spread == pytest.approx(0.02, rel=0.3)
        assert spread.scatter == pytest.approx(0.004, rel=0.15)

    def test_refused_logs_are_counted_by_their_reasons(self) -> None:
        records = [FlightRecord("a", f"a/{i}.csv", problem=f"a/{i}.csv: is empty") for i in range(3)]
        assert fact(Kind.REASON, flights=3, reason="is empty") in summarise(records).counted()

    def test_a_figure_shows_every_vehicle_and_the_changed_one_first(self) -> None:
        random = np.random.default_rng(6)
        every = [series(random.normal(1.0, 0.004, 20), f"v{i}") for i in range(9)]
        worn = series(np.linspace(1.0, 0.9, 20), "worn")
        figure = small_multiples([*every, worn], find_changes([worn]), None)
        assert [ax.get_title("left") for ax in figure.axes if ax.get_visible()][:2] == ["worn", "v0"]


def test_the_command_writes_a_report_that_names_what_changed(rigid: Model, tmp_path: Path) -> None:
    logs = tmp_path / "logs"
    for vehicle, loss in (("steady", 0.0), ("worn", 0.004)):
        for flight in range(8):
            logged(rigid, logs / vehicle / f"{flight}.csv", flight, 25.0, weak_rotor=3, loss=loss * flight)
    (logs / "steady" / "broken.csv").write_text("time_s\n")
    outputs = ["--html", str(tmp_path / "fleet.html"), "--json", str(tmp_path / "fleet.json")]
    result = CliRunner().invoke(app, ["fleet", str(logs), "--model", str(RAPTOR), *outputs])
    assert result.exit_code == 0, result.output
    assert "16 of 17 flights of 2 vehicles measured." in result.output
    found = json.loads((tmp_path / "fleet.json").read_text())
    assert ("worn", "rotor 3", "drift") in [(c["vehicle"], c["quantity"], c["kind"]) for c in found["changes"]]
    assert {c["vehicle"] for c in found["changes"]} == {"worn"}
    page = (tmp_path / "fleet.html").read_text()
    assert "worn: rotor 3 drifts by" in page
    assert page.count("<svg") == len(found["quantities"])
