"""A risk of 0.1 %: sampling goes on until enough draws lie below the stiffness that has it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import bayeshaptic as bh
from bayeshaptic.rig import Bench, WhiteNoise, simulate
from bayeshaptic.stability import critical, tail
from bayeshaptic.stability.critical import ENOUGH_BELOW, critical_stiffness
from bayeshaptic.stability.tail import TailWatch


@dataclass(frozen=True)
class Chains:
    """What `TailWatch` reads of a sampler."""

    model: bh.Model
    chains: np.ndarray


def independent(steps: int, walkers: int = 8, sd: float = 0.02) -> Chains:
    """Independent draws around the PHANToM's own values."""
    model = bh.free(device="phantom")
    noise = np.random.default_rng(0).standard_normal((2, steps, walkers, model.size))
    return Chains(model, model.values * np.exp(sd * noise))


def test_what_has_been_searched_is_not_searched_again(monkeypatch):
    whole = independent(40)
    first = critical_stiffness(Chains(whole.model, whole.chains[:, :25]))
    plain = critical_stiffness(whole)
    searched = []
    search = critical.find_crossings

    def counted(system, *arguments):
        searched.append(system.batch)
        return search(system, *arguments)

    monkeypatch.setattr(critical, "find_crossings", counted)
    grown = critical_stiffness(whole, before=first)
    assert sum(searched) == 15 * 16
    assert grown.samples == pytest.approx(plain.samples, rel=1e-11)
    assert grown.frequency_hz == pytest.approx(plain.frequency_hz, rel=1e-9)
    assert np.array_equal(grown.group, plain.group) and grown.crossings == plain.crossings


def test_the_watch_asks_for_more_until_twenty_lie_below():
    whole = independent(120)
    watch = TailWatch(whole.model, risk=0.02)
    # Independent draws: 16 a step, so 20 below the 2 % quantile take 62.5 steps.
    wanted = watch.steps_wanted(whole.chains[:, :30])
    assert 50 < wanted <= 90
    assert watch.limit.safe(0.02) is None
    wanted = watch.steps_wanted(whole.chains)
    assert wanted <= 120
    limit = watch.limit_of(whole)
    assert limit.effective_below(0.02) >= ENOUGH_BELOW
    assert limit.safe(0.02) == pytest.approx(np.quantile(limit.samples, 0.02))


def test_the_watch_does_not_ask_for_more_than_can_be_afforded(monkeypatch):
    whole = independent(30)
    monkeypatch.setattr(tail, "most_draws", lambda *_: 35 * 16)
    assert TailWatch(whole.model, risk=1e-4).steps_wanted(whole.chains) == 35
    monkeypatch.setattr(tail, "most_draws", lambda *_: 30 * 16)
    assert TailWatch(whole.model, risk=1e-4).steps_wanted(whole.chains) == 30


def test_what_was_found_of_all_draws_is_not_taken_for_what_a_thinned_run_holds():
    whole = independent(40)
    half = critical_stiffness(Chains(whole.model, whole.chains[:, :20]))
    fresh, resumed = (critical_stiffness(whole, max_draws=320, before=b) for b in (None, half))
    assert np.array_equal(fresh.samples, resumed.samples)


@pytest.fixture(scope="module")
def recorded():
    bench = Bench.from_device("lhifam")
    noise = WhiteNoise(bench.force_rms, bench.band_hz[1], bench.band_hz[0], 10.0)
    run = simulate(bench, noise, seed=6)
    return bh.recording_from_arrays(run.force, run.position, period_s=bench.period_s)


def test_an_analysis_states_every_risk(recorded):
    found = bh.analyse(recorded, model=bh.free(device="lhifam"))
    assert found.limit.effective_below(0.001) >= ENOUGH_BELOW
    safe = [found.limit.safe(risk) for risk in (0.05, 0.01, 0.001)]
    assert None not in safe and safe[0] > safe[1] > safe[2] > 0
    assert len(found.limit.samples) == len(found.posterior.draws)
    # What is stated is the quantile of these very draws.
    again = critical_stiffness(found.posterior)
    assert again.safe(0.001) == pytest.approx(safe[2], rel=1e-11)


def test_a_short_run_is_left_short(recorded):
    found = bh.analyse(recorded, model=bh.free(device="lhifam"), ess=200)
    assert found.limit.safe(0.001) is None
    assert found.posterior.chains.shape[1] == 100
