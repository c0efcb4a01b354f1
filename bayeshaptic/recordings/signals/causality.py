"""Which signal drives which: the force the position, the position the force, or each the other.

Prediction from the past decides (Granger, *Econometrica* 37(3), 1969). In an open loop the past
position says nothing about the next force that the past force did not say; where it does, the force
was computed from the motion, and the ETFE is biased. Where the past force says nothing about the
next position, but the past position a lot about the next force, the two columns are swapped.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.excitation import find_repetition

# Shares of the prediction error. On 170 simulated open loops (white, coloured and band-limited
# noise, steps, sweeps, multisines; four devices, quantised or not; with tremor, friction, backlash,
# saturation, reflexes and more) the feedback share stays below 0.003, and the answer above 0.15
# unless the encoder is very coarse; virtual walls from 3 % of the critical stiffness, position
# controllers and relays give a feedback share above 0.05, and the servo of the EMPS benchmark 0.18.
NOTABLE_SHARE = 0.02
SIGNIFICANT = 5.0

_LAGS_OF_ITSELF = 60
_LAGS_OF_THE_OTHER = 30
_BLOCKS = 40
_MOST_SAMPLES = 60_000
# Prediction errors below this share of a signal's second differences are none: band-limited
# signals can be predicted almost perfectly, and then anything seems to help.
_FLOOR = 1e-4
# Relative ridge, far below that floor, which keeps the normal equations of such signals solvable.
_RIDGE = 1e-9
# A computed force differs from period to period by the noise of the position; a played one never.
_SAME = 1e-6


@dataclass(frozen=True)
class Causality:
    """What the past of one signal adds to the prediction of the other.

    Attributes
    ----------
    feedback : float
        Share of the force's one-step prediction error (variance) that the past position removes, on
        data that was not used to fit the prediction; about zero or slightly negative in an open
        loop.
    feedback_z : float
        The same over its standard error.
    answer, answer_z : float
        Share of the position's prediction error that the past force removes.
    same_sample : float
        Share of the force's prediction error that the position at the same instant removes beyond
        the past: large where the position was recorded a sample early.
    repeats : bool
        The force repeats exactly, period by period: it cannot have been computed from a noisy
        position.
    relay : bool
        The force has two levels, and the sign of the position decides which.
    smooth_position : bool
        The position is smoother than the force, as that of every mass is.
    """

    feedback: float
    feedback_z: float
    answer: float
    answer_z: float
    same_sample: float
    repeats: bool
    relay: bool
    smooth_position: bool

    @property
    def has_feedback(self) -> bool:
        """The force was computed from the motion."""
        return self.relay or (self._position_drives and not self.swapped)

    @property
    def swapped(self) -> bool:
        """Position and force have each other's columns."""
        one_way = self._position_drives and not self._force_drives
        return one_way and not self.smooth_position and not self.relay

    @property
    def early_position(self) -> bool:
        """The position answers to the force within the sample: it is recorded a sample early."""
        return not self._position_drives and self.same_sample > NOTABLE_SHARE

    @property
    def _position_drives(self) -> bool:
        real = self.feedback > NOTABLE_SHARE and self.feedback_z > SIGNIFICANT
        return real and not self.repeats

    @property
    def _force_drives(self) -> bool:
        return self.answer > NOTABLE_SHARE and self.answer_z > SIGNIFICANT


def causality(recording: Recording) -> Causality:
    """Test which of the force and the position drives the other.

    Parameters
    ----------
    recording : Recording
        With at least some hundred samples; of a very long one, the middle is used.

    Returns
    -------
    Causality
    """
    start = max(0, (recording.samples - _MOST_SAMPLES) // 2)
    force = recording.force[start : start + _MOST_SAMPLES]
    position = recording.position[start : start + _MOST_SAMPLES]
    feedback, same_sample = _gains(force, position)
    answer, _ = _gains(position, force)
    return Causality(
        *feedback,
        *answer,
        same_sample,
        repeats=find_repetition(force, _SAME) is not None,
        relay=_is_relay(force, position),
        smooth_position=_roughness(position) < _roughness(force),
    )


def _gains(
    target: NDArray[np.float64], other: NDArray[np.float64]
) -> tuple[tuple[float, float], float]:
    """What the other signal's past adds to the prediction (share, z), and its present beyond it.

    Three nested linear predictions of the target's next increment are fitted on every second of ten
    stretches and judged on the others: from the target's own past, with the other's past, and with
    the other's increment at the same instant.
    """
    wanted, columns, sizes = _regressors(target, other)
    stretch = np.arange(len(wanted)) * 10 // len(wanted) % 2
    errors = np.empty((3, len(wanted)))
    for fitted in (0, 1):
        mine, rest = columns[stretch == fitted], stretch != fitted
        gram = mine.T @ mine
        gram[np.diag_indices_from(gram)] += _RIDGE * len(mine)
        moment = mine.T @ wanted[stretch == fitted]
        for error, size in zip(errors, sizes, strict=True):
            weights = np.linalg.solve(gram[:size, :size], moment[:size])
            error[rest] = wanted[rest] - columns[rest, :size] @ weights
    own, past, now = np.add.reduceat(errors**2, _block_starts(len(wanted)), axis=1)
    floor = _FLOOR * np.var(np.diff(wanted)) * len(wanted)
    share = (own.sum() - past.sum()) / (own.sum() + floor)
    # One block, one vote: a burst in the recording must not decide the significance alone.
    votes = (own - past) / (own + past + floor / _BLOCKS)
    z = votes.mean() / (votes.std() / np.sqrt(_BLOCKS) + 1e-12)
    return (float(share), float(z)), float((past.sum() - now.sum()) / (past.sum() + floor))


def _regressors(
    target: NDArray[np.float64], other: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], tuple[int, int, int]]:
    """The target's increments, the columns that may predict them, and the three nested sizes."""
    own_lags = max(4, min(_LAGS_OF_ITSELF, len(target) // 40))
    lags = max(2, min(_LAGS_OF_THE_OTHER, own_lags // 2))
    first = own_lags + 1
    steps, other_steps = np.diff(target), np.diff(other)
    rows = len(steps) - first

    def past(values: NDArray[np.float64], count: int) -> list[NDArray[np.float64]]:
        return [values[first - lag : first - lag + rows] for lag in range(1, count + 1)]

    levels = target[first : first + rows], other[first : first + rows]
    own = [np.linspace(-1, 1, rows), levels[0], *past(steps, own_lags)]
    theirs = [levels[1], *past(other_steps, lags)]
    columns = np.column_stack([*own, *theirs, other_steps[first:]])
    columns = columns - columns.mean(axis=0)
    columns /= np.maximum(columns.std(axis=0), np.finfo(float).tiny)
    wanted = steps[first:] - steps[first:].mean()
    wanted = wanted / max(float(wanted.std()), np.finfo(float).tiny)
    return wanted, columns, (len(own), len(own) + len(theirs), columns.shape[1])


def _block_starts(length: int) -> NDArray[np.intp]:
    return np.arange(_BLOCKS) * length // _BLOCKS


def _roughness(signal: NDArray[np.float64]) -> float:
    """Power of the increments over that of the signal: 2 for white noise."""
    return float(np.var(np.diff(signal)) / np.var(signal))


def _is_relay(force: NDArray[np.float64], position: NDArray[np.float64]) -> bool:
    """A force of two levels that opposes the position, taken from zero or from its middle."""
    low, high = force.min(), force.max()
    near = 1e-6 * (high - low)
    if not np.all((force - low <= near) | (high - force <= near)):
        return False
    pushes_up = force > (low + high) / 2
    if not 0.2 < np.mean(pushes_up) < 0.8:
        return False
    levels = (0.0, float(np.median(position)), float((position.min() + position.max()) / 2))
    agreement = [
        np.mean(pushes_up[lag:] == (position[: len(position) - lag] < level))
        for lag in range(3)
        for level in levels
    ]
    return max(agreement) > 0.99
