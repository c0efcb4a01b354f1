"""Forces that are one tone at a time, and how far up such a tone moves the device."""

from __future__ import annotations

import numpy as np

from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.types import Floats

# Counts of the encoder that a tone must move the device by: below, what rounding does to a motion
# is as large as the motion, and no noise. Of 40 sweeps of benchmarks/strangers 31 of 32 intervals
# hold; with ten counts, tried on thirteen, no more do.
FEWEST_COUNTS = 4
_STRETCH_S = 0.1
_FEWEST = 20  # samples of a stretch
# Share of the stretches up to there that may move less: where a tone sets in or turns.
_ASIDE = 0.1
_LEAST = 10  # stretches in which the device moves


def is_sweep(force: Floats) -> bool:
    """Whether a force is, for much of the time, one tone at a time that is not slow.

    Tones are looked for in pieces of 128 samples, above four of their lines: below these a ramp is
    one, too.
    """
    piece, slowest, beside = 128, 4, 2
    of_power, of_time = 0.95, 0.2
    pieces = len(force) // piece
    if pieces == 0:
        return False
    framed = force[: pieces * piece].reshape(pieces, piece)
    spectrum = (framed - framed.mean(axis=1, keepdims=True)) * np.hanning(piece)
    power = np.abs(np.fft.rfft(spectrum, axis=1)) ** 2
    peak = np.argmax(power, axis=1)
    near = np.abs(np.arange(power.shape[1]) - peak[:, None]) <= beside
    share = np.sum(power * near, axis=1) / np.maximum(power.sum(axis=1), np.finfo(float).tiny)
    return bool(np.mean((peak >= slowest) & (share > of_power)) > of_time)


def moves_until(recording: Recording) -> float | None:
    """The frequency in Hz up to which a sweep moves the device by some counts of its encoder.

    None where the force is no sweep, moves it all the way, or hardly ever.  A motion falls with
    the square of the frequency, and that of a free device by less than a count is rounded away: it
    seems to rest, or to answer less than it does.
    """
    step = increment_unit(recording.position) if is_sweep(recording.force) else None
    if step is None:
        return None
    length = max(round(_STRETCH_S / recording.period_s), _FEWEST)
    stretches = recording.samples // length
    framed = (stretches, length)
    position = recording.position[: stretches * length].reshape(framed)
    force = recording.force[: stretches * length].reshape(framed)
    finer = 4  # than the lines of a stretch
    power = np.abs(np.fft.rfft(force * np.hanning(length), finer * length, axis=1))
    tone_hz = np.argmax(power, axis=1) / (finer * length * recording.period_s)
    order = np.argsort(tone_hz, kind="stable")
    small = (np.ptp(position, axis=1) < (FEWEST_COUNTS + 0.01) * step)[order]
    # Where most of the stretches below move it, and most of those above do not.
    below = np.concatenate([[0], np.cumsum(small)])
    moved = int(np.argmax(np.arange(stretches + 1) - 2 * below))
    if not _LEAST <= moved < stretches or below[moved] > _ASIDE * moved:
        return None
    return float(tone_hz[order[moved - 1]])
