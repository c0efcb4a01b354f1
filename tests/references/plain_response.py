"""Sampled response of a mechanism behind filters, in plain NumPy: what `rational.py` must give."""

from __future__ import annotations

import numpy as np
from plain_alias_series import from_polynomials

from bayeshaptic.models.response.filters import Filters, filtered
from bayeshaptic.models.response.mechanism import Mechanism
from bayeshaptic.models.response.motion import phi
from bayeshaptic.models.response.poles import poles_and_residues
from bayeshaptic.numerics.polynomials.partial_fractions import moved_apart, residues
from bayeshaptic.numerics.polynomials.polynomial import Polynomial, evaluate, multiply, roots
from bayeshaptic.types import Bools, Complexes, Floats


def plain_response(
    mechanism: Mechanism,
    filters: Filters,
    delay_s: Floats,
    frequency_hz: Floats,
    period_s: float,
) -> Complexes:
    """The sampled response at frequencies of shape (L,), by what holds for each row; (B, L)."""
    response = np.empty((len(delay_s), len(frequency_hz)), complex)
    fast = fast_filters(filters, len(delay_s), period_s)
    for part in (fast, ~fast):
        if part.any():
            own = tuple(factor.rows(part) for factor in filters)
            route = _behind_fast_filters if part is fast else _by_polynomials
            response[part], good = route(
                mechanism.rows(part), own, delay_s[part], frequency_hz, period_s
            )
            bad = np.flatnonzero(part)[~good]
            if bad.size:
                poles = poles_and_residues(
                    mechanism.rows(bad), tuple(factor.rows(bad) for factor in filters)
                )
                response[bad] = from_poles(*poles, delay_s[bad], frequency_hz, period_s)
    return response


def from_poles(
    poles: Complexes, residues: Complexes, delay_s: Floats, frequency_hz: Floats, period_s: float
) -> Complexes:
    """Sampled response from poles and residues of the continuous transfer function: exact.

    Ill-conditioned beside a double pole, and as slow as the eigenvalues it needs.

    Parameters
    ----------
    poles, residues : ndarray, shape (B, n)
    delay_s : ndarray, shape (B,)
    frequency_hz : ndarray, shape (L,) or (B, L)
    period_s : float

    Returns
    -------
    ndarray of complex, shape (B, L)
    """
    whole = np.floor(delay_s / period_s)
    late = np.clip(delay_s - whole * period_s, 0.0, period_s)[:, None]
    early = period_s - late
    s = 2j * np.pi * np.atleast_2d(frequency_hz)
    back = np.exp(-s * period_s)
    first = residues * early * phi(poles * early)
    second = residues * np.exp(poles * early) * late * phi(poles * late)
    # 1 - e^{(p - s) T} = z^-1 ((z - 1) - (e^{pT} - 1)): accurate where p and s are both near zero.
    point, centre = np.expm1(s * period_s), np.expm1(poles * period_s)
    total = np.zeros(np.broadcast_shapes(back.shape, (len(poles), 1)), complex)
    for i in range(poles.shape[1]):
        total += (first[:, i, None] + back * second[:, i, None]) / (point - centre[:, i, None])
    return total * np.exp(-s * whole[:, None] * period_s)


def _by_polynomials(
    mechanism: Mechanism, filters: Filters, delay_s: Floats, frequency_hz: Floats, period_s: float
) -> tuple[Complexes, Bools]:
    top, bottom = filtered(*mechanism.transfer(), filters)
    return from_polynomials(top, bottom, delay_s, frequency_hz, period_s)


def _behind_fast_filters(
    mechanism: Mechanism, filters: Filters, delay_s: Floats, frequency_hz: Floats, period_s: float
) -> tuple[Complexes, Bools]:
    top, bottom = mechanism.transfer()
    rest, poles, residues = parted(top, bottom, filters)
    response, good = from_polynomials(rest, bottom, delay_s, frequency_hz, period_s)
    response += from_poles(poles.T, residues.T, delay_s, frequency_hz, period_s)
    return response, good


def fast_filters(filters: Filters, batch: int, period_s: float) -> Bools:
    """Where a filter is faster than the series over aliases bears, shape (B,)."""
    found = np.zeros(batch, bool)
    fast = 1.0  # |q| T
    for factor in filters:
        found |= np.abs(roots(factor.denominator)).max(axis=1, initial=0.0) * period_s > fast
    return found


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
