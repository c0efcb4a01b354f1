"""Sampled response of a mechanism behind filters, for large batches: compiled.

The formulas are those of `alias_tables.py`, filters are those of `filters.py`;
`tests/references/plain_response.py` is the same in plain NumPy.  What takes one number a row is
prepared for the whole batch; what takes one a frequency is left to `kernels/rational.py`, a vector
at a time, so that no result depends on the batch around it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from bayeshaptic.models.response.alias_tables import HIGH, ORDER, REACH, alias_tables
from bayeshaptic.models.response.dynamic_link import DynamicLink
from bayeshaptic.models.response.filters import Filters, filtered
from bayeshaptic.models.response.kernels.arrays import RationalArrays
from bayeshaptic.models.response.mechanism import Mechanism
from bayeshaptic.models.response.poles import poles_of
from bayeshaptic.models.response.transfer import transfer, transfer_with_link
from bayeshaptic.numerics.polynomials.polynomial import Polynomial, roots
from bayeshaptic.types import Complexes, Floats, Ints

_MOST_KEPT = 100_000  # frequencies whose tables are kept: those of all lines of an hour are 70 MB


@dataclass(frozen=True)
class Nodes:
    """Tables that depend on the frequencies and the period alone.

    Attributes
    ----------
    theta : ndarray, shape (L,)
        Angles w T.
    hold : ndarray, shape (2, L)
        1 - e^{-j theta}, real and imaginary part.
    high : ndarray of int
        Where the nearest aliases are to be taken by themselves.
    reach : float
        The largest angle of the others.
    """

    theta: Floats
    hold: Floats
    high: Ints
    reach: float


def rational_form(
    mechanism: Mechanism,
    filters: Filters,
    delay_s: Floats,
    frequency_hz: Floats,
    period_s: float,
    link: DynamicLink | None = None,
) -> RationalArrays:
    """Prepare a batch of mechanisms, each behind its filters and delay, for these frequencies.

    `link` is one more whose law is a ratio of polynomials.
    """
    nodes = nodes_at(frequency_hz, period_s)
    plain = transfer(mechanism) if link is None else transfer_with_link(mechanism, link)
    top, bottom = plain
    turns = delay_s / period_s
    terms = PoleTerms(np.zeros(len(turns), int), np.zeros((len(turns), 0, 3, 2)))
    if filters:
        top, bottom, terms = _behind(top, bottom, filters, turns, period_s)
    above, below, series, fastest = _expanded(top, bottom, period_s)
    bad = np.flatnonzero(~((fastest + nodes.reach) / (2 * np.pi) < REACH))
    if bad.size:
        own = tuple(factor.rows(bad) for factor in filters)
        part = mechanism.rows(bad)
        poles = poles_of(part, plain[1][bad].T, own, link and link.rows(bad))
        whole = filtered(plain[0][bad].T, plain[1][bad].T, own)
        terms = terms.alone(bad, _closed_form(*whole, poles, turns[bad], period_s))
    at, tables = (nodes.theta, nodes.hold, nodes.high), alias_tables()
    return RationalArrays(above, below, series, turns, terms.count, terms.table, *at, *tables)


def _expanded(
    top: Floats, bottom: Floats, period_s: float
) -> tuple[Floats, Floats, Floats, Floats]:
    """Both polynomials as the kernel reads them, their series for large s, and |p_max| T."""
    from bayeshaptic.models.response.kernels.expansion import expand

    batch = len(top)
    above, below = (np.empty((batch, 2, _groups(p.shape[1]))) for p in (top, bottom))
    series, fastest = np.empty((batch, ORDER + 1)), np.empty(batch)
    polynomials = np.ascontiguousarray(top), np.ascontiguousarray(bottom)
    expand(*polynomials, period_s, above, below, series, fastest)
    return above, below, series, fastest


def fastest_of(numerator: Polynomial, denominator: Polynomial, period_s: float) -> Floats:
    """|p_max| T of ratios of polynomials, shape (B,), as their series in 1/s tell it."""
    return _expanded(numerator.T, denominator.T, period_s)[3]


def _groups(coefficients: int) -> int:
    """Room for the even or odd ones of so many coefficients, in groups of four."""
    return 4 * -(-coefficients // 8)


def sampled_response(form: RationalArrays) -> Complexes:
    """The sampled response at the nodes, shape (B, L)."""
    from bayeshaptic.models.response.kernels.rational import respond

    parts = np.empty((len(form.turns), 2, len(form.theta)))
    respond(form, parts)
    response = np.empty((len(parts), parts.shape[2]), complex)
    response.real, response.imag = parts[:, 0], parts[:, 1]
    return response


@dataclass(frozen=True)
class PoleTerms:
    """Poles in the closed form.

    Attributes
    ----------
    count : ndarray of int, shape (B,)
        How many there are; negative where they are all there is: the series does not hold.
    table : ndarray, shape (B, n, 3, 2)
        Numerators without and with a further z^-1, and what is subtracted from z - 1; real and
        imaginary parts.
    """

    count: Ints
    table: Floats

    def alone(self, rows: Ints, table: Floats) -> PoleTerms:
        """These poles, shape (R, n, 3, 2), and no others, in some rows of the batch."""
        width = max(self.table.shape[1], table.shape[1])
        wider = np.zeros((len(self.count), width, 3, 2))
        wider[:, : self.table.shape[1]] = self.table
        wider[rows, : table.shape[1]] = table
        count = self.count.copy()
        count[rows] = -table.shape[1]
        return PoleTerms(count, wider)


def _behind(
    top: Floats, bottom: Floats, filters: Filters, turns: Floats, period_s: float
) -> tuple[Floats, Floats, PoleTerms]:
    """Numerators and denominators behind filters, the fast ones of which are parted from them."""
    from bayeshaptic.models.response.kernels.filters import part

    batch = len(turns)
    own = np.concatenate([np.zeros((batch, 0)), *(roots(f.denominator) for f in filters)], axis=1)
    tops, above = _together([f.numerator for f in filters], batch)
    bottoms, below = _together([f.denominator for f in filters], batch)
    longer_top = max(top.shape[1] + int(np.sum(above - 1)), bottom.shape[1] - 1)
    out_top = np.empty((batch, longer_top))
    out_bottom = np.empty((batch, bottom.shape[1] + own.shape[1]))
    terms = PoleTerms(np.empty(batch, int), np.zeros((batch, own.shape[1], 3, 2)))
    part(
        np.ascontiguousarray(top),
        np.ascontiguousarray(bottom),
        tops,
        bottoms,
        np.stack([above, below]),
        own.astype(complex),
        turns,
        period_s,
        out_top,
        out_bottom,
        terms.count,
        terms.table,
    )
    return out_top, out_bottom, terms


def _together(polynomials: list[Floats], batch: int) -> tuple[Floats, Ints]:
    """Polynomials in one array, (F, n, B), and how many coefficients each has."""
    lengths = np.array([len(polynomial) for polynomial in polynomials], int)
    out = np.zeros((len(polynomials), int(lengths.max(initial=1)), batch))
    for place, polynomial in zip(out, polynomials, strict=True):
        place[: len(polynomial)] = polynomial
    return out, lengths


def _closed_form(
    top: Polynomial, bottom: Polynomial, poles: Complexes, turns: Floats, period_s: float
) -> Floats:
    """The table of all poles, shape (R, n, 3, 2)."""
    from bayeshaptic.models.response.kernels.filters import close

    table = np.empty((*poles.shape, 3, 2))
    lead = np.ascontiguousarray(bottom[-1])
    close(np.ascontiguousarray(top.T), lead, np.ascontiguousarray(poles), turns, period_s, table)
    return table


def nodes_at(frequency_hz: Floats, period_s: float) -> Nodes:
    """The tables of these frequencies, kept from one call to the next where they are windows'."""
    frequency_hz = np.ascontiguousarray(frequency_hz, float)
    if frequency_hz.size > _MOST_KEPT:
        return _tables(frequency_hz, period_s)
    return _kept(frequency_hz.tobytes(), period_s)


@lru_cache(maxsize=64)
def _kept(frequency_bytes: bytes, period_s: float) -> Nodes:
    return _tables(np.frombuffer(frequency_bytes), period_s)


def _tables(frequency_hz: Floats, period_s: float) -> Nodes:
    theta = 2 * np.pi * frequency_hz * period_s
    hold = -np.expm1(-1j * theta)
    return Nodes(
        theta,
        np.stack([hold.real, hold.imag]),
        np.flatnonzero(np.abs(theta) > HIGH),
        min(float(np.max(np.abs(theta), initial=0.0)), HIGH),
    )
