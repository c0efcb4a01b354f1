"""Where jobs run: here, in processes, in a pool, on a cluster; and workers that die."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from bayeshaptic.errors import InputError
from bayeshaptic.jobs import executors
from bayeshaptic.types import Executor


def double_or_fail(number: int) -> int:
    if number < 0:
        raise InputError(f"{number} is negative")
    return 2 * number


def cannot_be_handed_back(number: int) -> Any:
    return (lambda: number) if number == 1 else number


def die_at_first(mark: Path) -> str:
    if mark.name == "1" and not mark.exists():
        mark.touch()
        os._exit(1)
    return "done"


def die(_: int) -> None:
    os._exit(3)


def outcomes(executor: Executor, job: Any, items: list[int]) -> dict[int, Any]:
    return {one.item: (one.result, one.error) for one in executor(job, items)}


EXPECTED = {1: (2, None), -2: (None, "-2 is negative"), 3: (6, None)}


def test_jobs_in_this_process() -> None:
    assert outcomes(executors.serial, double_or_fail, [1, -2, 3]) == EXPECTED


def test_jobs_in_processes() -> None:
    assert outcomes(executors.processes(2), double_or_fail, [1, -2, 3]) == EXPECTED


def test_a_result_that_cannot_come_back_is_a_failure_of_its_own() -> None:
    ended = outcomes(executors.processes(2), cannot_be_handed_back, [1, 2])
    assert ended[2] == (2, None) and "local object" in ended[1][1]


def test_a_worker_that_dies_is_a_failure_and_not_a_hang() -> None:
    ended = outcomes(executors.processes(2), die, [1, 2])
    assert set(ended) == {1, 2}
    assert all(result is None and "died" in error for result, error in ended.values())


def test_what_ran_beside_a_worker_that_died_is_done(tmp_path: Path) -> None:
    ended = outcomes(executors.processes(2), die_at_first, [tmp_path / str(i) for i in range(5)])
    assert {result for result, _ in ended.values()} == {"done"}


def test_jobs_in_a_pool_of_ones_own() -> None:
    with ThreadPoolExecutor(2) as pool:
        assert outcomes(executors.futures(pool), double_or_fail, [1, -2, 3]) == EXPECTED


def test_jobs_on_a_dask_cluster() -> None:
    distributed = pytest.importorskip("distributed", reason="the dask extra is not installed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None
    ) as cluster:
        executor = executors.dask(cluster.scheduler_address)
        assert outcomes(executor, double_or_fail, [1, -2, 3]) == EXPECTED
