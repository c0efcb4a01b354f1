"""Compiled kernels: where nothing can be kept on disk, and who is told of a compilation."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from bayeshaptic.compiled import kernel, when_compiling


def function_without_a_file():
    space: dict = {}
    exec("def half(x):\n    return x / 2", space)
    return space["half"]


def test_a_kernel_that_cannot_be_kept_on_disk_is_compiled_in_the_process() -> None:
    assert kernel(function_without_a_file())(3.0) == 1.5


def test_a_compilation_is_told_once() -> None:
    told = []
    when_compiling(lambda: told.append(1))
    try:
        half = kernel(function_without_a_file())
        half(3.0)
        half(5.0)
    finally:
        when_compiling(None)
    assert told == [1]


@pytest.mark.parametrize("setting", ["NUMBA_NUM_THREADS=0", "NUMBA_OPT=high"])
def test_an_environment_that_numba_cannot_read_is_no_defect(setting: str) -> None:
    name, value = setting.split("=")
    environment = {**os.environ, name: value}
    code = "from bayeshaptic.compiled import kernel; kernel(abs)"
    line = [sys.executable, "-c", code]
    done = subprocess.run(line, env=environment, capture_output=True, text=True, check=False)
    *_, told = done.stderr.strip().splitlines()
    assert done.returncode == 1
    assert f"InputError: {setting} in the environment: numba cannot be loaded with it" in told


_DIGEST = """
import hashlib
import numpy as np
from bayeshaptic.models import build_model
model = build_model("grasped", "lhifam").with_period(1e-3)
theta = model.values * np.exp(0.1 * np.random.default_rng(1).standard_normal((200, model.size)))
response = model.response(theta, np.linspace(1.0, 450.0, 200))
print(hashlib.sha256(np.ascontiguousarray(response)).hexdigest())
"""


def test_whoever_compiles_finds_the_numbers_of_those_who_load(tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    line = [sys.executable, "-c", _DIGEST]
    compiled, loaded = (
        subprocess.run(line, env=environment, check=True, capture_output=True, text=True).stdout
        for _ in range(2)
    )
    assert compiled == loaded
