"""The windows of the likelihood: their algebra, calibration and information."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from linear_bench import LHIFAM_FREE, LHIFAM_HELD, PHANTOM_HELD, RIGID, Device, tremor_density
from scale_and_delay import PERIOD, cramer_rao, record, scale_and_delay
from scipy.stats import chi2, f, kstest

from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import TableSpectra, compress
from bayeshaptic.recordings.response.local_polynomial import NODES, interpolation, window_edges
from bayeshaptic.recordings.response.window_reference import fit_local_rational, unit_mass


def test_windows_equal_dense_least_squares():
    """s0 + |z - R g|^2 is what least squares over the leakage leaves of Y - U B g."""
    rng = np.random.default_rng(1)
    device = Device(LHIFAM_HELD)
    etfe = estimate_etfe(record(device, rng, 8000))
    spectra, windows = etfe.spectra, compress(etfe, device.response)
    assert len(set(np.diff(spectra.edges))) > 5
    g = device.response(windows.frequency_hz) * np.exp(0.1 * rng.standard_normal((1, 3)))
    short = np.sum(np.abs(windows.target - np.einsum("wij,wj->wi", windows.design, g)) ** 2, axis=1)
    for w, (start, stop) in enumerate(zip(spectra.edges[:-1], spectra.edges[1:], strict=True)):
        f, x = spectra.frequency_hz[start:stop], np.linspace(-1, 1, stop - start)
        assert windows.frequency_hz[w] == pytest.approx(np.interp(NODES, x, f), rel=1e-12)
        ratio = interpolation(x) @ (g[w] / device.response(windows.frequency_hz[w]))
        rest = spectra.position[start:stop] - spectra.force[start:stop] * (
            device.response(f) * ratio
        )
        leakage = np.stack([x**0, x, x**2, f[0] / f, (f[0] / f) ** 2], axis=1)
        weight = (f / windows.frequency_hz[w, 1]) ** (spectra.noise_slope[w] / 2)
        rest, leakage = weight * rest, weight[:, None] * leakage
        rest = rest - leakage @ np.linalg.lstsq(leakage, rest, rcond=None)[0]
        assert windows.scatter[w] + short[w] == pytest.approx(np.sum(np.abs(rest) ** 2), rel=1e-7)
        assert windows.lines[w] == stop - start - 5


def test_leakage_and_a_parabola_are_represented_exactly():
    """Offset, drift, and a response that is a parabola times the reference leave nothing."""
    rng = np.random.default_rng(2)
    etfe = estimate_etfe(record(Device(RIGID), rng, 8000))
    f = etfe.spectra.frequency_hz
    truth = unit_mass(f) * (1 + 1e-3 * f + 1e-5j * f**2)
    exact = truth * etfe.spectra.force + 1e-3 + 1e-3 / f + 1e-3j / f**2
    spectra = type(etfe.spectra)(f, etfe.spectra.force, exact, etfe.spectra.edges, 0.0, unit_mass)
    windows = spectra.windows()
    g = np.linalg.solve(windows.design, windows.target[..., None])[..., 0]
    nodes = windows.frequency_hz
    expected = unit_mass(nodes) * (1 + 1e-3 * nodes + 1e-5j * nodes**2)
    assert np.max(np.abs(g / expected - 1)) < 1e-6
    assert np.all(windows.scatter < 1e-12 * np.sum(np.abs(windows.target) ** 2, axis=1))


def test_more_columns_than_lines_leave_rows_of_zeros():
    """Slopes of a motion in all parameters of a chain are more than a short window has lines."""
    rng = np.random.default_rng(5)
    spectra = estimate_etfe(record(Device(RIGID), rng, 8000)).spectra
    widest = int(np.diff(spectra.edges).max())
    inputs = rng.normal(size=(widest, len(spectra.frequency_hz), 2)) @ [1, 1j]
    few, many = spectra.windows(), spectra.windows(inputs=inputs)
    assert many.design.shape[1:] == (widest + 3, widest + 3)
    left = (np.sum(np.abs(w.target) ** 2, axis=1) + w.scatter for w in (few, many))
    assert next(left) == pytest.approx(next(left), rel=1e-9)
    assert not many.design[:, widest:].any() and not many.target[:, widest:].any()


@pytest.mark.parametrize("seconds", [2.0, 30.0, 300.0])
@pytest.mark.parametrize("minimum", [12, 24])
def test_window_edges(seconds, minimum):
    frequency = np.arange(int(0.7 * seconds) + 1, int(200 * seconds)) / seconds
    edges = window_edges(frequency, minimum)
    width = np.diff(edges)
    assert edges[0] == 0 and edges[-1] == len(frequency)
    assert np.all(width >= minimum)
    # The last window also takes what is left over, less than a window.
    wide = np.log10(frequency[edges[1:] - 1] / frequency[edges[:-1]])[:-1]
    inner = width[:-1]
    assert np.all((inner == minimum) | (wide < 1 / 80) | ((wide < 1 / 25) & (inner <= 24)))
    assert len(width) < 240


@pytest.mark.parametrize(
    ("chain", "force", "encoder", "hand"),
    [
        (RIGID, 1.0, 2e-5, 0.0),
        (LHIFAM_FREE, 1.0, 5e-7, 0.2),
        (LHIFAM_HELD, 1.0, 5e-7, 0.2),
        (PHANTOM_HELD, 0.02, 5e-5, 0.2),
    ],
    ids=["rigid-white", "lhifam-free-tremor", "lhifam-held-tremor", "phantom-held-tremor"],
)
def test_pulls_have_unit_rms_and_widths_are_near_cramer_rao(chain, force, encoder, hand):
    """With the true response as reference and a free scale and delay.

    The sum of squares of 2 x 30 pulls is chi-square but for a probability of 1e-3.
    """
    device, pulls, widths = Device(chain), [], []
    for seed in range(30):
        recording = record(device, np.random.default_rng(seed), 12000, force, encoder, hand)
        etfe = estimate_etfe(recording)
        theta, sd = scale_and_delay(compress(etfe, device.response), device.response)

        def density(frequency):
            hands = np.abs(device.response(frequency, device.n - 1)) ** 2
            noise = (hand * force) ** 2 * tremor_density(frequency, PERIOD)
            return hands * noise + encoder**2

        pulls.append(theta / sd)
        widths.append(sd / cramer_rao(recording, etfe.band_hz, device.response, density))
    total = np.sum(np.square(pulls))
    assert chi2.ppf(5e-4, 60) < total < chi2.ppf(1 - 5e-4, 60), np.sqrt(total / 60)
    # A rigid device in white noise is known from its lowest lines, where leakage costs most.
    limit = 1.15 if hand else 1.5
    assert np.all(np.median(widths, axis=0) < limit), np.median(widths, axis=0)


def test_noise_that_falls_steeply_in_the_lowest_window_is_no_misfit():
    """A hand that wanders: noise with power 8 of the frequency, where windows span an octave.

    Deviation over scatter at the truth is an F variable, in the lowest window too.
    """
    device, ratios = Device(LHIFAM_HELD), []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        recording = record(device, rng, 20000, hand=0.0)
        corner = np.fft.rfftfreq(20000 * 2, PERIOD) / 0.3
        wander = np.fft.irfft(np.fft.rfft(rng.normal(size=40000)) / np.sqrt(1 + corner**8))[:20000]
        moved = device.simulate(0.5 * wander / wander.std(), device.n - 1)
        recording = replace(recording, position=recording.position + moved)
        etfe = estimate_etfe(recording)
        windows = compress(etfe, device.response)
        short = windows.target - np.einsum(
            "wij,wj->wi", windows.design, device.response(windows.frequency_hz)
        )
        power = np.mean(np.abs(short) ** 2, axis=1) / windows.scatter * (windows.lines - 3)
        ratios.append(f.sf(power[0], 6, 2 * (windows.lines[0] - 3)))
    assert kstest(ratios, "uniform").pvalue > 1e-3, np.sort(ratios)[:5]
    assert min(ratios) > 1e-4


@pytest.mark.parametrize("chain", [LHIFAM_FREE, LHIFAM_HELD], ids=["free", "held"])
def test_default_reference_loses_little(chain):
    """Against the true response as reference: at most 5 % of the width, no bias to speak of."""
    device = Device(chain)
    for seed in range(3):
        etfe = estimate_etfe(record(device, np.random.default_rng(seed), 20000))
        best, best_sd = scale_and_delay(compress(etfe, device.response), device.response)
        theta, sd = scale_and_delay(compress(etfe), device.response)
        assert np.all(sd < 1.05 * best_sd), sd / best_sd
        assert np.all(np.abs(theta - best) < 0.5 * best_sd)


def test_default_reference_follows_a_sharp_resonance():
    """A mode with 0.5 % damping: the windows leave little more than with the true reference."""
    sharp = {**LHIFAM_FREE, "links": [(1.0, 55.3e3)]}
    device = Device(sharp)
    etfe = estimate_etfe(record(device, np.random.default_rng(1), 30000))
    best, own = compress(etfe, device.response), compress(etfe)
    plain = compress(etfe, unit_mass)
    mode = np.abs(best.frequency_hz[:, 1] - 86) < 10
    excess = [np.max(w.scatter[mode] / best.scatter[mode]) for w in (plain, own)]
    assert excess[0] > 10 and excess[1] < 1.5


def test_local_reference_changes_where_the_windows_do():
    etfe = estimate_etfe(record(Device(LHIFAM_FREE), np.random.default_rng(1), 9000))
    inner = etfe.spectra.edges[1:-1]
    between = (etfe.spectra.frequency_hz[inner - 1] + etfe.spectra.frequency_hz[inner]) / 2
    local = fit_local_rational(compress(etfe, unit_mass))
    assert local.edges_hz == pytest.approx(between, rel=1e-12)


def test_windows_that_no_force_moves_have_the_plain_reference():
    """Also where all windows around are such: a fit to nothing is zero, and no reference."""
    etfe = estimate_etfe(record(Device(LHIFAM_FREE), np.random.default_rng(1), 9000))
    windows = compress(etfe, unit_mass)
    dead = np.arange(len(windows.lines)) < 8
    nothing = replace(
        windows,
        design=windows.design * ~dead[:, None, None],
        target=windows.target * ~dead[:, None],
    )
    local = fit_local_rational(nothing)
    surely = windows.frequency_hz[:6]  # five windows are fitted together
    assert local(surely) == pytest.approx(unit_mass(surely), rel=1e-12)
    assert np.abs(local(windows.frequency_hz) / unit_mass(windows.frequency_hz)).min() > 0


def test_offset_and_drift_change_nothing():
    device = Device(LHIFAM_FREE)
    recording = record(device, np.random.default_rng(3), 30000)
    ramp = 1 + 0.01 * PERIOD * np.arange(recording.samples)
    moved = Recording(recording.force, recording.position + ramp, PERIOD)
    estimates = [
        scale_and_delay(compress(estimate_etfe(r), device.response), device.response)
        for r in (recording, moved)
    ]
    assert np.all(np.abs(estimates[1][0] - estimates[0][0]) < 0.01 * estimates[0][1])
    assert estimates[1][1] == pytest.approx(estimates[0][1], rel=1e-3)


def test_further_inputs_are_columns_of_the_design():
    """A known motion added to the position comes back with its coefficient."""
    rng, device = np.random.default_rng(4), Device(RIGID)
    recording = record(device, rng, 20000)
    extra = device.simulate(rng.standard_normal(20000))
    plus = Recording(recording.force, recording.position + 0.3 * extra, PERIOD)
    etfe = estimate_etfe(plus, (1.0, 200.0))
    lines = np.searchsorted(np.fft.rfftfreq(20000, PERIOD), etfe.spectra.frequency_hz - 1e-6)
    column = np.fft.rfft(extra)[lines] / np.sqrt(20000)
    windows = compress(etfe, device.response, column[None])
    assert windows.inputs == 1 and windows.design.shape[1:] == (4, 4)
    solved = np.linalg.solve(windows.design, windows.target[..., None])[..., 0]
    sd = np.sqrt(windows.scatter / (windows.lines - 4)) / np.abs(windows.design[:, 3, 3])
    mean = np.sum(solved[:, 3].real / sd**2) / np.sum(sd**-2)
    assert mean == pytest.approx(0.3, abs=4 / np.sqrt(2 * np.sum(sd**-2)))


def test_table_windows_give_the_gaussian_or_student_likelihood():
    frequency, value = np.array([1.0, 2.0]), np.array([1 + 1j, 2.0])
    variance, averages = np.array([0.04, 0.09]), np.array([np.inf, 16.0])
    etfe = SimpleNamespace(spectra=TableSpectra(frequency, value, variance, averages))
    windows = compress(etfe)
    error = np.array([0.3, 0.2j])
    log_p = -(windows.lines - 1) * np.log1p(np.abs(error) ** 2 / windows.scatter)
    assert log_p[0] == pytest.approx(-(0.3**2) / 0.04, rel=1e-5)
    assert log_p[1] == pytest.approx(-15 * np.log1p(0.2**2 / (15 * 0.09)))
    assert windows.frequency_hz.shape == (2, 1) and windows.design.shape == (2, 1, 1)
