"""What one recording says of the sizes of an effect, for another recording of the same device."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.special import logsumexp

from bayeshaptic.types import Floats, Ints


@dataclass(frozen=True)
class Evidence:
    """Evidence of sizes over nothing more, everything else integrated out.

    Attributes
    ----------
    size : ndarray, shape (C,)
        In a unit that all recordings of the device share; above and below zero.
    shape : ndarray, shape (C, K)
        What else tells the cases apart: a mode's frequency and damping ratio.
    weight : ndarray, shape (C,)
        Prior probability of each.
    log : ndarray, shape (C,)
        Log evidence of each.
    by_data : ndarray, shape (C,)
        Less what the priors of the parameters that give way have in it.  These are the device's, in
        every recording the same: of several recordings one counts them.
    """

    size: Floats = field(repr=False)
    shape: Floats = field(repr=False)
    weight: Floats = field(repr=False)
    log: Floats = field(repr=False)
    by_data: Floats = field(repr=False)

    def with_more(self, said: Floats) -> float:
        """Log evidence of the effect together with what others say of its sizes, shape (C,)."""
        return float(logsumexp(self.log + said, b=self.weight))

    def of(self, asked: Asked) -> Floats:
        """What the data say of other sizes (D,) with the shapes that come closest, (D,).

        In between linear over the logarithm of the size; beyond the ends as the square of the size,
        which is what the log likelihood of a small change goes with.
        """
        out = np.zeros(len(asked.size))
        kinds, which = np.unique(self.shape, axis=0, return_inverse=True)
        near = _nearest(kinds, asked.shapes)
        for number, rows in asked.parts:
            size, kind = asked.size[rows], which.ravel() == near[number]
            known = kind & ((self.size > 0) == (size[0] > 0))
            if known.any():
                out[rows] = _interpolated(
                    np.abs(size), np.abs(self.size[known]), self.by_data[known]
                )
        return out


@dataclass(frozen=True)
class Asked:
    """Sizes that evidence is asked for, in parts of one shape and one sign.

    Attributes
    ----------
    size : ndarray, shape (D,)
    shapes : ndarray, shape (S, K)
        Each once.
    parts : list of (int, ndarray of int)
        Which shape, and which of the sizes.
    """

    size: Floats
    shapes: Floats
    parts: list[tuple[int, Ints]]


def asked(size: Floats, shape: Floats) -> Asked:
    """Sizes (D,) with the shapes (D, K), put in order once for all that are asked.

    Parameters
    ----------
    size, shape : ndarray, shape (D,), (D, K)
    """
    shapes, which = np.unique(shape, axis=0, return_inverse=True)
    key = 2 * which.ravel() + (size > 0)
    order = np.argsort(key, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(key[order])) + 1)
    return Asked(size, shapes, [(int(key[part[0]]) // 2, part) for part in parts])


def _nearest(kinds: Floats, shape: Floats) -> Floats:
    """Which of the `kinds` (S, K), all above zero, is closest to each shape, (D,)."""
    if not kinds.shape[1]:
        return np.zeros(len(shape), int)
    apart = np.abs(np.log(shape)[:, None] - np.log(kinds)).sum(axis=2)
    return np.asarray(apart.argmin(axis=1))


def _interpolated(size: Floats, known: Floats, log: Floats) -> Floats:
    order = np.argsort(known)
    known, log = known[order], log[order]
    inside = np.interp(np.log(size), np.log(known), log)
    below = log[0] * (size / known[0]) ** 2
    above = np.minimum(log[-1], 0.0) * (size / known[-1]) ** 2 + max(log[-1], 0.0)
    return np.asarray(np.where(size < known[0], below, np.where(size > known[-1], above, inside)))
