"""How likely every count of a mass with dry friction is after those before, in one compiled pass.

What is known of the mass is a mixture: it moves forward, is held, or moves backward, since this
sample or for longer, and its position lies in one of the cells that a count is cut into; in each of
these cases position, velocity and the white force of the present sample are normal, and a velocity
that has one sign is cut off at zero.

It contains `cases.py` and `cut_normals.py` beside it, and is to be compiled anew where those are
changed.
"""

from __future__ import annotations

import math

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.inference.time_domain.counts.cases import (
    AGES,
    BLOCKS,
    SLIGHT,
    add,
    middle,
    outcome,
    side_of,
)
from bayeshaptic.inference.time_domain.counts.cut_normals import (
    FAR,
    LEAST_SKEW,
    below,
    between_cut,
    cut_off,
    density,
    handed_on,
    moments,
)
from bayeshaptic.types import Floats

# Standard deviations beyond which a velocity keeps its sign, and at which a count is looked for at
# first: beyond them lie 1.3e-12 and 4e-11 of a normal, less than `SLIGHT`.
_SURE, _NEAR = 7.0, 6.5
_SMALLEST = 1e-280  # probability; what is less likely counts as a jump, and doubles end at 2e-308
# Samples in which the command of before the recording arrives, and after which it no longer matters
# how it begins: three more tell position, velocity and force. With 5 for the first the values of
# three loops move by less than 0.07 of their standard deviations, with 10 for the second by 0.2.
_BEGINS, _FORGOTTEN = 3, 6


@kernel(inline=True)
def _later(
    cases: Floats, into: Floats, force: float, held: Floats, dry: float, span_s: float, fresh: float
) -> None:
    """All cases after a span under a constant force; with a new white force where `fresh` > 0."""
    cells = len(cases) // BLOCKS
    push, rub = held[3] * force, held[3] * dry
    into[:, 0] = 0.0
    case, new, pushed = np.empty(10), np.empty(10), np.empty(7)
    for i in range(len(cases)):
        if cases[i, 0] <= SLIGHT:
            continue
        side = side_of(i // cells)
        age = min(abs(AGES - i // cells) - 1 + (fresh > 0), AGES - 1)
        case[:] = cases[i]
        if fresh > 0:
            case[3] = case[7] = case[8] = 0.0
            case[9] = fresh**2
        elif side == 0:  # what held it is that of before
            add(into[i], case)
            continue
        with_x = held[0] * case[5] + held[3] * case[7]
        with_v = held[0] * case[6] + held[3] * case[8]
        with_f = held[0] * case[8] + held[3] * case[9]
        velocity = held[0] * case[2] + held[3] * case[3]
        sd = math.sqrt(max(held[0] * with_v + held[3] * with_f, 1e-30 * (1 + velocity**2)))
        pushed[0], pushed[1] = velocity, sd
        pushed[2], pushed[3], pushed[4] = with_x, with_v, with_f
        pushed[5], pushed[6] = push, rub
        # Between them it is held, or reverses if it is pushed back more than rubs.
        low = 0.0 if side > 0 and push < -rub else -rub - push
        high = 0.0 if side < 0 and push > rub else rub - push
        rests = min(max((low - velocity) / sd, -FAR), FAR)
        leaves = min(max((high - velocity) / sd, -FAR), FAR)
        goes_on = 1 if side == 0 else side
        # A velocity of one sign is cut off at zero; the less so, the more of it the force makes.
        cut = cut_off(handed_on(side, case[2], case[6], with_v / sd))
        gone, first_of, second_of = 0.0, 0.0, 0.0
        for way in (-goes_on, 0):
            first = -FAR if way < 0 else rests if way == 0 else leaves
            last = rests if way < 0 else leaves if way == 0 else FAR
            if side < 0:
                first, last = -last, -first
            if last <= first or first > _SURE or last < -_SURE:
                continue
            likely, at, left = between_cut(first, last, cut)
            if likely > SLIGHT:
                part = (likely, goes_on * at, left)
                since = (side, age)
                outcome(into, i % cells, way, case, since, pushed, part, held, span_s, new)
                gone += likely
                first_of += likely * goes_on * at
                second_of += likely * (left + at * at)
        stays = 1 - gone
        if stays > SLIGHT:  # what is left of the whole, so that its means and covariances are kept
            at = -first_of / stays
            part = (stays, at, min(max((1 - second_of) / stays - at * at, 1e-4), 1.0))
            outcome(into, i % cells, goes_on, case, (side, age), pushed, part, held, span_s, new)


@kernel(inline=True)
def _seen(cases: Floats, into: Floats, low: float, unit: float, reach: float, beyond: float) -> int:
    """All cases as the count says, which begins at `low`; those `beyond` to `reach` sd from it.

    How many normals were added is returned.
    """
    cells, added = len(cases) // BLOCKS, 0
    cell, new = unit / cells, np.empty(10)
    for i in range(len(cases)):
        if cases[i, 0] <= SLIGHT:
            continue
        xx = max(cases[i, 4], 1e-8 * unit * unit)
        sd, off = math.sqrt(xx), cases[i, 1] - low
        outside = max(-off, off - unit) / sd
        if outside > reach or outside <= beyond:
            continue
        # Probabilities of one tail, from the nearer end on, so that no digits are lost.
        sign = 1.0 if off < 0.5 * unit else -1.0
        begins = off if sign > 0 else unit - off
        first = max(int(math.floor((begins - reach * sd) / cell)), 0)
        last = min(int(math.floor((begins + reach * sd) / cell)), cells - 1)
        by_v, by_f = cases[i, 5] / xx, cases[i, 7] / xx
        # What moved one way alone is further on than it was: its position is cut off, too.
        side = side_of(i // cells)
        skew = handed_on(side, cases[i, 2], cases[i, 6], cases[i, 5] / sd)
        cut, turn = cut_off(skew), side * sign
        start = (first * cell - begins) / sd
        above, steep = below(-start), density(start)
        for j in range(first, last + 1):
            end = ((j + 1) * cell - begins) / sd
            rest, flat = below(-end), density(end)
            if skew < LEAST_SKEW:
                likely, at, left = moments(start, end, above - rest, steep, flat)
            elif turn > 0:
                likely, at, left = between_cut(start, end, cut)
            else:
                likely, at, left = between_cut(-end, -start, cut)
                at = -at
            start, above, steep = end, rest, flat
            if not cases[i, 0] * likely > 1e-300:
                continue
            new[:] = cases[i]
            moved, lost = sign * sd * at, xx * (1 - left)
            new[0] *= likely
            new[1] += moved
            new[2] += by_v * moved
            new[3] += by_f * moved
            new[4] = xx * left
            new[5] = by_v * new[4]
            new[6] = max(new[6] - by_v * by_v * lost, 0.0)
            new[7] = by_f * new[4]
            new[8] -= by_v * by_f * lost
            new[9] = max(new[9] - by_f * by_f * lost, 0.0)
            add(into[i - i % cells + (j if sign > 0 else cells - 1 - j)], new)
            added += 1
    return added


@kernel
def followed(
    held: Floats,
    loads: Floats,
    more: Floats,
    command: Floats,
    position: Floats,
    unit: float,
    cells: int,
) -> Floats:
    """Logarithms of probabilities, innovations over their size, velocities, work; shape (4, N).

    Parameters
    ----------
    held : ndarray, shape (2, 4)
        Of the part of a sample before the delayed command changes, and of that after it: what is
        kept of a velocity, position over velocity, position and velocity over a held force.
    loads : ndarray, shape (6,)
        Dry friction, constant force, white force's standard deviation, delay in whole samples, the
        rest of it in s, period in s.
    more : ndarray, shape (N,)
        A further force.
    command, position : ndarray, shape (N,)
    unit : float
        One count.
    cells : int
        Parts that a count is cut into.
    """
    dry, offset, force_sd, whole, late_s, period_s = loads
    cases, other = np.zeros((BLOCKS * cells, 10)), np.zeros((BLOCKS * cells, 10))
    out = np.zeros((4, len(position)))
    unknown = (3 * np.std(np.diff(position)) + 10 * unit) / period_s
    cell = unit / cells
    for k in range(len(position)):
        low = position[k] - unit / 2
        likely = 0.0
        if k > 0:
            before, spread, _ = middle(cases)
            other[:, 0] = 0.0
            out[3, k] = _seen(cases, other, low, unit, _NEAR, -np.inf)
            likely = np.sum(other[:, 0])
            if likely < SLIGHT:
                out[3, k] += _seen(cases, other, low, unit, FAR, _NEAR)
                likely = np.sum(other[:, 0])
        if likely > _SMALLEST:
            other[:, 0] /= likely
            cases, other = other, cases
            after, _, out[2, k] = middle(cases)
            if k >= _FORGOTTEN:
                out[0, k] = math.log(likely)
                out[1, k] = (after - before) * math.sqrt(spread + unit * unit / 12) / spread
        else:  # where it begins, and after a jump
            if k > 0:
                out[0, k] = math.log(_SMALLEST)
            cases[:] = 0.0
            for i in range(cells):
                cases[i, 0], cases[i, 1] = 1 / cells, low + (i + 0.5) * cell
                cases[i, 4], cases[i, 6], cases[i, 9] = cell * cell / 12, unknown**2, force_sd**2
        if k < _BEGINS:
            cases[:, 6] += unknown**2
        now = command[max(k - int(whole), 0)] - offset + more[k]
        old = command[max(k - int(whole) - 1, 0)] - offset + more[max(k - 1, 0)]
        _later(cases, other, old, held[0], dry, late_s, 0.0)
        cases, other = other, cases
        _later(cases, other, now, held[1], dry, period_s - late_s, force_sd)
        cases, other = other, cases
    return out
