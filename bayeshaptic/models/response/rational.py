"""Sampled response of a mechanism behind filters, for large batches: compiled.

The formulas are those of `sampled.py` and `filtered.py`; `tests/plain_response.py` is the same in
plain NumPy.  What takes one number a row is prepared for the whole batch; what takes one a
frequency is left to `kernels/rational.py`, a vector at a time, so that no result depends on the
batch around it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from bayeshaptic.models.response.filtered import Filters, fast_filters, filtered, parted
from bayeshaptic.models.response.kernels.arrays import RationalArrays
from bayeshaptic.models.response.mechanism import Mechanism
from bayeshaptic.models.response.poles import poles_and_residues
from bayeshaptic.models.response.sampled import HIGH, ORDER, REACH, alias_tables, phi
from bayeshaptic.models.response.transfer import transfer
from bayeshaptic.types import Complexes, Floats, Ints


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
    mechanism: Mechanism, filters: Filters, delay_s: Floats, frequency_hz: Floats, period_s: float
) -> RationalArrays:
    """Prepare a batch of mechanisms, each behind its filters and delay, for these frequencies."""
    from bayeshaptic.models.response.kernels.expansion import expand

    nodes = nodes_at(frequency_hz, period_s)
    top, bottom = transfer(mechanism)
    turns = delay_s / period_s
    terms: list[PoleTerms] = []
    if filters:
        top, bottom, terms = _behind(top, bottom, filters, turns, period_s)
    above, below = (np.empty((len(turns), 2, _groups(p.shape[1]))) for p in (top, bottom))
    series, fastest = np.empty((len(turns), ORDER + 1)), np.empty(len(turns))
    expand(
        np.ascontiguousarray(top),
        np.ascontiguousarray(bottom),
        period_s,
        above,
        below,
        series,
        fastest,
    )
    bad = np.flatnonzero(~((fastest + nodes.reach) / (2 * np.pi) < REACH))
    if bad.size:
        own = tuple(factor.rows(bad) for factor in filters)
        p, r = poles_and_residues(mechanism.rows(bad), own)
        terms.append(PoleTerms(bad, True, *_closed_form(p * period_s, r * period_s, turns[bad])))
    poles = _gathered(terms, len(turns))
    tables = alias_tables()
    return RationalArrays(
        above, below, series, turns, *poles, nodes.theta, nodes.hold, nodes.high, *tables
    )


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
    """Poles in the closed form, for some rows of a batch.

    Attributes
    ----------
    rows : ndarray of int, shape (R,)
    alone : bool
        Whether they are all there is: the series does not hold.
    direct, late, centre : ndarray, shape (R, n)
        Numerators without and with a further z^-1, and what is subtracted from z - 1.
    """

    rows: Ints
    alone: bool
    direct: Complexes
    late: Complexes
    centre: Complexes


def _behind(
    top: Floats, bottom: Floats, filters: Filters, turns: Floats, period_s: float
) -> tuple[Floats, Floats, list[PoleTerms]]:
    """Numerators and denominators behind filters, the fast ones of which are parted from them."""
    whole_top, whole_bottom = (p.T for p in filtered(top.T, bottom.T, filters))
    fast = np.flatnonzero(fast_filters(filters, len(turns), period_s))
    if not fast.size:
        return whole_top, whole_bottom, []
    own = tuple(factor.rows(fast) for factor in filters)
    rest, p, r = parted(top[fast].T, bottom[fast].T, own)
    closed = _closed_form(p.T * period_s, r.T * period_s, turns[fast])
    top = _with_rows(whole_top, fast, rest.T)
    return top, _with_rows(whole_bottom, fast, bottom[fast]), [PoleTerms(fast, False, *closed)]


def _with_rows(whole: Floats, rows: Ints, part: Floats) -> Floats:
    """Polynomials (B, n), some rows of them replaced by others of any length."""
    out = np.zeros((len(whole), max(whole.shape[1], part.shape[1])))
    out[:, : whole.shape[1]] = whole
    out[rows] = 0.0
    out[rows, : part.shape[1]] = part
    return out


def _closed_form(p: Complexes, r: Complexes, turns: Floats) -> tuple[Complexes, ...]:
    """Numerators and centres of poles and residues, each times the period."""
    late = (turns - np.floor(turns))[:, None]
    early = 1.0 - late
    with np.errstate(all="ignore"):
        direct = r * early * phi(p * early)
        second = r * np.exp(p * early) * late * phi(p * late)
        return direct, second, np.expm1(p)


def _gathered(terms: list[PoleTerms], batch: int) -> tuple[Ints, Floats, Floats, Floats]:
    """The terms of all rows; what is said last of a row holds."""
    count = np.zeros(batch, int)
    widest = max((part.direct.shape[1] for part in terms), default=0)
    tables = np.zeros((3, batch, widest, 2))
    for part in terms:
        width = part.direct.shape[1]
        count[part.rows] = -width if part.alone else width
        for table, values in zip(tables, (part.direct, part.late, part.centre), strict=True):
            table[part.rows, :width, 0] = values.real
            table[part.rows, :width, 1] = values.imag
    return count, *tables


def nodes_at(frequency_hz: Floats, period_s: float) -> Nodes:
    """The tables of these frequencies, kept from one call to the next."""
    return _nodes(np.ascontiguousarray(frequency_hz, float).tobytes(), period_s)


@lru_cache(maxsize=64)
def _nodes(frequency_bytes: bytes, period_s: float) -> Nodes:
    theta = 2 * np.pi * np.frombuffer(frequency_bytes) * period_s
    hold = -np.expm1(-1j * theta)
    return Nodes(
        theta,
        np.stack([hold.real, hold.imag]),
        np.flatnonzero(np.abs(theta) > HIGH),
        min(float(np.max(np.abs(theta), initial=0.0)), HIGH),
    )
