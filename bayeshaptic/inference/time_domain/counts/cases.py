"""What may be the case of a mass that counts leave in doubt: rows of a table, each a normal.

A row holds weight, means (position, velocity, force), variances and covariances (xx, xv, vv, xf,
vf, ff).  Rows stand in blocks: of a mass that moves forward (longest first), is held, and moves
backward (longest last), each of cells of the position in order.  What has just left its rest is
slow, and what moves since longer is not: one normal for both describes neither.

Kernels elsewhere contain it: they are to be compiled anew where it is changed.
"""

from __future__ import annotations

from bayeshaptic.compiled import kernel
from bayeshaptic.types import Floats

SLIGHT = 1e-10  # of the whole: a case less likely is none
# Blocks of a mass that moves one way: since this sample, since the one before, since longer.  With
# four or ten the log likelihoods of two loops that crawl are the same to a tenth; with one delays
# were up to 5.5 standard deviations off (docs/closed-loop.md).
AGES = 3
BLOCKS = 2 * AGES + 1


@kernel(inline=True)
def side_of(block: int) -> int:
    """1 of a mass that moves forward, 0 of one that is held, -1 of one that moves backward."""
    return 1 if block < AGES else 0 if block == AGES else -1


@kernel(inline=True)
def add(case: Floats, new: Floats) -> None:
    """Take `new` into a case: the normal of the same means and covariances as both."""
    if case[0] <= 0:
        case[:] = new
        return
    whole = case[0] + new[0]
    share = new[0] / whole
    x, v, f = new[1] - case[1], new[2] - case[2], new[3] - case[3]
    apart = share * (1 - share)
    case[0] = whole
    case[1] += share * x
    case[2] += share * v
    case[3] += share * f
    case[4] += share * (new[4] - case[4]) + apart * x * x
    case[5] += share * (new[5] - case[5]) + apart * x * v
    case[6] += share * (new[6] - case[6]) + apart * v * v
    case[7] += share * (new[7] - case[7]) + apart * x * f
    case[8] += share * (new[8] - case[8]) + apart * v * f
    case[9] += share * (new[9] - case[9]) + apart * f * f


@kernel(inline=True)
def outcome(
    into: Floats,
    cell: int,
    way: int,
    case: Floats,
    since: tuple[int, int],
    pushed: Floats,
    part: tuple[float, float, float],
    held: Floats,
    span_s: float,
    new: Floats,
) -> None:
    """What becomes of a case where the pushed velocity is in a part of its range.

    `way` is 1 where it goes forward in the end, -1 backward, 0 where it is held, or reverses on the
    way.  `since` has the side that it moved to before, and for how many samples it will have.
    `pushed` has velocity, its standard deviation and covariances (x, v, f), what the command and
    friction add.  `new` is room.
    """
    _, at, left = part
    side, age = since
    velocity, sd, push, rub = pushed[0], pushed[1], pushed[5], pushed[6]
    with_x, with_v, with_f = pushed[2], pushed[3], pushed[4]
    _given(new, case, pushed, part)
    if way == 0 and not side * push < -rub:
        if side != 0:
            _stop(new, side, rub - side * push, held[3], span_s)
        new[2] = new[5] = new[6] = new[8] = 0.0
        add(into[AGES * (len(into) // BLOCKS) + cell], new)
        return
    start, spread = velocity + sd * at, sd * sd * left
    with_x, with_v, with_f = with_x * left, with_v * left, with_f * left
    if way != 0:
        ratio = held[2] / held[3]
        own = held[1] - ratio * held[0]
        ends = start + push - way * rub
        keeps, goes, steep = 1.0, own * new[2] + ratio * ends, ratio
        xx = new[4] + 2 * own * new[5] + own * own * new[6]
        with_x, xf = with_x + own * with_v, new[7] + own * new[8]
    else:  # it slows down at one rate, and from rest goes back at another
        way = -side
        slows, back = (rub - side * push) / span_s, -(side * push + rub) / span_s
        lasts = min(abs(start) / slows, span_s)
        ends, keeps = way * back * (span_s - lasts), back / slows
        goes = side * start * start / (2 * slows) + 0.5 * way * back * (span_s - lasts) ** 2
        steep = (abs(start) + back * (span_s - lasts)) / slows
        xx, xf = new[4], new[7]
    new[1] += goes
    new[2] = ends
    new[4] = xx + 2 * steep * with_x + steep * steep * spread
    new[5] = keeps * (with_x + steep * spread)
    new[6] = keeps * keeps * spread
    new[7] = xf + steep * with_f
    new[8] = keeps * with_f
    block = AGES - way * (1 + (age if way == side else 0))
    add(into[block * (len(into) // BLOCKS) + cell], new)


@kernel(inline=True)
def _given(new: Floats, case: Floats, pushed: Floats, part: tuple[float, float, float]) -> None:
    """Write into `new` the normal of a case whose pushed velocity is in a part of its range."""
    likely, at, left = part
    sd, with_x, with_v, with_f = pushed[1], pushed[2], pushed[3], pushed[4]
    new[:] = case
    lost, off = (1 - left) / sd**2, at / sd
    new[0] *= likely
    new[1] += with_x * off
    new[2] += with_v * off
    new[3] += with_f * off
    new[4] -= with_x * with_x * lost
    new[5] -= with_x * with_v * lost
    new[6] -= with_v * with_v * lost
    new[7] -= with_x * with_f * lost
    new[8] -= with_v * with_f * lost
    new[9] -= with_f * with_f * lost


@kernel(inline=True)
def _stop(case: Floats, side: int, rub: float, push: float, span_s: float) -> None:
    """Move a case by the way on which it comes to rest.

    `rub` is what slows it down within the span, `push` velocity over a white force.
    """
    slows = (rub - side * push * case[3]) / span_s
    if slows <= 0:
        return
    before = max(side * case[2], 0.0)
    lasts = min(before / slows, span_s)
    # The way goes with the square of a velocity that lies between zero and what the span brings to
    # rest: its variance counts, too, and is at most that of its ends.
    case[1] += 0.5 * side * (before * lasts + min(case[6] / slows, 0.25 * slows * span_s**2))
    by_f = 0.5 * lasts * lasts * push / span_s
    case[4] += 2 * (lasts * case[5] + by_f * case[7])
    case[4] += lasts * lasts * case[6] + 2 * lasts * by_f * case[8] + by_f * by_f * case[9]
    case[7] += lasts * case[8] + by_f * case[9]


@kernel(inline=True)
def middle(cases: Floats) -> tuple[float, float, float]:
    """Mean and variance of the position, mean of the velocity."""
    total, x, v, spread = 0.0, 0.0, 0.0, 0.0
    for i in range(len(cases)):
        if cases[i, 0] > SLIGHT:
            total += cases[i, 0]
            share = cases[i, 0] / total
            off = cases[i, 1] - x
            spread += share * (cases[i, 4] - spread) + share * (1 - share) * off * off
            x += share * off
            v += share * (cases[i, 2] - v)
    return x, spread, v
