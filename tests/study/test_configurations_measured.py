"""Configurations from recordings of the bench: K_CR between them against the bench's own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import bayeshaptic as bh
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.rig import Bench, WhiteNoise, simulate
from bayeshaptic.study.configuration_limits import ConfigurationLimits, configuration_limits

MEASURED = (0.0, 0.3, 0.6, 1.0)


def bench_at(place: float) -> Bench:
    """A PHANToM whose arm is stretched out, as in examples/study, but with more damping."""
    bench = Bench.from_device("phantom", held=False)
    values = dict(bench.values)
    for name in ("m1", "m2"):
        values[name] *= 0.8 + 0.4 * place
    values["kc"] *= 1.1 - 0.2 * place
    values["b1"] *= 1.25 - 0.5 * place
    values["b2"] = 0.005
    return replace(bench, values=values)


def posterior_at(place: float) -> Posterior:
    excitation = WhiteNoise(0.05, 200.0, 0.7, seconds=12.0)
    done = simulate(bench_at(place), excitation, seed=int(100 * place))
    recording = bh.recording_from_arrays(**done.signals)
    etfe = bh.estimate_etfe(recording)
    model = bh.free(device="phantom")
    return bh.sample(model, etfe, bh.least_squares(model, etfe, seed=1), ess=400, seed=1)


@pytest.fixture(scope="module")
def along() -> ConfigurationLimits:
    return configuration_limits([posterior_at(one) for one in MEASURED], MEASURED, held=False)


def test_predicted_between_measured_configurations(along: ConfigurationLimits) -> None:
    between = [n for n, c in enumerate(along.coordinates) if c not in MEASURED]
    truth = np.array([bench_at(along.coordinates[n]).true_critical_stiffness() for n in between])
    assert len(between) >= 4
    low, high = along.quantile([0.05, 0.95])[:, between]
    # They are of one draw of the noise, so that all may miss together: 99 %, and 90 % of some.
    widest = along.quantile([0.005, 0.995])[:, between]
    assert np.all((widest[0] < truth) & (truth < widest[1]))
    assert np.any((low < truth) & (truth < high))
    assert np.all(20 * np.log10(high / low) < 1.0)  # of 4.5 dB along the coordinate


def test_the_worst_configuration_is_the_true_one(along: ConfigurationLimits) -> None:
    truth = [bench_at(place).true_critical_stiffness() for place in along.coordinates]
    assert along.worst_coordinate == along.coordinates[int(np.argmin(truth))] == 1.0
