"""Chains of masses: as many vibration modes as are asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import bayeshaptic as bh
from bayeshaptic.diagnosis.begun import base_model
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.errors import InputError
from bayeshaptic.inference.saved.archive import model_from_dict, model_to_dict
from bayeshaptic.models.chains import _as_chain
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


def test_modes_name_the_base_model():
    asked = Options(modes=2)
    assert [base_model("auto", replace(asked, modes=n)) for n in (None, 0, 1, 2)] == [
        "auto",
        "rigid",
        "free",
        "chain-2",
    ]
    for model, options in (("grasped", asked), ("auto", replace(asked, held=True))):
        with pytest.raises(InputError, match="nobody holds"):
            base_model(model, options)
    with pytest.raises(InputError, match="0 to 8"):
        base_model("auto", replace(asked, modes=9))
