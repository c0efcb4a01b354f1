"""Do intervals hold the truth?  The reduced version of `benchmarks/coverage/`."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from benchmarks.coverage.calibration import combined, one_recording, pooled, uniform

# Grasped devices take three times as long: fewer of them here.
JOBS = [(case, 300 + seed) for case in ("lhifam free", "phantom free") for seed in range(4)]
JOBS += [(case, 300) for case in ("lhifam grasped", "phantom grasped")]


@pytest.fixture(scope="module")
def outcomes():
    return [one_recording(case, seed, ess=200, seconds=10.0) for case, seed in JOBS]


def test_intervals_cover_the_truth_in_nine_of_ten_recordings(outcomes):
    covered = [o.limit_covered for o in outcomes]
    # Fewer by chance once in 500 times.
    assert sum(covered) >= binom.ppf(0.002, len(covered), 0.9)
    inside = pooled(outcomes, "covered")
    # Parameters of one recording go together: half of them count as independent.
    count = len(inside) // 2
    low, high = binom.ppf([0.002, 0.998], count, 0.9) / count
    assert low <= inside.mean() <= high


def test_ranks_are_uniform_and_pulls_are_one(outcomes):
    ranks = {}
    for outcome in outcomes:
        for name, rank, dominated in zip(
            outcome.names, outcome.rank, outcome.dominated, strict=True
        ):
            if not dominated:
                ranks.setdefault(name, []).append(rank)
    p = [uniform(np.array(r)) for r in ranks.values() if len(r) > 4]
    assert len(p) >= 4 and combined(np.array(p)) > 2e-3
    assert uniform(np.array([o.limit[3] for o in outcomes])) > 2e-3
    pull = pooled(outcomes, "pull")
    # The mean square of n / 2 independent normal numbers is 1 +- sqrt(4 / n); three of those.
    assert np.mean(pull**2) == pytest.approx(1.0, abs=3 * np.sqrt(4 / len(pull)))


def test_intervals_are_as_narrow_as_the_data_allow(outcomes):
    ratio = pooled(outcomes, "width") / pooled(outcomes, "bound")
    # 20 % over the bound in 30 s; a record of 10 s loses more of its lines to the leakage.
    assert 0.9 < np.median(ratio) < 1.3


def test_every_run_has_converged(outcomes):
    assert sum(o.converged for o in outcomes) >= len(outcomes) - 1
    assert np.median([o.chi_square for o in outcomes]) == pytest.approx(1.0, abs=0.1)
