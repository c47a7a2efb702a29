"""Parallel work in processes and on several machines gives the same answer as serial work."""

import pytest
from distributed import Client, LocalCluster
from joblib import parallel_config

from quadctl.effects.ground_effect import Exponential
from quadctl.effects.inflow import AxialInflow
from quadctl.effects.tether import HangingTether
from quadctl.effects.thrust_scale import ConstantScale
from quadctl.lab.flights.dataset import load_dataset
from quadctl.lab.selection.diagnosis import Diagnosis, diagnose
from quadctl.model import Model, load_model
from quadctl.vehicle import Vehicle
from tests.support.flights import obedient
from tests.support.places import ROOT

CANDIDATES = (ConstantScale, Exponential, AxialInflow, HangingTether)


def found(raptor: Vehicle) -> Diagnosis:
    hidden = Model(raptor).plus(Exponential(a=0.3, b=5.0))
    logs = [obedient(hidden, noise_m_s=0.01, seed=seed, name=f"{seed}.csv") for seed in (1, 2)]
    result: Diagnosis = diagnose(Model(raptor), load_dataset(logs, raptor), CANDIDATES)
    return result


@pytest.fixture(scope="module")
def alone() -> Diagnosis:
    return found(load_model(ROOT / "config/vehicles/raptor.yaml").vehicle)


def test_two_processes_find_the_same(raptor: Vehicle, alone: Diagnosis) -> None:
    with parallel_config("loky", n_jobs=2):
        together = found(raptor)
    assert together.missing == alone.missing == ["ground_effect"]
    assert together.to_dict() == alone.to_dict()


@pytest.mark.long
def test_a_dask_cluster_finds_the_same(raptor: Vehicle, alone: Diagnosis) -> None:
    with (
        LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None) as cluster,
        Client(cluster),
        parallel_config("dask"),
    ):
        together = found(raptor)
    assert together.to_dict() == alone.to_dict()
