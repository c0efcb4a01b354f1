"""When a report stops sampling, and a risk of 0.1 % from the lowest draws."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
import scipy.stats
from on_the_bench import usual_noise

import bayeshaptic as bh
from bayeshaptic.diagnosis import limit_known
from bayeshaptic.diagnosis.limit_known import LimitKnown
from bayeshaptic.rig import Bench, simulate
from bayeshaptic.stability import each_draw
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.stability.tail import low_quantile


@dataclass(frozen=True)
class Chains:
    """What the rule reads of a sampler."""

    model: bh.Model
    chains: np.ndarray


def independent(steps: int, walkers: int = 8, sd: float = 0.02, device: str = "phantom") -> Chains:
    """Independent draws around a device's own values."""
    model = bh.free(device=device)
    noise = np.random.default_rng(0).standard_normal((2, steps, walkers, model.size))
    return Chains(model, model.values * np.exp(sd * noise))


@pytest.fixture
def searched(monkeypatch) -> list[int]:
    """How many draws each search was for."""
    counts: list[int] = []
    search = each_draw.find_crossings

    def counted(system, *arguments):
        counts.append(system.batch)
        return search(system, *arguments)

    monkeypatch.setattr(each_draw, "find_crossings", counted)
    return counts


def test_what_has_been_searched_is_not_searched_again(searched):
    whole = independent(40)
    first = critical_stiffness(Chains(whole.model, whole.chains[:, :25]))
    plain = critical_stiffness(whole)
    searched.clear()
    grown = critical_stiffness(whole, before=first)
    assert sum(searched) == 15 * 16
    assert grown.samples == pytest.approx(plain.samples, rel=1e-11)
    assert grown.frequency_hz == pytest.approx(plain.frequency_hz, rel=1e-9)
    assert np.array_equal(grown.group, plain.group) and grown.crossings == plain.crossings


def test_a_walker_that_stays_is_not_searched_again(searched):
    moving = independent(20)
    stays = Chains(moving.model, np.repeat(moving.chains, 3, axis=1))
    found = critical_stiffness(stays)
    assert sum(searched) == 20 * 16
    each = critical_stiffness(moving).samples.reshape(16, 20)
    assert np.array_equal(found.samples, np.repeat(each, 3, axis=1).ravel())


def test_the_rule_asks_for_more_until_the_limit_is_known():
    # 16 independent draws a step: 0.1 % from a fitted tail to 10 % takes some 1500 of them.
    whole = independent(64, device="lhifam")
    rule = LimitKnown(whole.model)
    early = rule(whole.chains[:, :24])
    assert not (early.done or early.known) and early.share < 0.9
    many = independent(256, device="lhifam")
    late = rule(many.chains)
    assert late.done and late.share >= 1
    limit = rule.limit_of(many)
    assert limit is rule.limit  # the same draws are not searched again
    other = rule.limit_of(whole)  # nor is what was found of them taken for that of others
    assert np.array_equal(other.samples, critical_stiffness(whole).samples)
    found = limit.low_quantile(0.001)
    assert found.fitted and found.error < 0.1 * np.ptp(limit.quantile([0.05, 0.95]))


def test_without_small_risks_fewer_draws_do():
    whole = independent(48, device="lhifam")
    assert LimitKnown(whole.model, ())(whole.chains).done
    # A report said "not converged" of what met everything that it listed but for a small risk.
    waiting = LimitKnown(whole.model)(whole.chains)
    assert waiting.known and not waiting.done


@pytest.mark.parametrize(("least", "known"), [(0.1, True), (0.011, False)])
def test_a_quantile_that_is_known_roughly_will_do_in_the_end(monkeypatch, least, known):
    """Of 768 normal draws the 5 % quantile has an error of 2.3 % of the interval."""
    whole = independent(48, device="lhifam")
    assert LimitKnown(whole.model, ())(whole.chains).done
    monkeypatch.setattr(limit_known, "PRECISION", 0.01)
    monkeypatch.setattr(limit_known, "RISK_PRECISION", least)
    verdict = LimitKnown(whole.model, ())(whole.chains)
    assert verdict.known == known and not verdict.done and verdict.share < 0.5


def test_ensembles_that_are_apart_are_not_done():
    whole = independent(256, device="lhifam")
    whole.chains[0, ..., whole.model.names.index("b2")] *= 1.006
    verdict = LimitKnown(whole.model)(whole.chains)
    assert verdict.diagnostics.rhat.max() > 1.01 and not (verdict.known or verdict.done)


@pytest.mark.parametrize("name", ["norm", "gumbel_r", "gumbel_l"])
def test_a_fitted_tail_knows_its_error(name):
    """Quantiles of 0.1 % from 4000 draws, 60 times: next to unbiased, no further off than said."""
    law = getattr(scipy.stats, name)()
    rng = np.random.default_rng(1)
    draws = law.rvs((60, 4000), random_state=rng) + 30.0
    found = [low_quantile(row, 0.001, lambda _: 4000.0) for row in draws]
    stated = [one for one in found if one is not None and one.fitted]
    assert len(stated) >= 55
    pull = np.array([(one.value - law.ppf(0.001) - 30.0) / one.error for one in stated])
    # Errors are those of a tail that is at least exponential: too large for lighter ones.
    assert abs(pull.mean()) < 0.6
    assert np.sqrt(np.mean(pull**2)) < 1.2 and np.mean(pull > 1.645) < 0.12


def test_a_tail_of_two_humps_is_not_fitted():
    rng = np.random.default_rng(2)
    low, high = rng.normal(50, 1, 60), rng.normal(100, 1, 2940)
    assert low_quantile(np.concatenate([low, high]), 0.001, lambda _: 3000.0) is None
    assert low_quantile(high[:300], 0.001, lambda _: 300.0) is None  # too few


def test_an_error_that_no_use_asks_for_is_small_enough() -> None:
    # 5 % of 900 draws: an exponential tail at 0.1 % has a third of the 90 % interval for an error.
    samples = 1e4 - np.random.default_rng(4).exponential(size=900)
    alone = low_quantile(samples, 0.001, lambda _: 900.0)
    assert alone is None
    found = low_quantile(samples, 0.001, lambda _: 900.0, enough=100.0)
    assert found is not None and found.fitted
    assert found.value == pytest.approx(1e4 + np.log(0.001), abs=3 * found.error)


def test_what_was_found_of_all_draws_is_not_taken_for_what_a_thinned_run_holds():
    whole = independent(40)
    half = critical_stiffness(Chains(whole.model, whole.chains[:, :20]))
    fresh, resumed = (critical_stiffness(whole, max_draws=320, before=b) for b in (None, half))
    assert np.array_equal(fresh.samples, resumed.samples)


def test_what_was_found_is_not_taken_for_that_of_thinned_chains_that_begin_alike():
    """Walkers that have not moved yet: the first steps of both are the same, and others are not."""
    whole = independent(64)
    whole = Chains(whole.model, np.concatenate([whole.chains[:, [0, 0]], whole.chains], axis=1))
    rule = LimitKnown(whole.model)
    rule(whole.chains)
    thinned = Chains(whole.model, whole.chains[:, 1::2])
    again = rule.limit_of(thinned)
    assert np.array_equal(again.samples, critical_stiffness(thinned).samples)
    assert again.confirmed == again.checked


def test_a_tail_whose_first_quarter_is_at_its_threshold_is_not_fitted():
    """A fit is scaled by that quartile, and divided by nothing."""
    samples = np.sort(1 + np.random.default_rng(0).random(10_000))
    count = 500  # the lowest twentieth
    samples[count - 125 : count] = samples[count]
    assert low_quantile(samples, 0.01, lambda _: 900.0) is None


@pytest.fixture(scope="module")
def recorded():
    bench = Bench.from_device("lhifam")
    noise = usual_noise(bench, 10.0)
    run = simulate(bench, noise, seed=6)
    return bh.recording_from_arrays(**run.signals)


def test_an_analysis_states_every_risk(recorded):
    found = bh.analyse(recorded, model=bh.free(device="lhifam"))
    width = np.ptp(found.limit.quantile([0.05, 0.95]))
    assert found.limit.low_quantile(0.001).error < 0.1 * width
    safe = [found.limit.safe(risk) for risk in (0.05, 0.01, 0.001)]
    assert None not in safe and safe[0] > safe[1] > safe[2] > 0
    assert len(found.limit.samples) == len(found.posterior.draws)
    # What is stated is of these very draws.
    again = critical_stiffness(found.posterior)
    assert again.safe(0.001) == pytest.approx(safe[2], rel=1e-11)


def test_a_short_run_is_left_short(recorded):
    found = bh.analyse(recorded, model=bh.free(device="lhifam"), ess=200)
    assert found.posterior.chains.shape[1] == 32


def test_no_risk_is_stated_below_one_that_is_not():
    """A thousandth of independent draws far below a chain that hardly moved."""
    rng = np.random.default_rng(4)
    slow = np.repeat(rng.standard_normal(100), 500)
    draws = np.where(rng.random(len(slow)) < 2e-3, -9 - rng.random(len(slow)), slow)

    def effective(threshold: float) -> float:
        return 100.0 if threshold > -5 else 50_000.0

    assert np.mean(draws < -5) * effective(-9) > 40
    assert low_quantile(draws, 0.01, effective) is None
    assert low_quantile(draws, 0.001, effective) is None
