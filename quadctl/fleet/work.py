"""Work on the logs of a fleet: in processes of this computer, or on a Dask cluster."""

import contextlib
import importlib
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from joblib import Parallel, delayed, parallel_config

from quadctl.errors import SettingsError
from quadctl.fleet.index import Index, LogFile
from quadctl.fleet.measurement import measure

AT_ONCE = 16
"""Logs for each process that are given out together; the index is written after them."""


def measure_fleet(
    logs: Sequence[LogFile],
    index: Index,
    jobs: int = 1,
    cluster: str | None = None,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> None:
    """Measure the `logs` that `index` does not hold yet, and write them to it.

    Parameters
    ----------
    jobs
        Number of processes on this computer.
    cluster
        Address of the scheduler of a Dask cluster that does the work instead, such as `tcp://10.0.0.5:8786`. Its
        workers read the logs themselves, so they need quadctl and the same folder. What a lost worker had is given to
        another one.

    Raises
    ------
    SettingsError
        The cluster cannot be reached, or the index cannot be written.
    """
    todo = index.missing(logs)
    with _workers(jobs, cluster) as count:
        size = AT_ONCE * count
        for begin in range(0, len(todo), size):
            progress(begin, len(todo))
            batch = todo[begin : begin + size]
            work = (delayed(measure)(log.vehicle, log.flight, log.key, log.path.resolve(), log.model) for log in batch)
            index.append(Parallel()(work))
    progress(len(todo), len(todo))


@contextlib.contextmanager
def _workers(jobs: int, cluster: str | None) -> Iterator[int]:
    """Context in which joblib uses the workers; gives their number."""
    if cluster is None:
        with parallel_config("loky", n_jobs=jobs):
            yield jobs
        return
    try:
        distributed: Any = importlib.import_module("distributed")
    except ModuleNotFoundError:
        raise SettingsError("--cluster needs Dask, expected: pip install distributed") from None
    try:
        client = distributed.Client(cluster, timeout="10s")
    except (OSError, ValueError) as error:
        raise SettingsError(f"--cluster {cluster}: no scheduler answers there ({error})") from None
    with client, parallel_config("dask"):
        yield max(1, sum(client.nthreads().values()))
