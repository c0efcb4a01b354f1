"""Leakage of modes that ring on at the end of a short record."""

from __future__ import annotations

import numpy as np
import pytest
from linear_bench import LHIFAM_FREE, LHIFAM_HELD, PHANTOM_FREE, Device, tremor

import bayeshaptic as bh
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import compress

PERIOD, NOISE = 1e-3, 1e-7
SHARP = {**LHIFAM_FREE, "links": [(1.0, 55.3e3)]}  # damped by 0.5 %


def record(chain, seed, samples, tone=0.0):
    """White force, and a hand's; noise for counts, and a tone as high as so many times that."""
    rng, device = np.random.default_rng(seed), Device(chain)
    u = rng.standard_normal(samples)
    y = device.simulate(u) + NOISE * rng.standard_normal(samples)
    if device.n == 3:
        y += device.simulate(0.2 * tremor(rng, samples, PERIOD), 2)
    y += tone * NOISE * np.sin(2 * np.pi * 60.3 * PERIOD * np.arange(samples) + seed)
    return Recording(u, y, PERIOD)


def ringing(etfe):
    """Which windows have a pole, and the poles."""
    poles = etfe.spectra.ringing_hz
    if poles is None:
        return np.zeros(len(etfe.spectra.edges) - 1, bool), np.zeros(0)
    return ~np.isnan(poles), poles[~np.isnan(poles)]


def normalised(windows, response):
    """Mean squared deviation of each window from the truth, over its noise as the window says."""
    g = response(windows.frequency_hz)
    left = windows.target - np.einsum("wij,wj->wi", windows.design, g)
    return np.mean(np.abs(left) ** 2, axis=1) / (windows.scatter / (windows.lines - 4))


def test_its_pole_is_found_and_what_is_left_is_noise():
    device, squared, louder, blurred = Device(SHARP), [], [], []
    eigenvalue = np.log(np.linalg.eigvals(device.ad)) / PERIOD
    truth = eigenvalue[np.argmax(eigenvalue.imag)] / 2j / np.pi
    for seed in range(24):
        etfe = estimate_etfe(record(SHARP, seed, (2000, 3000, 5000, 8000)[seed % 4]))
        there, poles = ringing(etfe)
        line = etfe.spectra.frequency_hz[1] - etfe.spectra.frequency_hz[0]
        assert np.min(np.abs(poles - truth)) < 0.1 * line
        windows = compress(etfe, device.response)
        squared.extend(normalised(windows, device.response)[there])
        for which, found in ((louder, windows), (blurred, compress(etfe.blurred, device.response))):
            which.extend((found.scatter / (found.lines - 3))[there] / NOISE**2)
    # An F variable of 6 and some 20 degrees of freedom each: mean 1, sd 0.7.
    assert abs(np.mean(squared) - 1) < 4 * 0.7 / np.sqrt(len(squared)), np.mean(squared)
    assert np.median(louder) < 2 < 10 < np.median(blurred)


@pytest.mark.parametrize("chain", [LHIFAM_FREE, LHIFAM_HELD, PHANTOM_FREE])
def test_ordinary_devices_have_none(chain):
    for seed in range(4):
        etfe = estimate_etfe(record(chain, seed, 20000))
        assert etfe.spectra.ringing_hz is None and etfe.blurred is etfe


@pytest.mark.parametrize("tone", [3.0, 300.0])
def test_a_tone_is_none(tone):
    for seed in range(6):
        _, poles = ringing(estimate_etfe(record(LHIFAM_FREE, seed, 4000 + 900 * seed, tone)))
        assert not np.any(np.abs(poles - 60.3) < 1)


def test_a_fit_knows_a_limit_by_it():
    """The mode's own window says more than those beside it do: closer, and as the interval says."""
    errors, sharper = [], []
    for seed in range(6):
        etfe = estimate_etfe(record(SHARP, seed, 4000))
        model = bh.free(delay_s=0.2e-3, period_s=PERIOD)
        fits = [bh.least_squares(model, seen) for seen in (etfe, etfe.blurred)]
        kc = list(fits[0].model.names).index("kc")
        errors.append((fits[0].theta[kc] - 55.3e3) / fits[0].sd[kc])
        sharper.append(fits[1].sd[kc] / fits[0].sd[kc])
        assert not fits[0].misfits
    assert np.sqrt(np.mean(np.square(errors))) < 2 and np.median(sharper) > 1.5
