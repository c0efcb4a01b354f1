"""The search of `crossings.py` for loops that have finitely many poles, compiled.

A row at a time: the same grid (`responses/grid.py`), signs, dips and roots.  Angles theta and the
terms of the poles are those of `responses/response.py`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.numerics.cos_sin import cos_sin
from bayeshaptic.types import Complexes, Floats, Ints

LOWEST = 1e-9  # as in `responses/grid.py`
TOP = math.pi * (1 - 1e-7)
# Points around a resonance: tangents of the angles that its phase has there.
TANGENTS = tuple(math.tan(math.radians(a)) for a in (-88, -80, -60, -30, -8, 8, 30, 60, 80, 88))
SHARPEST = 1e-8  # half width of the sharpest resonance, over its frequency
PER_TURN = 16  # points in a turn that the delay makes of the phase
DIP_POINTS, DIP_ROUNDS = 17, 5  # of the search for two crossings between two points


class Poles(NamedTuple):
    """The arrays of a `PoleResponse`."""

    poles: Complexes
    direct: Complexes
    late: Complexes
    centre: Complexes
    delay: Floats
    exact: bool
    log_points: int


class Space(NamedTuple):
    """What one row is searched in, an angle each."""

    points: Floats
    re: Floats
    im: Floats
    sine: Floats
    cosine: Floats
    point: Floats
    along: Floats


@kernel
def find(loops: Poles, theta: Floats, gain: Floats, count: Ints) -> None:
    """Crossings of every row: `count` of them, at `theta`, where the response is `gain`.

    Parameters
    ----------
    theta, gain : ndarray, shape (B, most)
        More crossings than there is room for are left out.
    count : ndarray of int, shape (B,)
    """
    (batch, poles), most = loops.poles.shape, theta.shape[1]
    room = loops.log_points + 10 * poles
    room += int(math.ceil(PER_TURN * (loops.delay.max() + 1.5) / 2)) + DIP_POINTS
    space = Space(
        np.empty(room),
        np.empty(room),
        np.empty(room),
        np.empty(room),
        np.empty(room),
        np.empty(room),
        np.empty(room),
    )
    grid, ends, re, sine = np.empty(room), np.empty((room, 2)), space.re, space.sine
    for row in range(batch):
        points = _grid(loops, row, grid, space.points)
        _sines(loops, row, grid[:points], space)
        found = 0
        for k in range(points - 1):
            if (sine[k] < 0) != (sine[k + 1] < 0) and (re[k] < 0 or re[k + 1] < 0):
                if found < most:
                    theta[row, found] = _root(
                        loops, row, grid[k], grid[k + 1], sine[k], sine[k + 1]
                    )
                found += 1
        dips = 0
        for k in range(1, points - 1):
            here = abs(sine[k])
            if re[k] < 0 and here <= abs(sine[k - 1]) and here < abs(sine[k + 1]):
                negative = sine[k] < 0
                if negative == (sine[k - 1] < 0) and negative == (sine[k + 1] < 0):
                    ends[dips, 0], ends[dips, 1] = grid[k - 1], grid[k + 1]
                    dips += 1
        for dip in range(dips):
            found = _dip(loops, row, ends[dip, 0], ends[dip, 1], space, theta, found)
        for k in range(min(found, most)):
            gain[row, k] = _value(loops, row, theta[row, k]).real
        count[row] = min(found, most)


@kernel(inline=True)
def _grid(loops: Poles, row: int, grid: Floats, around: Floats) -> int:
    """Sorted angles so that no crossing slips between two points; how many."""
    slowest = np.inf
    count = 0
    for pole in loops.poles[row]:
        size = abs(pole)
        if 0 < size < slowest:
            slowest = size
    low = min(max(0.02 * slowest, LOWEST), 1e-3) if loops.poles.shape[1] else LOWEST
    for pole in loops.poles[row]:
        if pole.imag >= 0:  # conjugates see the same angles
            width = max(abs(pole.real), SHARPEST * abs(pole.imag))
            # A pole beyond the Nyquist frequency shows at its alias.
            angle = abs(pole.imag - 2 * math.pi * np.rint(pole.imag / (2 * math.pi)))
            for tangent in TANGENTS:
                place = angle + width * tangent
                if low < place < TOP:  # both ends are there already
                    _insert(around, count, place)
                    count += 1
    linear = int(math.ceil(PER_TURN * (loops.delay[row] + 1.5) / 2))
    ratio = math.exp(math.log(TOP / low) / (loops.log_points - 1))
    a, b, c, total = 0, 0, 0, 0
    log = low
    while a < count or b < linear or c < loops.log_points:
        next_around = around[a] if a < count else np.inf
        next_linear = TOP * (b + 1) / linear if b < linear else np.inf
        next_log = log if c < loops.log_points else np.inf
        if next_around <= next_linear and next_around <= next_log:
            grid[total] = next_around
            a += 1
        elif next_linear <= next_log:
            grid[total] = next_linear
            b += 1
        else:
            grid[total] = next_log
            c += 1
            log = min(log * ratio, TOP)
        total += 1
    return total


@kernel(inline=True)
def _insert(ordered: Floats, count: int, value: float) -> None:
    """Put a value in its place among `count` others.

    Those around a pole come in order, and poles do nearly: it is seldom far from the end.
    """
    place = count
    while place > 0 and ordered[place - 1] > value:
        ordered[place] = ordered[place - 1]
        place -= 1
    ordered[place] = value


@kernel(inline=True)
def _sines(loops: Poles, row: int, theta: Floats, space: Space) -> None:
    """The response at many angles, and the sine of how far its phase is from -180 degrees."""
    count = len(theta)
    re, im, cosine, sine, point = space.re, space.im, space.cosine, space.sine, space.point
    along = space.along
    for k in range(count):
        half_c, half_s = cos_sin(0.5 * theta[k])
        re[k], im[k] = 0.0, 0.0
        cosine[k], sine[k] = 1.0 - 2.0 * half_s * half_s, 2.0 * half_s * half_c
        point[k] = -2.0 * half_s * half_s if loops.exact else 0.0
        along[k] = sine[k] if loops.exact else theta[k]
    for pole in range(loops.poles.shape[1]):
        direct, late = loops.direct[row, pole], loops.late[row, pole]
        centre = loops.centre[row, pole]
        direct_re, direct_im, late_re, late_im = direct.real, direct.imag, late.real, late.imag
        centre_re, centre_im = centre.real, centre.imag
        for k in range(count):
            above_re = direct_re + late_re * cosine[k] + late_im * sine[k]
            above_im = direct_im + late_im * cosine[k] - late_re * sine[k]
            below_re, below_im = point[k] - centre_re, along[k] - centre_im
            size = 1.0 / (below_re * below_re + below_im * below_im)
            re[k] += size * (above_re * below_re + above_im * below_im)
            im[k] += size * (above_im * below_re - above_re * below_im)
    delay = loops.delay[row]
    if delay != 0.0:
        for k in range(count):
            c, s = cos_sin(theta[k] * delay)
            value_re = re[k] * c + im[k] * s
            im[k] = im[k] * c - re[k] * s
            re[k] = value_re
    for k in range(count):
        size = math.sqrt(re[k] * re[k] + im[k] * im[k])
        sine[k] = -im[k] / size if size > 0 else 0.0


@kernel(inline=True)
def _value(loops: Poles, row: int, theta: float) -> complex:
    half_c, half_s = cos_sin(0.5 * theta)
    c, s = 1.0 - 2.0 * half_s * half_s, 2.0 * half_s * half_c
    back = complex(c, -s)
    point = complex(-2.0 * half_s * half_s, s) if loops.exact else complex(0.0, theta)
    total = 0j
    for pole in range(loops.poles.shape[1]):
        above = loops.direct[row, pole] + back * loops.late[row, pole]
        below = point - loops.centre[row, pole]
        size = 1.0 / (below.real * below.real + below.imag * below.imag)
        total += above * below.conjugate() * size
    if loops.delay[row] == 0.0:
        return total
    c, s = cos_sin(theta * loops.delay[row])
    return total * complex(c, -s)


@kernel(inline=True)
def _sine(loops: Poles, row: int, theta: float) -> float:
    value = _value(loops, row, theta)
    size = abs(value)
    return -value.imag / size if size > 0 else 0.0


@kernel(inline=True)
def _dip(
    loops: Poles,
    row: int,
    low: float,
    high: float,
    space: Space,
    theta: Floats,
    found: int,
) -> int:
    """Zoom in where |sine| has a minimum, for the two crossings that may hide there."""
    points, sine = space.points, space.sine
    for _ in range(DIP_ROUNDS):
        best = 0
        for k in range(DIP_POINTS):
            points[k] = low + (high - low) * (k / (DIP_POINTS - 1))
        _sines(loops, row, points[:DIP_POINTS], space)
        before = found
        for k in range(DIP_POINTS - 1):
            if (sine[k] < 0) != (sine[k + 1] < 0):
                if found < theta.shape[1]:
                    theta[row, found] = _root(
                        loops, row, points[k], points[k + 1], sine[k], sine[k + 1]
                    )
                found += 1
            if abs(sine[k + 1]) < abs(sine[best]):
                best = k + 1
        if found > before:
            break
        low, high = points[max(best - 1, 0)], points[min(best + 1, DIP_POINTS - 1)]
    return found


@kernel(inline=True)
def _root(loops: Poles, row: int, low: float, high: float, f_low: float, f_high: float) -> float:
    """Chandrupatla's method, as in `scipy.optimize.elementwise.find_root`."""
    a, b, fa, fb, t = low, high, f_low, f_high, 0.5
    best = a
    for _ in range(100):
        x = a + t * (b - a)
        fx = _sine(loops, row, x)
        if np.sign(fx) == np.sign(fa):
            c, fc = a, fa
        else:
            c, fc, b, fb = b, fb, a, fa
        a, fa = x, fx
        best = a if abs(fa) < abs(fb) else b
        if fa == 0 or fb == 0 or a == b:
            break
        limit = 1e-13 * abs(best) / abs(b - a)
        if limit > 0.5:
            break
        t = 0.5
        if c != b and fc != fb:
            xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
            if phi * phi < xi and (1 - phi) * (1 - phi) < 1 - xi:
                t = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (
                    fc - fb
                )
        t = min(max(t, limit), 1 - limit)
    return best
