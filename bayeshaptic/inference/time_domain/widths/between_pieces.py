"""What friction that differs from recording to recording does to the widths of joined ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayeshaptic.inference.time_domain.uneven import Ridge
from bayeshaptic.numerics.gauss_newton import lengths
from bayeshaptic.types import Floats, Ints


def between_pieces(
    columns: Floats,
    residual: Floats,
    found: Ridge,
    pieces: Sequence[slice],
    differ: Ints,
    own: Sequence[Ints],
    effective: float,
) -> Floats:
    """Covariance that coefficients which differ between pieces add to the solution, (C, C).

    Each piece has its own coefficients, normal around those of all, with a spread from how far
    apart the pieces are beyond their noise (the moment estimator of R. DerSimonian and N. Laird,
    Controlled Clinical Trials 7, 1986), times (J - 1) / (J - 3): a spread seen in J pieces is not
    known any better.  What was fitted to all pieces has taken up some of what is apart, a force
    along the way before all, where each moves along a way of its own.

    Parameters
    ----------
    columns : ndarray, shape (N, C)
    residual : ndarray, shape (N,)
    found : Ridge
    pieces : sequence of slice
        J of them.
    differ : ndarray of int, shape (D,)
        Columns whose coefficients may differ.
    own : sequence of ndarray of int
        Columns that each piece has for itself.
    effective : float
        Number of independent samples that the N are worth.
    """
    total = np.zeros((columns.shape[1],) * 2)
    count = len(pieces)
    fewest = 3  # pieces beyond these say how well the spread is known
    if count <= fewest:
        return total
    thin = len(residual) / effective
    alone = [
        _Alone.of(columns[piece][:, np.append(differ, mine)])
        for piece, mine in zip(pieces, own, strict=True)
    ]
    rests = [residual[piece] for piece in pieces]
    first = slice(0, len(differ))
    both = tuple(zip(alone, rests, strict=True))
    apart = np.array([(one.reads @ rest)[first] for one, rest in both])
    variance = np.array([one.variances(rest, thin)[first] for one, rest in both])
    for number, index in enumerate(differ):
        moved = np.array([found.inverse @ (columns[p].T @ columns[p, index]) for p in pieces])
        # What a unit in each piece leaves in every other, beside all that was fitted to it.
        seen = np.empty((count, count))
        for place, (piece, one) in enumerate(zip(pieces, alone, strict=True)):
            left = -columns[piece] @ moved.T
            left[:, place] += columns[piece, index]
            seen[place] = one.reads[number] @ left
        spread = _spread(apart[:, number], variance[:, number], seen)
        total += spread * (count - 1) / (count - fewest) * (moved.T @ moved)
    return total


@dataclass(frozen=True)
class _Alone:
    """What reads a piece's own coefficients off what is left of it.

    Attributes
    ----------
    design : ndarray, shape (n, K)
    reads : ndarray, shape (K, n)
    known : ndarray, shape (K,)
        Variances of the coefficients over that of a sample.
    """

    design: Floats
    reads: Floats
    known: Floats

    @classmethod
    def of(cls, design: Floats) -> _Alone:
        scale = lengths(design)
        scaled = design / scale
        inverse = np.linalg.pinv(scaled.T @ scaled, hermitian=True)
        return cls(design, (inverse @ scaled.T) / scale[:, None], np.diag(inverse) / scale**2)

    def variances(self, rest: Floats, thin: float) -> Floats:
        """Of the coefficients of a rest, where `thin` samples are worth one."""
        left = rest - self.design @ (self.reads @ rest)
        return np.where(self.known > 0, thin * np.mean(left**2) * self.known, np.inf)


def _spread(values: Floats, variances: Floats, seen: Floats) -> float:
    """Variance between coefficients, of which `seen` (J, J) is in `values`, beyond their own."""
    weight = 1 / variances
    total = float(np.sum(weight))
    if not total > 0:
        return 0.0
    values = values - weight @ values / total
    below = float(weight @ np.sum((seen - weight @ seen / total) ** 2, axis=1))
    if not below > 1e-6 * total:  # one piece alone says anything
        return 0.0
    excess = float(weight @ values**2) - (np.count_nonzero(weight) - 1)
    return max(excess / below, 0.0)
