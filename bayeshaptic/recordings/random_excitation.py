"""ETFE of a recording with random excitation: windows of DFT lines of the whole record."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.excitation import driven_range, responds_until
from bayeshaptic.recordings.local_polynomial import window_edges
from bayeshaptic.recordings.points import Points
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.reference import fit_local_rational, unit_mass
from bayeshaptic.recordings.spectra import RandomSpectra
from bayeshaptic.recordings.windows import Windows

FEWEST_WINDOWS = 8
# The lowest window then spans a factor 2.14: for 30 s and 24 lines, 0.7 to 1.5 Hz.
LOW_END_WINDOWS = 0.875
# Slower than this a hand wanders more than it answers; the paper's lowest frequency too.
LOWEST_HZ = 0.3
# A rational reference must explain a window better than chance does with its two more terms.
BETTER = 10.0


def default_minimum_lines(duration_s: float) -> int:
    """Lines in the narrowest window: 24, but 12 where 24 would be wider than 2.4 Hz."""
    return 24 if duration_s >= 10 else 12


def estimate_random(
    recording: Recording, band_hz: tuple[float, float] | None, minimum_lines: int | None
) -> tuple[RandomSpectra, Points, tuple[Notice, ...]]:
    """Spectra, and what a person sees, of a recording with random excitation.

    Parameters
    ----------
    recording : Recording
    band_hz : (low, high) or None
        Chosen from the data when None.
    minimum_lines : int or None

    Raises
    ------
    InputError
        When there are too few lines for `FEWEST_WINDOWS` windows, or no response.
    """
    minimum = minimum_lines or default_minimum_lines(recording.duration_s)
    notices: tuple[Notice, ...] = ()
    if band_hz is None:
        everything = _spectra(recording, _widest(recording, minimum), minimum)
        band_hz = _choose_band(everything, recording)
        notices = (
            Notice(
                "note",
                "band",
                f"Band {band_hz[0]:.3g} to {band_hz[1]:.4g} Hz, chosen where the force has power "
                "and the position answers it.",
            ),
        )
    spectra = _with_reference(_spectra(recording, band_hz, minimum))
    return spectra, points(spectra.windows()), notices


def points(windows: Windows) -> Points:
    """Response, variance and coherence at the centre of each window.

    The variance comes from the window's scatter, which has n - 3 complex degrees of freedom; the
    coherence is the multiple coherence of the three columns, corrected for their number.
    """
    inverse = np.linalg.pinv(windows.design, rcond=1e-10)[:, 1]
    value = np.einsum("wk,wk->w", inverse, windows.target)
    noise = windows.scatter / (windows.lines - 3)
    total = windows.scatter + np.sum(np.abs(windows.target) ** 2, axis=1)
    return Points(
        frequency_hz=windows.frequency_hz[:, 1],
        value=value,
        variance=noise * np.sum(np.abs(inverse) ** 2, axis=1),
        coherence=np.clip(1 - noise * windows.lines / total, 0, 1),
    )


def _widest(recording: Recording, minimum: int) -> tuple[float, float]:
    low = max(LOWEST_HZ, LOW_END_WINDOWS * minimum / recording.duration_s)
    return low, 0.5 / recording.period_s


def _choose_band(spectra: RandomSpectra, recording: Recording) -> tuple[float, float]:
    windows = spectra.windows()
    power = np.add.reduceat(np.abs(spectra.force) ** 2, spectra.edges[:-1])
    low, high = driven_range(windows.frequency_hz[:, 1], power / np.diff(spectra.edges))
    # Share of the power explained, against what three columns explain of noise.
    n = windows.lines
    explained = np.sum(np.abs(windows.target) ** 2, axis=1)
    share = explained / (explained + windows.scatter)
    excess = (share - 3 / n) / np.sqrt(3 * (n - 3) / (n**2 * (n + 1)))
    last = responds_until(excess[low : high + 1])
    if last is None:
        raise InputError(
            f"{recording.name}: the position does not follow the force at any frequency; check "
            "which column is which, or record with more force"
        )
    high = low + last
    lines = slice(spectra.edges[low], spectra.edges[high + 1])
    level = power[max(high - 1, low)] / np.diff(spectra.edges)[max(high - 1, low)]
    driven = np.flatnonzero(np.abs(spectra.force[lines]) ** 2 > level / 20)
    frequency = spectra.frequency_hz[lines]
    return float(frequency[0]), float(frequency[driven[-1]])


def _spectra(recording: Recording, band_hz: tuple[float, float], minimum: int) -> RandomSpectra:
    samples = recording.samples
    frequency = np.fft.rfftfreq(samples, recording.period_s)
    # The last line of an even record, at the Nyquist frequency, is real: not one like the others.
    usable = (samples - 1) // 2
    first, last = np.searchsorted(frequency, np.array(band_hz) * (1 + np.array([-1e-9, 1e-9])))
    lines = slice(max(first, 1), min(last, usable + 1))
    # Eight windows in a narrow band, too.
    decades = min(1 / 80, 0.99 * np.log10(band_hz[1] / band_hz[0]) / FEWEST_WINDOWS)
    edges = window_edges(frequency[lines], minimum, decades)
    if len(edges) <= FEWEST_WINDOWS:
        raise InputError(_too_short(recording, band_hz, minimum, len(frequency[lines])))
    position = _detrended(recording.position)
    scale = 1 / np.sqrt(samples)
    return RandomSpectra(
        frequency_hz=frequency[lines],
        force=np.fft.rfft(recording.force - recording.force.mean())[lines] * scale,
        position=np.fft.rfft(position)[lines] * scale,
        edges=edges,
        floor=float(np.finfo(float).eps * np.max(np.abs(recording.position))) ** 2,
        reference=unit_mass,
    )


def _too_short(recording: Recording, band_hz: tuple[float, float], minimum: int, lines: int) -> str:
    """What to say when the band holds too few lines."""
    needed = FEWEST_WINDOWS * minimum
    where = f"{recording.name}: {recording.samples} samples ({recording.duration_s:.3g} s)"
    if lines and band_hz[1] < 0.5 / recording.period_s:
        width = needed / recording.duration_s
        return (
            f"{where} have {lines} DFT lines in the band {band_hz[0]:g} to {band_hz[1]:g} Hz, "
            f"{needed} are needed; widen the band to {width:.3g} Hz or record "
            f"{needed / (band_hz[1] - band_hz[0]):.3g} s"
        )
    seconds = (FEWEST_WINDOWS + LOW_END_WINDOWS) * minimum / band_hz[1]
    return f"{where} are too few for a frequency response; record at least {seconds:.2g} s"


def _with_reference(spectra: RandomSpectra) -> RandomSpectra:
    """With a local rational reference where it explains a window better than a unit mass."""
    plain = spectra.windows()
    rational = fit_local_rational(plain)
    fitted = spectra.windows(rational)
    gain = (plain.lines - 1) * np.log(plain.scatter / fitted.scatter)
    return replace(spectra, reference=rational.where(gain > BETTER))


def _detrended(values: NDArray[Any]) -> NDArray[Any]:
    """Without the straight line of least squares: large offsets cost digits."""
    time = np.arange(len(values)) - (len(values) - 1) / 2
    centred = values - values.mean()
    return centred - time * (time @ centred) / (time @ time)
