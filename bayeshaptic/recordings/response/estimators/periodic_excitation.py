"""ETFE of a recording whose force repeats itself: excited lines, noise from the lines between.

The DFT of M whole periods holds the response in every M-th line. The lines between are what does
not repeat: noise, drift, and what is left of the transient. Their local polynomial gives the
leakage below an excited line, their scatter its noise. After R. Pintelon, G. Vandersteen,
L. De Locht, Y. Rolain and J. Schoukens, "Experimental characterization of operational amplifiers",
IEEE Trans. Instrumentation and Measurement 53(3), 854-862, 2004, and the fast method in their book.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.band import responds_until, tells_until
from bayeshaptic.recordings.response.local_polynomial import (
    LEAKAGE_TERMS,
    default_minimum_lines,
    leakage_terms,
)
from bayeshaptic.recordings.response.points import Points
from bayeshaptic.recordings.response.spectra import REPEATS_TO, PeriodicSpectra
from bayeshaptic.recordings.signals.excitation import (
    FEWEST_LINES,
    Repetition,
    excited_lines,
    find_repetition,
    noise_of,
)
from bayeshaptic.recordings.signals.raw_signals import count_of
from bayeshaptic.recordings.signals.rounding import hidden_rounding
from bayeshaptic.recordings.signals.sweeps import moves_until

FEWEST_BETWEEN, MOST_BETWEEN = 20, 60
# More excited lines than that are as many windows: 6,082 took 400 s of CPU time and more.
_MOST_LINES = 2000
# Excited lines in a window of all lines from which on it knows the response as well: two a node.
_ENOUGH_EXCITED = 6


def estimate_periodic(
    recording: Recording, band_hz: tuple[float, float] | None, fewest: int = FEWEST_LINES
) -> tuple[PeriodicSpectra, Points, tuple[Notice, ...]] | None:
    """Spectra, and what a person sees, of a recording with periodic excitation.

    Parameters
    ----------
    recording : Recording
    band_hz : (low, high) or None
        All excited lines where the response stands out when None.
    fewest : int
        Excited lines that are asked for.

    Returns
    -------
    tuple or None
        None where the force does not repeat itself for two whole periods.

    Raises
    ------
    InputError
        When fewer than `fewest` excited lines are in the band.
    """
    repetition = find_repetition(recording.force)
    if repetition is None:
        return None
    force, position = _periods(recording, repetition)
    if len(position) < 2:
        return None
    harmonics = excited_lines(force.mean(axis=0), noise_of(force))
    frequency = harmonics / (repetition.period * recording.period_s)
    if band_hz is not None:
        inside = (frequency >= band_hz[0] * (1 - 1e-9)) & (frequency <= band_hz[1] * (1 + 1e-9))
        harmonics = harmonics[inside]
    if len(harmonics) < fewest:
        _refuse_few(recording, len(harmonics), band_hz)
    if _as_dense_as_noise(recording, harmonics, len(position)):
        return None
    transient = transient_periods(position, harmonics)
    kept = position[transient:]
    spectra = _spectra(recording, force[transient:], kept, harmonics)
    if band_hz is None:
        spectra = _responding(spectra, recording)
    return spectra, points(spectra), _notices(recording, spectra, repetition, position, transient)


def _as_dense_as_noise(recording: Recording, harmonics: NDArray[np.int64], periods: int) -> bool:
    """Whether there are thousands of excited lines, and enough in windows of all lines.

    A window then knows the response as well as its lines do, and there are ten times fewer of them.
    """
    if len(harmonics) <= _MOST_LINES:
        return False
    between = np.count_nonzero(harmonics >= harmonics[len(harmonics) // 2])
    spanned = harmonics[-1] - harmonics[len(harmonics) // 2] + 1
    share = between / spanned / periods
    return share * default_minimum_lines(recording.duration_s) >= _ENOUGH_EXCITED


def points(spectra: PeriodicSpectra) -> Points:
    """Response, variance and coherence in each excited line.

    The scatter has n - 1 complex degrees of freedom; over n - 2 the error over the standard
    deviation, a Student t, has unit variance.
    """
    noise = spectra.scatter / (spectra.freedom - 1)
    value = spectra.position / spectra.force
    answer = np.maximum(np.abs(spectra.position) ** 2 - noise, 0)
    return Points(
        frequency_hz=spectra.frequency_hz,
        value=value,
        variance=spectra.scatter / (spectra.freedom - 2) / np.abs(spectra.force) ** 2,
        coherence=answer / (answer + spectra.periods * noise),
    )


def transient_periods(position: NDArray[Any], harmonics: NDArray[np.int64]) -> int:
    """How many of the first periods differ from the later half by more than that half scatters.

    Parameters
    ----------
    position : ndarray, shape (M, p)
    harmonics : ndarray of int, shape (L,)
    """
    count, samples = position.shape
    if count < 3:
        return 0
    # A drift is no transient: each period without the slope between its neighbours.
    slope = np.gradient(position.mean(axis=1)) / samples
    ramp = np.arange(samples) - (samples - 1) / 2
    lines = np.fft.rfft(position - slope[:, None] * ramp, axis=1)[:, harmonics]
    half = max(2, count - count // 2)
    late = lines[-half:]
    departure = np.abs(lines - late.mean(axis=0)) ** 2
    departure[:-half] /= 1 + 1 / half
    departure[-half:] /= 1 - 1 / half
    width = min(21, len(harmonics))
    variance = np.convolve(departure[-half:].mean(axis=0), np.ones(width) / width, mode="same")
    floor = np.finfo(float).eps * np.abs(late).max()
    distance = np.mean(departure / np.maximum(variance, floor**2), axis=1)
    limit = distance[-half:].max() * (1 + 4 / np.sqrt(len(harmonics)))
    return int(np.argmax(distance <= limit))


def _periods(recording: Recording, repetition: Repetition) -> tuple[NDArray[Any], NDArray[Any]]:
    """Whole periods of the force and of the position, shapes (M, p).

    The position of a sample answers the forces before it: it may go on for one sample more.
    """
    start, period = repetition.start, repetition.period
    stop = min(repetition.stop + 1, recording.samples)
    count = (stop - start) // period
    first = stop - count * period
    force = repetition.periods_of(recording.force, first, count)
    return force, recording.position[first:stop].reshape(count, period)


def _refuse_few(recording: Recording, lines: int, band_hz: tuple[float, float] | None) -> None:
    where = "" if band_hz is None else f" in the band {band_hz[0]:g} to {band_hz[1]:g} Hz"
    cure = "excite more frequencies" if band_hz is None else "widen the band"
    raise InputError(
        f"{recording.name}: the periodic force excites {lines} lines{where}, a model "
        f"needs {FEWEST_LINES}; {cure}"
    )


def _spectra(
    recording: Recording,
    force: NDArray[Any],
    position: NDArray[Any],
    harmonics: NDArray[np.int64],
) -> PeriodicSpectra:
    count, samples = position.shape
    drive, spectrum = _whole_spectrum(force), _whole_spectrum(position)
    line = harmonics * count
    between = np.arange(1, (position.size + 1) // 2)
    between = between[between % count != 0]
    width = int(np.clip(count - 1, FEWEST_BETWEEN, MOST_BETWEEN))
    if len(between) < width:
        raise InputError(
            f"{recording.name}: {count} periods of {samples} samples are too few to tell the "
            "response from noise; record longer"
        )
    first = np.searchsorted(between, line) - width // 2
    near = between[np.clip(first, 0, len(between) - width)[:, None] + np.arange(width)]
    below, residual, leverage = _leakage(spectrum[near], near, line)
    if np.any(drive[near]):  # what the force has there is answered, or is noise of its sensor
        response = (spectrum[line] - below) / drive[line]
        left = spectrum[near] - np.interp(near, line, response) * drive[near]
        below, residual, leverage = _leakage(left, near, line)
    # Leakage is known from the lines between only: its error adds to the noise of the line.
    shrink = 1 / np.sqrt(1 + leverage)
    freedom = width - LEAKAGE_TERMS + 1
    answer = (spectrum[line] - below) * shrink
    rounding = hidden_rounding(position, harmonics, count_of(recording))
    floor = rounding + (REPEATS_TO * np.abs(answer)) ** 2
    return PeriodicSpectra(
        frequency_hz=harmonics / (samples * recording.period_s),
        force=drive[line] * shrink,
        position=answer,
        scatter=np.sum(np.abs(residual) ** 2, axis=1) + (freedom - 1) * floor,
        freedom=np.full(len(line), float(freedom)),
        periods=count,
    )


def _whole_spectrum(periods: NDArray[Any]) -> NDArray[Any]:
    """DFT of all periods; of those that are the same in every bit, exactly zero between lines."""
    count, samples = periods.shape
    if np.all(periods == periods[0]):
        found = np.zeros(count * samples // 2 + 1, complex)
        found[::count] = (np.fft.rfft(periods[0] - periods[0].mean()) * count)[
            : len(found[::count])
        ]
    else:
        found = np.fft.rfft(periods.ravel() - periods.mean())
    return found / np.sqrt(periods.size)


def _leakage(
    values: NDArray[Any], near: NDArray[np.int64], line: NDArray[np.int64]
) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """Leakage at a line (L,) from the values (L, w) of lines near it, their residual, leverage."""
    centre = line[:, None].astype(float)
    scale = np.max(np.abs(near - centre), axis=1, keepdims=True)
    terms = leakage_terms((near - centre) / scale, near.astype(float), centre)
    at_line = leakage_terms(np.zeros_like(centre), centre, centre)[:, 0]
    q, r = np.linalg.qr(terms)
    along = np.einsum("lwt,lw->lt", q, values)
    weights = np.linalg.solve(np.swapaxes(r, -1, -2), at_line[..., None])[..., 0]
    residual = values - np.einsum("lwt,lt->lw", q, along)
    return np.sum(weights * along, axis=1), residual, np.sum(weights**2, axis=1)


def _responding(spectra: PeriodicSpectra, recording: Recording) -> PeriodicSpectra:
    """Only the lines up to where the response stands out, and a sweep moves the device."""
    noise = spectra.scatter / (spectra.freedom - 1)
    last = responds_until(np.abs(spectra.position) ** 2 / noise - 1)
    until = moves_until(recording)
    if last is not None and until is not None:
        last = min(last, int(np.searchsorted(spectra.frequency_hz, until)))
    if last is not None:
        inside = spectra.frequency_hz <= tells_until(recording) * (1 + 1e-9)
        last = min(last, int(np.count_nonzero(inside)) - 1)
    if last is None or last + 1 < FEWEST_LINES:
        raise InputError(
            f"{recording.name}: the position does not follow the periodic force; check which "
            "column is which, or record with more force"
        )
    kept = slice(0, last + 1)
    return PeriodicSpectra(
        frequency_hz=spectra.frequency_hz[kept],
        force=spectra.force[kept],
        position=spectra.position[kept],
        scatter=spectra.scatter[kept],
        freedom=spectra.freedom[kept],
        periods=spectra.periods,
    )


def _notices(
    recording: Recording,
    spectra: PeriodicSpectra,
    repetition: Repetition,
    position: NDArray[Any],
    transient: int,
) -> tuple[Notice, ...]:
    seconds = repetition.period * recording.period_s
    rest = recording.samples - position.size
    unused = f" ({rest} samples more are in no whole period)" if rest else ""
    dropped = (
        f"the first {transient} are transient and dropped"
        if transient
        else "none of them transient"
    )
    text = (
        f"The force repeats every {seconds:.6g} s ({repetition.period} samples): "
        f"{len(position)} whole periods, {dropped}, {spectra.periods} kept{unused}. "
        f"{spectra.lines} excited lines, "
        f"{spectra.frequency_hz[0]:.4g} to {spectra.frequency_hz[-1]:.4g} Hz."
    )
    notices = [Notice("note", "periods", text)]
    if len(position) < 3:
        notices.append(
            Notice(
                "warning",
                "periods",
                "With two periods nothing shows whether the first is still transient; record more.",
            )
        )
    return tuple(notices)
