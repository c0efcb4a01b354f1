"""The values of a mass, and the white force on it, under which its counts are likeliest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayeshaptic.inference.time_domain.counts.ascent import (
    LOWEST,
    TRIALS,
    Likeliest,
    after,
    ascend,
    likely_at,
)
from bayeshaptic.inference.time_domain.counts.filter import Counts
from bayeshaptic.inference.time_domain.mass_in_loop import DELAY, MASS
from bayeshaptic.types import Floats

ROUGH = 4  # cells of a count, with which values are looked for at first
_FINER = (8, 16, 32)  # cells, where fewer are not enough
# Squared changes of the samples' log likelihoods with twice the cells, added: with less than this
# likelihoods are as smooth with fewer.  A smaller number takes more cells, or finds none enough;
# with a larger one the likelihood is that of the cells, too.
_ENOUGH = 4.0
# Normals that are added in one of some 150 passes: half a minute in all.  What takes more is left
# to a filter; with a larger number a long recording would take minutes.
_WORK = 5e6
_SIZES = 10.0 ** np.arange(-4.0, 0.6, 0.25)  # of the command, that a white force may have
_FEW = 8  # steps, after which it shows whether more are worth while
_ABOUT = 0.1  # log likelihood that a step gains at the end, where it is only looked for
_SETTLED = 0.03  # the same, where it is found
_AWAY = 2.0  # standard deviations off, where the likelihood is looked at
_PLACES = 2  # other delays from which the likeliest is looked for: each takes a third of the time
_SAME = 0.1  # of a period, within which nothing else is looked for
_AGAIN = 3  # ascents from what was found there: after them nothing has settled


def about(counts: Counts, values: Floats) -> Likeliest:
    """Some steps from `values`, shape (5,), to the likeliest, with few cells."""
    counts = replace(counts, cells=ROUGH)
    return ascend(counts, _begun(counts, values), _ABOUT, _FEW)


def exactly(near: Likeliest, delay_s: float, delay_sd: float) -> Likeliest | None:
    """The likeliest values, with as many cells as it takes, and their covariance.

    A delay may be likeliest in more than one place: others are tried, up to two `delay_sd` from
    `delay_s`, and the covariance reaches as far as they are likely.  None where no cells are
    enough: little but counts disturbs the mass then, and where in a count it is lies between edges
    that no few normals describe.  None, too, where it would take minutes.
    """
    places = _places(near, delay_s, delay_sd)
    first = max(places, key=lambda place: place.likely)
    cells = _enough(first)
    if cells is None:
        return None
    counts = replace(first.counts, cells=cells)
    found = ascend(counts, first.point, _SETTLED)
    for _ in range(_AGAIN):
        covariance, highest = _fallen(found)
        if likely_at(counts, highest) < found.likely + _SETTLED:
            return among(_held(replace(found, covariance=covariance)), places)
        found = ascend(counts, highest, _SETTLED)
    return replace(found, settled=False)


def _begun(counts: Counts, values: Floats) -> Floats:
    """Values with the likeliest of some sizes of the white force, shape (6,)."""
    tried = np.log(_SIZES * np.std(counts.command))
    return max((np.append(values, size) for size in tried), key=lambda at: likely_at(counts, at))


def _enough(near: Likeliest) -> int | None:
    """As many cells as it takes for likelihoods to be the same with more; None where none do."""
    cells, known = near.counts.cells, after(near.counts, near.point)
    for finer in _FINER:
        other = after(replace(near.counts, cells=finer), near.point)
        if np.sum(known.work) > _WORK:
            return None
        if np.sum((other.likely - known.likely) ** 2) < _ENOUGH:
            return cells
        cells, known = finer, other
    return None


def _held(found: Likeliest) -> Likeliest:
    """The same, the covariance narrower by what slopes hold values at their bounds with.

    Above its bound such a value has a density that falls at the slope.  Half of a normal stands for
    it, beyond which a twentieth lies where a twentieth of that does, to 13 %.
    """
    steep = np.where(found.point <= LOWEST, np.minimum(found.slopes.sum(axis=0), 0.0), 0.0)
    sd = np.sqrt(np.diag(found.covariance))
    inner = np.linalg.inv(found.covariance / np.outer(sd, sd)) + np.diag(0.5 * (steep * sd) ** 2)
    held = np.linalg.inv(inner) * np.outer(sd, sd)
    return replace(found, covariance=held, past=-steep * sd)


def _places(found: Likeliest, delay_s: float, delay_sd: float) -> list[Likeliest]:
    """`found`, and the likeliest values from the best of other delays, the others moved along."""
    inner = found.slopes[:, :DELAY].T @ found.slopes
    along = np.linalg.lstsq(inner[:, :DELAY], inner[:, DELAY], rcond=None)[0]
    counts = found.counts
    wide = delay_s + delay_sd * np.linspace(-2, 2, 9)
    close = found.point[DELAY] + counts.period_s * np.array([-1.0, -0.5, 0.5, 1.0])
    tried = []
    for delay in np.unique(np.maximum(np.append(wide, close), 0.0)):
        off = delay - found.point[DELAY]
        point = found.point.copy()
        point[:DELAY] -= along * off
        point[DELAY] = delay
        possible = 0.5 < point[MASS] / found.point[MASS] < 2
        if abs(off) > _SAME * counts.period_s and possible:
            tried.append(np.maximum(point, LOWEST))
    likely = np.array([-np.inf, *(likely_at(counts, one) for one in tried), -np.inf])
    tops = np.flatnonzero((likely[1:-1] >= likely[:-2]) & (likely[1:-1] >= likely[2:]))
    best = sorted(tops.tolist(), key=lambda i: -likely[i + 1])[:_PLACES]
    places = [found]
    for i in best:
        other = ascend(counts, tried[i], _ABOUT, _FEW)
        off = min(abs(other.point[DELAY] - place.point[DELAY]) for place in places)
        if off > _SAME * counts.period_s:
            places.append(other)
    return places


def among(found: Likeliest, places: list[Likeliest]) -> Likeliest:
    """The same, the covariance wider by how far other places are, each by its probability.

    That is of the normal there: its likelihood times the root of its covariance's determinant.
    """
    volume = [place.likely + 0.5 * np.linalg.slogdet(place.covariance)[1] for place in places]
    share = np.exp(np.array(volume) - max(volume))
    share /= share.sum()
    apart = np.array([place.point - found.point for place in places])
    return replace(found, covariance=found.covariance + (share[:, None] * apart).T @ apart)


def _fallen(found: Likeliest) -> tuple[Floats, Floats]:
    """The covariance, no less than the likelihood falls by; the likeliest point met.

    Along its axes, and along each value alone.  Where few samples say most of a value the
    likelihood is rough, and its slopes are steeper than it falls; next to a whole number of periods
    those of a delay are.
    """
    scale = 1 / np.sqrt(np.diag(found.covariance))
    power, axes = np.linalg.eigh(found.covariance * np.outer(scale, scale))
    axes = axes * np.sqrt(np.maximum(power, 0.0)) / scale[:, None]
    best = found.point, found.likely
    for axis in axes.T:
        times, best = _wider(found, axis, best)
        axis *= times
    covariance = np.asarray(axes @ axes.T)
    alone = np.diag(1 / np.sqrt(np.diag(np.linalg.inv(covariance * np.outer(scale, scale)))))
    for i, axis in enumerate(alone / scale):
        times, best = _wider(found, axis, best)
        covariance[i] *= times
        covariance[:, i] *= times
    return covariance, best[0]


def _wider(
    found: Likeliest, axis: Floats, best: tuple[Floats, float]
) -> tuple[float, tuple[Floats, float]]:
    """By how much the likelihood falls less along an axis of one standard deviation than it should.

    `best` is the likeliest point met before, with its likelihood; it is handed on.
    """
    times = 1.0
    for _ in range(TRIALS):
        ends = [found.point + side * _AWAY * times * axis for side in (-1, 1)]
        ends = [end for end in ends if np.all(end >= LOWEST)]
        if not ends:
            break
        likely = [likely_at(found.counts, end) for end in ends]
        if max(likely) > best[1]:
            best = ends[int(np.argmax(likely))], max(likely)
        fell = (found.likely - float(np.mean(likely))) / (0.5 * _AWAY**2)
        if fell > 0.9:
            break
        times *= min(1 / np.sqrt(max(fell, 0.1)), 3.0)
    return times, best
