"""One signal predicted from its past, the other's past, and what both have at the same instant.

Cross-fitted: coefficients from every second of some stretches, errors on the others. Robust: a
reference that steps throws a controlled force far off its course a few times a second, and those
samples must not decide how the rest is predicted. Errors beyond twice the 95th percentile count no
more than that (iteratively reweighted least squares; P. J. Huber, *Robust Statistics*, 1981).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayeshaptic.types import Bools, Floats, Ints

# The other signal by differences over wider and wider spans: each coefficient more costs a share of
# 1/samples of what can be seen.
_SPANS = (1, 2, 3, 5, 8, 13, 21, 34, 55, 89)
# Samples after which sums of the signal's own past forget it.
_MEMORIES = (32, 64, 128, 256, 512, 1024)
_BLOCKS = 40  # of samples, each a vote in the z of what is removed
# Relative ridge, far below the floor, which keeps the normal equations of such signals solvable.
_RIDGE = 1e-9
# What is larger than so many times the 95 % quantile of its size is cut off, or set to zero.
_USUAL, _CUT = 0.95, 2.0
# What is new in a signal that is predicted to the last digit is rounding.
_DUST = 1e-12
_LEADS = (0, 1, 3, 6)  # samples by which the other signal may be ahead
_TINY = float(np.finfo(float).tiny)


@dataclass(frozen=True)
class Share:
    """A share of a prediction's error, or a correlation, and its distance from zero.

    Attributes
    ----------
    value : float
    z : float
        Over its standard error, from 40 blocks with one vote each: a burst must not decide alone.
    """

    value: float
    z: float


@dataclass(frozen=True)
class Prediction:
    """Errors of the prediction of a signal's increments, in standard deviations of these.

    Attributes
    ----------
    own, full : ndarray, shape (rows,)
        Error from the signal's own past, and from both pasts.
    cut : ndarray, shape (rows,)
        Beyond it an error counts no more.
    other : ndarray, shape (4, rows)
        What both pasts do not tell of the other signal now, and one, three and six samples later.
    stretch : ndarray of bool, shape (rows,)
        Which of the two halves a row belongs to.
    rows : ndarray of int, shape (rows,)
        Samples that were predicted.
    """

    own: Floats
    full: Floats
    cut: Floats
    other: Floats
    stretch: Bools
    rows: Ints

    def past(self, floor: float) -> Share:
        """Share of the error (variance) that the other's past removes.

        Parameters
        ----------
        floor : float
            Errors below this share of the increments' variance are none: band-limited signals are
            predicted almost perfectly, and then anything seems to help.

        Returns
        -------
        Share
        """
        own, full = (np.minimum(e**2, self.cut**2) for e in (self.own, self.full))
        starts = _blocks(len(own))
        a, b = (np.add.reduceat(e, starts) for e in (own, full))
        share = (a.sum() - b.sum()) / (a.sum() + floor * len(own))
        votes = (a - b) / (a + b + floor * len(own) / _BLOCKS)
        return Share(float(share), _z(votes))

    def same_instant(self) -> Share:
        """Correlation of what is new in both signals at the same instant."""
        return _correlation(self.full, self.other[0])

    def next_instant(self) -> Share:
        """Correlation with what is new in the other one instant later, beyond the same instant."""
        full, ahead = np.empty((2, len(self.full)))
        for half in (True, False):
            fitted, rest = self.stretch == half, self.stretch != half
            inside = fitted & (np.abs(self.full) <= self.cut)
            now = self.other[0]
            power = now[inside] @ now[inside] + _TINY
            for left, whole in ((full, self.full), (ahead, self.other[1])):
                left[rest] = (whole - (whole[inside] @ now[inside] / power) * now)[rest]
        return _correlation(full, ahead)

    def answers(self) -> tuple[Share, ...]:
        """How the other signal answers to what is new in this one, now and 1, 3, 6 samples later.

        Coefficients of regression, in one scale.
        """
        kept = np.abs(self.full) <= self.cut
        new = np.where(kept, self.full, 0.0)
        starts, tiny = _blocks(len(new)), _TINY
        power = np.add.reduceat(new**2, starts)
        found = []
        for answer in self.other:
            other = np.where(kept, answer, 0.0)
            product = np.add.reduceat(new * other, starts)
            votes = product / np.sqrt(power * np.add.reduceat(other**2, starts) + tiny)
            found.append(Share(float(product.sum() / (power.sum() + tiny)), _z(votes)))
        return tuple(found)


def predict(
    target: Floats,
    other: Floats,
    left_out: Bools | None = None,
    stretches: int = 10,
    remembered: bool = False,
    joints: tuple[int, ...] = (),
) -> Prediction:
    """Predict each increment of `target` from the past of both signals.

    Parameters
    ----------
    target, other : ndarray, shape (N,)
        Of at least some hundred samples.
    left_out : ndarray of bool, shape (N,), optional
        Samples of the target that are not to be predicted, such as those at a limit.
    stretches : int
        Coefficients are from every second of so many.
    remembered : bool
        Whether the target's far past may predict it, too: sums that forget it slowly.
    joints : tuple of int
        Where pieces begin that were recorded by themselves: none is predicted from another's past.

    Returns
    -------
    Prediction
    """
    rows, columns, own = _regressors(target, other, left_out, remembered, joints)
    wanted = _scaled(target[rows] - target[rows - 1])
    beside = np.stack([other[rows + lead] - other[rows - 1] for lead in _LEADS], axis=1)
    beside = (beside - beside.mean(axis=0)) / max(float(beside[:, -1].std()), _TINY)
    half = np.arange(len(rows)) * stretches // len(rows) % 2 == 0
    errors, cut, new = (
        np.empty((2, len(rows))),
        np.empty(len(rows)),
        np.empty((len(_LEADS), len(rows))),
    )
    for fitted in (half, ~half):
        rest = ~fitted
        known, open_ = columns[fitted], columns[rest]
        gram = known.T @ known  # of one matrix with itself: half the work
        for error, size in zip(errors, (own, columns.shape[1]), strict=True):
            weights, beyond = _robust(known[:, :size], wanted[fitted], gram[:size, :size])
            error[rest] = wanted[rest] - open_[:, :size] @ weights
            if size == own:
                cut[rest] = beyond
        weights = _solved(gram, known.T @ beside[fitted], len(known))
        new[:, rest] = (beside[rest] - open_ @ weights).T
    return Prediction(errors[0], errors[1], cut, new, half, rows)


def _regressors(
    target: Floats,
    other: Floats,
    left_out: Bools | None,
    remembered: bool,
    joints: tuple[int, ...],
) -> tuple[np.ndarray, Floats, int]:
    """Rows to predict, the columns that may predict them, and how many are of the target itself."""
    lags_of_itself = 60
    edges = (0, *joints, len(target))
    pieces = [slice(a, b) for a, b in zip(edges[:-1], edges[1:], strict=True)]
    longest = max(piece.stop - piece.start for piece in pieces)
    most = min(len(target) // 40, longest // 4)
    lags = max(4, min(lags_of_itself, most))
    spans = [span for span in _SPANS if span <= max(2, most)]
    first = max(lags, spans[-1]) + 2
    rows = np.concatenate([np.arange(p.start + first, p.stop - _LEADS[-1]) for p in pieces])
    if left_out is not None:
        rows = rows[~left_out[rows]]
    steps, before = np.diff(target), rows - 1
    if joints:  # where a piece is, and what its integral began with, is its own
        target, other = (_centred(signal, pieces) for signal in (target, other))
    summed = np.concatenate([np.cumsum(other[p] - other[p].mean()) for p in pieces])
    if joints:
        summed = _centred(summed, pieces)
    own = [np.linspace(-1, 1, len(rows)), target[before]]
    own += [steps[before - lag] for lag in range(1, lags + 1)]
    own += [memory[before] for memory in _memories(target, pieces)] if remembered else []
    theirs = [other[before], summed[before]]
    theirs += [other[before] - other[before - span] for span in spans]
    columns = np.column_stack([_scaled(column) for column in (*own, *theirs)])
    columns = np.column_stack([np.ones(len(rows)), columns])
    return rows, columns, len(own) + 1


def _centred(signal: Floats, pieces: Sequence[slice]) -> Floats:
    """Each piece without its mean."""
    return np.concatenate([signal[piece] - signal[piece].mean() for piece in pieces])


def _memories(signal: Floats, pieces: Sequence[slice]) -> list[Floats]:
    """What a signal was long ago in its piece: sums that forget it more and more slowly."""
    from scipy.signal import lfilter

    centred = signal - signal.mean()
    kept = [np.exp(-1 / samples) for samples in _MEMORIES if samples <= len(signal) / 20]
    return [
        np.concatenate([lfilter([1.0], [1.0, -keep], centred[piece]) for piece in pieces])
        for keep in kept
    ]


def _scaled(signal: Floats) -> Floats:
    """Without its mean, in standard deviations; zeros where it does not change."""
    centred = signal - signal.mean()
    sd = float(centred.std())
    still = sd <= 1e-12 * max(float(np.abs(signal).max()), _TINY)
    return np.zeros_like(centred) if still else np.asarray(centred / sd)


def _robust(columns: Floats, wanted: Floats, gram: Floats) -> tuple[Floats, float]:
    """Coefficients, and the error beyond which an error counts no more.

    `gram` is that of the columns.  Few errors lie beyond, and only their share is taken off it.
    """
    reweightings = 6
    normal, product = gram, columns.T @ wanted
    for _ in range(reweightings):
        coefficients = _solved(normal, product, len(columns))
        size = np.abs(wanted - columns @ coefficients)
        cut = float(_CUT * np.quantile(size, _USUAL)) + np.finfo(float).eps
        beyond = size > cut
        if not beyond.any():
            break
        lost = 1.0 - (cut / size[beyond]) ** 2
        far = columns[beyond] * np.sqrt(lost)[:, None]
        normal = gram - far.T @ far
        product = columns.T @ wanted - far.T @ (wanted[beyond] * np.sqrt(lost))
    return coefficients, cut


def _solved(gram: Floats, product: Floats, rows: int) -> Floats:
    """Coefficients of least squares."""
    ridge = _RIDGE * rows * np.eye(len(gram))
    return np.asarray(np.linalg.solve(gram + ridge, product))


def _correlation(one: Floats, other: Floats) -> Share:
    """Correlation without what lies beyond the usual size in either."""
    a, b = within_the_usual(one), within_the_usual(other)
    kept = (a != 0) & (b != 0)
    a, b = np.where(kept, a, 0.0), np.where(kept, b, 0.0)
    if min(float(np.mean(a * a)), float(np.mean(b * b))) < _DUST:
        return Share(0.0, 0.0)
    starts, tiny = _blocks(len(a)), _TINY
    product, left, right = (np.add.reduceat(v, starts) for v in (a * b, a * a, b * b))
    value = product.sum() / np.sqrt(left.sum() * right.sum() + tiny)
    return Share(float(value), _z(product / np.sqrt(left * right + tiny)))


def within_the_usual(signal: Floats) -> Floats:
    """A signal, shape (N,), with zeros where it lies beyond its usual size."""
    size = np.abs(signal)
    return np.where(size <= _CUT * np.quantile(size, _USUAL), signal, 0.0)


def _z(votes: Floats) -> float:
    return float(votes.mean() / (votes.std() / np.sqrt(_BLOCKS) + 1e-12))


def _blocks(length: int) -> np.ndarray:
    return np.arange(_BLOCKS) * length // _BLOCKS
