"""Poles and residues of a mechanism behind filters."""

from __future__ import annotations

import numpy as np

from bayeshaptic.models.response.dynamic_link import DynamicLink
from bayeshaptic.models.response.filters import Filters, filtered
from bayeshaptic.models.response.mechanism import Mechanism
from bayeshaptic.models.response.transfer import transfer
from bayeshaptic.numerics.polynomials.partial_fractions import moved_apart, residues
from bayeshaptic.numerics.polynomials.polynomial import Polynomial, roots
from bayeshaptic.types import Complexes, Floats


def poles_and_residues(mechanism: Mechanism, filters: Filters) -> tuple[Complexes, Complexes]:
    """Poles and residues without the delay, each of shape (B, n).

    Poles that coincide are moved apart, but for two at zero: their residues blow up.
    """
    top, bottom = (polynomial.T for polynomial in transfer(mechanism))
    p = moved_apart(poles_of(mechanism, bottom, filters))
    numerator, denominator = filtered(top, bottom, filters)
    return p, residues(numerator, denominator[-1], p)


def poles_of(
    mechanism: Mechanism, bottom: Polynomial, filters: Filters, link: DynamicLink | None = None
) -> Complexes:
    """Poles, shape (B, n), of a mechanism with this denominator and of its filters.

    By the denominator's roots, each relative to itself; eigenvalues where these do not settle.
    """
    from bayeshaptic.numerics.polynomials.roots import find_roots

    own = np.empty((bottom.shape[1], len(bottom) - 1), complex)
    settled = np.empty(len(own), bool)
    find_roots(np.ascontiguousarray(bottom.T), own, settled)
    if not settled.all():
        unsettled = np.flatnonzero(~settled)
        own[unsettled] = np.nan
        if link is None:
            own[unsettled] = _eigenvalues(mechanism.rows(unsettled).state_matrix())
    return np.concatenate([own, *(roots(factor.denominator) for factor in filters)], axis=1)


def _eigenvalues(matrices: Floats) -> Complexes:
    """Eigenvalues of a batch; nan for parameters so far away that a matrix overflows."""
    finite = np.isfinite(matrices).all(axis=(1, 2))
    values = np.full(matrices.shape[:2], np.nan, complex)
    values[finite] = np.linalg.eigvals(matrices[finite])
    return values
