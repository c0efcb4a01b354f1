"""The critical stiffness read from a measurement without a model."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from linear_bench import LHIFAM_FREE, Device
from scipy.signal import chirp

from bayeshaptic.models import build_model
from bayeshaptic.recordings import join_recordings, recording_from_arrays
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.table_spectra import TableSpectra
from bayeshaptic.rig import Bench, simulate
from bayeshaptic.stability import critical_stiffness, etfe_critical_stiffness
from bayeshaptic.stability.from_etfe import _caveat, _runs
from bayeshaptic.stability.local_fit import LocalFit, local_fit, response_data

T = 1e-3


def table(response, frequency_hz, relative_sd, seed=0, force_unit="N"):
    """An ETFE from a table: `response` with complex normal noise of known size."""
    rng = np.random.default_rng(seed)
    sd = relative_sd * np.abs(response)
    noise = rng.standard_normal((2, len(frequency_hz))) * sd / np.sqrt(2)
    value = response + noise[0] + 1j * noise[1]
    averages = np.full(len(frequency_hz), np.inf)
    return Etfe(
        frequency_hz=frequency_hz,
        value=value,
        variance=sd**2,
        coherence=np.full(len(frequency_hz), np.nan),
        period_s=T,
        band_hz=(float(frequency_hz[0]), float(frequency_hz[-1])),
        force_unit=force_unit,
        position_unit="rad" if force_unit == "Nm" else "m",
        spectra=TableSpectra(frequency_hz, value, sd**2, averages),
    )


def model_table(name, device, relative_sd, low=1.0, high=300.0, seed=0, step=0.7, **changes):
    model = build_model(name, device)
    values = model.values.copy()
    for key, value in changes.items():
        values[model.names.index(key)] = value
    frequency = np.arange(low, high, step)
    response = model.response(values, frequency)
    unit = "Nm" if device == "phantom" else "N"
    return table(response, frequency, relative_sd, seed, unit), critical_stiffness(model, values)


@pytest.mark.parametrize(
    ("device", "name"),
    [("lhifam", "free"), ("lhifam", "grasped"), ("phantom", "free"), ("phantom", "grasped")],
)
def test_a_precise_measurement_gives_the_models_limit(device, name):
    etfe, limit = model_table(name, device, 1e-5, step=0.2)
    own = etfe_critical_stiffness(etfe)
    assert own.q05 < own.q50 < own.q95
    assert 20 * np.log10(own.q50 / limit.value) == pytest.approx(0, abs=0.004)
    assert own.frequency_hz == pytest.approx(limit.frequency_hz[0], rel=2e-3)
    assert own.unit == limit.unit
    assert own.reason is None and own.caveat is None


def test_the_interval_covers_the_truth():
    covered, errors, widths = 0, [], []
    for seed in range(40):
        etfe, limit = model_table("grasped", "phantom", 0.02, low=20.0, high=150.0, seed=seed)
        own = etfe_critical_stiffness(etfe, seed=seed, draws=1000)
        covered += own.q05 < limit.value < own.q95
        errors.append(np.log(own.q50 / limit.value))
        widths.append(np.log(own.q95 / own.q05) / 3.29)
    # 36 of 40 expected; 31 or fewer has a probability of 1.5 %.
    assert covered >= 32
    assert abs(np.mean(errors)) < 3 * np.std(errors) / np.sqrt(40)
    # As wide as the errors are (their spread is known to 11 %), and about a line's noise.
    assert 0.7 < np.std(errors) / np.median(widths) < 1.35
    assert np.median(widths) < 0.022


def test_a_recording_from_the_bench():
    bench = Bench.from_device("phantom", held=True)
    run = simulate(bench, seed=3)
    recording = Recording(run.force, run.position, T, force_unit="Nm", position_unit="rad")
    own = etfe_critical_stiffness(estimate_etfe(recording))
    truth = bench.true_critical_stiffness()
    assert own.q05 * 0.99 < truth < own.q95 * 1.01
    assert own.q95 / own.q05 < 1.1


def test_no_crossing_inside_the_band():
    etfe, _ = model_table("grasped", "phantom", 1e-3, low=20.0, high=50.0)
    own = etfe_critical_stiffness(etfe)
    assert (own.q05, own.q50, own.q95, own.frequency_hz) == (None, None, None, None)
    assert "does not reach -180 degrees between 20 and" in own.reason


def test_limit_below_the_band():
    etfe, limit = model_table("free", "lhifam", 1e-4, low=2.0, b1=0.01, b2=0.0)
    assert limit.frequency_hz[0] < 0.3
    own = etfe_critical_stiffness(etfe)
    assert own.q50 is None
    assert "beyond -180 degrees at" in own.reason


def test_noise_alone():
    etfe, _ = model_table("free", "lhifam", 3.0)
    own = etfe_critical_stiffness(etfe)
    assert own.q50 is None
    assert "too noisy" in own.reason


def test_a_crossing_hidden_by_noise_is_mentioned_but_not_counted():
    # The phase stays 0.4 degrees above -180 degrees near 10 Hz, with noise of 0.8 degrees a line.
    found = []
    for seed in range(12):
        etfe, limit = model_table("free", "lhifam", 0.02, low=4.0, high=200.0, seed=seed, b2=8.5)
        own = etfe_critical_stiffness(etfe)
        assert limit.frequency_hz[0] > 100
        assert own.q95 == pytest.approx(limit.value, rel=0.05)
        found.append(own.caveat is not None)
    assert any(found)


def test_the_phase_just_short_of_180_degrees_is_mentioned():
    """Within two standard deviations of -180 degrees, below the crossing that was read."""
    inverse = [-3 + 3j, -2 + 1j, -1.5 + 0.2j, -2 + 1j, -3 - 3j]
    fits = [
        SimpleNamespace(inverse=v, centre_hz=hz, covers=lambda margin: True)
        for v, hz in zip(inverse, range(5, 10), strict=True)
    ]
    near = _caveat(fits, np.array([30.0, 9, 1.5, 9, -30]), 2.4, "N/m")
    assert "near 7 Hz" in near and "1.5 N/m" in near
    assert _caveat(fits, np.array([30.0, 9, 3.5, 9, -30]), 2.4, "N/m") is None
    assert _caveat(fits, np.array([30.0, 9, 1.5, 9, -30]), 1.4, "N/m") is None
    # Far from all data no limit is told: 420 N/m were, of a gain of 1000 kN/m.
    vars(fits[2])["covers"] = lambda margin: False
    assert _caveat(fits, np.array([30.0, 9, 1.5, 9, -30]), 2.4, "N/m") is None


def test_a_fit_covers_what_its_data_are_about():
    etfe, _ = model_table("free", "lhifam", 0.02, low=4.0, high=200.0, seed=0, b2=8.5)
    data = response_data(etfe)
    assert local_fit(data, 50.0).covers(0.03) and not local_fit(data, 300.0).covers(0.03)


def test_weak_stretches_join_their_neighbours():
    side = np.array([9.0, 5, 1.5, -0.4, 0.7, 3, -0.9, -6, -8])
    runs, doubtful = _runs(side, 1.0)
    assert [(run.start, run.stop) for run in runs] == [(0, 6), (6, 9)]
    assert [run.strength for run in doubtful] == [-0.4]
    every, _ = _runs(side, 0.0)
    assert len(every) == 4
    one, _ = _runs(side, 100.0)
    assert [(run.start, run.stop, run.strength) for run in one] == [(0, 9, 9.0)]


def test_the_seed_decides_the_draws():
    etfe, _ = model_table("grasped", "phantom", 0.02, low=20.0, high=150.0)
    first, again, other = (etfe_critical_stiffness(etfe, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.samples, again.samples)
    assert not np.array_equal(first.samples, other.samples)


def test_draws_of_a_fit_whose_covariance_has_rounded_to_below_zero():
    rng = np.random.default_rng(3)
    root = rng.standard_normal((6, 3)) + 1j * rng.standard_normal((6, 3))
    covariance = root @ root.conj().T - 1e-13 * np.eye(6)
    with pytest.raises(np.linalg.LinAlgError):
        np.linalg.cholesky(covariance)
    fit = LocalFit(10.0, 0.2, True, 8.0, 12.0, np.full(6, 50.0 + 0j), covariance)
    count = 20_000
    drawn = fit.draws(rng, count, np.array([10.0]))[:, 0]
    wanted = covariance[0, 0].real
    # The mean of the squares of complex normal numbers: relative standard deviation 1/sqrt(count).
    assert np.mean(np.abs(drawn - 50) ** 2) == pytest.approx(wanted, rel=4 / np.sqrt(count))


@pytest.mark.parametrize("seed", range(4))
def test_a_line_that_sweeps_hardly_excite_does_not_bend_its_neighbours(seed):
    """Sweeps that begin again between two samples: sums of lines are known far better than each."""
    device = Device(LHIFAM_FREE)
    rng = np.random.default_rng(seed)
    samples = int(rng.uniform(6000, 9000))
    length = samples / rng.integers(4, 8)
    force = chirp((np.arange(samples) % length) * T, 0.5, length * T, 300.0)
    position = np.round(device.simulate(force) / 1.5e-6) * 1.5e-6
    units = {"force_unit": "N", "position_unit": "m"}
    data = response_data(
        estimate_etfe(recording_from_arrays(force=force, position=position, period_s=T, **units))
    )
    places = np.geomspace(3.0, 200.0, 140)
    fits = [fit for hz in places if (fit := local_fit(data, hz))]
    assert len(fits) > 100
    truth = device.response(np.array([fit.centre_hz for fit in fits]))
    wrong = np.array([fit.inverse for fit in fits]) * truth - 1
    # The worst of 140 complex errors: 6 standard deviations of each part have a chance of 2e-6;
    # with bent lines they were 15 to 290.
    assert np.max(np.abs(wrong) / [fit.relative_sd for fit in fits]) < 6


def test_pieces_whose_windows_are_the_same_leave_no_polynomial_free():
    """Below the second window of each: their quintics were of rounding, and 1/G was 1e-10."""
    device = Bench("rigid", {"m": 0.4, "b": 3.0}, delay_s=0.3e-3, encoder_resolution=1e-7)
    pieces = [
        simulate(device, np.random.default_rng(seed).standard_normal(3431), seed=seed)
        for seed in range(4)
    ]
    etfe = estimate_etfe(
        join_recordings(
            [recording_from_arrays(one.force, one.position, period_s=1e-3) for one in pieces]
        )
    )
    measured = np.abs(1 / etfe.value)
    places = np.geomspace(*etfe.band_hz, 100)
    fits = [fit for hz in places if (fit := local_fit(response_data(etfe), hz))]
    assert len(fits) > 80
    for fit in fits:
        assert 0.1 * measured.min() < abs(fit.inverse) < 10 * measured.max()
