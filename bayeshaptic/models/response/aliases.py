r"""What dynamic links add to a response, sampled: behind a hold, and with its aliases.

The remainder `Delta P` falls off so quickly (s^-4 or faster) that its aliases, in

.. math:: \Delta G = \frac{1 - e^{-sT}}{T} \sum_k e^{-s_k t_d} \frac{\Delta P(s_k)}{s_k},
          \qquad s_k = s + j \frac{2 \pi k}{T},

can be summed term by term, and so smoothly where no pole is near the Nyquist frequency that the sum
without k = 0 is a short Chebyshev series in the frequency.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import chebyshev

from bayeshaptic.models.response.dynamic_link import Index
from bayeshaptic.models.response.rational import fastest_of
from bayeshaptic.models.response.remainder import Remainder, real_pairs
from bayeshaptic.types import Bools, Complexes, Floats, Ints

_ALIASES = 8  # on either side
_MOST_ALONE = 3  # the nearest alias that a series begins with; those before are summed themselves
_TERMS = 16  # of the Chebyshev series
_FAR_TERMS = 8  # of those beyond the nearest ones: 2 pi further from all poles, and far smaller
_REACH = 5.2  # |p_max| T + theta up to which it converges to 1e-8 of itself


@dataclass(frozen=True)
class Aliases:
    """The sum over k != 0 of e^{-j 2 pi k td / T} Delta P(s_k) / s_k, for 0 <= w T <= top.

    Attributes
    ----------
    coefficients : ndarray of complex, shape (_TERMS, B)
        Chebyshev series in the angle w T.
    top : float
    """

    coefficients: Complexes
    top: float

    def at(self, theta: Floats, index: Index) -> Complexes:
        """Values at angles of shape (..., B') for the part `index` of the batch."""
        x = 2 * theta / self.top - 1
        return np.asarray(chebyshev.chebval(x, self.coefficients[:, index], tensor=False))

    def sampled(
        self, values: Complexes, theta: Floats, index: Index, turns: Floats, period_s: float
    ) -> Complexes:
        """`Remainder.on_axis` with its aliases, behind hold and delay, at angles (L, B')."""
        from bayeshaptic.models.response.kernels.remainder import sampled

        series = real_pairs(np.ascontiguousarray(self.coefficients[:, index]))
        angles, turns = np.ascontiguousarray(theta), np.ascontiguousarray(turns)
        sampled(angles, series, self.top, turns, period_s, real_pairs(values))
        return values


def aliases(
    remainder: Remainder, top: float, delay_s: Floats, period_s: float, nearest: int = 1
) -> Aliases:
    """The sum as a Chebyshev series; only where `smooth_aliases` says so.

    Without the aliases nearer than `nearest` that is so for poles that are faster by
    2 pi / T for each of them.
    """

    def series(terms: int, first: int, last: int) -> Complexes:
        x, inverse = _chebyshev_nodes(terms)
        angles = (x + 1) * top / 2
        return inverse @ _shared_alias_sums(remainder, angles, delay_s, period_s, first, last)

    coefficients = series(_TERMS, nearest, nearest)
    coefficients[:_FAR_TERMS] += series(_FAR_TERMS, nearest + 1, _ALIASES)
    return Aliases(coefficients, top)


def smooth_aliases(fastest: Floats, top: float) -> Bools:
    """Where they are so up to the angle `top`, for mechanisms with |p T| <= `fastest`."""
    return fastest + top < _REACH


def alias_sums(
    remainder: Remainder, theta: Floats, delay_s: Floats, period_s: float, nearest: int = 1
) -> Complexes:
    """The same sum, term by term, at angles of shape (L,) or (..., B); shape (L, B) or (..., B).

    Without those nearer than `nearest`.
    """
    if theta.ndim == 1:
        return _shared_alias_sums(remainder, theta, delay_s, period_s, nearest, _ALIASES)
    total: Complexes | float = 0.0
    for k in _numbers(nearest, _ALIASES):
        s = 1j * (theta + 2 * np.pi * k) / period_s
        total = total + np.exp(-2j * np.pi * k * delay_s / period_s) * remainder.at(s) / s
    return np.asarray(total)


def _shared_alias_sums(
    remainder: Remainder,
    theta: Floats,
    delay_s: Floats,
    period_s: float,
    nearest: int,
    furthest: int,
) -> Complexes:
    """`alias_sums` at angles that the batch shares, shape (L,): all aliases in one call."""
    k = _numbers(nearest, furthest)
    omega = ((theta + 2 * np.pi * k[:, None]) / period_s).ravel()
    values = remainder.on_axis(omega)
    turned = np.exp(-2j * np.pi * k[:, None] * delay_s / period_s)
    # By name: where a series reaches everything there is no alias, and nothing to count from.
    return np.einsum("kb,klb->lb", turned, values.reshape(len(k), len(theta), values.shape[-1]))


@cache
def _numbers(nearest: int, furthest: int) -> Ints:
    """Of the aliases on both sides."""
    return np.r_[-furthest : 1 - nearest, nearest : furthest + 1]


@cache
def _chebyshev_nodes(terms: int) -> tuple[Floats, Floats]:
    """Nodes in [-1, 1], and the matrix from values there to coefficients."""
    x = chebyshev.chebpts1(terms)
    matrix = np.asarray(np.linalg.inv(chebyshev.chebvander(x, terms - 1)), float)
    return x, matrix


def sampled_remainder(
    remainder: Remainder, delay_s: Floats, frequency_hz: Floats, period_s: float
) -> Complexes:
    """Delta G at frequencies of shape (L,), with hold and delay; shape (B, L)."""
    from bayeshaptic.models.response.kernels.remainder import hold_and_delay

    omega = 2 * np.pi * np.asarray(frequency_hz, float)
    theta = omega * period_s
    total = remainder.on_axis(omega)
    top = float(np.max(theta))
    fastest = fastest_of(remainder.compliances[1, 1], remainder.denominator, period_s)
    few = len(theta) <= _TERMS
    nearest = np.maximum(1 + np.ceil((fastest + top - _REACH) / (2 * np.pi)), 1)
    series_from = np.zeros(len(fastest), int)  # 0: no series converges, or nothing is a number
    converges = (nearest <= _MOST_ALONE) & (not few)
    series_from[converges] = nearest[converges]
    for first in np.unique(series_from):
        rows = series_from == first
        part = remainder if rows.all() else remainder.rows(rows)
        late = delay_s[rows]
        if first == 0:
            total[:, rows] += alias_sums(part, theta, late, period_s)
            continue
        series = aliases(part, top, late, period_s, first)
        powers = chebyshev.chebvander(2 * theta / top - 1, _TERMS - 1)
        coefficients = np.ascontiguousarray(series.coefficients)
        total[:, rows] += (powers @ coefficients.view(float)).view(complex)
        if first > 1:
            total[:, rows] += _shared_alias_sums(part, theta, late, period_s, 1, first - 1)
    out = np.empty((len(delay_s), len(theta)), complex)
    hold = np.ascontiguousarray(-np.expm1(-(1j * omega) * period_s) / period_s)
    turns = np.ascontiguousarray(delay_s / period_s)
    hold_and_delay(
        theta, real_pairs(hold), turns, real_pairs(np.ascontiguousarray(total)), real_pairs(out)
    )
    return out
