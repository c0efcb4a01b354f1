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
from bayeshaptic.recordings.response.estimators.instrument import (
    HIGHEST_THROUGH_REFERENCE,
    STRONG,
    InstrumentSpectra,
)
from bayeshaptic.recordings.response.estimators.lines import LOW_END_WINDOWS, Lines
from bayeshaptic.recordings.response.estimators.noise_slope import noise_slopes
from bayeshaptic.recordings.response.estimators.ringing import ringing_poles
from bayeshaptic.recordings.response.local_polynomial import ENOUGH_LINES, default_minimum_lines
from bayeshaptic.recordings.response.points import Points
from bayeshaptic.recordings.response.spectra import RandomSpectra
from bayeshaptic.recordings.response.window_reference import LocalRational, fit_local_rational
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.recordings.signals.lone import without_lone
from bayeshaptic.recordings.signals.raw_signals import clipping, increment_unit
from bayeshaptic.recordings.signals.sweeps import FEWEST_COUNTS, moves_until

# Slower than this a hand wanders more than it answers; the paper's lowest frequency too.
LOWEST_HZ = 0.3
# Windows in which the reference must move the force.
FEWEST_STRONG = 16
# A rational reference must explain a window better than chance does with its two more terms.
BETTER = 10.0
# Share of samples that were cut off, from which that may be why nothing follows the force.
_MUCH_CUT_OFF = 0.05


def estimate_random(
    recording: Recording,
    band_hz: tuple[float, float] | None,
    minimum_lines: int | None,
    mended: Recording | None = None,
) -> tuple[RandomSpectra, Points, tuple[Notice, ...]]:
    """Spectra, and what a person sees, of a recording with random excitation.

    Parameters
    ----------
    recording : Recording
    band_hz : (low, high) or None
        Chosen from the data when None.
    minimum_lines : int or None
    mended : Recording, optional
        Without its wild samples, where these have been looked for.

    Raises
    ------
    InputError
        When there are too few lines for eight windows, or no response.
    """
    minimum = minimum_lines or default_minimum_lines(recording.duration_s)
    notice: Notice | None
    if recording.reference is not None:
        spectra, notice = _through_reference(recording, band_hz, minimum)
    elif band_hz is None:
        spectra, notice = _in_chosen_band(recording, minimum, mended or without_lone(recording))
    else:
        spectra, notice = _in_given_band(recording, band_hz, minimum)
    spectra, windows = _with_reference(spectra)
    return spectra, points(windows), (notice,) if notice else ()


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
    lines = Lines.of(recording)
    plain = lines.cut((0.5 / recording.duration_s, nyquist), ENOUGH_LINES)
    plain = replace(plain, floor=lines.rounding**2 * np.ones(len(plain.floor)))
    plain = replace(plain, reference=_local_reference(plain)[0])
    # Where a hand's own motion falls steeply within a window, lines that weigh alike do not add up.
    plain = replace(plain, noise_slope=noise_slopes(plain))
    same = {field.name: getattr(plain, field.name) for field in fields(RandomSpectra)}
    count = increment_unit(recording.position) or 0.0
    spectra = DirectSpectra(**same, rounding=count**2 / 12)
    return spectra, points(spectra.windows())


def windows_of_all(recording: Recording) -> Windows:
    """Windows of all lines but the last ones, also where the force has no power: noise alone there.

    Parameters
    ----------
    recording : Recording
        In one piece.
    """
    whole = (1 / recording.duration_s, 0.49 / recording.period_s)
    lines = Lines.of(recording).cut(whole, default_minimum_lines(recording.duration_s))
    return _with_reference(lines)[1]


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


def _in_chosen_band(
    recording: Recording, minimum: int, mended: Recording
) -> tuple[RandomSpectra, Notice]:
    widest = max(LOWEST_HZ, LOW_END_WINDOWS * minimum / recording.duration_s)
    # A wild sample is noise at all frequencies, until the loop mends it, in this band.
    lines = Lines.of(mended)
    everything = lines.cut((widest, 0.5 / recording.period_s), minimum)
    try:
        low, high = choose_band(everything, recording.name)
    except InputError as error:
        raise _cut_off(recording) or error from None
    why, drives = "the force has power and the position answers it", "the force drives"
    until = moves_until(mended)
    if until is not None and low < until < high:
        high = until
        why = f"the sweep moves the device by {FEWEST_COUNTS} counts of its encoder or more"
        drives = f"the force moves the device by {FEWEST_COUNTS} counts of its encoder from"
    until = tells_until(mended)
    if low < until < high:
        high = until
        why += ", and what is between the samples of a velocity does not hide the loop"
    text = f"Band {low:.3g} to {high:.4g} Hz, chosen where {why}."
    if mended is not recording:
        lines = Lines.of(recording)
    return lines.cut((low, high), minimum, drives), Notice("note", "band", text)


def _through_reference(
    recording: Recording, band_hz: tuple[float, float] | None, minimum: int
) -> tuple[RandomSpectra, Notice]:
    """With the reference as instrument, between the lowest and the highest window that it moves."""
    lowest = max(LOWEST_HZ, LOW_END_WINDOWS * minimum / recording.duration_s)
    everything = band_hz or (lowest, HIGHEST_THROUGH_REFERENCE / recording.period_s)
    lines = Lines.of(recording)
    spectra = _with_instrument(lines.cut(everything, minimum), recording)
    strong = np.flatnonzero(spectra.strength > STRONG)
    if len(strong) < FEWEST_STRONG:
        raise InputError(
            f"{recording.name}: the reference moves the force in {len(strong)} of "
            f"{len(spectra.strength)} windows of frequencies, and {FEWEST_STRONG} are needed; "
            "let it step more often or more widely, or be noise, and record longer"
        )
    low, high = spectra.span_hz(strong)
    text = (
        f"Band {low:.3g} to {high:.4g} Hz, chosen where the reference moves the force: in "
        f"{len(strong)} of {len(spectra.strength)} windows."
    )
    spectra = _with_instrument(lines.cut((low, high), minimum), recording)
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
    lines = Lines.of(recording)
    spectra = lines.cut(band_hz, minimum)
    driven = np.flatnonzero(spectra.force_power > NO_POWER * np.var(recording.force))
    if len(driven) == len(spectra.force_power):
        return spectra, None
    asked = f"the band was set to {band_hz[0]:g} to {band_hz[1]:g} Hz"
    if len(driven) == 0:
        raise InputError(f"{recording.name}: {asked}, where the force has no power")
    low, high = spectra.span_hz(driven)
    text = f"The force has no power outside {low:.3g} to {high:.4g} Hz ({asked})."
    return lines.cut((low, high), minimum), Notice("warning", "band", text)


def _with_reference(spectra: RandomSpectra) -> tuple[RandomSpectra, Windows]:
    """With a local rational reference where it explains a window better than a unit mass.

    And with the poles of modes that ring on, and the slope of the noise around it; and the windows.
    """
    rational, curved, windows = _local_reference(spectra)
    if isinstance(spectra, InstrumentSpectra):
        spectra = replace(spectra, reference=rational)
        spectra = replace(spectra, noise_slope=noise_slopes(spectra.regressed()))
        return spectra, spectra.windows()
    poles = ringing_poles(spectra, curved, windows.scatter)
    if poles is not None:
        rational = rational.with_poles(poles)
    spectra = replace(spectra, reference=rational, ringing_hz=poles)
    slopes = noise_slopes(spectra)
    spectra = replace(spectra, noise_slope=slopes)
    if poles is not None:
        return spectra, spectra.windows()
    # Others are as they were: noise falls within the lowest windows.
    sloped = int(np.max(np.flatnonzero(slopes), initial=-1)) + 1
    return spectra, windows.after(spectra.lowest(sloped).windows()) if sloped else windows


def _local_reference(spectra: RandomSpectra) -> tuple[LocalRational, NDArray[Any], Windows]:
    """The reference, in which windows it is rational, and the windows with it."""
    plain = spectra.windows()
    rational = fit_local_rational(plain)
    fitted = spectra.windows(rational)
    gain = (plain.lines - 1) * np.log(plain.scatter / fitted.scatter)
    curved = gain > BETTER
    return rational.where(curved), curved, plain.where(~curved, fitted)
