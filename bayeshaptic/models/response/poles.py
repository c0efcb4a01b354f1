"""Poles and residues of a mechanism behind filters."""

from __future__ import annotations

import numpy as np

from bayeshaptic.models.response.dynamic_link import DynamicLink
from bayeshaptic.models.response.filtered import Filters, filtered
from bayeshaptic.models.response.mechanism import Mechanism
from bayeshaptic.models.response.transfer import transfer, transfer_with_link
from bayeshaptic.numerics.partial_fractions import moved_apart, residues
from bayeshaptic.numerics.polynomial import Polynomial, roots
from bayeshaptic.types import Complexes, Floats


def poles_and_residues(
    mechanism: Mechanism, filters: Filters, link: DynamicLink | None = None
) -> tuple[Complexes, Complexes]:
    """Poles and residues without the delay, each of shape (B, n).

    Poles that coincide are moved apart, but for two at zero: their residues blow up.
    """
    parts = transfer(mechanism) if link is None else transfer_with_link(mechanism, link)
    top, bottom = (polynomial.T for polynomial in parts)
    poles = [_eigenvalues(mechanism.state_matrix()) if link is None else _roots(bottom)]
    poles += [roots(factor.denominator) for factor in filters]
    p = moved_apart(np.concatenate(poles, axis=1))
    numerator, denominator = filtered(top, bottom, filters)
    return p, residues(numerator, denominator[-1], p)


def _roots(bottom: Polynomial) -> Complexes:
    """Relative to themselves; nan where a parameter is so far away that none are found."""
    from bayeshaptic.numerics.polynomial_roots import find_roots

    own = np.empty((bottom.shape[1], len(bottom) - 1), complex)
    settled = np.empty(len(own), bool)
    find_roots(np.ascontiguousarray(bottom.T), own, settled)
    own[~settled] = np.nan
    return own


def _eigenvalues(matrices: Floats) -> Complexes:
    """Eigenvalues of a batch; nan for parameters so far away that a matrix overflows."""
    finite = np.isfinite(matrices).all(axis=(1, 2))
    values = np.full(matrices.shape[:2], np.nan, complex)
    values[finite] = np.linalg.eigvals(matrices[finite])
    return values
