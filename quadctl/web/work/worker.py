"""A process for long work: the page keeps responding, progress comes back, and cancelling ends the process."""

import asyncio
import importlib
import multiprocessing
import os
import traceback
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from quadctl.errors import QuadctlError
from quadctl.logs.memory import give_memory_back, return_freed_memory
from quadctl.web.work.exchange import Exchange

Progress = Callable[[str], None]
"""Callback by which a job reports the step that it begins, in a few words."""

AT_ONCE_S = 0.2
"""Time that a new process waits for a job before it imports the module of the jobs."""
LIBRARIES = "quadctl.web.work.libraries"
_FORKS = "forkserver" in multiprocessing.get_all_start_methods()
_CONTEXT = multiprocessing.get_context("forkserver") if _FORKS else multiprocessing.get_context("spawn")
"""A server with threads cannot be forked, but a process can that has only loaded the libraries."""


def prepare_workers() -> None:
    """Begin to load the libraries of the jobs in the process that workers are forked from, and return at once."""
    if _FORKS:
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # its threads would not be there after a fork
        from multiprocessing import forkserver

        forkserver.set_forkserver_preload([LIBRARIES])
        forkserver.ensure_running()


class CancelledError(Exception):
    """The work was cancelled, or its process ended."""


class Worker:
    """One process that does one job after the other.

    Parameters
    ----------
    jobs: name of the module that holds the jobs. The process imports it as soon as it starts, not within the first job,
        unless that waits already: it may be of another module, which needs less.
    exchange: the exchange through which values go; workers that get the same one share their large arrays.
    patient: run at low priority, for work that nobody waits for.
    """

    def __init__(self, jobs: str | None = None, exchange: Exchange | None = None, *, patient: bool = False) -> None:
        self._jobs, self._exchange, self._patient = jobs, exchange or Exchange(), patient
        self._one_at_a_time = asyncio.Lock()
        self._working = False
        prepare_workers()
        self._start()

    async def run(self, job: Callable[..., Any], *args: Any, progress: Progress = lambda text: None) -> Any:
        """Run `job(*args, progress=...)` in the process and return its result; `progress` is called in this process.

        Raises
        ------
        QuadctlError
            As the job raised it; anything else that it raised, as one sentence.
        CancelledError
            The work was cancelled.
        """
        async with self._one_at_a_time:
            pipe = self._pipe
            self._working = True
            message, file = self._exchange.pack((job, args))
            try:
                await asyncio.to_thread(pipe.send_bytes, message)
                while True:
                    kind, value = self._exchange.unpack(await asyncio.to_thread(pipe.recv_bytes))
                    if kind == "progress":
                        progress(value)
                    elif kind == "failed":
                        raise QuadctlError(value)
                    else:
                        return value
            except (EOFError, OSError):
                raise CancelledError from None
            finally:
                self._working = False
                self._exchange.forget(file)

    def cancel(self) -> None:
        """End what is being done, at once; without work, nothing happens."""
        if self._working:
            self.close()
            self._start()

    def close(self) -> None:
        self._process.kill()
        self._process.join()

    def _start(self) -> None:
        self._pipe, theirs = _CONTEXT.Pipe()
        self._process = _CONTEXT.Process(
            target=_serve, args=(theirs, self._jobs, self._exchange.folder, self._patient), daemon=True
        )
        self._process.start()
        theirs.close()


def _serve(pipe: Connection, jobs: str | None, folder: Path, patient: bool) -> None:
    """Run job after job in the worker's process, until the other end of `pipe` is closed."""
    if patient and hasattr(os, "nice"):  # Windows has none
        os.nice(5)
    return_freed_memory()
    if jobs is not None and not pipe.poll(AT_ONCE_S):  # a job that waits already brings what it needs
        importlib.import_module(jobs)
    exchange = Exchange(folder)
    while _one_job(pipe, exchange):
        give_memory_back()


def _one_job(pipe: Connection, exchange: Exchange) -> bool:
    """Run one job and send its result, of which nothing is kept here; False at the end of all work."""

    def say(kind: str, value: Any) -> None:
        pipe.send_bytes(exchange.pack((kind, value))[0])

    try:
        job, args = exchange.unpack(pipe.recv_bytes())
    except (EOFError, KeyboardInterrupt):
        return False
    try:
        result = job(*args, progress=lambda text: say("progress", text))
    except QuadctlError as error:
        say("failed", str(error))
    except MemoryError:
        say("failed", "there is not enough memory for flights of this size")
    except KeyboardInterrupt:
        return False
    except Exception as error:
        traceback.print_exc()
        say("failed", f"this is a mistake of quadctl, not yours ({type(error).__name__}: {error})")
    else:
        say("done", result)
    return True
