"""The ETFE: honest variances, bands from the data, periods, and what cannot be estimated."""

from __future__ import annotations

import numpy as np
import pytest
from linear_bench import (
    LHIFAM_FREE,
    PHANTOM_FREE,
    PHANTOM_HELD,
    Device,
    limited_noise,
    multisine,
    tremor,
)
from scipy.signal import butter, lfilter

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.estimators.random_excitation import points
from bayeshaptic.recordings.signals.excitation import Repetition, excited_lines, find_repetition
from bayeshaptic.recordings.signals.rounding import hidden_rounding

SYSTEMS = [
    pytest.param(LHIFAM_FREE, 1.0, 5e-7, id="lhifam-free"),
    pytest.param(PHANTOM_HELD, 0.02, 5e-5, id="phantom-held"),
]


def answer(device, force, rng, encoder, hand):
    """Position with encoder noise and a hand's tremor on the last mass."""
    samples = len(force)
    y = device.simulate(force) + encoder * rng.standard_normal(samples)
    return y + device.simulate(hand * tremor(rng, samples, device.period), device.n - 1)


def random_recording(chain, force, encoder, seed, samples=30000, period=1e-3, highest=200.0):
    device, rng = Device(chain, period), np.random.default_rng(seed)
    u = force * limited_noise(rng, samples, period, highest)
    return device, Recording(u, answer(device, u, rng, encoder, 0.2 * force), period)


def assert_unit_variance(squares, freedom):
    """The mean of |error|^2 / variance is 1 within four standard errors.

    The ratio of an exponential to an estimate of m degrees of freedom, scaled to the mean of one,
    has the variance m / (m - 2).
    """
    squares, freedom = np.concatenate(squares), np.concatenate(freedom)
    tolerance = 4 * np.sqrt(np.mean(freedom / (freedom - 2)) / len(squares))
    assert np.mean(squares) == pytest.approx(1, abs=tolerance)


@pytest.mark.parametrize(("chain", "force", "encoder"), SYSTEMS)
@pytest.mark.parametrize(
    ("samples", "period"), [(20000, 1e-3), (4000, 1e-3), (8000, 4e-3), (24000, 0.25e-3)]
)
def test_error_over_sd_has_unit_variance(chain, force, encoder, samples, period):
    squares, freedom = [], []
    for seed in range(8):
        device, recording = random_recording(
            chain, force, encoder, seed, samples, period, min(200, 0.4 / period)
        )
        etfe = estimate_etfe(recording)
        error = etfe.value - device.response(etfe.frequency_hz)
        squares.append(np.abs(error) ** 2 / etfe.variance)
        freedom.append(etfe.spectra.windows().lines - 3)
    assert_unit_variance(squares, freedom)


def test_a_plot_has_enough_points_and_a_long_recording_not_too_many():
    counts = [
        len(estimate_etfe(random_recording(LHIFAM_FREE, 1, 5e-7, 0, n)[1]).value)
        for n in (30000, 300000)
    ]
    assert 100 <= counts[0] <= counts[1] <= 200


def test_attributes_and_properties():
    device, recording = random_recording(LHIFAM_FREE, 1.0, 5e-7, 5)
    etfe = estimate_etfe(recording)
    truth = device.response(etfe.frequency_hz)
    assert etfe.gain_db == pytest.approx(20 * np.log10(np.abs(etfe.value)))
    good = etfe.relative_sd < 0.1
    lag = np.degrees(np.unwrap(np.angle(truth)))
    turn = np.round(np.median(etfe.phase_deg - lag)[None] / 360) * 360
    assert np.all(np.abs(etfe.phase_deg - lag - turn)[good] < 30)
    assert etfe.lines == len(etfe.spectra.frequency_hz) > 5900
    assert (etfe.kind, etfe.stiffness_unit) == ("translational", "N/m")
    assert etfe.recording is recording and etfe.period_lines is None
    assert etfe.band_hz == pytest.approx((0.7, 200), abs=0.05)
    assert [notice.topic for notice in etfe.notices] == ["band"]


def test_coherence_is_that_of_signal_and_noise():
    """White noise on a static response: coherence is signal over signal and noise."""
    rng = np.random.default_rng(6)
    u = rng.standard_normal(60000)
    y = np.concatenate([[0], u[:-1]]) + 0.5 * rng.standard_normal(60000)
    coherence = estimate_etfe(Recording(u, y, 1e-3)).coherence
    assert np.mean(coherence) == pytest.approx(1 / 1.25, abs=0.01)


def colour(order, corner, kind="low"):
    return lambda w: lfilter(*butter(order, corner, kind, fs=1000), w)


@pytest.mark.parametrize(
    ("shape", "low", "high"),
    [
        (lambda w: w, (0.69, 0.71), (400, 500)),
        (colour(10, 200), (0.69, 0.71), (195, 230)),
        (colour(1, 10), (0.69, 0.71), (300, 500)),
        (colour(4, [5, 50], "band"), (2.5, 5), (50, 75)),
    ],
    ids=["white", "to-200", "first-order", "band"],
)
def test_band_is_where_the_force_has_power(shape, low, high):
    rng, device = np.random.default_rng(7), Device(LHIFAM_FREE)
    u = shape(rng.standard_normal(30000))
    u = u / u.std()
    etfe = estimate_etfe(Recording(u, answer(device, u, rng, 5e-7, 0.05), 1e-3))
    assert low[0] <= etfe.band_hz[0] <= low[1]
    assert high[0] <= etfe.band_hz[1] <= high[1]


def test_band_ends_where_the_response_drowns():
    """White force and a coarse encoder: the band ends where the answer is lost in its noise."""
    rng, device = np.random.default_rng(8), Device(PHANTOM_FREE)
    u = 0.02 * rng.standard_normal(30000)
    noise = 2e-3
    etfe = estimate_etfe(Recording(u, answer(device, u, rng, noise, 0.0), 1e-3))
    ratio = np.abs(device.response(np.array(etfe.band_hz[1:]))) * 0.02 / noise
    assert 0.005 < ratio[0] ** 2 < 0.5


def test_given_band_is_kept_or_trimmed_to_the_force():
    _, recording = random_recording(LHIFAM_FREE, 1.0, 5e-7, 9)
    assert estimate_etfe(recording, (1.0, 150.0)).band_hz == pytest.approx((1, 150), abs=0.04)
    narrow = estimate_etfe(recording, (100.0, 120.0))
    assert len(narrow.value) >= 8
    wide = estimate_etfe(recording, (0.7, 400.0))
    assert wide.band_hz[1] < 210
    assert [notice.level for notice in wide.notices] == ["warning"]


def good():
    return random_recording(LHIFAM_FREE, 1.0, 5e-7, 10)[1]


def changed(force=None, position=None):
    recording = good()
    position = recording.position if position is None else position
    return Recording(recording.force if force is None else force, position, 1e-3, name="x.csv")


def with_nan():
    position = good().position.copy()
    position[5] = np.nan
    return changed(position=position)


NOISE = np.random.default_rng(11).standard_normal(30000)
SINE = np.sin(2 * np.pi * 5e-3 * np.arange(30000))


@pytest.mark.parametrize(
    ("recording", "band_hz", "says"),
    [
        (good, (200, 100), "0 < low < high"),
        (good, (0, 100), "0 < low < high"),
        (good, (1, 600), "Nyquist frequency, 500 Hz"),
        (good, (10, 12), "61 lines of the spectrum, and 192 are needed; record 96 s"),
        (good, (300, 400), "no power"),
        (lambda: good().part(0, 50), None, "50 samples (0.05 s) are too few"),
        (lambda: changed(force=np.ones(30000)), None, "the force is 1 in all 30000 samples"),
        (lambda: changed(position=np.zeros(30000)), None, "the position is 0 in all"),
        (lambda: changed(position=NOISE), None, "does not follow the force"),
        (
            lambda: changed(position=np.clip(NOISE, -0.1, 0.1)),
            None,
            "cut off at -0.1 or 0.1 m in 9",
        ),
        (lambda: changed(force=SINE), None, "the periodic force excites 1 lines"),
        (with_nan, None, "position is nan in sample 6"),
    ],
)
def test_what_cannot_be_estimated_is_refused_in_one_line(recording, band_hz, says):
    with pytest.raises(InputError) as error:
        estimate_etfe(recording(), band_hz)
    assert says in str(error.value) and "\n" not in str(error.value)


def test_what_is_shown_is_what_the_windows_of_the_spectra_say():
    """Windows are made again where their noise falls with the frequency alone."""
    rng = np.random.default_rng(8)
    force = limited_noise(rng, 20000, 1e-3, 200.0)
    device = Device(PHANTOM_HELD, 1e-3)
    wander = lfilter(*butter(4, 0.6, fs=1e3), rng.standard_normal(len(force)))
    position = device.simulate(force) + 0.3 * wander * device.simulate(force).std() / wander.std()
    etfe = estimate_etfe(Recording(force, position, 1e-3))
    slopes = etfe.spectra.noise_slope
    assert slopes.any() and not slopes.all()
    said = points(etfe.spectra.windows())
    np.testing.assert_allclose(etfe.value, said.value, rtol=1e-9)
    np.testing.assert_allclose(etfe.variance, said.variance, rtol=1e-9)


def test_narrow_windows_for_short_blocks():
    _, recording = random_recording(LHIFAM_FREE, 1.0, 5e-7, 12)
    block = estimate_etfe(recording.part(5000, 10000), (0.7, 200.0), minimum_lines=12)
    assert np.diff(block.spectra.edges).min() == 12
    assert np.diff(estimate_etfe(recording).spectra.edges).min() == 24
    with pytest.raises(InputError, match="at least 10"):
        estimate_etfe(recording, minimum_lines=6)


# Periodic excitation


def test_repetition_is_found_between_other_things():
    rng = np.random.default_rng(13)
    one = rng.standard_normal(1234)
    force = np.concatenate([rng.standard_normal(777), np.tile(one, 6), np.zeros(100)])
    assert find_repetition(force) == Repetition(777, 777 + 6 * 1234, 1234)
    noisy = force + 1e-5 * rng.standard_normal(len(force))
    assert find_repetition(noisy) == Repetition(777, 777 + 6 * 1234, 1234)
    assert find_repetition(np.round(force, 2)).period == 1234


@pytest.mark.parametrize("kind", ["white", "held", "low-pass", "steps", "once"])
def test_random_forces_do_not_repeat(kind):
    rng = np.random.default_rng(14)
    white = rng.standard_normal(10000)
    force = {
        "white": white,
        "held": np.repeat(white[:2000], 5),
        "low-pass": colour(2, 5)(white),
        "steps": np.repeat(np.sign(white[:1000]), 10),
        "once": np.concatenate([white[:6000], white[:4000]]),
    }[kind]
    assert find_repetition(force) is None


def test_excited_lines():
    rng = np.random.default_rng(15)
    harmonics = np.array([3, 4, 9, 50])
    assert np.array_equal(excited_lines(multisine(rng, 400, harmonics) + 7), harmonics)


def periodic_recording(device, force, encoder, seed, periods, hand=0.2, lead=0, drift=0.0):
    rng = np.random.default_rng(seed)
    one = force * multisine(rng, 2000, np.arange(2, 400))
    u = np.concatenate([force * rng.standard_normal(lead), np.tile(one, periods)])
    y = answer(device, u, rng, encoder, hand * force)
    return Recording(u, y + drift * np.arange(len(u)) * device.period, device.period)


@pytest.mark.parametrize(("chain", "force", "encoder"), SYSTEMS)
@pytest.mark.parametrize(("periods", "drift", "lead"), [(2, 0, 0), (4, 0.1, 0), (20, 0.1, 321)])
def test_periodic_error_over_sd_has_unit_variance(chain, force, encoder, periods, drift, lead):
    device, squares, freedom = Device(chain), [], []
    for seed in range(6):
        recording = periodic_recording(
            device, force, encoder, seed, periods, drift=drift, lead=lead
        )
        etfe = estimate_etfe(recording)
        assert etfe.period_lines == len(etfe.value) <= 398
        error = etfe.value - device.response(etfe.frequency_hz)
        squares.append(np.abs(error) ** 2 / etfe.variance)
        freedom.append(etfe.spectra.freedom - 1)
    # With two periods neighbouring lines share their noise estimate: fewer independent values.
    share = 10 if periods == 2 else 4
    assert_unit_variance([np.concatenate(squares)[::share]], [np.concatenate(freedom)[::share]])


@pytest.mark.parametrize(("chain", "force", "encoder"), SYSTEMS)
def test_two_periods_of_thousands_of_tones_are_read_in_windows(chain, force, encoder):
    """A window a tone cost minutes: of two sweeps of 6,082 lines no report ended within 400 s."""
    device, squares, freedom = Device(chain), [], []
    for seed in range(4):
        rng = np.random.default_rng(200 + seed)
        u = np.tile(force * multisine(rng, 10000, np.arange(5, 3300)), 2)
        recording = Recording(u, answer(device, u, rng, encoder, 0.2 * force), device.period)
        etfe = estimate_etfe(recording)
        assert etfe.period_lines is None and len(etfe.value) < 400
        error = etfe.value - device.response(etfe.frequency_hz)
        squares.append(np.abs(error) ** 2 / etfe.variance)
        freedom.append(etfe.spectra.windows().lines - 3)
    assert_unit_variance(squares, freedom)


@pytest.mark.parametrize("applied", [False, True])
@pytest.mark.parametrize("periods", [2, 5])
def test_noise_of_a_force_that_repeats_is_noise_of_the_response(periods, applied):
    """Of the force's sensor, and of the amplifier, which the device answers to."""
    device, squares, freedom = Device(LHIFAM_FREE), [], []
    for seed in range(6):
        rng = np.random.default_rng(100 + seed)
        repeats = np.tile(multisine(rng, 2000, np.arange(2, 400)), periods)
        noisy = repeats + 0.1 * repeats.std() * rng.standard_normal(len(repeats))
        position = answer(device, noisy if applied else repeats, rng, 5e-7, 0.0)
        etfe = estimate_etfe(Recording(noisy, position, device.period))
        assert etfe.period_lines
        error = etfe.value - device.response(etfe.frequency_hz)
        squares.append(np.abs(error) ** 2 / etfe.variance)
        freedom.append(etfe.spectra.freedom - 1)
    share = 10 if periods == 2 else 4
    assert_unit_variance([np.concatenate(squares)[::share]], [np.concatenate(freedom)[::share]])


def test_transient_periods_are_dropped_and_said():
    """A mode with a time constant of 0.4 s rings through the first periods of 0.5 s."""
    chain = {"masses": [1.0], "ground": [(5.0, 4e3)], "links": []}
    device, rng = Device(chain), np.random.default_rng(16)
    u = np.tile(multisine(rng, 500, np.arange(1, 100)), 30)
    y = device.simulate(u) + 1e-6 * rng.standard_normal(len(u))
    etfe = estimate_etfe(Recording(u, y, 1e-3))
    # It has to fall below the noise, by 0.4 s times log(amplitude over noise).
    assert 3 <= 30 - etfe.spectra.periods <= 12
    assert f"the first {30 - etfe.spectra.periods} are transient" in etfe.notices[0].text
    truth = device.response(etfe.frequency_hz)
    assert np.mean(np.abs(etfe.value - truth) ** 2 / etfe.variance) < 1.3


def test_two_periods_carry_a_warning():
    etfe = estimate_etfe(periodic_recording(Device(LHIFAM_FREE), 1.0, 5e-7, 17, 2))
    assert "warning" in {notice.level for notice in etfe.notices}


@pytest.mark.parametrize("noise", [0.0, 0.15])
@pytest.mark.parametrize("step", [0.2, 0.5, 2.0])
def test_rounding_of_a_slow_motion_is_no_white_noise(step, noise):
    """Against rounding simulated, at lines below a tenth of the Nyquist frequency."""
    rng, periods, samples = np.random.default_rng(21), 4, 8000
    lines, ours, simulated = np.arange(20, 400), [], []
    for _ in range(6):
        motion = multisine(rng, samples, np.arange(1, 400))
        motion *= step / np.diff(motion).std()
        seen = np.round(motion + noise * rng.standard_normal((periods, samples)))
        smooth = np.round(motion + noise * rng.standard_normal((100, samples))).mean(axis=0)
        error = np.fft.rfft(smooth - motion)[lines]
        simulated.append(periods * np.mean(np.abs(error) ** 2) / samples)
        ours.append(np.mean(hidden_rounding(seen, lines, 1.0)))
    # 2280 squares, of neighbours that share some of their error; and a hundredth of the noise.
    assert np.mean(ours) == pytest.approx(np.mean(simulated), rel=0.15)


def test_exactly_repeated_counts_have_a_variance():
    """Without noise the periods agree to the last count; the rounding shows all the same."""
    device, count = Device(LHIFAM_FREE), 3e-6
    chain = {"masses": [5.0], "ground": [(200.0, 5e4)], "links": []}
    device = Device(chain)
    recording = periodic_recording(device, 1.0, 0.0, 19, 10, hand=0.0)
    rounded = Recording(recording.force, np.round(recording.position / count) * count, 1e-3)
    etfe = estimate_etfe(rounded)
    error = etfe.value - device.response(etfe.frequency_hz)
    assert 0.5 < np.mean(np.abs(error) ** 2 / etfe.variance) < 1.5


def test_measured_two_mass_bench(measured):
    from scipy.io import loadmat

    data = loadmat(measured("two_mass_bench/MultisineTypeA.mat"))
    force, position = data["iq_refx"].ravel(), data["theta_mx"].ravel()
    etfe = estimate_etfe(Recording(force, position, 4e-4, "A", "rad"))
    assert np.allclose(etfe.frequency_hz, np.arange(11, 251))
    assert etfe.period_lines == 240
    assert 15 <= etfe.spectra.periods < 20
    assert "20 whole periods" in etfe.notices[0].text
    assert np.median(etfe.relative_sd) < 0.006
    assert etfe.stiffness_unit == "A/rad"
