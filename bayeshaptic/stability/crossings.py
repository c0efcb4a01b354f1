"""Every frequency at which the sampled response is real and negative."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import elementwise

from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.stability.responses.evaluated import EvaluableSystem, EvaluatedResponse
from bayeshaptic.stability.responses.grid import in_chunks, search_grid
from bayeshaptic.stability.responses.linked import linked_response
from bayeshaptic.stability.responses.response import PoleResponse, Response, pole_response
from bayeshaptic.types import Floats, Ints


@dataclass(frozen=True)
class Crossings:
    """All crossings of a batch of loops, lowest stiffness first.

    Attributes
    ----------
    frequency_hz : ndarray, shape (B, C)
        Where the response is real and negative; padded with nan.  1/(2T) is the Nyquist frequency.
    stiffness : ndarray, shape (B, C)
        -1/G there: the gain that puts a closed-loop pole on the unit circle at that frequency.
    stable_at_rest : ndarray of bool, shape (B,)
        False where the loop is unstable for every small K > 0.
    """

    frequency_hz: Floats
    stiffness: Floats
    stable_at_rest: NDArray[np.bool_]

    @property
    def critical(self) -> Floats:
        """K_CR, shape (B,): the lowest crossing; 0 if never stable; inf without a crossing."""
        lowest = np.where(np.isnan(self.stiffness[:, 0]), np.inf, self.stiffness[:, 0])
        return np.where(self.stable_at_rest, lowest, 0.0)

    @property
    def binding_hz(self) -> Floats:
        """Frequency of the binding crossing, shape (B,); 0 if never stable; nan without one."""
        return np.where(self.stable_at_rest, self.frequency_hz[:, 0], 0.0)


def find_crossings(
    system: LinearSystem | EvaluableSystem, period_s: float, approximation: str = "exact"
) -> Crossings:
    """Every crossing of a batch of loops in (0, pi/T], the Nyquist frequency included.

    Parameters
    ----------
    system : LinearSystem
        Mechanism, delay, filters and dynamic links of B parameter vectors.  Any other system with
        ``rational = False`` is searched on a fine grid, by its sampled response alone.
    period_s : float
    approximation : {"exact", "continuous"}
        "continuous" looks at P(s) e^{-s (td + T/2)} instead, as the paper does.

    Returns
    -------
    Crossings
    """
    return search(response_of(system, period_s, approximation == "exact"), period_s)


def response_of(
    system: LinearSystem | EvaluableSystem, period_s: float, exact: bool = True
) -> Response:
    """The response of a batch of loops in the form that its kind of system allows.

    From poles where there are finitely many, with dynamic links as poles and a remainder, else by
    evaluation alone.

    Parameters
    ----------
    system : LinearSystem or EvaluableSystem
    period_s : float
        Sampling period, s.
    exact : bool
        False: the continuous approximation P(s) e^{-s (td + T/2)}.
    """
    if isinstance(system, LinearSystem) and system.has_rational_form:
        found = pole_response(system, period_s, exact)
        if np.isfinite(found.poles).all():
            return found
    if isinstance(system, LinearSystem) and system.dynamic_links:
        return linked_response(system, period_s, exact)
    return EvaluatedResponse(system, period_s, exact)


def rational(system: LinearSystem | EvaluableSystem) -> bool:
    """Whether the loop has finitely many poles; a system may say otherwise by itself."""
    return bool(getattr(system, "rational", True))


def search(response: Response, period_s: float) -> Crossings:
    """Every crossing of a response, with its ends at zero frequency and at the Nyquist frequency.

    Compiled where the response has finitely many poles.

    Parameters
    ----------
    response : Response
        Of B loops.
    period_s : float
        Sampling period, s.

    Returns
    -------
    Crossings
    """
    if isinstance(response, PoleResponse):
        row, theta, gain = _compiled_search(response)
    else:
        row, theta, gain = plain_search(response)
    static, nyquist = response.at_ends()
    batch = len(response.delay)
    ends = np.arange(batch)
    row = np.concatenate([row, ends, ends])
    theta = np.concatenate([theta, np.zeros(batch), np.full(batch, np.pi)])
    gain = np.concatenate([gain, static, nyquist])
    with np.errstate(invalid="ignore"):
        keep = (gain < 0) & np.isfinite(gain)
    stiffness = -1.0 / gain[keep]
    frequency = theta[keep] / (2 * np.pi * period_s)
    return Crossings(*_padded(row[keep], stiffness, frequency, batch), response.stable_at_rest())


def _compiled_search(response: PoleResponse) -> tuple[Ints, Floats, Floats]:
    """What `plain_search` gives, a row at a time."""
    from bayeshaptic.stability import crossings_kernel

    batch = len(response.delay)
    # The phase of the delay passes -180 degrees every other turn, and each pole may turn it once.
    most = 2 * int(response.delay.max()) + 4 * response.poles.shape[1] + 8
    theta, gain = np.empty((2, batch, most))
    count = np.empty(batch, int)
    crossings_kernel.find(
        crossings_kernel.Poles(
            response.poles,
            response.direct,
            response.late,
            response.centre,
            response.delay,
            response.exact,
            response.log_points,
        ),
        theta,
        gain,
        count,
    )
    used = np.arange(theta.shape[1]) < count[:, None]
    return np.nonzero(used)[0], theta[used], gain[used]


def plain_search(response: Response) -> tuple[Ints, Floats, Floats]:
    """Crossings between the ends: scan, look into the dips, refine.

    This is the slow, obvious form of `crossings_kernel.py`, and serves where there are no poles.

    Parameters
    ----------
    response : Response

    Returns
    -------
    row, theta, gain : ndarray, shape (M,)
        Of which loop, at which angle, and the real value of the response there.
    """
    scans = [_scan(response, rows) for rows in in_chunks(len(response.delay))]
    row, low, high = (np.concatenate(part) for part in zip(*scans, strict=True))

    def value(theta: Floats, row: Ints) -> Floats:
        return _sine(response.at(row, theta[:, None])[:, 0])

    tolerance = 1e-13  # of a crossing's angle
    found = elementwise.find_root(value, (low, high), args=(row,), tolerances={"xrtol": tolerance})
    theta = np.asarray(found.x)
    return row, theta, response.at(row, theta[:, None])[:, 0].real


def _sine(response: NDArray[np.complex128]) -> Floats:
    """Im(-G)/|G|: the sine of how far the phase is from -180 degrees.

    It is 0 where G is: a mass without damping or delay has a zero at the Nyquist frequency.
    """
    size = np.abs(response)
    return np.divide(-response.imag, size, out=np.zeros_like(size), where=size > 0)


def _scan(response: Response, rows: slice) -> tuple[Ints, Floats, Floats]:
    """Brackets (row, low, high) of the sign changes of one chunk."""
    theta = search_grid(response, rows)
    index = np.arange(rows.start, rows.stop)
    value = response.at(index, theta)
    sine, negative = _sine(value), value.real < 0
    change = np.signbit(sine[:, 1:]) != np.signbit(sine[:, :-1])
    change &= negative[:, 1:] | negative[:, :-1]
    i, k = np.nonzero(change)
    found = (index[i], theta[i, k], theta[i, k + 1])
    size = np.abs(sine)
    dip = (size[:, 1:-1] <= size[:, :-2]) & (size[:, 1:-1] < size[:, 2:])
    dip &= negative[:, 1:-1] & ~change[:, 1:] & ~change[:, :-1]
    i, k = np.nonzero(dip)
    if not i.size:
        return found
    deeper = _dips(response, index[i], theta[i, k], theta[i, k + 2])
    return tuple(np.concatenate(pair) for pair in zip(found, deeper, strict=True))  # type: ignore[return-value]


def _dips(response: Response, row: Ints, low: Floats, high: Floats) -> tuple[Ints, Floats, Floats]:
    """Pairs of sign changes hidden between grid points: zoom in where |sine| has a minimum."""
    dip_points = 17
    steps = np.linspace(0.0, 1.0, dip_points)
    found = []
    dip_rounds = 5
    for _ in range(dip_rounds):
        theta = low[:, None] + (high - low)[:, None] * steps
        sine = _sine(response.at(row, theta))
        change = np.signbit(sine[:, 1:]) != np.signbit(sine[:, :-1])
        i, k = np.nonzero(change)
        found.append((row[i], theta[i, k], theta[i, k + 1]))
        left = ~change.any(axis=1)
        if not left.any():
            break
        row, theta, sine = row[left], theta[left], sine[left]
        best = np.argmin(np.abs(sine), axis=1)
        pick = np.arange(len(best))
        low = theta[pick, np.maximum(best - 1, 0)]
        high = theta[pick, np.minimum(best + 1, dip_points - 1)]
    return tuple(np.concatenate(part) for part in zip(*found, strict=True))  # type: ignore[return-value]


def _padded(row: Ints, stiffness: Floats, frequency: Floats, batch: int) -> tuple[Floats, Floats]:
    """Flat lists as arrays (B, C) of frequency and stiffness, lowest stiffness first."""
    order = np.argsort(row, kind="stable")
    row = row[order]
    count = np.bincount(row, minlength=batch)
    column = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    shape = (batch, max(int(count.max(initial=0)), 1))
    frequency_table, stiffness_table = np.full(shape, np.nan), np.full(shape, np.nan)
    frequency_table[row, column] = frequency[order]
    stiffness_table[row, column] = stiffness[order]
    ranks = np.argsort(stiffness_table, axis=1, kind="stable")  # nan comes last
    return (
        np.take_along_axis(frequency_table, ranks, axis=1),
        np.take_along_axis(stiffness_table, ranks, axis=1),
    )
