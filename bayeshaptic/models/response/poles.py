"""Poles and residues of a mechanism behind filters."""

from __future__ import annotations

import numpy as np

from bayeshaptic.models.response.filtered import Filters, filtered
from bayeshaptic.models.response.mechanism import Mechanism
from bayeshaptic.numerics.polynomial import evaluate, roots
from bayeshaptic.types import Complexes, Floats


def poles_and_residues(mechanism: Mechanism, filters: Filters) -> tuple[Complexes, Complexes]:
    """Poles and residues without the delay, each of shape (B, n).

    The residues assume simple poles; beside a double pole they blow up.
    """
    poles = [_eigenvalues(mechanism.state_matrix())]
    poles += [roots(factor.denominator) for factor in filters]
    p = np.concatenate(poles, axis=1)
    numerator, denominator = filtered(*mechanism.transfer(), filters)
    gaps = p[:, :, None] - p[:, None, :]
    gaps[:, np.arange(p.shape[1]), np.arange(p.shape[1])] = 1.0
    with np.errstate(divide="ignore", invalid="ignore"):
        residues = evaluate(numerator, p.T).T / (denominator[-1][:, None] * gaps.prod(axis=2))
    return p, residues


def _eigenvalues(matrices: Floats) -> Complexes:
    """Eigenvalues of a batch; nan for parameters so far away that a matrix overflows."""
    finite = np.isfinite(matrices).all(axis=(1, 2))
    values = np.full(matrices.shape[:2], np.nan, complex)
    values[finite] = np.linalg.eigvals(matrices[finite])
    return values
