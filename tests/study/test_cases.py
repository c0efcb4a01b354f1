"""The limit of a device over all its cases."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fake_analysis import fake_closed
from fake_study import fake_study

import bayeshaptic as bh
from bayeshaptic.errors import InputError
from bayeshaptic.models import build_model
from bayeshaptic.rig import Bench, simulate
from bayeshaptic.stability.cases import FREE, HELD, Case, device_limit
from bayeshaptic.stability.critical import CriticalStiffness
from bayeshaptic.study import recorded_cases
from bayeshaptic.study.cases import _two_names
from bayeshaptic.study.recorded_cases import contradictions
from bayeshaptic.types import Floats

MODEL = build_model("free", "phantom")


def case(label: str, samples: Floats, joint: str | None = None, unit: str = "N/m") -> Case:
    """A case with invented limits of independent draws."""
    count = len(samples)
    limit = CriticalStiffness(samples, np.ones(count), unit, (), np.zeros(count, int), chains=count)
    group = FREE if label == "nobody holds it" else HELD
    return Case(label, group, MODEL, np.ones((count, MODEL.size)), limit, joint)


@pytest.mark.parametrize("kind", ["model", "fit", "posterior", "case", "analysis", "closed"])
def test_whatever_holds_parameters_has_walls_and_guidance(kind: str) -> None:
    closed = fake_closed()
    analysis = closed.analysis
    draws = analysis.posterior.chains[:, ::40].reshape(-1, analysis.model.size)
    limit = bh.critical_stiffness(analysis.model, draws)
    source = {
        "model": bh.free(device="phantom"),
        "fit": analysis.fit,
        "posterior": analysis.posterior,
        "case": Case("user ana", HELD, analysis.model, draws, limit),
        "analysis": analysis,
        "closed": closed,
    }[kind]
    found = bh.critical_stiffness(source)
    assert np.isfinite(found.value)
    count = {"model": 1, "fit": 1, "case": len(draws)}.get(kind, len(analysis.posterior.draws))
    assert len(found.samples) == count
    assert bh.kb_region(source, draws=20).probability(0.1 * found.value, 0.0) == 1.0
    assert bh.elasticities(source, draws=20)
    assert np.isfinite(bh.sweep(source, "kc", [0.5, 1.0, 2.0], draws=20).middle).all()
    assert bh.variance_shares(source, draws=200).draws >= 1


def test_the_least_of_two_independent_cases() -> None:
    rng = np.random.default_rng(1)
    one, other = rng.normal(100, 5, 40_000), rng.normal(104, 5, 20_000)
    found = device_limit([case("nobody holds it", one), case("user ana", other)])
    # P(one < other) = Phi(4 / sqrt(50)); 40,000 draws: 0.0023 is one standard error.
    shares = {binding.case: binding.probability for binding in found.binding}
    assert shares["nobody holds it"] == pytest.approx(0.7142, abs=0.01)
    assert sum(shares.values()) == pytest.approx(1.0)
    assert found.by_group() == {FREE: shares["nobody holds it"], HELD: shares["user ana"]}
    assert found.binding[0].case == "nobody holds it"
    below = 1 - (1 - np.mean(one < 95)) * (1 - np.mean(other < 95))
    assert found.probability_unstable(95.0) == pytest.approx(below, abs=0.006)


def test_safe_wants_draws_in_the_tail() -> None:
    rng = np.random.default_rng(2)
    found = device_limit([case("nobody holds it", rng.normal(100, 5, 500))])
    assert found.safe(0.05) == pytest.approx(100 - 1.645 * 5, abs=1.0)
    assert found.safe(0.01) is None and found.safe(0.001) is None
    many = [
        case("nobody holds it", rng.normal(100, 5, 500)),
        case("user ana", 1e6 + rng.normal(size=60_000)),
    ]
    assert device_limit(many).safe(0.01) is None  # draws of a case that never binds do not count


def test_where_some_are_stable_at_no_stiffness_the_draws_say_so() -> None:
    """It was said that they are too few."""
    rng = np.random.default_rng(5)
    samples = np.exp(rng.standard_normal(4000))
    some = np.where(rng.random(4000) < 0.17, 0.0, samples)
    limit = device_limit([case("nobody holds it", samples), case("a new person", some)], 1)
    assert limit.safe(0.05) == limit.safe(0.01) == 0.0
    few = device_limit([case("nobody holds it", some[:40])], 1)
    assert few.safe(0.01) is None


def test_few_draws_of_the_binding_case_limit_the_whole() -> None:
    rng = np.random.default_rng(3)
    few, plenty = rng.normal(100, 5, 400), rng.normal(100, 5, 50_000)
    both = device_limit([case("nobody holds it", few), case("user ana", plenty)])
    assert both.safe(0.05) is not None and both.safe(0.01) is None
    alone = device_limit([case("user ana", plenty)])
    assert alone.safe(0.001) is not None


def test_cases_that_are_drawn_together_keep_their_order() -> None:
    rng = np.random.default_rng(4)
    samples = rng.normal(100, 5, 30_000)
    together = [case(f"user {n}", samples + 0.1 * n, joint="a path") for n in range(9)]
    found = device_limit(together)
    assert found.binding[0].case == "user 0" and found.binding[0].probability == 1.0
    assert found.quantile(0.01) == pytest.approx(np.quantile(samples, 0.01))
    assert found.safe(0.001) is not None
    apart = device_limit([case(f"user {n}", samples + 0.1 * n) for n in range(9)])
    assert apart.quantile(0.5) < found.quantile(0.5) - 5  # the least of nine


def test_unstable_and_unlimited_draws() -> None:
    never = case("nobody holds it", np.full(1000, np.inf))
    found = device_limit([never])
    assert found.quantile(0.5) == np.inf and found.binding[0].probability == 0.0
    always = device_limit([never, case("user ana", np.zeros(1000))])
    assert always.quantile(0.5) == 0.0 and always.binding[0].case == "user ana"
    assert always.db(0.5) == -np.inf


def test_units_must_agree() -> None:
    ones = np.ones(10)
    with pytest.raises(InputError, match="N m/rad and N/m"):
        device_limit([case("a", ones), case("b", ones, unit="N m/rad")])
    with pytest.raises(InputError, match="no case"):
        device_limit([])


def recorded(device: str, held: bool) -> Case:
    """A case from a simulated recording of 30 s."""
    bench = Bench.from_device(device, held=held)
    run = simulate(bench, seed=11)
    recording = bh.recording_from_arrays(**run.signals)
    model = build_model("grasped" if held else "free", device)
    posterior = bh.sample(model, bh.estimate_etfe(recording), ess=300)
    label, group = ("user ana", HELD) if held else ("nobody holds it", FREE)
    return Case(label, group, model, posterior.draws, bh.critical_stiffness(posterior))


@pytest.mark.parametrize(("device", "apart_db"), [("phantom", 18.5), ("lhifam", 0.05)])
def test_free_or_held_whichever_is_worse(device: str, apart_db: float) -> None:
    """Diaz and Gil (2010), Table III: the PHANToM is worst alone, the LHIfAM as bad when held."""
    free, held = recorded(device, False), recorded(device, True)
    found = device_limit([free, held])
    low, middle, high = (20 * np.log10(free.limit.quantile(p)) for p in (0.005, 0.5, 0.995))
    apart = 20 * np.log10(held.limit.quantile(0.5)) - middle
    # Within the 99 % interval of the free device's limit, which is by far the wider one.
    assert apart == pytest.approx(apart_db, abs=0.05 + high - low)
    if device == "phantom":
        assert found.by_group()[FREE] == 1.0 and found.by_group().get(HELD, 0.0) == 0.0
    else:  # a toss: neither is safe to leave out
        assert abs(apart) < 0.5
        assert found.safe(0.05) <= min(free.limit.safe(0.05), held.limit.safe(0.05))


def test_recordings_of_two_devices_contradict_each_other() -> None:
    """One of another device had been a third of the draws of "nobody holds it", without a word."""
    first, other, third = fake_study(people=0, free=3).recordings
    assert not contradictions((first, other, third))
    analysis = other.analysis
    analysis.limit = replace(analysis.limit, samples=0.1 * analysis.limit.samples)
    (warning,) = contradictions((first, other, third))
    assert (warning.level, warning.topic) == ("warning", "contradiction")
    assert "nobody holds it" in warning.text and f"by {other.name} " in warning.text
    elsewhere = replace(other, entry=replace(other.entry, configuration="folded"))
    assert not contradictions((first, elsewhere, third))


def test_an_effect_in_one_recording_of_a_device_and_not_in_another_is_told() -> None:
    """Friction in one of three recordings that nobody held was a case of its own in silence."""
    some = fake_study(people=0, free=3).recordings
    found: Any = SimpleNamespace(analysis=some[2].analysis, effect_names=("coulomb_friction",))
    odd = replace(some[2], result=found)
    (warning,) = contradictions((*some[:2], odd))
    assert (warning.level, warning.topic) == ("warning", "contradiction")
    assert f"no effect in {some[0].name} and {some[1].name}; " in warning.text
    assert f"coulomb_friction in {odd.name}" in warning.text
    labels = [case.label for case in recorded_cases.recorded((*some[:2], odd), FREE)]
    assert labels[0] == f"nobody holds it ({some[0].name} and 1 other)"


def test_effects_that_no_recording_tells_apart_do_not_contradict_each_other() -> None:
    """A lag on either side of the masses: that they did not agree about the device was said."""
    some = fake_study(people=0, free=3).recordings

    def named(*effects: tuple[str, ...]) -> tuple[Any, ...]:
        results = (SimpleNamespace(analysis=some[0].analysis, effect_names=e) for e in effects)
        return tuple(replace(one, result=r) for one, r in zip(some, results, strict=True))

    assert not contradictions(named(("actuator_lag",), ("position_filter",), ("actuator_lag",)))
    rubbing = ("coulomb_friction", "position_filter")
    (warning,) = contradictions(named(("actuator_lag",), rubbing, ("position_filter",)))
    assert "coulomb_friction, position_filter in" in warning.text


def test_a_user_with_two_names_is_asked_about() -> None:
    people = fake_study(people=3, free=1).recordings
    assert not _two_names(people)

    def named(user: str | None, configuration: str | None) -> list[str]:
        last = people[-1]
        entry = replace(last.entry, user=user, configuration=configuration)
        return [one.text for one in _two_names((*people, replace(last, entry=entry)))]

    (text,) = named("Anna ", None)
    assert "The users 'anna' and 'Anna ' differ in capitals or spaces alone" in text
    assert not named("anna", "Folded")
    assert not named(None, None)
