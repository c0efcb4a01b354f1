"""Results do not depend on how many cores the linear algebra may use."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bayeshaptic.threads import single_threaded

ROOT = Path(__file__).parents[2]
SCRIPT = """
import json, sys
import numpy as np
import bayeshaptic as bh
from bayeshaptic.report import summary_json
from bayeshaptic.stability import etfe_critical_stiffness

run = np.load(sys.argv[1])
recording = bh.recording_from_arrays(
    run["force"], run["position"], period_s=1e-3, force_unit="Nm", position_unit="rad"
)
etfe = bh.estimate_etfe(recording)
model = bh.grasped(device="phantom")
closed = bh.close_loop(recording, model, ess=300)
posterior = bh.sample(model, etfe, start=bh.least_squares(model, etfe), ess=300)
# As in a user's hands: nothing around it.
limit = bh.critical_stiffness(posterior)
own = etfe_critical_stiffness(etfe)
found = json.loads(summary_json(closed))
found["posterior"].pop("seconds")
print(json.dumps([found, limit.samples.tolist(), own.samples.tolist()]))
"""


def test_the_same_numbers_with_one_core_and_with_two(tmp_path: Path) -> None:
    if (os.cpu_count() or 1) < 2:
        pytest.skip("one core only")
    from bayeshaptic.rig import Bench, WhiteNoise, simulate

    bench = Bench.from_device("phantom", held=True)
    noise = WhiteNoise(bench.force_rms, bench.band_hz[1], bench.band_hz[0], 8.0)
    run = simulate(bench, noise, seed=4)
    np_file = tmp_path / "run.npz"
    np.savez(np_file, force=run.force, position=run.position)
    found = []
    for threads in ("1", "2"):
        names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
        environment = os.environ | dict.fromkeys(names, threads) | {"PYTHONPATH": str(ROOT)}
        command = [sys.executable, "-c", SCRIPT, str(np_file)]
        done = subprocess.run(command, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        found.append(done.stdout)
    assert len(found[0]) > 1000 and found[0] == found[1]


def test_threads_are_limited_inside_and_given_back() -> None:
    from threadpoolctl import threadpool_info, threadpool_limits

    def most() -> int:
        return max(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas")

    @single_threaded
    def inner() -> int:
        return most()

    @single_threaded
    def outer() -> tuple[int, int, int]:
        return most(), inner(), most()

    @single_threaded
    def broken() -> None:
        raise ValueError

    with threadpool_limits(limits=2, user_api="blas"):
        before = most()
        assert outer() == (1, 1, 1)
        assert most() == before
        with pytest.raises(ValueError):
            broken()
        assert most() == before and inner() == 1


def test_densities_underflow_whatever_a_caller_set() -> None:
    import bayeshaptic as bh

    recording = bh.read_recording(ROOT / "data" / "recordings" / "phantom-free.csv.gz")
    with np.errstate(all="raise"):
        assert bh.analyse(recording.part(0, 4000)).posterior.converged
        assert np.geterr()["under"] == "raise"
