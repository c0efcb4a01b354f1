"""Linear effects: every effect of the shared list meets every check."""

from __future__ import annotations

import json

import numpy as np
import pytest
from effect_cases import CASES, Case, base_fit, recorded

from bayeshaptic.effects.library import effects
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.inference.saved.archive import model_from_dict, model_to_dict
from bayeshaptic.inference.screening import promising_starts
from bayeshaptic.inference.valleys import refine_anew
from bayeshaptic.rig.truth import sampled_loop
from bayeshaptic.stability import critical_stiffness

T = 1e-3
FREQUENCY_HZ = np.geomspace(0.3, 450, 60)
FAINT = {
    "mode_mass": 1e-9, "arm_mass": 1e-9, "extra_delay_s": 0.0, "lag_s": 1e-10, "filter_hz": 1e9,
    "centring_stiffness": 1e-9, "base_mass": 1e9, "reflex_stiffness": 0.0, "reflex_damping": 0.0,
    "loss_factor": 0.0, "relaxing_stiffness": 0.0,
}  # fmt: skip

every_case = pytest.mark.parametrize("case", CASES, ids=lambda case: case.id)


def bench_response(bench, frequency_hz):
    """The bench's own sampled response, from the state matrix of one period."""
    loop = sampled_loop(bench.plant(), bench.period_s)
    z = np.exp(2j * np.pi * frequency_hz * bench.period_s)
    resolvent = z[:, None, None] * np.eye(len(loop.matrix)) - loop.matrix
    return np.linalg.solve(resolvent, loop.column[:, None])[..., 0] @ loop.row


@every_case
def test_response_is_that_of_the_bench(case: Case) -> None:
    model = case.base.with_effect(case.effect)
    mine = model.response(case.theta(model), FREQUENCY_HZ)
    expected = bench_response(case.truth, FREQUENCY_HZ)
    np.testing.assert_allclose(np.abs(mine / expected - 1), 0, atol=case.response)
    plain = case.base.response(case.base.values, FREQUENCY_HZ)
    assert np.max(np.abs(expected / plain - 1)) > 0.05


@every_case
def test_critical_stiffness_is_that_of_the_bench(case: Case) -> None:
    model = case.base.with_effect(case.effect)
    limit = critical_stiffness(model, case.theta(model))
    assert limit.value == pytest.approx(case.truth.true_critical_stiffness(), rel=case.limit)
    assert limit.confirmed == limit.checked


@every_case
def test_without_strength_it_is_the_base_model(case: Case) -> None:
    model = case.base.with_effect(case.effect)
    theta = case.theta(model)
    for name in FAINT.keys() & set(model.names):
        theta[model.names.index(name)] = FAINT[name]
    mine, plain = (
        model.response(theta, FREQUENCY_HZ),
        case.base.response(case.base.values, FREQUENCY_HZ),
    )
    np.testing.assert_allclose(np.abs(mine / plain - 1), 0, atol=1e-5)


def fit_with_effect(case: Case, bases: np.ndarray, keep: int) -> Fit:
    etfe, before, effect = recorded(case), base_fit(case), case.effect
    own = effect.starting_values(before.model, etfe)
    starts = promising_starts(before.model, effect, before.windows, bases, own, keep)
    model = before.model.with_effect(effect)
    first = refine_anew(model, etfe, before.windows, starts)
    return least_squares(model, etfe, start=first.theta)


@every_case
def test_parameters_are_recovered_from_a_recording(case: Case) -> None:
    before = base_fit(case)
    fit = fit_with_effect(case, np.stack([before.theta, before.model.values]), keep=24)
    assert before.reduced_chi_square > 1.5
    assert fit.reduced_chi_square < 1.3
    for name, value in case.values.items():
        index = fit.model.names.index(name)
        error = abs(fit.theta[index] - value)
        if name not in case.weak:
            assert error < 4.5 * fit.sd[index] + 1e-3 * value
            assert error < 0.1 * value
    mine, truth = critical_stiffness(fit).value, case.truth.true_critical_stiffness()
    assert abs(20 * np.log10(mine / truth)) < 0.2


@every_case
def test_optimum_is_found_from_the_fit_alone_and_from_the_device_file_alone(
    case: Case,
) -> None:
    before = base_fit(case)
    alone = np.concatenate([before.theta[None], *before.elsewhere[:, None]])
    found = [
        fit_with_effect(case, bases, keep=6 * len(bases)).log_likelihood
        for bases in (alone, before.model.values[None])
    ]
    assert found[0] == pytest.approx(found[1], abs=0.5)


@every_case
def test_saved_and_read_back(case: Case) -> None:
    model = case.base.with_effect(case.effect)
    back = model_from_dict(json.loads(json.dumps(model_to_dict(model))))
    assert back.effects == model.effects
    assert back == model
    theta = case.theta(model)
    np.testing.assert_array_equal(
        back.response(theta, FREQUENCY_HZ), model.response(theta, FREQUENCY_HZ)
    )


@every_case
def test_starting_values_lie_in_the_priors(case: Case) -> None:
    effect = case.effect
    values = effect.starting_values(case.base, recorded(case))
    assert values.shape[1] == len(effect.parameters)
    for column, parameter in zip(values.T, effect.parameters, strict=True):
        assert np.all(np.isfinite(parameter.prior.log_density(column))), parameter.name
        assert parameter.title and model_unit_known(case, parameter.name)


def model_unit_known(case: Case, name: str) -> bool:
    return isinstance(case.base.with_effect(case.effect).unit(name), str)


def test_list_is_complete() -> None:
    assert {case.name for case in CASES} == {effect.name for effect in effects("linear")}
