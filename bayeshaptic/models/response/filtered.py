r"""Rational factors in the loop; and those that are too fast for the series over aliases.

By partial fractions at the filters' poles q_j, with mechanism N/D and filters M/F,

.. math:: \frac{N M}{D F} = \sum_j \frac{c_j}{s - q_j} + \frac{R}{D}, \qquad
          c_j = \frac{N(q_j) M(q_j)}{D(q_j) F'(q_j)}, \qquad R = \frac{N M - D C}{F},

C the numerator of the sum over j.  The poles have the closed form, and R/D has no poles but the
mechanism's.  The division for R begins at the lowest power, where F is 1 + small terms.
"""

from __future__ import annotations

import numpy as np

from bayeshaptic.models.response.filter import Filter
from bayeshaptic.numerics.partial_fractions import moved_apart, residues
from bayeshaptic.numerics.polynomial import Polynomial, evaluate, multiply, roots
from bayeshaptic.types import Bools, Complexes, Floats

Filters = tuple[Filter, ...]


def fast_filters(filters: Filters, batch: int, period_s: float) -> Bools:
    """Where a filter is faster than the series over aliases bears, shape (B,)."""
    found = np.zeros(batch, bool)
    fast = 1.0  # |q| T
    for factor in filters:
        found |= np.abs(roots(factor.denominator)).max(axis=1, initial=0.0) * period_s > fast
    return found


def filtered(
    numerator: Polynomial, denominator: Polynomial, filters: Filters
) -> tuple[Polynomial, Polynomial]:
    """Numerator and denominator of a transfer function behind filters."""
    for factor in filters:
        numerator = multiply(numerator, factor.numerator)
        denominator = multiply(denominator, factor.denominator)
    return numerator, denominator


def parted(
    numerator: Polynomial, denominator: Polynomial, filters: Filters
) -> tuple[Polynomial, Complexes, Complexes]:
    """A transfer function behind filters as the sum of the filters' poles and the rest.

    Returns
    -------
    rest : ndarray
        R, a numerator over the `denominator` of the mechanism alone.
    poles, residues : ndarray of complex, shape (n, B)
    """
    numerator, bottom = filtered(numerator, np.ones((1, denominator.shape[1])), filters)
    own = moved_apart(np.concatenate([roots(factor.denominator) for factor in filters], axis=1))
    poles, parts = own.T, residues(numerator, bottom[-1], own).T
    parts /= evaluate(denominator, poles)
    rest = _divided(
        _difference(numerator, multiply(denominator, _sum(poles, parts, bottom[-1]))), bottom
    )
    return rest[: len(denominator) - 1], poles, parts


def _sum(poles: Complexes, residues: Complexes, lead: Floats) -> Polynomial:
    """Numerator of the sum of the partial fractions over a denominator with this leading factor."""
    total = np.zeros((len(poles), poles.shape[1]), complex)
    for j in range(len(poles)):
        term = (residues[j] * lead)[None]
        for i in range(len(poles)):
            if i != j:
                longer = np.zeros((len(term) + 1, term.shape[1]), complex)
                longer[1:] += term
                longer[:-1] -= poles[i] * term
                term = longer
        total += term
    return np.asarray(total.real)


def _difference(a: Polynomial, b: Polynomial) -> Polynomial:
    out = np.zeros((max(len(a), len(b)), b.shape[1]))
    out[: len(a)] += a
    out[: len(b)] -= b
    return out


def _divided(dividend: Polynomial, divisor: Polynomial) -> Polynomial:
    """The power series of a quotient, as many terms as the dividend has."""
    quotient = np.zeros_like(dividend)
    for k in range(len(dividend)):
        known = sum(divisor[j] * quotient[k - j] for j in range(1, min(k, len(divisor) - 1) + 1))
        quotient[k] = (dividend[k] - known) / divisor[0]
    return quotient
