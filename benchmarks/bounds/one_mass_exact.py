"""What the counts of one mass say of its values: the likelihood on a grid, and its information.

`one_mass.py` knows at every sample which way friction acts, as nobody does who reads counts.
Here the density of position and velocity is followed from one change of the delayed command to the
next, on a grid that is finer than the encoder's counts and than what the white force does to the
velocity in a sample, beside the mass at rest.  It shares nothing with the normals of
`bayeshaptic/inference/time_domain/counts/`, and takes some 0.3 ms a sample.
"""

from __future__ import annotations

import math

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.types import Floats
from benchmarks.bounds.one_mass import bound
from benchmarks.recordings.one_mass import Case

_CELLS = 24  # of a count; with 16 or 32 log likelihoods over 2,000 samples differ by 0.6 and 0.15
_FINE = 0.5, 0.25  # of what a sample's white force does to the velocity, of a count a sample
_LIKELY = 2.1  # counts a sample, that the velocity is from where it is expected, at most
_FEWEST, _MOST = 64, 192  # velocities
_PARTS = 32  # of the white forces that stop or turn a mass
_FAR = 6.5  # standard deviations of the white force
_BEGUN = 60  # samples, before which nothing is counted: how it begins is known to nobody else
_STEP = 0.15  # of a standard deviation, over which slopes are taken


def of_counts(case: Case) -> tuple[Floats, float]:
    """Covariance by the counts' information at the truth, (5, 5), and what left the grid at most.

    By outer products of the score, with the white force's size unknown.
    """
    least = np.sqrt(np.diag(bound(case)))
    usual = 2e-3 * float(np.std(case.recording.force))
    steps = _STEP * np.append(np.where(least > 0, least, usual), 0.03)
    truth = np.append(case.truth, math.log(case.noise))
    slopes, lost = np.zeros((len(case.recording.position), len(truth))), 0.0
    for i, step in enumerate(steps):
        up, down = truth.copy(), truth.copy()
        up[i] += step
        down[i] = down[i] - step if i in (3, 5) else max(down[i] - step, 0.0)
        above, left = likely(case, up)
        slopes[:, i] = (above - likely(case, down)[0]) / (up[i] - down[i])
        lost = max(lost, left)
    slopes = slopes[_BEGUN:]
    scale = np.linalg.norm(slopes, axis=0)
    inner = np.linalg.inv((slopes / scale).T @ (slopes / scale)) / np.outer(scale, scale)
    return inner[: len(case.truth), : len(case.truth)], lost


def likely(case: Case, point: Floats) -> tuple[Floats, float]:
    """Logarithm of the probability of every count after those before, and what left the grid.

    Parameters
    ----------
    case : Case
        Its resolution, and its white force for how fine the grid is.
    point : ndarray, shape (6,)
        Values in the order of `NAMES`, logarithm of the white force's standard deviation.
    """
    recording, unit = case.recording, case.resolution
    period_s = recording.period_s
    pushed = case.noise * period_s / float(case.truth[0])
    fine = min(_FINE[0] * pushed, _FINE[1] * unit / period_s)
    speeds = int(min(max(_FEWEST, 2 * _LIKELY * unit / period_s / fine), _MOST))
    signals = np.array(recording.force), np.array(recording.position)
    force_sd = math.exp(point[5])
    found, lost = _followed(point[:5], force_sd, *signals, period_s, unit, _CELLS, fine, speeds)
    return found, float(np.max(lost[_BEGUN:]))


@kernel(inline=True)
def _below(z: float) -> float:
    return 0.5 * math.erfc(-z * math.sqrt(0.5))


@kernel(inline=True)
def _moved(
    v: float, force: float, dry: float, damping: float, mass: float, t: float
) -> tuple[float, float]:
    """How far it goes in a time, and the velocity then; standstill and reversals located."""
    x, rate = 0.0, damping / mass
    while t > 1e-15:
        if v == 0 and abs(force) <= dry:
            break
        way = 1.0 if v > 0 or (v == 0 and force > 0) else -1.0
        last = (force - way * dry) / damping  # the velocity that it goes to
        kept = math.exp(-rate * t)
        end = last + (v - last) * kept
        if v == 0 or end * way > 0:
            return x + last * t + (v - last) * (1 - kept) / rate, end
        stops = min(max(math.log((v - last) / -last) / rate, 0.0), t)
        x += last * stops + (v - last) * (1 - math.exp(-rate * stops)) / rate
        v = 0.0
        t -= stops
    return x, v


@kernel(inline=True)
def _put(into: Floats, cells: Floats, likely: float, off: tuple[float, float], unit: float) -> None:
    """Add what a row of cells becomes, as far as the count that is read holds it.

    `off` is from the row's beginning to the count, in the sample, and to where `into` begins, at
    the end; in cells.
    """
    first = math.floor(off[1])
    part, last = off[1] - first, len(into) - 2
    for i in range(len(cells)):
        if cells[i] > 0:
            begins = i + off[0]
            inside = min(begins + 1, unit) - max(begins, 0.0)
            if inside > 0:
                at = min(max(i + int(first), 0), last)
                mass = cells[i] * likely * min(inside, 1.0)
                into[at] += (1 - part) * mass
                into[at + 1] += part * mass


@kernel(inline=True)
def _expected(
    now: Floats,
    share: Floats,
    speed: Floats,
    law: tuple[float, float, float, float],
    times: tuple[float, float],
    off: float,
    cell: float,
) -> tuple[float, float, float, float, float]:
    """Where it will be, so that the grid goes with it: the count that is read corrects it.

    Means of the velocity at the end, of the position in the sample, from the count's lower edge, of
    the way from there to the end, of both, and of the position squared.
    """
    force, dry, damping, mass = law
    v, x, ahead, with_v, spread = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(len(share)):
        if share[i] > 1e-13:
            seen = _moved(speed[i], force, dry, damping, mass, times[0])
            end = _moved(speed[i], force, dry, damping, mass, times[1])
            at = seen[0] + off
            for j in range(now.shape[1]):
                at += now[i, j] / share[i] * (j + 0.5) * cell
            v += share[i] * end[1]
            x += share[i] * at
            ahead += share[i] * (end[0] - seen[0])
            with_v += share[i] * at * end[1]
            spread += share[i] * at**2
    return v, x, ahead, with_v, spread


@kernel(inline=True)
def _stopped(
    into: Floats,
    cells: Floats,
    moving: tuple[float, int, float],
    law: tuple[float, float, float, float],
    force_sd: float,
    times: tuple[float, float],
    grid: tuple[float, float, float, float, int, int],
) -> None:
    """Add a row that is stopped, and stays or turns: parts of the white forces that do that.

    `moving` is the row's velocity, its way, and the largest white force that stops it, in standard
    deviations; `grid` the beginning of a row, from the count and from that of `into`, the size of a
    cell of positions and of velocities, cells a count, and the first velocity.
    """
    v, way, top = moving
    force, dry, damping, mass = law
    base, moves, cell, fine, unit, first = grid
    rest = len(into) - 1
    for part in range(_PARTS if top > -_FAR else 0):
        z = -_FAR + (top + _FAR) * part / _PARTS
        ends = z + (top + _FAR) / _PARTS
        likely = _below(ends) - _below(z)
        if likely > 1e-11:
            total = force + way * 0.5 * (z + ends) * force_sd
            seen = _moved(v, total, dry, damping, mass, times[0])
            end = _moved(v, total, dry, damping, mass, times[1])
            off = (base + seen[0] / cell, moves + end[0] / cell)
            if end[1] == 0:
                _put(into[rest], cells, likely, off, unit)
            else:  # between two rows of one sign
                row = end[1] / fine - 0.5 - first
                j = int(math.floor(row))
                nearer = 1 - (row - j)
                if j + first == -1:
                    j, nearer = (j + 1 if end[1] > 0 else j), 1.0
                j = min(max(j, 0), rest - 2)
                _put(into[j], cells, likely * nearer, off, unit)
                _put(into[j + 1], cells, likely * (1 - nearer), off, unit)


@kernel
def _followed(
    values: Floats,
    force_sd: float,
    command: Floats,
    position: Floats,
    period_s: float,
    unit: float,
    cells: int,
    fine: float,
    speeds: int,
) -> tuple[Floats, Floats]:
    """Logarithms of probabilities, and what lies at the grid's ends; shape (N,) each.

    A table has a row a velocity, and one of the mass at rest, of cells of the position.
    """
    mass, damping, dry, offset, delay_s = values
    rate, rest = damping / mass, speeds
    whole = int(math.floor(delay_s / period_s))
    late = delay_s - whole * period_s
    read = period_s - late  # from a change of the command to the next sample
    kept = math.exp(-rate * period_s)
    once, read_once = (1 - kept) / rate, (1 - math.exp(-rate * read)) / rate
    twice, read_twice = (period_s - once) / rate, (read - read_once) / rate
    pushed = force_sd * once / mass
    cell = unit / cells
    width = 3 * cells + 2
    now, after = np.zeros((speeds + 1, width)), np.zeros((speeds + 1, width))
    share, speed = np.zeros(speeds + 1), np.zeros(speeds + 1)
    out, lost = np.zeros(len(position)), np.zeros(len(position))
    # At rest, anywhere in the count, until the first command arrives.
    start, slowest = int(round((position[0] - unit / 2) / cell)) - cells, -(speeds // 2)
    now[rest, cells : 2 * cells] = 1 / cells
    for k in range(whole, len(position) - 1):
        force = command[k - whole] - offset
        low = position[k + 1] - unit / 2
        for i in range(speeds + 1):
            share[i] = np.sum(now[i])
            speed[i] = (slowest + i + 0.5) * fine if i < rest else 0.0
        law = (force, dry, damping, mass)
        v, x, ahead, with_v, spread = _expected(
            now, share, speed, law, (read, period_s), start * cell - low, cell
        )
        by = force_sd * read_twice / mass
        gain = (with_v - x * v + by * pushed) / (max(spread - x * x, 0.0) + by**2 + unit**2 / 6)
        v += gain * (unit / 2 - x)
        ahead += gain * (unit / 2 - x) * late * (1 - 0.5 * late / period_s)
        begins, first = int(round((low + ahead) / cell)) - cells, int(round(v / fine)) - speeds // 2
        after[:] = 0.0
        base, moves = start - low / cell, float(start - begins)
        for i in range(speeds + 1):
            if share[i] <= 1e-13:
                continue
            for way in (-1, 1):
                if way * speed[i] < 0:
                    continue
                # It keeps its way: the white force is that which makes the velocity of each row.
                usual = kept * speed[i] + once * (force - way * dry) / mass
                a = max(0, -first) if way > 0 else 0
                b = speeds if way > 0 else min(speeds, -first)
                a = max(a, int((usual - _FAR * pushed) / fine) - first - 1)
                b = min(b, int((usual + _FAR * pushed) / fine) - first + 2)
                for j in range(a, b):
                    likely = _below(((first + j + 1) * fine - usual) / pushed)
                    likely -= _below(((first + j) * fine - usual) / pushed)
                    if likely > 1e-11:
                        pull = ((first + j + 0.5) * fine - kept * speed[i]) / once
                        seen_at = speed[i] * read_once + pull * read_twice
                        end_at = speed[i] * once + pull * twice
                        off = (base + seen_at / cell, moves + end_at / cell)
                        _put(after[j], now[i], likely, off, cells)
                if i < rest:
                    grid = (base, moves, cell, fine, cells, first)
                    top = min(-way * usual / pushed, _FAR)
                    _stopped(
                        after, now[i], (speed[i], way, top), law, force_sd, (read, period_s), grid
                    )
            if i == rest:
                likely = _below((dry - force) / force_sd) - _below((-dry - force) / force_sd)
                _put(after[rest], now[i], likely, (base, moves), cells)
        total = np.sum(after)
        if not total > 1e-250:
            lost[k + 1 :] = 1.0
            break
        out[k + 1] = math.log(total)
        after /= total
        lost[k + 1] = np.sum(after[0]) + np.sum(after[rest - 1])
        lost[k + 1] += np.sum(after[:, 0]) + np.sum(after[:, width - 1])
        now, after = after, now
        start, slowest = begins, first
    return out, lost
