"""Where independent jobs run: in this process, in a pool of processes, or on a dask cluster.

An executor is a function ``(job, items) -> outcomes in the order they end``. A job that raises
ends in an `Outcome` with its error in one line, and the other jobs go on. Jobs and items cross
process boundaries, so both must be picklable (a function of a module, frozen dataclasses).
"""

from __future__ import annotations

import multiprocessing
import os
import re
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Any

from bayeshaptic.errors import InputError, describe

Job = Callable[[Any], Any]


@dataclass(frozen=True)
class Outcome:
    """How one job ended.

    Attributes
    ----------
    item : object
        What the job was called with.
    result : object
        What it returned; None where it failed.
    error : str or None
        One line saying why it failed.
    """

    item: Any
    result: Any = None
    error: str | None = None


Executor = Callable[[Job, Sequence[Any]], Iterator[Outcome]]


def serial(job: Job, items: Sequence[Any]) -> Iterator[Outcome]:
    """Run one job after the other in this process."""
    for item in items:
        yield _attempt(job, item)


def processes(workers: int) -> Executor:
    """Run jobs in a pool of worker processes on this machine.

    Parameters
    ----------
    workers : int
        Number of processes; never more than there are items.

    Returns
    -------
    Executor
    """

    def run(job: Job, items: Sequence[Any]) -> Iterator[Outcome]:
        context = multiprocessing.get_context("spawn")
        others = set(multiprocessing.active_children())
        pool = ProcessPoolExecutor(
            min(workers, len(items)), mp_context=context, initializer=_leave_interrupts_to_parent
        )
        try:
            futures = {pool.submit(_attempt, job, item): item for item in items}
            for future in as_completed(futures):
                try:
                    yield future.result()
                except BrokenProcessPool:
                    message = "a worker process died (out of memory, or killed)"
                    yield Outcome(futures[future], error=message)
        except BaseException:
            for worker in set(multiprocessing.active_children()) - others:
                worker.terminate()
            raise
        finally:
            pool.shutdown(cancel_futures=True)

    return run


def dask(address: str) -> Executor:
    """Run jobs on a dask cluster whose workers have bayeshaptic and see the same files.

    Parameters
    ----------
    address : str
        The scheduler's address, for example ``tcp://10.0.0.1:8786``.

    Returns
    -------
    Executor

    Raises
    ------
    InputError
        dask is not installed, or no scheduler answers at `address`.
    """
    try:
        import distributed
    except ImportError:
        raise InputError(
            "running on a dask cluster needs the dask extra: pip install 'bayeshaptic[dask]'"
        ) from None

    if not re.fullmatch(r"\w+://\S+", address):
        raise InputError(f"'{address}' is no dask address: write it as in tcp://10.0.0.1:8786")

    def run(job: Job, items: Sequence[Any]) -> Iterator[Outcome]:
        try:
            client = distributed.Client(address, timeout="10s", set_as_default=False)
        except (OSError, ValueError) as error:
            raise InputError(
                f"no dask scheduler answers at {address} ({describe(error)}): start one with "
                "'dask scheduler', or use --workers"
            ) from error
        with client, client.as_current():
            futures = {
                client.submit(_attempt, job, item, pure=False, retries=0): item for item in items
            }
            for future in distributed.as_completed(futures):
                problem = future.exception()
                if problem is None:
                    yield future.result()
                else:
                    yield Outcome(futures[future], error=describe(problem))

    return run


def usable_cores() -> int:
    """How many cores this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on macOS or Windows
        return os.cpu_count() or 1


def _attempt(job: Job, item: Any) -> Outcome:
    try:
        return Outcome(item, result=job(item))
    except Exception as error:
        return Outcome(item, error=describe(error))


def _leave_interrupts_to_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
