"""ETFE of a recording with random excitation: windows of DFT lines of the whole record."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.band import NO_POWER, choose_band, tells_until
from bayeshaptic.recordings.response.estimators.direct import DirectSpectra
from bayeshaptic.recordings.response.estimators.instrument import STRONG, InstrumentSpectra
from bayeshaptic.recordings.response.estimators.noise_slope import noise_slopes
from bayeshaptic.recordings.response.estimators.ringing import ringing_poles
from bayeshaptic.recordings.response.local_polynomial import (
    ENOUGH_LINES,
    default_minimum_lines,
    window_edges,
)
from bayeshaptic.recordings.response.points import Points
from bayeshaptic.recordings.response.spectra import REPEATS_TO, RandomSpectra
from bayeshaptic.recordings.response.window_reference import (
    LocalRational,
    fit_local_rational,
    unit_mass,
)
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.recordings.signals.lone import without_lone
from bayeshaptic.recordings.signals.raw_signals import clipping, increment_unit
from bayeshaptic.recordings.signals.sweeps import FEWEST_COUNTS, moves_until

FEWEST_WINDOWS = 8
# The lowest window then spans a factor 2.14: for 30 s and 24 lines, 0.7 to 1.5 Hz.
LOW_END_WINDOWS = 0.875
# Slower than this a hand wanders more than it answers; the paper's lowest frequency too.
LOWEST_HZ = 0.3
# Of the sampling rate: above, a command that is held moves next to nothing.
HIGHEST_THROUGH_REFERENCE = 0.4
# Windows in which the reference must move the force.
FEWEST_STRONG = 16
# A rational reference must explain a window better than chance does with its two more terms.
BETTER = 10.0
# Share of samples that were cut off, from which that may be why nothing follows the force.
_MUCH_CUT_OFF = 0.05
# What to advise: 12 lines are then 12 Hz, and limits below 20 Hz are common.
SHORTEST_S = 1.0


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
    notice: Notice | None
    if recording.reference is not None:
        spectra, notice = _through_reference(recording, band_hz, minimum)
    elif band_hz is None:
        spectra, notice = _in_chosen_band(recording, minimum)
    else:
        spectra, notice = _in_given_band(recording, band_hz, minimum)
    spectra = _with_reference(spectra)
    return spectra, points(spectra.windows()), (notice,) if notice else ()


def estimate_direct(recording: Recording) -> tuple[DirectSpectra, Points]:
    """All lines of a recording with feedback, and the response of each window, which it biases.

    Parameters
    ----------
    recording : Recording
        In one piece.

    Raises
    ------
    InputError
        When there are too few lines.
    """
    nyquist = 0.5 / recording.period_s
    plain = _spectra(recording, (0.5 / recording.duration_s, nyquist), ENOUGH_LINES)
    plain = replace(plain, floor=_rounding(recording.position) ** 2 * np.ones(len(plain.floor)))
    plain = replace(plain, reference=_local_reference(plain)[0])
    # Where a hand's own motion falls steeply within a window, lines that weigh alike do not add up.
    plain = replace(plain, noise_slope=noise_slopes(plain))
    same = {field.name: getattr(plain, field.name) for field in fields(RandomSpectra)}
    count = increment_unit(recording.position) or 0.0
    spectra = DirectSpectra(**same, rounding=count**2 / 12)
    return spectra, points(spectra.windows())


def points(windows: Windows) -> Points:
    """Response, variance and coherence at the centre of each window.

    The variance comes from the window's scatter, which has n - 3 complex degrees of freedom; over
    n - 4, so that the error over the standard deviation, a Student t, has unit variance. The
    coherence is the multiple coherence of the three columns, corrected for their number.
    """
    inverse = np.linalg.pinv(windows.design, rcond=1e-10)[:, 1]
    value, n = np.einsum("wk,wk->w", inverse, windows.target), windows.lines
    total = windows.scatter + np.sum(np.abs(windows.target) ** 2, axis=1)
    return Points(
        frequency_hz=windows.frequency_hz[:, 1],
        value=value,
        variance=windows.scatter / (n - 4) * np.sum(np.abs(inverse) ** 2, axis=1),
        coherence=np.clip(1 - windows.scatter / (n - 3) * n / total, 0, 1),
    )


def _in_chosen_band(recording: Recording, minimum: int) -> tuple[RandomSpectra, Notice]:
    widest = max(LOWEST_HZ, LOW_END_WINDOWS * minimum / recording.duration_s)
    # A wild sample is noise at all frequencies, until the loop mends it, in this band.
    seen = without_lone(recording)
    everything = _spectra(seen, (widest, 0.5 / recording.period_s), minimum)
    try:
        low, high = choose_band(everything, recording.name)
    except InputError as error:
        raise _cut_off(recording) or error from None
    why, drives = "the force has power and the position answers it", "the force drives"
    until = moves_until(seen)
    if until is not None and low < until < high:
        high = until
        why = f"the sweep moves the device by {FEWEST_COUNTS} counts of its encoder or more"
        drives = f"the force moves the device by {FEWEST_COUNTS} counts of its encoder from"
    until = tells_until(seen)
    if low < until < high:
        high = until
        why += ", and what is between the samples of a velocity does not hide the loop"
    text = f"Band {low:.3g} to {high:.4g} Hz, chosen where {why}."
    return _spectra(recording, (low, high), minimum, drives), Notice("note", "band", text)


def _through_reference(
    recording: Recording, band_hz: tuple[float, float] | None, minimum: int
) -> tuple[RandomSpectra, Notice]:
    """With the reference as instrument, between the lowest and the highest window that it moves."""
    lowest = max(LOWEST_HZ, LOW_END_WINDOWS * minimum / recording.duration_s)
    everything = band_hz or (lowest, HIGHEST_THROUGH_REFERENCE / recording.period_s)
    spectra = _with_instrument(_spectra(recording, everything, minimum), recording)
    strong = np.flatnonzero(spectra.strength > STRONG)
    if len(strong) < FEWEST_STRONG:
        raise InputError(
            f"{recording.name}: the reference moves the force in {len(strong)} of "
            f"{len(spectra.strength)} windows of frequencies, and {FEWEST_STRONG} are needed; "
            "let it step more often or more widely, or be noise, and record longer"
        )
    first, last = spectra.edges[strong[0]], spectra.edges[strong[-1] + 1] - 1
    low, high = (float(spectra.frequency_hz[line]) for line in (first, last))
    text = (
        f"Band {low:.3g} to {high:.4g} Hz, chosen where the reference moves the force: in "
        f"{len(strong)} of {len(spectra.strength)} windows."
    )
    spectra = _with_instrument(_spectra(recording, (low, high), minimum), recording)
    return spectra, Notice("note", "band", text)


def _with_instrument(spectra: RandomSpectra, recording: Recording) -> InstrumentSpectra:
    """With the reference at the same lines; its leakage is projected out with the position's."""
    assert recording.reference is not None
    reference = recording.reference - recording.reference.mean()
    frequency = np.fft.rfftfreq(recording.samples, recording.period_s)
    first = int(np.argmin(np.abs(frequency - spectra.frequency_hz[0])))
    lines = np.fft.rfft(reference / np.ptp(reference))[first : first + spectra.lines]
    same = {field.name: getattr(spectra, field.name) for field in fields(RandomSpectra)}
    return InstrumentSpectra(**same, instrument=lines)


def _cut_off(recording: Recording) -> InputError | None:
    """What is wrong where the position was cut off and does not follow the force because of it."""
    ends = clipping(recording.position)
    share = (ends.low_samples + ends.high_samples) / recording.samples
    if not (ends.low_clipped or ends.high_clipped) or share < _MUCH_CUT_OFF:
        return None
    return InputError(
        f"{recording.name}: the position is cut off at {ends.low:.4g} or {ends.high:.4g} "
        f"{recording.position_unit} in {100 * share:.0f} % of the samples, and what is left does "
        "not follow the force; widen the range of the sensor, or keep the device in its middle"
    )


def _in_given_band(
    recording: Recording, band_hz: tuple[float, float], minimum: int
) -> tuple[RandomSpectra, Notice | None]:
    """Without windows at the ends where there is no force."""
    spectra = _spectra(recording, band_hz, minimum)
    driven = np.flatnonzero(spectra.force_power > NO_POWER * np.var(recording.force))
    if len(driven) == len(spectra.force_power):
        return spectra, None
    asked = f"the band was set to {band_hz[0]:g} to {band_hz[1]:g} Hz"
    if len(driven) == 0:
        raise InputError(f"{recording.name}: {asked}, where the force has no power")
    first, last = spectra.edges[driven[0]], spectra.edges[driven[-1] + 1] - 1
    low, high = (float(spectra.frequency_hz[line]) for line in (first, last))
    text = f"The force has no power outside {low:.3g} to {high:.4g} Hz ({asked})."
    return _spectra(recording, (low, high), minimum), Notice("warning", "band", text)


def _spectra(
    recording: Recording,
    band_hz: tuple[float, float],
    minimum: int,
    what: str = "the band is",
) -> RandomSpectra:
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
        count = len(frequency[lines])
        raise InputError(_too_short(recording, band_hz, minimum, count, what))
    position = _detrended(recording.position)
    scale = 1 / np.sqrt(samples)
    found = np.fft.rfft(position)[lines] * scale
    power = np.add.reduceat(np.abs(found) ** 2, edges[:-1]) / np.diff(edges)
    return RandomSpectra(
        frequency_hz=frequency[lines],
        force=np.fft.rfft(recording.force - recording.force.mean())[lines] * scale,
        position=found,
        edges=edges,
        floor=_rounding(recording.position) ** 2 + REPEATS_TO**2 * power,
        reference=unit_mass,
    )


def _rounding(position: NDArray[Any]) -> float:
    return float(np.finfo(float).eps * np.max(np.abs(position)))


def _too_short(
    recording: Recording, band_hz: tuple[float, float], minimum: int, lines: int, what: str
) -> str:
    """What to say when the band holds too few lines."""
    needed, (low, high) = FEWEST_WINDOWS * minimum, band_hz
    where = f"{recording.name}: {recording.samples} samples ({recording.duration_s:.3g} s)"
    if lines and high < 0.5 / recording.period_s:
        return (
            f"{where} are too few: {what} {low:.4g} to {high:.4g} Hz, {lines} lines of the "
            f"spectrum, and {needed} are needed; record {needed / (high - low):.3g} s, or use a "
            f"band that is {needed / recording.duration_s:.3g} Hz wide"
        )
    seconds = max((FEWEST_WINDOWS + LOW_END_WINDOWS) * minimum / high, SHORTEST_S)
    return f"{where} are too few for a frequency response; record at least {seconds:.2g} s"


def _with_reference(spectra: RandomSpectra) -> RandomSpectra:
    """With a local rational reference where it explains a window better than a unit mass.

    And with the poles of modes that ring on, and the slope of the noise around it.
    """
    rational, curved, scatter = _local_reference(spectra)
    if isinstance(spectra, InstrumentSpectra):
        spectra = replace(spectra, reference=rational)
        return replace(spectra, noise_slope=noise_slopes(spectra.regressed()))
    poles = ringing_poles(spectra, curved, scatter)
    if poles is not None:
        rational = rational.with_poles(poles)
    spectra = replace(spectra, reference=rational, ringing_hz=poles)
    return replace(spectra, noise_slope=noise_slopes(spectra))


def _local_reference(spectra: RandomSpectra) -> tuple[LocalRational, Any, NDArray[Any]]:
    """The reference, where it is rational, and the scatter of each window around it."""
    plain = spectra.windows()
    rational = fit_local_rational(plain)
    fitted = spectra.windows(rational)
    gain = (plain.lines - 1) * np.log(plain.scatter / fitted.scatter)
    curved = gain > BETTER
    return rational.where(curved), curved, np.where(curved, fitted.scatter, plain.scatter)


def _detrended(values: NDArray[Any]) -> NDArray[Any]:
    """Without the straight line of least squares: large offsets cost digits."""
    time = np.arange(len(values)) - (len(values) - 1) / 2
    centred = values - values.mean()
    return centred - time * (time @ centred) / (time @ time)
