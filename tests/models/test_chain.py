"""Chains of masses: as many vibration modes as are asked for."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from response_table import noisy_table

import bayeshaptic as bh
from bayeshaptic.diagnosis.base.asked import base_model
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.errors import InputError
from bayeshaptic.inference.saved.archive import model_from_dict, model_to_dict
from bayeshaptic.models.chains import _as_chain, with_a_mode_moved
from bayeshaptic.models.structures import chain
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.rig import Bench, simulate


def test_a_chain_has_the_modes_that_it_was_made_of():
    """Receptance of the chain without dampers: the sum over its modes."""
    squares = (2 * np.pi * np.array([0.0, 40.0, 90.0, 130.0])) ** 2
    weights = np.array([0.2, 0.5, 0.1, 0.05])
    masses, springs = _as_chain(squares, weights)
    names = ("m1", "m2", "m3", "m4", "kc", "k3", "k4")
    values = dict(zip(names, (*masses, *springs), strict=True))
    model = bh.chain(3, delay_s=0.0, period_s=1e-3)
    theta = np.array([[values.get(name, 0.0) for name in model.names]])
    s = 2j * np.pi * np.array([5.0, 39.0, 60.0, 100.0, 300.0])
    expected = np.sum(weights[:, None] / (s**2 + squares[:, None]), axis=0)
    found = model.system(theta).continuous_response(s)[0]
    assert found == pytest.approx(expected, rel=1e-9)


def test_a_chain_of_the_bench_is_found():
    """Three masses in a row on the bench, from the data alone: every part within five sd."""
    free = Bench.from_device("lhifam")
    bench = free.with_effect("second_mode", mass_ratio=0.3, frequency_hz=45.0, on="m2")
    made = simulate(bench, seed=1)
    recording = recording_from_arrays(**made.signals)
    model = bh.chain(2, delay_s=bench.delay_s)
    fit = bh.least_squares(model, bh.estimate_etfe(recording))
    truth = dict(bench.values) | {"m3": 0.3 * bench.values["m2"]}
    truth |= {"k3": truth["m3"] * (2 * np.pi * 45.0) ** 2}
    assert fit.reduced_chi_square < 1.3
    for name, value, sd in zip(fit.model.names, fit.theta, fit.sd, strict=True):
        if name in ("m1", "kc", "m2", "m3", "k3"):
            assert abs(value - truth[name]) < 5 * sd, name
            assert sd < 0.05 * value, name
    again = model_from_dict(model_to_dict(fit.model))
    assert again.names == fit.model.names
    assert np.allclose(again.response(fit.theta, [80.0]), fit.model.response(fit.theta, [80.0]))


@pytest.mark.parametrize("held", [False, True])
def test_workers_hand_a_chain_back(held):
    assert pickle.loads(pickle.dumps(chain(3, held))) == chain(3, held)


def test_modes_name_the_base_model():
    asked = Options(modes=2)
    assert [base_model("auto", replace(asked, modes=n)) for n in (None, 0, 1, 2)] == [
        "auto",
        "rigid",
        "free",
        "chain-2",
    ]
    assert base_model("grasped", asked) == base_model("auto", replace(asked, held=True))
    assert base_model("grasped", asked) == "grasped-2"
    for model, options in (("rigid", asked), ("free", replace(asked, held=True))):
        with pytest.raises(InputError, match="leave one of them out"):
            base_model(model, options)
    for model, held in (("free", True), ("rigid", True), ("chain-2", True), ("grasped", False)):
        with pytest.raises(InputError, match=f"model is '{model}'.*leave one of them out"):
            base_model(model, Options(held=held))
        assert base_model(model, Options(held=not held)) == model
    with pytest.raises(InputError, match="1 to 8"):
        base_model("grasped", replace(asked, modes=0))
    with pytest.raises(InputError, match="0 to 8"):
        base_model("auto", replace(asked, modes=9))


def test_a_held_chain_is_found(tmp_path):
    """Three masses and a hand on the last, with a mode that `grasped` lacks: from its response."""
    model = bh.chain(2, held=True, delay_s=2e-4, period_s=1e-3)
    values = {"m1": 0.3, "b1": 0.5, "bc": 0.5, "kc": 2e4, "m2": 0.2, "b2": 0.2}
    values |= {"m3": 0.2, "c3": 0.4, "k3": 4e4, "b3": 0.1}
    values |= {"bs": 5.0, "ks": 3e3, "mh": 0.2, "bh": 4.0, "kh": 80.0}
    truth = np.array([values[name] for name in model.names])
    frequency = np.geomspace(1.0, 250.0, 400)
    response = model.response(truth, frequency)
    assert model.system(truth).mechanism.hand == 3
    at_rest = model.system(truth).continuous_response(np.array([1e-6j]))[0, 0]
    assert at_rest.real == pytest.approx(1 / 2e4 + 1 / 4e4 + 1 / 3e3 + 1 / 80.0, rel=1e-6)
    table = noisy_table(tmp_path, frequency, response, 0.005, seed=2)
    fit = bh.least_squares(model, table)
    assert fit.reduced_chi_square < 1.2
    limit, found = (
        float(bh.critical_stiffness(fit.model, theta).value) for theta in (truth, fit.theta)
    )
    assert found == pytest.approx(limit, rel=0.02)
    assert bh.least_squares(bh.grasped(delay_s=2e-4), table).reduced_chi_square > 2


MASSES = {"m1": 0.49, "m2": 0.037, "m3": 0.19, "m4": 0.28}
SPRINGS = {"kc": 2900.0, "bc": 0.24, "k3": 4300.0, "c3": 1.4, "k4": 35000.0, "c4": 9.7}
GROUND = {"b1": 1.0, "b2": 0.0, "b3": 0.0, "b4": 1.0}


def test_a_fit_that_grew_a_mode_where_none_is_moves_it(tmp_path):
    """Of 48 simulated chains of three to five masses 20 were left far from the noise."""
    model = bh.chain(3, delay_s=2e-4, period_s=1e-3)
    values = MASSES | SPRINGS | GROUND
    truth = np.array([values[name] for name in model.names])
    frequency = np.geomspace(1.0, 400.0, 400)
    table = noisy_table(tmp_path, frequency, model.response(truth, frequency), 3e-4, seed=14)
    assert bh.least_squares(model, table).reduced_chi_square < 1.2


def test_a_fit_whose_motor_is_let_go_moves_no_mode(tmp_path):
    """A spring of nothing leaves modes in which the motor rests: its chain would have no masses."""
    model = bh.chain(2, delay_s=2e-4, period_s=1e-3)
    values = MASSES | SPRINGS | GROUND | {"kc": 1e-13, "bc": 1e-13}
    theta = np.array([values[name] for name in model.names])
    frequency = np.geomspace(1.0, 400.0, 400)
    table = noisy_table(tmp_path, frequency, model.response(theta, frequency), 3e-4, seed=14)
    for moved in (1, 2):
        starts = with_a_mode_moved(model, theta, moved, table)
        assert starts.shape[1] == len(theta) and np.all(np.isfinite(starts))
    assert np.isfinite(bh.least_squares(model, table, start=theta).theta).all()
