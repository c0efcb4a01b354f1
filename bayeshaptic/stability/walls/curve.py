r"""The boundary of stability in the plane of a wall's stiffness K and damping B, loop by loop.

The loop :math:`u = -(K + B D(z)) y` has a pole at :math:`e^{j\theta}` where

.. math:: K + B D(e^{j\theta}) = -1 / G(e^{j\theta}), \qquad
          B = \frac{\mathrm{Im}(-1/G)}{\mathrm{Im} D}, \qquad
          K = \mathrm{Re}(-1/G) - B \, \mathrm{Re} D,

one curve for :math:`0 < \theta < \pi`, and where it has one at z = -1, the line
:math:`K + B D(-1) = -1/G(-1)`.  On the right of the curve, going with :math:`\theta`, the loop has
two more poles outside the unit circle than on its left: at a fixed B a pole leaves it with growing
K where :math:`\mathrm{Im}(-1/G) - B \, \mathrm{Im} D` grows with :math:`\theta`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import elementwise

from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.numerics.polynomials.polynomial import roots
from bayeshaptic.stability.crossings import response_of
from bayeshaptic.stability.responses.evaluated import EvaluableSystem
from bayeshaptic.stability.responses.grid import search_grid
from bayeshaptic.stability.responses.response import Response
from bayeshaptic.stability.walls.damping import Damping, derivative, derivative_at_nyquist
from bayeshaptic.types import Complexes, Floats, Ints


@dataclass(frozen=True, eq=False)
class InverseCurve:
    """-1/G of a batch of loops along the upper half of the unit circle.

    Attributes
    ----------
    response : Response
    period_s : float
    factor : ndarray, shape (n,)
        On -1/G: 1, or what widens the limit by more than the parameters say.
    theta : ndarray, shape (n, L)
        Angles, in ascending order.
    value : complex ndarray, shape (n, L)
    nyquist : ndarray, shape (n,)
        At z = -1.
    """

    response: Response
    period_s: float
    factor: Floats
    theta: Floats
    value: Complexes
    nyquist: Floats

    def at(self, rows: Ints, theta: Floats) -> Complexes:
        """-1/G of loops `rows`, shape (M,), at one angle each, shape (M,); complex, shape (M,)."""
        return -self.factor[rows] / self.response.at(rows, theta[:, None])[:, 0]

    def scaled(self, factor: Floats) -> InverseCurve:
        """With -1/G multiplied by `factor`, shape (n,)."""
        columns = factor[:, None]
        return InverseCurve(
            self.response,
            self.period_s,
            self.factor * factor,
            self.theta,
            self.value * columns,
            self.nyquist * factor,
        )


@dataclass(frozen=True, eq=False)
class KbCurve:
    """The boundaries of a batch of loops with a given damping term.

    Attributes
    ----------
    inverse : InverseCurve
    kind : Damping
    damping, stiffness : ndarray, shape (n, L)
        B and K along the curve.
    """

    inverse: InverseCurve
    kind: Damping
    damping: Floats
    stiffness: Floats

    def rate(self, theta: Floats) -> Complexes:
        """The velocity estimate D at angles `theta`, in 1/s; of their shape."""
        return derivative(self.kind, theta, self.inverse.period_s)


def kb_curve(inverse: InverseCurve, kind: Damping) -> KbCurve:
    """The boundaries in the K-B plane of loops whose -1/G is known.

    At each angle K + B D = -1/G has one solution: B = Im(-1/G) / Im(D), K = Re(-1/G) - B Re(D).

    Parameters
    ----------
    inverse : InverseCurve
    kind : Damping
    """
    rate = derivative(kind, inverse.theta, inverse.period_s)
    damping = inverse.value.imag / rate.imag
    return KbCurve(inverse, kind, damping, inverse.value.real - damping * rate.real)


@dataclass(frozen=True)
class Events:
    """Where boundaries meet a set of lines, in no particular order.

    Attributes
    ----------
    row, level : ndarray of int, shape (M,)
        Which loop, and which of the lines.
    place : ndarray, shape (M,)
        The coordinate along the line.
    poles : ndarray of int, shape (M,)
        How many more poles are outside the unit circle beyond it: 2, 1, -1 or -2.
    """

    row: Ints
    level: Ints
    place: Floats
    poles: Ints


@dataclass(frozen=True)
class _Features:
    """What `search_grid` reads of a response, with the zeros among the places to look at."""

    delay: Floats
    features: Complexes
    log_points: int


def inverse_curve(system: LinearSystem | EvaluableSystem, period_s: float) -> InverseCurve:
    """-1/G of a batch of loops on a grid that follows every resonance and antiresonance.

    Parameters
    ----------
    system : LinearSystem or EvaluableSystem
        Of n loops.
    period_s : float
        Sampling period, s.
    """
    response = response_of(system, period_s)
    features = response.features
    if isinstance(system, LinearSystem) and features.shape[1]:
        zeros = roots(system.rational_part.transfer()[0]) * period_s
        if zeros.shape[1]:
            features = np.concatenate([features, zeros], axis=1)
    look = _Features(response.delay, features, response.log_points)
    every = np.arange(len(response.delay))
    theta = search_grid(look, slice(0, len(every)))  # type: ignore[arg-type]
    top = np.pi * (1 - 1e-4)  # beyond it both imaginary parts are too small to divide
    theta = np.minimum(theta, top)
    value = np.empty(theta.shape, complex)
    chunk = 64  # rows at a time: the arrays of one chunk stay in the cache
    for start in range(0, len(every), chunk):
        rows = every[start : start + chunk]
        value[rows] = -1 / response.at(rows, theta[rows])
    with np.errstate(divide="ignore"):  # without damping G may be zero there: no limit
        nyquist = -1 / response.at_ends()[1]
    return InverseCurve(response, period_s, np.ones(len(every)), theta, value, nyquist)


def along_stiffness(curve: KbCurve, levels: Floats, lowest_above: Floats | None = None) -> Events:
    """Where the boundaries meet lines of constant damping.

    Parameters
    ----------
    curve : KbCurve
        Of n loops.
    levels : ndarray, shape (J,)
        Dampings B of the lines, ascending.
    lowest_above : ndarray, shape (n,), optional
        A stiffness of each loop.  Only the first boundary above it is wanted, so that places which
        cannot be that one are left out.

    Returns
    -------
    Events
        Their places are stiffnesses K.
    """
    inverse = curve.inverse
    row, level, segment, rising = _passages(curve.damping, levels)
    if lowest_above is not None:
        k = curve.stiffness
        ends = np.stack([k[row, segment], k[row, segment + 1]])
        kept = _may_be_lowest(row, level, ends, lowest_above[row], k.shape[0], len(levels))
        row, level, segment, rising = row[kept], level[kept], segment[kept], rising[kept]

    def off(index: Ints, theta: Floats) -> Floats:
        wanted = levels[level[index]] * curve.rate(theta)
        value = inverse.at(row[index], theta)
        return (value.imag - wanted.imag) / (np.abs(value) + np.abs(wanted))

    theta = _roots(off, inverse.theta, row, segment)
    stiffness = inverse.at(row, theta).real - levels[level] * curve.rate(theta).real
    on_line = inverse.nyquist[:, None] - levels * _at_nyquist(curve)
    outwards = curve.damping[:, -1:] < levels
    return _with_line(row, level, stiffness, np.where(rising, 2, -2), on_line, outwards)


def along_damping(curve: KbCurve, start: Floats) -> Events:
    """Where the boundaries of each loop meet its own line K = `start`, shape (n,).

    The places of the events are dampings B.
    """
    inverse = curve.inverse
    row, level, segment, rising = _passages(curve.stiffness - start[:, None], np.zeros(1))

    def off(index: Ints, theta: Floats) -> Floats:
        value = (inverse.at(row[index], theta) - start[row[index]]) / curve.rate(theta)
        return -value.imag / np.abs(value)

    theta = _roots(off, inverse.theta, row, segment)
    place = ((inverse.at(row, theta) - start[row]) / curve.rate(theta)).real
    on_line = (inverse.nyquist - start)[:, None] / _at_nyquist(curve)
    outwards = curve.damping[:, -1:] < on_line
    return _with_line(row, level, place, np.where(rising, -2, 2), on_line, outwards)


def _at_nyquist(curve: KbCurve) -> float:
    """D(-1), which ties K and B together on the line of the Nyquist frequency."""
    return derivative_at_nyquist(curve.kind, curve.inverse.period_s)


def _passages(values: Floats, levels: Floats) -> tuple[Ints, Ints, Ints, NDArray[np.bool_]]:
    """Every passage of `values` (n, L) through a level: row, level, segment, whether upwards."""
    above = np.searchsorted(levels, values, side="left")
    step = np.diff(above, axis=1)
    row, segment = np.nonzero(step)
    count = np.abs(step[row, segment])
    first = np.minimum(above[row, segment], above[row, segment + 1])
    within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    level = np.repeat(first, count) + within
    rising = np.repeat(step[row, segment] > 0, count)
    return np.repeat(row, count), level, np.repeat(segment, count), rising


def _may_be_lowest(
    row: Ints, level: Ints, ends: Floats, above: Floats, rows: int, levels: int
) -> NDArray[np.bool_]:
    """Passages whose place may be the lowest above a value, by K at the `ends` of their segments.

    A margin of the segment's own span is left on both sides.
    """
    low, high = ends.min(axis=0), ends.max(axis=0)
    span = high - low
    possible = high + span > above
    certain = low - span > above
    bound = np.full((rows, levels), np.inf)
    np.minimum.at(bound, (row[certain], level[certain]), (high + span)[certain])
    return possible & (low - span <= bound[row, level])


def _roots(
    off: Callable[[Ints, Floats], Floats], theta: Floats, row: Ints, segment: Ints
) -> Floats:
    """The angle in each segment where a function changes its sign."""
    every = np.arange(len(row))
    low, high = theta[row, segment], theta[row, segment + 1]
    tolerance = 1e-8  # of a bracket's angle
    found = elementwise.find_root(
        lambda place, index: off(index, place),
        (low, high),
        args=(every,),
        tolerances={"xrtol": tolerance},
    )
    return np.asarray(found.x)


def _with_line(
    row: Ints,
    level: Ints,
    place: Floats,
    poles: Ints,
    on_line: Floats,
    outwards: NDArray[np.bool_],
) -> Events:
    """The events of the curve and those of the Nyquist line, (n, J)."""
    rows, levels = np.indices(on_line.shape)
    return Events(
        np.concatenate([row, rows.ravel()]),
        np.concatenate([level, levels.ravel()]),
        np.concatenate([place, on_line.ravel()]),
        np.concatenate([poles, np.where(outwards, 1, -1).ravel()]),
    )
