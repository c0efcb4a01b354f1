"""Noise of the force itself, which a device that changes does not make."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, sosfilt, sosfiltfilt
from test_wandering_mode import DELAY, KC, T, fitted, limit_of, recorded, step_of

import bayeshaptic as bh
from bayeshaptic.diagnosis.residuals import excess
from bayeshaptic.recordings.from_arrays import recording_from_arrays
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.report.headline import headline

COUNT = 1e-6
RNG = np.random.default_rng(11)


def played(force: np.ndarray, plays: np.ndarray, parts: int = 1) -> Recording:
    """A recording of a command, of which each part of a period played something else."""
    by_state, by_force = step_of(KC, T / parts)
    late = np.concatenate([np.zeros(parts), plays])
    state, position = np.zeros(4), np.empty(len(force))
    for step in range(len(plays)):
        if step % parts == 0:
            position[step // parts] = state[0]
        state = by_state @ state + by_force * late[step]
    position = COUNT * np.round(position / COUNT)
    return recording_from_arrays(force=force, position=position, period_s=T)


def coarse(force: np.ndarray) -> Recording:
    return played(force, 0.1 * np.round(force / 0.1))


def hissing(force: np.ndarray) -> Recording:
    """An amplifier whose noise falls as 1/f."""
    frequency = np.maximum(np.fft.rfftfreq(len(force)), 1 / len(force))
    noise = np.fft.irfft(
        np.fft.rfft(RNG.standard_normal(len(force))) / np.sqrt(frequency), len(force)
    )
    return played(force, force + 0.05 * noise / noise.std())


def late(force: np.ndarray) -> Recording:
    """Each command begins up to three tenths of a period early or late."""
    parts = 10
    begins = np.arange(len(force)) * parts + RNG.integers(-3, 4, len(force))
    begins[0] = 0
    lasts = np.diff(begins, append=len(force) * parts)
    return played(force, np.repeat(force, lasts), parts)


@pytest.mark.parametrize(
    ("make", "rms", "falls"), [(coarse, 0.1 / np.sqrt(12), 0.0), (hissing, 0.05, 1.0)]
)
def test_noise_of_the_force_is_none_of_the_device(make, rms: float, falls: float) -> None:  # type: ignore[no-untyped-def]
    fit, etfe = fitted(make(RNG.standard_normal(20_000)))
    (found,) = excess.excess_noise_test(fit, etfe)
    assert not found.flagged
    noise = excess.noise_besides(fit, etfe)
    assert noise is not None and noise.falls == pytest.approx(falls, abs=0.3)
    lines = np.fft.rfftfreq(20_000, T)[1:]
    assert np.sqrt(noise.power(lines).mean()) == pytest.approx(rms, rel=0.15)


@pytest.mark.parametrize("wander", [0.02, 0.05, 0.1])
def test_a_mode_that_wanders_is_no_noise_of_the_force(wander: float) -> None:
    fit, etfe = fitted(recorded(wander))
    assert excess.noise_besides(fit, etfe) is None
    assert excess.excess_noise_test(fit, etfe)[0].flagged


def test_a_mode_that_wanders_is_seen_beside_it() -> None:
    """Noise of the force hides no more of a mode than its own share of the response."""
    steady = coarse(RNG.standard_normal(20_000))
    wandering = recorded(0.1)
    noise = steady.position - played(steady.force, steady.force).position
    both = recording_from_arrays(
        force=wandering.force, position=wandering.position + noise, period_s=T
    )
    fit, etfe = fitted(both)
    assert excess.noise_besides(fit, etfe) is None
    assert excess.excess_noise_test(fit, etfe)[0].flagged


def test_friction_that_holds_a_mass_is_no_noise_of_the_force() -> None:
    """As loud as the command: whatever it is, it is not taken for an amplifier's."""
    force = RNG.standard_normal(20_000)
    fit, etfe = fitted(played(force, force + 0.5 * RNG.standard_normal(20_000)))
    assert excess.noise_besides(fit, etfe) is None
    assert excess.excess_noise_test(fit, etfe)[0].flagged


@pytest.mark.parametrize("make", [coarse, late])
def test_the_limit_stays_and_the_page_names_the_noise(make) -> None:  # type: ignore[no-untyped-def]
    result = bh.close_loop(
        make(np.random.default_rng(4).standard_normal(12_000)), bh.free(delay_s=DELAY, period_s=T)
    )
    truth = limit_of(KC)
    limit = result.analysis.limit
    assert result.verdict == "consistent"
    assert limit.quantile(0.01) < truth < limit.quantile(0.99)
    head = headline(result)
    assert head.status == "safe" and 0.8 * truth < head.stiffness < truth
    (notice,) = [one for one in result.analysis.notices if one.topic == "noise of the force"]
    assert notice.level == "note" and "white" in notice.text


@pytest.mark.parametrize("wander", [0.0, 0.1])
def test_noise_that_was_smoothed_away_is_no_floor(wander: float) -> None:
    """Above a force of a band positions hold what a filter left: not the noise within the band."""
    force = sosfilt(butter(4, 150, fs=1 / T, output="sos"), RNG.standard_normal(20_000))
    raw = played(force, force)
    if wander:
        raw = recorded(wander, force=force)
    smooth = sosfiltfilt(butter(2, 200, fs=1 / T, output="sos"), raw.position)
    for position in (raw.position, smooth):
        recording = recording_from_arrays(force=force, position=position, period_s=T)
        (found,) = excess.excess_noise_test(*fitted(recording))
        assert found.flagged == (wander > 0)


def test_a_hand_is_no_louder_than_slower_windows_leave_it() -> None:
    """Where a motor hardly moves the position any motion is a large force: told of no hand."""
    hertz = np.geomspace(10, 200, 60)
    falls = 1e-3 * (45 / hertz) ** 4
    stands_still = (hertz > 38) & (hertz < 42)
    hand = excess._of_the_hand(hertz, np.where(stands_still, 1e3 * falls, falls))
    fast = hertz > 45
    # Of three windows together those of a steep fall have 5 % more than the middle one.
    np.testing.assert_allclose(hand[fast], falls[fast], rtol=0.1)
    assert np.all(hand[hertz < 30] == 0)
