"""How the likelihood and K_CR cost more with more lines, poles and walkers; exponents of each.

python -m benchmarks.costs.scaling
"""

from __future__ import annotations

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import time  # noqa: E402
from collections.abc import Callable, Sequence  # noqa: E402
from dataclasses import replace  # noqa: E402

import numpy as np  # noqa: E402

import bayeshaptic as bh  # noqa: E402
from bayeshaptic.stability.crossings import find_crossings  # noqa: E402

T = 1e-3
RNG = np.random.default_rng(0)


def cpu(job: Callable[[], object]) -> float:
    """The least CPU microseconds of a call."""
    job()
    least = np.inf
    for _ in range(7):
        began = time.process_time()
        for _ in range(5):
            job()
        least = min(least, time.process_time() - began)
    return 1e6 * least / 5


def row(name: str, sizes: Sequence[int], microseconds: Sequence[float]) -> None:
    exponent = np.polyfit(np.log(sizes), np.log(microseconds), 1)[0]
    cells = "   ".join(f"{n}: {t:.3g}" for n, t in zip(sizes, microseconds, strict=True))
    print(f"{name:44s} exponent {exponent:5.2f}   us  {cells}", flush=True)


def grown(masses: int, batch: int):
    """The held LHIfAM with so many further masses on its motor."""
    model = bh.grasped(device="lhifam")
    system = model.system(model.values * np.exp(0.05 * RNG.standard_normal((batch, model.size))))
    for number in range(masses):
        mass = np.full(batch, 0.02 * (number + 1))
        more = system.mechanism.with_mass(mass, 0, 0.5 + 0 * mass, 1e4 * mass)
        system = replace(system, mechanism=more)
    return system


def main() -> None:
    lines = (48, 96, 192, 384, 768, 1536)
    device = grown(0, 64)
    grids = [np.geomspace(1, 300, n) for n in lines]
    took = [cpu(lambda f=f: device.sampled_response(f, T)) / 64 for f in grids]
    row("response, one vector of 64, by lines", lines, took)
    poles = (6, 8, 10, 12, 14)
    systems = [grown((n - 6) // 2, 64) for n in poles]
    frequency = np.geomspace(1, 300, 384)
    took = [cpu(lambda s=s: s.sampled_response(frequency, T)) / 64 for s in systems]
    row("response, one vector of 64, by poles", poles, took)
    took = [cpu(lambda s=s: find_crossings(s, T)) / 64 for s in systems]
    row("K_CR, one draw of 64, by poles", poles, took)
    walkers = (1, 4, 16, 64, 256, 1024)
    systems = [grown(0, n) for n in walkers]
    took = [cpu(lambda s=s: s.sampled_response(frequency, T)) for s in systems]
    row("response, all vectors, by walkers", walkers, took)
    took = [cpu(lambda s=s: find_crossings(s, T)) for s in systems]
    row("K_CR, all draws, by draws", walkers, took)


if __name__ == "__main__":
    main()
