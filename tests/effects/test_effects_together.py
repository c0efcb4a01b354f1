"""Effects in company: several at once, on every base model, and from outside the package."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from importlib.metadata import EntryPoint

import numpy as np
import pytest
from effect_cases import CASES, plain_bench, recorded
from test_effects import bench_response

from bayeshaptic.effects import library, registry
from bayeshaptic.effects.effect import LinearEffect
from bayeshaptic.effects.library import effect_class, effects
from bayeshaptic.effects.registry import register
from bayeshaptic.errors import InputError
from bayeshaptic.inference.saved.archive import model_from_dict, model_to_dict
from bayeshaptic.models import HalfNormal, Model, Parameter, build_model, rigid
from bayeshaptic.models.response.mechanism import Link
from bayeshaptic.models.start import informed
from bayeshaptic.rig import Bench, run_wall
from bayeshaptic.stability import critical_stiffness

FREQUENCY_HZ = np.geomspace(0.3, 450, 60)
CASE = {case.id: case for case in CASES}
ETFE_CASE = CASE["mode on the motor"]
PAIRS = [
    ("mode on the motor", "lag"),
    ("base", "mode on the motor"),
    ("base", "centring"),
    ("mode on the body", "delay"),
    ("base", "constant loss modulus"),
    ("reflex", "filter of order 2"),
    ("reflex", "constant loss modulus"),
    ("reflex", "base"),
    ("relaxing transmission", "constant loss modulus"),
    ("filter of order 2", "lag of order 3"),
    ("mode on the motor", "mode of the arm"),
]


def with_pair(first: str, second: str) -> tuple[Model, np.ndarray, Bench]:
    """Two effects on the held device: model, true parameters, bench."""
    model, bench = build_model("grasped", "lhifam"), plain_bench("lhifam", held=True)
    values = dict(model.reference)
    for case in (CASE[first], CASE[second]):
        added = dict(case.values)
        if case.id == "mode on the body":  # a tenth of the body, which is another one when held
            added["mode_mass"] *= 3.78 / 5.20
        bench = bench.with_effect(case.twin or case.name, **case.bench)
        model = model.with_effect(case.effect)
        values |= added
    return model, np.array([values[name] for name in model.names]), bench


@pytest.mark.parametrize(("first", "second"), PAIRS, ids=[" + ".join(p) for p in PAIRS])
def test_two_effects_against_the_bench(first: str, second: str) -> None:
    model, theta, bench = with_pair(first, second)
    mine, expected = model.response(theta, FREQUENCY_HZ), bench_response(bench, FREQUENCY_HZ)
    tolerance = max(CASE[first].response, CASE[second].response)
    assert np.max(np.abs(mine / expected - 1)) < 3 * tolerance
    limit = critical_stiffness(model, theta)
    assert limit.value == pytest.approx(bench.true_critical_stiffness(), rel=5e-5)
    back = model_from_dict(json.loads(json.dumps(model_to_dict(model))))
    np.testing.assert_array_equal(back.response(theta, FREQUENCY_HZ), mine)


def test_the_same_effect_twice_numbers_its_parameters() -> None:
    etfe = recorded(ETFE_CASE)
    model = ETFE_CASE.base.with_effect(ETFE_CASE.effect)
    again = effect_class("second_mode").candidates(model, etfe)[1]
    assert [p.name for p in again.parameters] == ["mode_hz_2", "mode_mass_2", "mode_damping_2"]
    both = model.with_effect(again)
    values = {**ETFE_CASE.base.reference, **ETFE_CASE.values}
    values |= {"mode_hz_2": 40.0, "mode_mass_2": 0.378, "mode_damping_2": 0.05}
    bench = ETFE_CASE.truth.with_effect(
        "second_mode", mass_ratio=0.1, frequency_hz=40.0, damping_ratio=0.05, on="m2"
    )
    mine = both.response(np.array([values[name] for name in both.names]), FREQUENCY_HZ)
    assert np.max(np.abs(mine / bench_response(bench, FREQUENCY_HZ) - 1)) < 1e-9


def test_reflex_limit_by_a_virtual_wall_in_the_time_domain() -> None:
    case = CASE["reflex"]
    model = case.base.with_effect(case.effect)
    limit = critical_stiffness(model, case.theta(model)).value
    bench = case.truth.quiet()
    assert run_wall(bench, 0.97 * limit, seconds=4.0).stable
    assert not run_wall(bench, 1.03 * limit, seconds=4.0).stable


@pytest.mark.parametrize("share", [3.0, 8.0, 40.0])
def test_strong_reflexes_up_to_one_that_shakes_the_hand_by_itself(share: float) -> None:
    case = CASE["reflex"]
    model = case.base.with_effect(case.effect)
    theta = case.theta(model)
    for name in ("reflex_stiffness", "reflex_damping"):
        theta[model.names.index(name)] *= share
    stronger = {**case.bench, "stiffness": 70.0 * share, "damping": 9.0 * share}
    truth = plain_bench("lhifam", True).with_effect("reflex", **stronger).true_critical_stiffness()
    assert (truth == 0) == (share == 40.0)
    assert critical_stiffness(model, theta).value == pytest.approx(truth, rel=2e-5)


# ---------------------------------------------------------------- candidates


@pytest.mark.parametrize("device", ["lhifam", None], ids=["device file", "unknown device"])
@pytest.mark.parametrize("name", ["rigid", "free", "grasped"])
def test_candidates_of_every_base_model(name: str, device: str | None) -> None:
    etfe = recorded(ETFE_CASE)
    model = informed(build_model(name, device, delay_s=2e-4), etfe)
    found = [effect for kind in effects("linear") for effect in kind.candidates(model, etfe)]
    names = {effect.name for effect in found}
    assert {"second_mode", "extra_delay", "actuator_lag", "position_filter"} <= names
    assert ({"reflex", "arm_mode"} <= names) == (name == "grasped")
    assert ("structural_damping" in names) == (name != "rigid")
    rng = np.random.default_rng(1)
    for effect in found:
        full = model.with_effect(effect)
        assert len(set(full.names)) == full.size
        drawn = np.stack([full.prior(n).quantile(rng.uniform(0.1, 0.9, 5)) for n in full.names], 1)
        assert np.all(np.isfinite(full.response(drawn, FREQUENCY_HZ)))
        assert np.all(np.isfinite(full.log_prior(drawn)))
        assert all(full.unit(p.name) is not None for p in effect.parameters)
        assert effect.title and (effect.told_apart_by or not effect.ties)


def test_no_extra_delay_where_the_delay_is_inferred_anyway() -> None:
    etfe = recorded(ETFE_CASE)
    model = informed(rigid("lhifam", delay_s=2e-4, delay_sd_s=1e-4), etfe)
    assert effect_class("extra_delay").candidates(model, etfe) == ()


def test_ties_name_effects_or_parameters() -> None:
    known = {effect.name for effect in effects()} | {"kh"}
    for effect in effects("linear"):
        assert set(effect.ties) <= known


# ---------------------------------------------------------------- from outside the package


@dataclass(frozen=True)
class Eddy(LinearEffect):
    """A toy: an eddy-current brake, one more damper from the motor to the frame."""

    name = "toy_brake"
    title = "eddy-current brake"

    @classmethod
    def candidates(cls, model, etfe):
        return (cls((Parameter("brake", "damping", "damper of the brake", HalfNormal(10.0)),)),)

    def starting_values(self, model, etfe):
        return np.array([[1.0], [10.0]])

    def apply(self, system, values):
        (damping,) = self.own(values)
        mechanism = system.mechanism
        brake = Link(mechanism.driven, mechanism.frame, damping, np.zeros_like(damping))
        return replace(system, mechanism=mechanism.with_link(brake))


@pytest.fixture
def empty_registry(monkeypatch):
    """The registry as it is, and as it was afterwards."""
    monkeypatch.setattr(registry, "_registered", dict(registry._registered))


def check_the_toy() -> None:
    etfe = recorded(ETFE_CASE)
    base = build_model("free", "lhifam")
    (effect,) = effect_class("toy_brake").candidates(base, etfe)
    model = base.with_effect(effect)
    assert model.unit("brake") == "N s/m"
    values = {**base.reference, "brake": 3.0}
    braked = model.response(np.array([values[n] for n in model.names]), FREQUENCY_HZ)
    values["b1"] += 3.0
    np.testing.assert_allclose(
        braked, base.response(np.array([values[n] for n in base.names]), FREQUENCY_HZ), rtol=1e-12
    )
    assert model_from_dict(model_to_dict(model)).effects == (effect,)


def test_toy_effect_by_register(empty_registry) -> None:
    register(Eddy)
    assert register(Eddy) is Eddy  # twice does no harm
    check_the_toy()


def test_toy_effect_by_an_entry_point(empty_registry, monkeypatch) -> None:
    point = EntryPoint("toy_brake", f"{__name__}:Eddy", library.ENTRY_POINT)
    monkeypatch.setattr(library, "entry_points", lambda group: [point])
    library._load_installed.cache_clear()
    check_the_toy()
    library._load_installed.cache_clear()


def test_two_effects_of_one_name_are_refused(empty_registry) -> None:
    register(Eddy)
    with pytest.raises(InputError, match="there is an effect 'toy_brake' already"):
        register(type("Other", (Eddy,), {}))


def test_a_saved_effect_that_is_not_installed_is_said_in_one_line() -> None:
    etfe = recorded(ETFE_CASE)
    model = build_model("free", "lhifam").with_effect(Eddy.candidates(None, etfe)[0])
    with pytest.raises(
        InputError, match="made with the effect 'toy_brake', which is not installed"
    ):
        model_from_dict(model_to_dict(model))


def test_an_effect_that_cannot_be_saved_is_said_in_one_line() -> None:
    @dataclass(frozen=True)
    class Odd(Eddy):
        table: object = None

    odd = Odd(Eddy.candidates(None, None)[0].parameters, np.zeros(2))
    with pytest.raises(InputError, match="toy_brake cannot be saved: its table is a ndarray"):
        model_to_dict(build_model("free", "lhifam").with_effect(odd))
