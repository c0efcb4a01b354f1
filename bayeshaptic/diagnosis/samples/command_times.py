"""Commands that take effect early or late: what the device does beside them tells.

A command that comes a row late is, until then, the one before: a force of (u[k-1] - u[k]) acts
that nobody recorded.  Its mean over all rows is a delay, which the model has.  What is left depends
on which rows are late.  In every second row, or in one pattern of a few rows, it is the command
itself times a sequence that repeats, so that the spectrum of what is left is that of the command,
shifted by a whole part of the sampling rate (L. A. Zadeh, "Frequency analysis of variable
networks", Proc. IRE 38, 1950).  By chance, it is noise that is louder where the command changes
more.  A hand, a floor and friction know nothing of either.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import gcd

import numpy as np
from scipy.signal.windows import tukey

from bayeshaptic.errors import Notice
from bayeshaptic.inference.fit import Fit
from bayeshaptic.recordings.response.etfe import Etfe, RandomSpectra
from bayeshaptic.recordings.signals.sweeps import is_sweep
from bayeshaptic.types import Bools, Complexes, Floats

TOPIC = "command times"
# Standard deviations from which on a pattern is one, and noise that of late commands; and how far
# the increments must tell more than the command's own size, as where an amplifier's gain hisses.
# How often recordings of other kinds are above: docs/statistics.md.
_PATTERN, _CHANCE, _OF_INCREMENTS = 8.0, 5.0, 3.0
# Rates that a servo's and a log's differ by, and tasks that take turns.
_ROWS = (2, 3, 4, 5, 8, 10)
# None of the numbers below decides: with half or twice of each (0.4 or 0.49 of the rate) all of 36
# simulated recordings with late commands are named, and none of 36 others.
_LINES, _FEWEST = 30, 8  # lines in a window, and windows
# How many times as wide as the band is what is looked at: late commands make noise beyond it, too,
# and noise makes the band narrow. The frequency below which a hand moves a device, and the share of
# the sampling rate above which a filter of the log's would cut.
_WIDER, _LOWEST_HZ, _OF_THE_RATE = 3.0, 5.0, 0.45
_TAPER = 0.05  # of the recording, at both ends together
_BLOCKS = 60  # of samples, whose noise may be alike
_NULL = 24  # shifts by no part of the rate: what a pattern is by chance


@dataclass(frozen=True)
class CommandTimes:
    """How what is left of the motion goes with the rows, and with the command's increments.

    Attributes
    ----------
    rows : int
        Of the clearest pattern.
    pattern : float
        Standard deviations of what is left in the spectrum of the command, shifted by it.
    chance : float
        Standard deviations of the slope of the squared noise over the squared increments.
    of_increments : float
        The same beside the squared command.
    """

    rows: int
    pattern: float
    chance: float
    of_increments: float

    @property
    def how(self) -> str | None:
        """In which way commands are off their time, for a sentence; None where none shows."""
        if self.pattern > _PATTERN:
            return f"in a pattern of {self.rows} rows ({self.pattern:.0f} standard deviations)"
        if self.chance > _CHANCE and self.of_increments > _OF_INCREMENTS:
            return f"by chance ({self.chance:.0f} standard deviations)"
        return None

    @property
    def notices(self) -> tuple[Notice, ...]:
        """What a reader should know of it."""
        if self.how is None:
            return ()
        seen = "is the command's own, turned from row to row"
        if self.pattern <= _PATTERN:
            seen = "is louder where the command changes more"
        text = (
            f"Commands take effect early or late {self.how}: what the device does beside its "
            f"answer {seen}. A servo that misses its deadlines, runs at another rate than the log, "
            "or takes turns does that, or an amplifier that is too slow for large changes. It is "
            "noise to the model, whose delay is the mean. Log every command of the servo's, and "
            "when it took effect."
        )
        return (Notice("note", TOPIC, text),)


@dataclass(frozen=True)
class _Left:
    """What is left as a force, at lines `inside` of the spectrum, without what answers linearly.

    `power` is its smooth power, shape (L,) as `force`; `spectrum` the command's at all lines, N.
    """

    force: Complexes
    power: Floats
    inside: Bools
    command: Floats
    spectrum: Complexes


def command_times(fit: Fit, etfe: Etfe) -> CommandTimes | None:
    """How what `fit` leaves over goes with the times at which commands take effect.

    Parameters
    ----------
    fit : Fit
    etfe : Etfe

    Returns
    -------
    CommandTimes or None
        None where the command repeats itself or was measured, or there is no recording.
    """
    recording = etfe.unbroken
    if recording is None or recording.sensed is not None or etfe.direct or etfe.through_reference:
        return None
    if not isinstance(etfe.spectra, RandomSpectra):
        return None
    left = _left(fit, etfe)
    if left is None:
        return None
    rows, pattern = _pattern(left)
    # Of a sweep each frequency has its moment: what a line leaves is louder then.
    chance, of_increments = (0.0, 0.0) if is_sweep(recording.force) else _by_chance(left)
    return CommandTimes(rows, pattern, chance, of_increments)


def _left(fit: Fit, etfe: Etfe) -> _Left | None:
    recording = etfe.unbroken
    assert recording is not None
    every = int(np.lcm.reduce(_ROWS))  # so that shifts are whole lines
    period_s, samples = recording.period_s, recording.samples // every * every
    force = recording.force[:samples] - recording.force[:samples].mean()
    # Of the acceleration: a free device wanders, and the ends of that leak into all lines.
    bent = np.zeros(samples)
    bent[1:-1] = np.diff(recording.position[:samples], 2)
    frequency = np.fft.rfftfreq(samples, period_s)
    low, high = etfe.band_hz
    high = min(_WIDER * high, _OF_THE_RATE / period_s)
    inside = np.asarray((frequency >= max(low, _LOWEST_HZ)) & (frequency <= high))
    if inside.sum() < _LINES * _FEWEST:
        return None
    taper = tukey(samples, _TAPER)
    spectrum = np.asarray(np.fft.fft(force * taper))
    at: Floats = frequency[inside].astype(np.float64)
    response = -4 * np.sin(np.pi * at * period_s) ** 2 * fit.response(at)
    command = spectrum[: len(frequency)][inside]
    left = np.fft.rfft(bent * taper)[inside] / response - command
    answers = _smooth(left * command.conj()) / _smooth(_power(command))
    left = left - answers * command
    return _Left(left, _smooth(_power(left)).real, inside, force, spectrum)


def _power(lines: Complexes) -> Complexes:
    return np.asarray(lines * lines.conj())


def _smooth(values: Complexes) -> Complexes:
    """Mean over neighbouring lines, each end's continued."""
    padded = np.pad(values, (_LINES // 2, _LINES - 1 - _LINES // 2), "edge")
    return np.asarray(np.convolve(padded, np.full(_LINES, 1 / _LINES), "valid"))


def _pattern(left: _Left) -> tuple[int, float]:
    """Rows of the clearest pattern, and its standard deviations.

    From shifts that are no part of the rate: where the command's size goes up and down, so does
    that of what is left, and neighbouring lines of both are alike.
    """
    samples = len(left.spectrum)
    white = left.force / np.sqrt(left.power)
    white = white[: len(white) // _LINES * _LINES].reshape(-1, _LINES)
    lines = np.flatnonzero(left.inside)[: white.size]

    def alike(shift: int) -> float:
        other = left.spectrum[(lines + shift) % samples].reshape(white.shape)
        both = np.abs(np.sum(white * other.conj(), axis=1)) ** 2
        each = np.sum(np.abs(white) ** 2, axis=1) * np.sum(np.abs(other) ** 2, axis=1)
        return float(np.sum(both / each))

    golden = (np.sqrt(5) - 1) / 2
    shares = 0.05 + 0.9 * (np.arange(1, _NULL + 1) * golden % 1)
    chance = np.array([alike(round(share * samples)) for share in shares])
    found = [
        (alike(sign * part * samples // rows), rows)
        for rows in _ROWS
        for part in range(1, rows // 2 + 1)
        if gcd(part, rows) == 1
        for sign in (1, -1)
    ]
    most, rows = max(found)
    # What few shifts say of the scatter is itself uncertain; independent lines have at least this.
    least = np.sqrt(len(white)) / _LINES
    return rows, float((most - chance.mean()) / max(chance.std(ddof=1), least))


def _by_chance(left: _Left) -> tuple[float, float]:
    """Slope of squared noise over squared increments, and beside the squared command, in sds.

    Weighed with the inverse of its power, so that those lines count in which a force is told from
    the encoder's noise: what a command in one row does to the sum is the weights' own transform.
    """
    samples, weight = len(left.command), np.zeros(len(left.inside))
    weight[left.inside] = np.median(left.power) / left.power
    seen = np.zeros(len(left.inside), complex)
    seen[left.inside] = left.force * weight[left.inside]
    noise = np.fft.irfft(seen, samples) ** 2
    reach = np.fft.rfft(np.fft.irfft(weight, samples) ** 2)
    inner = slice(int(_TAPER * samples), samples - int(_TAPER * samples))

    def felt(power: Floats) -> Floats:
        return np.fft.irfft(np.fft.rfft(power) * reach, samples)[inner]

    increments = felt(np.diff(left.command, prepend=left.command[0]) ** 2)
    size = felt(left.command**2)
    alone = _scores(noise[inner], increments[:, None])[0]
    beside = _scores(noise[inner], np.stack([increments, size], axis=1))[0]
    return float(alone), float(beside)


def _scores(power: Floats, columns: Floats) -> Floats:
    """Slopes over their standard deviations, which allow for blocks alike."""
    columns = np.column_stack([np.ones(len(power)), columns / columns.mean(axis=0)])
    inverse = np.linalg.pinv(columns.T @ columns)
    slopes = inverse @ (columns.T @ power)
    left = columns * (power - columns @ slopes)[:, None]
    whole = len(power) // _BLOCKS * _BLOCKS
    blocks = left[:whole].reshape(_BLOCKS, -1, columns.shape[1]).sum(axis=1)
    variance = np.diag(inverse @ (blocks.T @ blocks) @ inverse)
    return np.asarray(slopes / np.sqrt(np.maximum(variance, np.finfo(float).tiny)))[1:]
