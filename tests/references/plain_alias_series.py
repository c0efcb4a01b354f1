"""The sum over aliases of `alias_tables.py`, in plain NumPy."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from bayeshaptic.models.response.alias_tables import HIGH, ORDER, REACH, bernoulli_table
from bayeshaptic.numerics.polynomials.polynomial import Polynomial
from bayeshaptic.types import Bools, Complexes, Floats


def from_polynomials(
    numerator: Polynomial,
    denominator: Polynomial,
    delay_s: Floats,
    frequency_hz: Floats,
    period_s: float,
) -> tuple[Complexes, Bools]:
    """Sampled response by the sum over aliases, and where in the batch its series holds.

    Parameters
    ----------
    numerator, denominator : ndarray, shape (degree + 1, B)
        Of the continuous transfer function, lowest power first.
    delay_s : ndarray, shape (B,)
    frequency_hz : ndarray, shape (L,)
    period_s : float

    Returns
    -------
    response : ndarray of complex, shape (B, L)
    good : ndarray of bool, shape (B,)
        False where a pole is too fast for the series; use `from_poles` there.
    """
    nodes = _Nodes(frequency_hz, period_s)
    h = _laurent(numerator, denominator, period_s)
    good = (_fastest_pole(h) + nodes.reach) / (2 * np.pi) < REACH
    late = delay_s / period_s - np.floor(delay_s / period_s)
    response = nodes.term(numerator, denominator)
    response += nodes.tail(_alias_coefficients(h, late))
    if len(nodes.high):
        response[nodes.high] = _towards_nyquist(nodes, numerator, denominator, h, late)
    if np.all(delay_s == delay_s[0]):
        response *= (nodes.hold * np.exp(-nodes.s * delay_s[0]))[:, None]
    else:
        response *= nodes.hold[:, None] * np.exp(-nodes.s[:, None] * delay_s)
    return response.T, good


class _Nodes:
    """Tables that depend on the frequencies and the period alone."""

    def __init__(self, frequency_hz: Floats, period_s: float) -> None:
        omega = 2 * np.pi * frequency_hz
        self.period_s = period_s
        self.s = 1j * omega
        self.reach = min(float(np.max(np.abs(omega))) * period_s, HIGH)
        self.high = np.flatnonzero(np.abs(omega) * period_s > HIGH)
        powers = np.vander(omega, 2 * 12, increasing=True)
        sign = np.array([1.0, 1.0, -1.0, -1.0] * 6)  # of Re and Im of j^p
        signed = powers * sign
        self.even, self.odd = signed[:, 0::2].copy(), signed[:, 1::2].copy()
        scaled = np.vander(omega * period_s, ORDER, increasing=True)
        scaled = scaled * np.resize(np.array([1.0, 1.0, -1.0, -1.0]), ORDER)
        self.tail_even, self.tail_odd = scaled[:, 0::2].copy(), scaled[:, 1::2].copy()
        self.hold = -np.expm1(-self.s * period_s)

    @cached_property
    def beyond(self) -> tuple[_Nodes, list[tuple[int, _Nodes]]]:
        """The high frequencies by themselves, and their nearest aliases with their numbers."""
        omega = np.asarray(self.s.imag[self.high], np.float64)
        step = 2 * np.pi / self.period_s
        here, *aliases = (
            _Nodes(np.asarray((omega + k * step) / (2 * np.pi), np.float64), self.period_s)
            for k in (0, -1, 1)
        )
        return here, list(zip((-1, 1), aliases, strict=True))

    def polynomial(self, coefficients: Polynomial) -> Complexes:
        """Values of a polynomial in s at the nodes, shape (L, B), as two real products."""
        even, odd = coefficients[0::2], coefficients[1::2]
        value = np.empty((len(self.s), coefficients.shape[1]), complex)
        value.real = self.even[:, : len(even)] @ even
        value.imag = self.odd[:, : len(odd)] @ odd
        return value

    def term(self, numerator: Polynomial, denominator: Polynomial) -> Complexes:
        """P(s) / (s T) at the nodes, shape (L, B)."""
        value = self.polynomial(numerator) / self.polynomial(denominator)
        value /= (self.s * self.period_s)[:, None]
        return value

    def tail(self, coefficients: Floats) -> Complexes:
        value = np.empty((len(self.s), coefficients.shape[1]), complex)
        value.real = self.tail_even @ coefficients[0::2]
        value.imag = self.tail_odd @ coefficients[1::2]
        return value


def _laurent(numerator: Polynomial, denominator: Polynomial, period_s: float) -> Floats:
    """Coefficients h_q T^q of P(s) = sum_q h_q s^-q for large s, q = 0..ORDER; shape (Q, B)."""
    degree = len(denominator) - 1
    scale = period_s ** -np.arange(degree + 1)[:, None]
    bottom = denominator * scale
    top = np.zeros((ORDER + 1, numerator.shape[1]))
    reversed_numerator = (numerator * scale[: len(numerator)])[::-1]
    shift = degree - (len(numerator) - 1)
    top[shift : shift + len(numerator)] = reversed_numerator[: ORDER + 1 - shift]
    bottom = (bottom / bottom[-1])[::-1]  # 1, d_{n-1}, ...
    top = top / (denominator[-1] * scale[-1])
    h = np.zeros_like(top)
    for q in range(shift, ORDER + 1):
        back = min(q, degree)
        h[q] = top[q] - np.sum(bottom[1 : back + 1] * h[q - back : q][::-1], axis=0)
    return h


def _alias_sums(x: Floats, far: bool) -> Floats:
    """B_n(x)/n! for delays of x periods, shape (N, len(x)); `far`: without the terms k = 1, -1."""
    coefficients, _ = bernoulli_table()
    sums = coefficients @ x ** np.arange(coefficients.shape[1])[:, None]
    if far:  # B_n(x)/n! = -sum over k != 0 of e^{2 pi j k x} / (2 pi j k)^n
        turns = (2j * np.pi) ** -np.arange(len(sums), dtype=float)[:, None]
        sums[1:] += 2 * np.real(np.exp(2j * np.pi * x) * turns[1:])
    return sums


def _alias_coefficients(h: Floats, late: Floats, far: bool = False) -> Floats:
    """A_p of `alias_tables.py`, shape (ORDER, B)."""
    _, binomials = bernoulli_table()
    index = np.arange(ORDER)[:, None] + np.arange(ORDER + 1)[None, :] + 1
    if np.all(late == late[0]):
        return (binomials * _alias_sums(late[:1], far)[index, 0]) @ h
    beta = _alias_sums(late, far)
    out = np.empty((ORDER, h.shape[1]))
    for p in range(ORDER):
        out[p] = np.einsum("qb,qb->b", binomials[p][:, None] * h, beta[p + 1 : p + ORDER + 2])
    return out


def _fastest_pole(h: Floats) -> Floats:
    """|p_max| T: h_q T^q grows like its q-th power, so that its last terms tell it; shape (B,)."""
    start = int(np.argmax(np.any(h != 0, axis=1)))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        first = np.max(np.abs(h[start : start + 2]), axis=0)
        last = np.max(np.abs(h[-4:]), axis=0)
        return (last / first) ** (1.0 / (ORDER - start - 2))


def _towards_nyquist(
    nodes: _Nodes, numerator: Polynomial, denominator: Polynomial, h: Floats, late: Floats
) -> Complexes:
    """The sum over aliases at the high nodes, without its common factor; shape (H, B)."""
    here, aliases = nodes.beyond
    total = here.term(numerator, denominator) + here.tail(_alias_coefficients(h, late, far=True))
    for k, alias in aliases:
        total += alias.term(numerator, denominator) * np.exp(-2j * np.pi * k * late)
    return total
