"""Moments in which something else than the command moved the device.

A bump, a touch, a command that did not arrive for a while: each sample is predicted from the past
and from the command (`prediction`), and in such a moment predicted far worse than ever else.  What
must have pushed is found from the same predictions, and added to the command: then the recording
says of the device what it says without the moment, and stays in one piece.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solveh_banded

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.samples.prediction import Samples
from bayeshaptic.recordings.signals.filling import TINY, Predictor
from bayeshaptic.recordings.signals.rows.runs import runs
from bayeshaptic.types import Bools, Floats

BLOCK = 32  # samples that one look takes together
# Mean squares of the errors of a block, over their median: whatever is above the first belongs to a
# moment.  A law that the model lacks shows wherever the motion is large, in blocks of every size
# between: moments are few, clear, and nothing is in between.
_QUIET = 4.0
_ONE = 8  # blocks between two that are one moment
_BESIDE = 3  # blocks before and after: of how it begins and ends less can be seen
_MOST, _LONGEST = 5, 0.2  # moments, and their share of the recording
_ROUNDS = 4  # for the size of what pushed, which is that of what is found
_FINE = 1e-3  # of the motion, the count of a sensor where there is none,
_NOISELESS = 0.1  # and of that count, errors of the prediction that no sensor makes,
_DIGITS = 10  # or so many last digits


@dataclass(frozen=True)
class Outside:
    """What moved the device besides its command.

    Attributes
    ----------
    moments : tuple of slice
        Of samples; none where there is nothing, or no end of it.
    force : ndarray, shape (N,)
        What pushed, in units of the command; zero elsewhere.
    statistic : float
        Mean square of the errors in the least clear moment, over the usual one; of the worst block
        where there is no moment, and zero where there are too many.
    """

    moments: tuple[slice, ...]
    force: Floats
    statistic: float

    @property
    def acts(self) -> Bools:
        """Whether it pushes, shape (N,)."""
        acts = np.zeros(len(self.force), dtype=bool)
        for moment in self.moments:
            acts[moment] = True
        return acts


def outside(samples: Samples) -> Outside:
    """Moments of a recording in which something else moved the device, and the force that did.

    Parameters
    ----------
    samples : Samples
        With all that is known to be wrong among them marked.
    """
    samples = _as_a_sensor_reads(samples)
    recording, predictor = samples.recording, samples.predictor
    nothing = Outside((), np.zeros(recording.samples), 0.0)
    if predictor is None:
        return nothing
    loud = _loudness(samples.errors, recording.position)
    moments, statistic = _moments(loud, recording.samples)
    if statistic <= thresholds.OUTSIDE:
        return replace(nothing, statistic=statistic)
    # What the regression learnt of the moments themselves, it unlearns.
    found = Outside(moments, np.zeros(recording.samples), statistic)
    predictor = samples.without(found.acts).predictor
    if predictor is None:
        return nothing
    errors = predictor.errors(samples.position, recording.force)
    noise = max(predictor.spread, TINY * float(np.std(recording.position)))
    usual = float(np.std(recording.force))
    for moment in moments:
        found.force[moment] = _force(predictor, errors, moment, noise, usual)
    left = predictor.errors(samples.position, recording.force + found.force)
    if _loudness(left, recording.position).max() > _QUIET:  # it was no force
        return nothing
    return found


def _as_a_sensor_reads(samples: Samples) -> Samples:
    """The samples in counts where there is no noise at all, as in a simulation without a sensor.

    The regression then predicts to within rounding by coefficients that no force out of the
    excited band has ever tried, and what pushed in a moment is not to be found by these.
    """
    predictor, position = samples.predictor, samples.recording.position
    count = _FINE * float(np.std(position))
    if predictor is None or max(predictor.spread, _DIGITS * samples.unit) > _NOISELESS * count:
        return samples
    rounded = replace(samples.recording, position=count * np.round(position / count))
    return replace(samples, recording=rounded)


def _loudness(errors: Floats, position: Floats) -> Floats:
    """Mean square of the errors in each block but the last, over the usual one, (N // BLOCK - 1,).

    Of what pushes in the last no motion tells, and an integral is worst known at its end.
    """
    blocks = len(errors) // BLOCK - 1
    squares = np.mean(errors[: blocks * BLOCK].reshape(blocks, BLOCK) ** 2, axis=1)
    return np.asarray(squares / max(float(np.median(squares)), (TINY * np.std(position)) ** 2))


def _moments(loud: Floats, samples: int) -> tuple[tuple[slice, ...], float]:
    """Moments with what is beside them, and how clear the least clear one is."""
    first, stop = runs(loud > _QUIET)
    if len(first) == 0:
        return (), float(loud.max())
    apart = first[1:] - stop[:-1] >= _ONE
    first, stop = first[np.append(True, apart)], stop[np.append(apart, True)]
    statistic = min(float(loud[a:b].max()) for a, b in zip(first, stop, strict=True))
    low = BLOCK * np.maximum(first - _BESIDE, 0)
    high = np.minimum(BLOCK * (stop + _BESIDE), samples)
    if len(first) > _MOST or np.sum(high - low) > _LONGEST * samples:
        return (), 0.0
    return tuple(slice(int(a), int(b)) for a, b in zip(low, high, strict=True)), statistic


def _force(
    predictor: Predictor, errors: Floats, moment: slice, noise: float, usual: float
) -> Floats:
    """The likeliest force within a moment, a priori white and as large as it is found to be.

    Parameters
    ----------
    predictor : Predictor
    errors : ndarray, shape (N,)
        Of the predictions from the command alone.
    moment : slice
        Of M samples.
    noise, usual : float
        Standard deviations of the usual errors, and of the command: what pushes is no smaller.

    Returns
    -------
    ndarray, shape (M,)
    """
    answer, n, inside = predictor.force, predictor.order, moment.stop - moment.start
    after = errors[moment.start : moment.stop + n]
    slope = np.convolve(after[::-1], answer)[: len(after)][::-1][:inside]
    alike = [[answer[: n + 1 - apart] @ answer[apart:]] for apart in range(n + 1)]
    bands, size = np.repeat(alike, inside, axis=1), usual
    for _ in range(_ROUNDS):
        held = bands.copy()
        held[0] += (noise / size) ** 2
        found = np.asarray(solveh_banded(held, slope, lower=True))
        larger = float(np.sqrt(np.mean(found**2)))
        if larger <= size:
            break
        size = larger
    return found
