"""What friction that differs from recording to recording does to the widths of joined ones."""

from __future__ import annotations

from collections.abc import Sequence

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
    known any better.

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
    parts = [_alone(columns, residual, *one, differ, thin) for one in zip(pieces, own, strict=True)]
    apart, variance = (np.array(values) for values in zip(*parts, strict=True))
    for number, index in enumerate(differ):
        spread = _spread(apart[:, number], variance[:, number]) * (count - 1) / (count - fewest)
        for piece in pieces:
            moved = found.inverse @ (columns[piece].T @ columns[piece, index])
            total += spread * np.outer(moved, moved)
    return total


def _alone(
    columns: Floats, residual: Floats, piece: slice, own: Ints, differ: Ints, thin: float
) -> tuple[Floats, Floats]:
    """A piece's own coefficients less those of all, and their variances; shapes (D,), (D,)."""
    design = columns[piece][:, np.append(differ, own)]
    scale = lengths(design)
    scaled = design / scale
    inverse = np.linalg.pinv(scaled.T @ scaled, hermitian=True)
    value = inverse @ scaled.T @ residual[piece]
    left = residual[piece] - scaled @ value
    known = np.diag(inverse)
    variance = np.where(known > 0, thin * np.mean(left**2) * known / scale**2, np.inf)
    kept = slice(0, len(differ))
    return (value / scale)[kept], variance[kept]


def _spread(values: Floats, variances: Floats) -> float:
    """Variance between values beyond their own."""
    weight = 1 / variances
    total = float(np.sum(weight))
    below = total - float(np.sum(weight**2)) / total if total > 0 else 0.0
    if not below > 1e-6 * total:  # one piece alone says anything
        return 0.0
    middle = np.sum(weight * values) / total
    excess = np.sum(weight * (values - middle) ** 2) - (np.count_nonzero(weight) - 1)
    return float(max(excess / below, 0.0))
