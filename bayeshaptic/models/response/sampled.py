r"""The sampled response Z[H(s) P(s) e^{-s td}]: zero-order hold, mechanism, delay; exact.

Two routes give the same numbers:

`from_poles`
    the closed form over poles and residues of P (design of the modal kind): exact at every
    frequency, ill-conditioned beside a double pole, and as slow as the eigenvalues it needs.
`from_polynomials`
    the sum over aliases.  With s_k = s + j 2 pi k / T,

    .. math:: G(e^{sT}) = \frac{1 - e^{-sT}}{T} \sum_k e^{-s_k t_d} \frac{P(s_k)}{s_k},

    the term k = 0 is taken from the polynomials of P as it stands.  In all others |s_k| is beyond
    the poles, so P(s) = sum_q h_q s^-q there, and the sum over k of e^{-s_k td} s_k^{-q-1},
    expanded in powers of sT, is a Bernoulli polynomial B_n(x)/n! of x = td/T - floor(td/T):

    .. math:: \sum_{k \ne 0} \to T e^{-s t_d} \sum_p (sT)^p A_p, \qquad
              A_p = \sum_q (-1)^q h_q T^q \binom{p+q}{p} \frac{B_{p+q+1}(x)}{(p+q+1)!}.

    It converges like ((|p_max| + |s|) T / 2 pi)^n, needs no poles, and does not mind double ones.
    Towards the Nyquist frequency the terms k = 1 and -1 are taken as they stand, too, and what
    is left converges like ((|p_max| + |s|) T / 4 pi)^n.
"""

from __future__ import annotations

from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.polynomial import Polynomial as PowerSeries
from numpy.typing import NDArray
from scipy.special import bernoulli, comb, factorial

from bayeshaptic.numerics.polynomial import Polynomial
from bayeshaptic.types import Complexes, Floats

ORDER = 28  # terms in 1/s and in s that the alias series keeps
REACH = 0.62  # (|p_max| + |s|) T / 2 pi up to which the series is used: relative error < 1e-9
ECONOMY = 10  # powers of (sT)^2 that stand for ORDER / 2 of them when compiled; `_economy_table`
HIGH = 2.2  # |s| T above which the nearest aliases are taken out of the series


def phi(x: Complexes) -> Complexes:
    """(e^x - 1) / x, and 1 at x = 0."""
    small = np.abs(x) < 1e-8
    safe = np.where(small, 1.0, x)
    return np.where(small, 1.0 + 0.5 * x, np.expm1(safe) / safe)


def from_poles(
    poles: Complexes, residues: Complexes, delay_s: Floats, frequency_hz: Floats, period_s: float
) -> Complexes:
    """Sampled response from poles and residues of the continuous transfer function.

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


def nodes_at(frequency_hz: Floats, period_s: float) -> _Nodes:
    """The tables of these frequencies, kept from one call to the next."""
    return _nodes(np.ascontiguousarray(frequency_hz, float).tobytes(), period_s)


@lru_cache(maxsize=64)
def _nodes(frequency_bytes: bytes, period_s: float) -> _Nodes:
    return _Nodes(np.frombuffer(frequency_bytes), period_s)


def laurent(numerator: Polynomial, denominator: Polynomial, period_s: float) -> Floats:
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


@lru_cache(maxsize=1)
def _bernoulli_table() -> tuple[Floats, Floats]:
    """Coefficients of B_n(x)/n! in powers of x (row n), and (-1)^q binom(p + q, p)."""
    top = 2 * ORDER + 1
    numbers = bernoulli(top) / factorial(np.arange(top + 1))
    coefficients = np.zeros((top + 1, top + 1))
    for n in range(top + 1):
        powers = np.arange(n + 1)
        coefficients[n, : n + 1] = numbers[n - powers] / factorial(powers)
    p, q = np.arange(ORDER)[:, None], np.arange(ORDER + 1)[None, :]
    return coefficients, (-1.0) ** q * comb(p + q, p)


@lru_cache(maxsize=1)
def alias_tables() -> tuple[Floats, Floats, Floats]:
    """What `_alias_coefficients` is made of, as the compiled form reads it: even and odd apart.

    Returns
    -------
    bernoulli : ndarray, shape (N, 2, N / 2)
        Coefficients of B_n(x)/n!, of the even n and the odd ones, for each power of x.
    binomials : ndarray, shape (ORDER + 1, 2, ORDER / 2)
        (-1)^q binom(p + q, p) for each q, of the even p and the odd ones, with the signs of j^p.
    economy : ndarray, shape (ORDER / 2 - ECONOMY, ECONOMY)
        What each higher power of z = theta^2 adds to the coefficients of the lower ones, up to
        z = HIGH^2.
    """
    coefficients, binomials = _bernoulli_table()
    signed = binomials * np.resize(np.array([1.0, 1.0, -1.0, -1.0]), ORDER)[:, None]
    return _parted(coefficients.T), _parted(signed.T), _economy_table()


def _parted(rows: Floats) -> Floats:
    """The even and the odd columns of each row, one after the other."""
    return np.ascontiguousarray(np.swapaxes(rows.reshape(len(rows), -1, 2), 1, 2))


def _economy_table() -> Floats:
    """Lanczos's economisation: the higher powers' Chebyshev series over [0, HIGH^2], cut off.

    The aliases' poles are farther than d = 2 pi (1 - REACH) + HIGH from s = 0.  Powers of s up to
    HIGH are off by (HIGH / d)^28 = 1e-9 of the aliases where ORDER of them are taken, and Chebyshev
    polynomials, as many as 2 ECONOMY, by (r + sqrt(r^2 - 1))^-20 = 1e-12 with r = d / HIGH.
    """
    higher = np.arange(ECONOMY, ORDER // 2)
    table = np.array(
        [
            PowerSeries.basis(power)
            .convert(domain=[0, 1], kind=Chebyshev)
            .truncate(ECONOMY)
            .convert(domain=[-1, 1], kind=PowerSeries)
            .coef
            for power in higher
        ]
    )
    return table * HIGH ** (2.0 * (higher[:, None] - np.arange(ECONOMY)))


def _alias_sums(x: Floats, far: bool) -> Floats:
    """B_n(x)/n! for delays of x periods, shape (N, len(x)); `far`: without the terms k = 1, -1."""
    coefficients, _ = _bernoulli_table()
    sums = coefficients @ x ** np.arange(coefficients.shape[1])[:, None]
    if far:  # B_n(x)/n! = -sum over k != 0 of e^{2 pi j k x} / (2 pi j k)^n
        turns = (2j * np.pi) ** -np.arange(len(sums), dtype=float)[:, None]
        sums[1:] += 2 * np.real(np.exp(2j * np.pi * x) * turns[1:])
    return sums


def _alias_coefficients(h: Floats, late: Floats, far: bool = False) -> Floats:
    """A_p of the module's docstring, shape (ORDER, B)."""
    _, binomials = _bernoulli_table()
    index = np.arange(ORDER)[:, None] + np.arange(ORDER + 1)[None, :] + 1
    if np.all(late == late[0]):
        return (binomials * _alias_sums(late[:1], far)[index, 0]) @ h
    beta = _alias_sums(late, far)
    out = np.empty((ORDER, h.shape[1]))
    for p in range(ORDER):
        out[p] = np.einsum("qb,qb->b", binomials[p][:, None] * h, beta[p + 1 : p + ORDER + 2])
    return out


def from_polynomials(
    numerator: Polynomial,
    denominator: Polynomial,
    delay_s: Floats,
    frequency_hz: Floats,
    period_s: float,
) -> tuple[Complexes, NDArray[np.bool_]]:
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
    nodes = nodes_at(frequency_hz, period_s)
    h = laurent(numerator, denominator, period_s)
    good = (fastest_pole(h) + nodes.reach) / (2 * np.pi) < REACH
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


def fastest_pole(h: Floats) -> Floats:
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
