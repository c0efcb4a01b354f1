"""Sampled response of a mechanism behind filters, in plain NumPy: what `rational.py` must give."""

from __future__ import annotations

import numpy as np

from bayeshaptic.models.response.filtered import Filters, fast_filters, filtered, parted
from bayeshaptic.models.response.mechanism import Mechanism
from bayeshaptic.models.response.poles import poles_and_residues
from bayeshaptic.models.response.sampled import from_poles, from_polynomials
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
