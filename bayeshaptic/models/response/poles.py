"""Poles and residues of a mechanism behind filters."""

from __future__ import annotations

import numpy as np

from bayeshaptic.models.response.filtered import Filters, filtered
from bayeshaptic.models.response.mechanism import Mechanism
from bayeshaptic.models.response.transfer import transfer
from bayeshaptic.numerics.partial_fractions import moved_apart, residues
from bayeshaptic.numerics.polynomial import roots
from bayeshaptic.types import Complexes, Floats


def poles_and_residues(mechanism: Mechanism, filters: Filters) -> tuple[Complexes, Complexes]:
    """Poles and residues without the delay, each of shape (B, n).

    Poles that coincide are moved apart, but for two at zero: their residues blow up.
    """
    poles = [_eigenvalues(mechanism.state_matrix())]
    poles += [roots(factor.denominator) for factor in filters]
    p = moved_apart(np.concatenate(poles, axis=1))
    top, bottom = (polynomial.T for polynomial in transfer(mechanism))
    numerator, denominator = filtered(top, bottom, filters)
    return p, residues(numerator, denominator[-1], p)


def _eigenvalues(matrices: Floats) -> Complexes:
    """Eigenvalues of a batch; nan for parameters so far away that a matrix overflows."""
    finite = np.isfinite(matrices).all(axis=(1, 2))
    values = np.full(matrices.shape[:2], np.nan, complex)
    values[finite] = np.linalg.eigvals(matrices[finite])
    return values
