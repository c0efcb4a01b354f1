"""The values of a mass, and the white force on it, under which its counts are likeliest."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from bayeshaptic.inference.time_domain.counts.filter import Counts, Followed
from bayeshaptic.inference.time_domain.mass_in_loop import DAMPING, DELAY, MASS, SHARED
from bayeshaptic.numerics.gauss_newton import lengths
from bayeshaptic.types import Floats

WHITE = SHARED  # in a point: behind the values, the logarithm of the white force's sd
ROUGH = 4  # cells of a count, with which values are looked for at first
_FINER = (8, 16, 32)  # cells, where fewer are not enough
# Squared changes of the samples' log likelihoods with twice the cells, added: with less than this
# likelihoods are as smooth with fewer.  A smaller number takes more cells, or finds none enough;
# with a larger one the likelihood is that of the cells, too.
_ENOUGH = 4.0
# Normals that are added in one of some 150 passes: half a minute in all.  What takes more is left
# to a filter; with a larger number a long recording would take minutes.
_WORK = 5e6
_LOWEST = np.array([1e-12, 0.0, 0.0, -np.inf, 0.0, -np.inf])
_SIZES = 10.0 ** np.arange(-4.0, 0.6, 0.25)  # of the command, that a white force may have
_STEPS, _TRIALS = 30, 8  # of an ascent, and of a step, at most: what takes more has not settled
_FEW = 8  # steps, after which it shows whether more are worth while
# Of the standard deviation, that slopes are taken over.  Over more than one, what single counts say
# of a value that they know well counts several times.
_OVER = 0.15
_RIDGE = 1e-10  # of the information: what two values share that nothing tells apart
_ABOUT = 0.1  # log likelihood that a step gains at the end, where it is only looked for
_SETTLED = 0.03  # the same, where it is found
_AWAY = 2.0  # standard deviations off, where the likelihood is looked at
_PLACES = 2  # other delays from which the likeliest is looked for: each takes a third of the time
_SAME = 0.1  # of a period, within which nothing else is looked for
_AGAIN = 3  # ascents from what was found there: after them nothing has settled


@dataclass(frozen=True, eq=False)
class Likeliest:
    """Where the likelihood of the counts is largest.

    Attributes
    ----------
    counts : Counts
        With as many cells as it takes.
    point : ndarray, shape (6,)
        Values, and the logarithm of the white force's standard deviation.
    likely : float
        Logarithm of the likelihood.
    slopes : ndarray, shape (N, 6)
        Of the logarithms of probabilities.
    covariance : ndarray, shape (6, 6)
    settled : bool
    past : ndarray, shape (6,)
        Standard deviations by which slopes point past the bounds of values that are there.
    """

    counts: Counts = field(repr=False)
    point: Floats
    likely: float
    slopes: Floats = field(repr=False)
    covariance: Floats
    settled: bool
    past: Floats = field(default_factory=lambda: np.zeros(WHITE + 1))

    @property
    def force_sd(self) -> float:
        return float(np.exp(self.point[WHITE]))


def about(counts: Counts, values: Floats) -> Likeliest:
    """Some steps from `values`, shape (5,), to the likeliest, with few cells."""
    counts = replace(counts, cells=ROUGH)
    return _ascend(counts, _begun(counts, values), _ABOUT, _FEW)


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
    found = _ascend(counts, first.point, _SETTLED)
    for _ in range(_AGAIN):
        covariance, highest = _fallen(found)
        if _likely(counts, highest) < found.likely + _SETTLED:
            return among(_held(replace(found, covariance=covariance)), places)
        found = _ascend(counts, highest, _SETTLED)
    return replace(found, settled=False)


def _begun(counts: Counts, values: Floats) -> Floats:
    """Values with the likeliest of some sizes of the white force, shape (6,)."""
    tried = np.log(_SIZES * np.std(counts.command))
    return max((np.append(values, size) for size in tried), key=lambda at: _likely(counts, at))


def after(counts: Counts, point: Floats, more: Floats | None = None) -> Followed:
    """The counts with these values and this white force, and a further force."""
    return counts.after(point[:SHARED], float(np.exp(point[WHITE])), more)


def slopes_of(counts: Counts, point: Floats, sd: Floats) -> Floats:
    """Of the logarithms of probabilities, over a part of standard deviations; shape (N, 6)."""
    out = np.zeros((len(counts.position), len(point)))
    for i, step in enumerate(_OVER * sd):
        up, down = point.copy(), point.copy()
        up[i] += step
        down[i] = max(down[i] - step, _LOWEST[i])
        gained = after(counts, up).likely - after(counts, down).likely
        out[:, i] = gained / (up[i] - down[i])
    return out


def _likely(counts: Counts, point: Floats) -> float:
    return float(np.sum(after(counts, point).likely))


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


def _inverse(slopes: Floats) -> Floats:
    """Covariance by the outer products of slopes.

    E. K. Berndt, B. H. Hall, R. E. Hall and J. A. Hausman, Annals of Economic and Social
    Measurement 3, 1974.
    """
    scale = lengths(slopes)
    scaled = slopes / scale
    inverse = np.linalg.inv(scaled.T @ scaled + _RIDGE * np.eye(len(scale)))
    return np.asarray(inverse / np.outer(scale, scale))


def _held(found: Likeliest) -> Likeliest:
    """The same, the covariance narrower by what slopes hold values at their bounds with.

    Above its bound such a value has a density that falls at the slope.  Half of a normal stands for
    it, beyond which a twentieth lies where a twentieth of that does, to 13 %.
    """
    steep = np.where(found.point <= _LOWEST, np.minimum(found.slopes.sum(axis=0), 0.0), 0.0)
    sd = np.sqrt(np.diag(found.covariance))
    inner = np.linalg.inv(found.covariance / np.outer(sd, sd)) + np.diag(0.5 * (steep * sd) ** 2)
    held = np.linalg.inv(inner) * np.outer(sd, sd)
    return replace(found, covariance=held, past=-steep * sd)


def _first_sd(counts: Counts, point: Floats) -> Floats:
    """What standard deviations may be at most, shape (6,), before anything is known of them."""
    size = float(np.std(counts.command))
    mass, damping = point[[MASS, DAMPING]]
    moves = [0.02 * mass, 0.06 * max(damping, mass), 0.02 * size, 0.02 * size]
    return np.array([*moves, 0.2 * counts.period_s, 0.2])


def _ascend(counts: Counts, start: Floats, settled: float, steps: int = _STEPS) -> Likeliest:
    """Steps of Levenberg and Marquardt, the information by the slopes' outer products."""
    point, likely, damped = start, _likely(counts, start), 1e-3
    most = _first_sd(counts, point)
    sd = most / 3
    done = False
    for _ in range(steps):
        slopes = slopes_of(counts, point, sd)
        covariance = _inverse(slopes)
        sd = np.clip(np.sqrt(np.diag(covariance)), most / 150, most)
        better, gain = None, 0.0
        for _ in range(_TRIALS):
            trial = _moved(point, slopes, damped)
            gain = _likely(counts, trial) - likely
            if gain > 0:
                better = trial
                break
            damped = max(8 * damped, 1e-3)
        if better is not None:
            point, likely, damped = better, likely + gain, max(damped / 8, 1e-6)
        done = better is None or gain < settled
        if done:
            break
    return Likeliest(counts, point, likely, slopes, covariance, done)


def _moved(point: Floats, slopes: Floats, damped: float) -> Floats:
    """A damped step that keeps to what is possible: values at their bounds do not pull others."""
    scale = lengths(slopes)
    scaled = slopes / scale
    free = np.ones(len(point), dtype=bool)
    step = np.zeros(len(point))
    for _ in range(len(point)):
        some = scaled[:, free]
        step[:] = 0.0
        inner = some.T @ some + damped * np.eye(some.shape[1])
        step[free] = np.linalg.solve(inner, some.sum(axis=0)) / scale[free]
        out = free & (point <= _LOWEST) & (step < 0)
        if not np.any(out):
            break
        free &= ~out
    moved = np.maximum(point + step, _LOWEST)
    moved[MASS] = np.clip(moved[MASS], 0.5 * point[MASS], 2 * point[MASS])
    moved[WHITE] = np.clip(moved[WHITE], point[WHITE] - 1.5, point[WHITE] + 1.5)
    return np.asarray(moved)


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
            tried.append(np.maximum(point, _LOWEST))
    likely = np.array([-np.inf, *(_likely(counts, one) for one in tried), -np.inf])
    tops = np.flatnonzero((likely[1:-1] >= likely[:-2]) & (likely[1:-1] >= likely[2:]))
    best = sorted(tops.tolist(), key=lambda i: -likely[i + 1])[:_PLACES]
    places = [found]
    for i in best:
        other = _ascend(counts, tried[i], _ABOUT, _FEW)
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
    for _ in range(_TRIALS):
        ends = [found.point + side * _AWAY * times * axis for side in (-1, 1)]
        ends = [end for end in ends if np.all(end >= _LOWEST)]
        if not ends:
            break
        likely = [_likely(found.counts, end) for end in ends]
        if max(likely) > best[1]:
            best = ends[int(np.argmax(likely))], max(likely)
        fell = (found.likely - float(np.mean(likely))) / (0.5 * _AWAY**2)
        if fell > 0.9:
            break
        times *= min(1 / np.sqrt(max(fell, 0.1)), 3.0)
    return times, best
