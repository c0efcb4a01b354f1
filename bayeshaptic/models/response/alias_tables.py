r"""The sum over aliases that makes a sampled response, and the tables of its series.

With s_k = s + j 2 pi k / T, a mechanism P behind a zero-order hold and a delay responds with

.. math:: G(e^{sT}) = \frac{1 - e^{-sT}}{T} \sum_k e^{-s_k t_d} \frac{P(s_k)}{s_k}.

The term k = 0 is taken from the polynomials of P as it stands.  In all others |s_k| is beyond the
poles, so P(s) = sum_q h_q s^-q there, and the sum over k of e^{-s_k td} s_k^{-q-1}, expanded in
powers of sT, is a Bernoulli polynomial B_n(x)/n! of x = td/T - floor(td/T):

.. math:: \sum_{k \ne 0} \to T e^{-s t_d} \sum_p (sT)^p A_p, \qquad
          A_p = \sum_q (-1)^q h_q T^q \binom{p+q}{p} \frac{B_{p+q+1}(x)}{(p+q+1)!}.

It converges like ((|p_max| + |s|) T / 2 pi)^n, needs no poles, and does not mind double ones.
Towards the Nyquist frequency the terms k = 1 and -1 are taken as they stand, too, and what is left
converges like ((|p_max| + |s|) T / 4 pi)^n.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial as PowerSeries
from scipy.special import bernoulli, comb, factorial

from bayeshaptic.types import Floats

ORDER = 28  # terms in 1/s and in s that the alias series keeps
REACH = 0.62  # (|p_max| + |s|) T / 2 pi up to which the series is used: relative error < 1e-9
ECONOMY = 10  # powers of (sT)^2 that stand for ORDER / 2 of them when compiled; `_economy_table`
HIGH = 2.2  # |s| T above which the nearest aliases are taken out of the series


@lru_cache(maxsize=1)
def bernoulli_table() -> tuple[Floats, Floats]:
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
    """What the coefficients A_p are made of, as the compiled form reads it: even and odd apart.

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
    coefficients, binomials = bernoulli_table()
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
