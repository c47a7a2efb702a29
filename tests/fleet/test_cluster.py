"""A fleet on a Dask cluster: the same records, even where a worker is killed meanwhile."""

import os
import signal
import threading
from pathlib import Path

import pytest
from distributed import LocalCluster

from quadctl.errors import SettingsError
from quadctl.fleet.index import Index, find_logs
from quadctl.fleet.work import measure_fleet
from quadctl.logs.csv_log import write_csv
from quadctl.model import Model
from tests.support.flights import obedient
from tests.support.links import RAPTOR

FLIGHTS = 30


@pytest.mark.long
def test_a_worker_that_is_killed_loses_no_flight(rigid: Model, tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    for flight in range(FLIGHTS):
        path = folder / "a" / f"{flight}.csv"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_csv(obedient(rigid, 30.0, noise_m_s=0.01, seed=flight, name=path.name), path)
    logs = find_logs(folder, RAPTOR)
    alone, spread = Index(tmp_path / "alone.jsonl"), Index(tmp_path / "spread.jsonl")
    measure_fleet(logs, alone)
    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster:
        victim = next(iter(cluster.workers.values())).pid
        killer = threading.Timer(0.5, os.kill, (victim, signal.SIGKILL))

        def kill_soon(done: int, of: int) -> None:
            if done == 0:
                killer.start()

        measure_fleet(logs, spread, cluster=cluster.scheduler_address, progress=kill_soon)
        killer.join()
        assert not Path(f"/proc/{victim}/exe").exists()
    assert spread.of(logs) == alone.of(logs)
    assert not any(record.problem for record in spread.of(logs))


@pytest.mark.long
def test_a_cluster_that_does_not_answer_is_one_sentence(rigid: Model, tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="no scheduler answers there"):
        measure_fleet([], Index(tmp_path / "fleet.jsonl"), cluster="tcp://127.0.0.1:1")
