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

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.models.polynomial import roots
from bayeshaptic.models.system import LinearSystem
from bayeshaptic.stability.crossings import response_of
from bayeshaptic.stability.damping import Damping, derivative, derivative_at_nyquist
from bayeshaptic.stability.evaluated import EvaluableSystem
from bayeshaptic.stability.grid import search_grid
from bayeshaptic.stability.response import Response
from bayeshaptic.stability.roots import bracketed_roots

Floats = NDArray[np.float64]
Ints = NDArray[np.int_]
Complexes = NDArray[np.complex128]

_CHUNK = 64  # rows at a time: the arrays of one chunk stay in the cache
_TOLERANCE = 1e-9  # of a bracket's angle
_TOP = np.pi * (1 - 1e-4)  # beyond it both imaginary parts are too small to divide


@dataclass(frozen=True)
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
        """-1/G of rows (M,) at one angle each, shape (M,)."""
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

    def damping(self, kind: Damping) -> tuple[Floats, Floats]:
        """B and K along the curve, each of shape (n, L)."""
        rate = derivative(kind, self.theta, self.period_s)
        damping = self.value.imag / rate.imag
        return damping, self.value.real - damping * rate.real


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
    theta : ndarray, shape (M,)
        Angle of the pole on the circle.
    """

    row: Ints
    level: Ints
    place: Floats
    poles: Ints
    theta: Floats


@dataclass(frozen=True)
class _Features:
    """What `search_grid` reads of a response, with the zeros among the places to look at."""

    delay: Floats
    features: Complexes
    log_points: int


def inverse_curve(system: LinearSystem | EvaluableSystem, period_s: float) -> InverseCurve:
    """-1/G of a batch of loops on a grid that follows every resonance and antiresonance."""
    response = response_of(system, period_s)
    features = response.features
    if isinstance(system, LinearSystem) and features.shape[1]:
        zeros = roots(system.rational_part.transfer()[0]) * period_s
        features = np.concatenate([features, zeros], axis=1)
    look = _Features(response.delay, features, response.log_points)
    every = np.arange(len(response.delay))
    theta = search_grid(look, slice(0, len(every)))  # type: ignore[arg-type]
    theta = np.minimum(theta, _TOP)
    value = np.empty(theta.shape, complex)
    for start in range(0, len(every), _CHUNK):
        rows = every[start : start + _CHUNK]
        value[rows] = -1 / response.at(rows, theta[rows])
    return InverseCurve(
        response, period_s, np.ones(len(every)), theta, value, -1 / response.at_ends()[1]
    )


def along_stiffness(curve: InverseCurve, kind: Damping, levels: Floats) -> Events:
    """Where the boundaries meet the lines B = `levels`, shape (J,), ascending; places are K."""
    damping, _ = curve.damping(kind)
    row, level, low, high, rising = _sign_changes(damping, levels, curve.theta)

    def off(index: Ints, theta: Floats) -> Floats:
        rate = derivative(kind, theta, curve.period_s)
        value = curve.at(row[index], theta)
        wanted = levels[level[index]]
        return (value.imag - wanted * rate.imag) / (np.abs(value) + np.abs(wanted * rate))

    theta = _roots(off, low, high)
    rate = derivative(kind, theta, curve.period_s)
    stiffness = curve.at(row, theta).real - levels[level] * rate.real
    on_line = curve.nyquist[:, None] - levels * derivative_at_nyquist(kind, curve.period_s)
    outwards = damping[:, -1:] < levels
    return _with_line(row, level, stiffness, np.where(rising, 2, -2), theta, on_line, outwards)


def along_damping(curve: InverseCurve, kind: Damping, start: Floats) -> Events:
    """Where each boundary meets its own line K = `start`, shape (n,); places are B."""
    _, stiffness = curve.damping(kind)
    origin = np.zeros(1)
    row, level, low, high, rising = _sign_changes(stiffness - start[:, None], origin, curve.theta)

    def off(index: Ints, theta: Floats) -> Floats:
        rate = derivative(kind, theta, curve.period_s)
        value = curve.at(row[index], theta) - start[row[index]]
        return -(value / rate).imag / np.abs(value / rate)

    theta = _roots(off, low, high)
    rate = derivative(kind, theta, curve.period_s)
    place = ((curve.at(row, theta) - start[row]) / rate).real
    on_line = (curve.nyquist - start)[:, None] / derivative_at_nyquist(kind, curve.period_s)
    outwards = curve.damping(kind)[0][:, -1:] < on_line
    return _with_line(row, level, place, np.where(rising, -2, 2), theta, on_line, outwards)


def _sign_changes(
    values: Floats, levels: Floats, theta: Floats
) -> tuple[Ints, Ints, Floats, Floats, NDArray[np.bool_]]:
    """Every passage of `values` (n, L) through a level: row, level, bracket, whether upwards."""
    above = np.searchsorted(levels, values, side="left")
    step = np.diff(above, axis=1)
    row, segment = np.nonzero(step)
    count = np.abs(step[row, segment])
    first = np.minimum(above[row, segment], above[row, segment + 1])
    within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    level = np.repeat(first, count) + within
    rising = np.repeat(step[row, segment] > 0, count)
    row, segment = np.repeat(row, count), np.repeat(segment, count)
    return row, level, theta[row, segment], theta[row, segment + 1], rising


def _roots(off: object, low: Floats, high: Floats) -> Floats:
    every = np.arange(len(low))
    f_low, f_high = off(every, low), off(every, high)  # type: ignore[operator]
    return bracketed_roots(off, low, high, f_low, f_high, _TOLERANCE)  # type: ignore[arg-type]


def _with_line(
    row: Ints,
    level: Ints,
    place: Floats,
    poles: Ints,
    theta: Floats,
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
        np.concatenate([theta, np.full(on_line.size, np.pi)]),
    )
