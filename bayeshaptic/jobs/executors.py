"""Where independent jobs run: in this process, in a pool of processes, or on a dask cluster.

An executor is a function ``(job, items) -> outcomes in the order they end``. A job that raises
ends in an `Outcome` with its error in one line, and the other jobs go on. Jobs and items cross
process boundaries, so both must be picklable (a function of a module, frozen dataclasses).
"""

from __future__ import annotations

import concurrent.futures
import logging
import multiprocessing
import os
import re
import signal
import sys
import threading
import time
import warnings
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from typing import Any

from bayeshaptic.errors import InputError, describe, warned
from bayeshaptic.faq import entry, explained
from bayeshaptic.jobs.own_process import collect_garbage_rarely, lighten_imports
from bayeshaptic.threads import THREADS
from bayeshaptic.types import Executor, Work

# Dask asks for memory to be handed back at once (MALLOC_TRIM_THRESHOLD_), which makes every larger
# array a system call, and reports cost a quarter more; its loop looks fifty times a second whether
# it is held up, which takes 2 % of the time of a worker; and it keeps statistics that nobody reads.
_CHEAPER = {
    "distributed.nanny.pre-spawn-environ": dict.fromkeys(THREADS, 1),
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.tick.limit": "1 minute",
    "distributed.admin.system-monitor.interval": "5s",
}
_DIED = "a worker process died twice (out of memory, or killed)"


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
    refused : bool
        Whether it failed by its input, and would again.
    """

    item: Any
    result: Any = None
    error: str | None = None
    refused: bool = False


def serial(job: Work, items: Sequence[Any]) -> Iterator[Outcome]:
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

    def run(job: Work, items: Sequence[Any]) -> Iterator[Outcome]:
        waiting = deque(items)
        while waiting:
            # What ran when a worker died is done once more, each alone: one of them may be why.
            suspects = yield from _until_a_worker_dies(job, waiting, workers)
            for item in suspects:
                if (yield from _until_a_worker_dies(job, deque([item]), 1)):
                    yield Outcome(item, error=f"{_DIED} [{entry('worker').command}]")

    return run


def _until_a_worker_dies(
    job: Work, waiting: deque[Any], workers: int
) -> Generator[Outcome, None, list[Any]]:
    """Take jobs from `waiting` and yield outcomes; hand back what ran when a worker died."""
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(
        min(workers, len(waiting)),
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_start_worker,
        initargs=(os.getpid(),),
    )
    running: dict[Future[Outcome], Any] = {}
    suspects: list[Any] = []
    try:
        while running or (waiting and not suspects):
            while waiting and not suspects and len(running) < workers:
                item = waiting.popleft()
                try:
                    running[pool.submit(_attempt, job, item)] = item
                except BrokenProcessPool:
                    suspects.append(item)
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                item = running.pop(future)
                try:
                    outcome = future.result()
                except BrokenProcessPool:
                    suspects.append(item)
                    continue
                except Exception as error:  # of a result on its way here
                    outcome = Outcome(item, error=explained(error))
                yield outcome
    except BaseException:
        _end_children(others)
        raise
    finally:
        pool.shutdown(cancel_futures=True)
    return suspects


def futures(pool: concurrent.futures.Executor) -> Executor:
    """Run jobs in any pool of `concurrent.futures`, of this machine or others (mpi4py, dask).

    Parameters
    ----------
    pool : concurrent.futures.Executor
        It stays open.

    Returns
    -------
    Executor
    """

    def run(job: Work, items: Sequence[Any]) -> Iterator[Outcome]:
        running = {pool.submit(_attempt, job, item): item for item in items}
        try:
            while running:
                done, _ = wait(running, return_when=FIRST_COMPLETED)
                for future in done:
                    item = running.pop(future)
                    problem = future.exception()
                    yield (
                        future.result()
                        if problem is None
                        else Outcome(item, error=describe(problem))
                    )
        finally:
            for future in running:
                future.cancel()

    return run


def dask(address: str) -> Executor:
    """Run jobs on a dask cluster whose workers have bayeshaptic and see the same files.

    Parameters
    ----------
    address : str
        The scheduler's address, for example ``tcp://10.0.0.1:8786``; "local" starts a cluster of
        processes on this machine.

    Returns
    -------
    Executor

    Raises
    ------
    InputError
        dask is not installed, or no scheduler answers at `address`.
    """
    if find_spec("distributed") is None:
        raise InputError(
            "running on a dask cluster needs the dask extra: pip install 'bayeshaptic[dask]'"
        )

    if address == "local":
        return _local_dask
    if not re.fullmatch(r"\w+://\S+", address):
        raise InputError(f"'{address}' is no dask address: write it as in tcp://10.0.0.1:8786")
    return partial(_on_dask, address)


def _on_dask(address: str, job: Work, items: Sequence[Any]) -> Iterator[Outcome]:
    import distributed

    try:
        client = distributed.Client(address, timeout="10s", set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(
            f"no dask scheduler answers at {address} ({describe(error)}): start one with "
            "'dask scheduler', or use --workers"
        ) from error
    with client, client.as_current():
        submitted = {
            client.submit(_attempt, job, item, pure=False, retries=0): item for item in items
        }
        for future in distributed.as_completed(submitted):
            problem = future.exception()
            if problem is None:
                yield future.result()
            else:
                yield Outcome(submitted[future], error=describe(problem))


def _local_dask(job: Work, items: Sequence[Any]) -> Iterator[Outcome]:
    import dask.config
    import distributed

    others = set(multiprocessing.active_children())
    log = logging.getLogger("tornado.application")
    cheaper = dask.config.set(_CHEAPER)
    empty = distributed.LocalCluster(
        n_workers=0, threads_per_worker=1, dashboard_address=None, silence_logs=logging.ERROR
    )
    try:
        with cheaper, empty as cluster:
            try:
                cluster.scale(usable_cores())
                with distributed.Client(cluster, set_as_default=False) as client:
                    client.wait_for_workers(usable_cores())
                    client.run(collect_garbage_rarely)
                yield from _on_dask(cluster.scheduler_address, job, items)
            except BaseException:
                log.disabled = True  # closing would wait for what they do, and tell who dies
                # Those that are starting are not among the workers yet.
                for nanny in {*cluster.workers.values(), *getattr(cluster, "_created", ())}:
                    nanny.auto_restart = False
                _end_children(others)
                raise
    finally:
        log.disabled = False


def _end_children(others: set[Any]) -> None:
    """Kill the processes that this one has started, but for `others`."""
    for worker in set(multiprocessing.active_children()) - others:
        worker.kill()


def usable_cores() -> int:
    """How many cores this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not on macOS or Windows
        return os.cpu_count() or 1


def _in_one_line(message: Warning | str, category: type[Warning], *_: Any, **__: Any) -> None:
    with suppress(OSError):  # stderr that cannot be written is no reason to stop
        print(f"bayeshaptic: warning: {warned(message, category)}", file=sys.stderr)


def _attempt(job: Work, item: Any) -> Outcome:
    try:
        return Outcome(item, result=job(item))
    except Exception as error:
        return Outcome(item, error=explained(error), refused=isinstance(error, InputError))


def _start_worker(parent: int) -> None:
    """Leave interrupts to the parent, and end with it however it ends."""
    collect_garbage_rarely()
    lighten_imports()
    warnings.showwarning = _in_one_line
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
