"""Up a likelihood of counts, from values near its top: slopes, steps, and the covariance there."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bayeshaptic.inference.time_domain.counts.filter import Counts, Followed
from bayeshaptic.inference.time_domain.mass_in_loop import DAMPING, MASS, SHARED
from bayeshaptic.numerics.gauss_newton import lengths
from bayeshaptic.types import Floats

WHITE = SHARED  # in a point: behind the values, the logarithm of the white force's sd
LOWEST = np.array([1e-12, 0.0, 0.0, -np.inf, 0.0, -np.inf])
_STEPS, TRIALS = 30, 8  # of an ascent, and of a step, at most: what takes more has not settled
# Of the standard deviation, that slopes are taken over.  Over more than one, what single counts say
# of a value that they know well counts several times.
_OVER = 0.15
_RIDGE = 1e-10  # of the information: what two values share that nothing tells apart


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


def after(counts: Counts, point: Floats, more: Floats | None = None) -> Followed:
    """The counts with these values and this white force, and a further force."""
    return counts.after(point[:SHARED], float(np.exp(point[WHITE])), more)


def slopes_of(counts: Counts, point: Floats, sd: Floats) -> Floats:
    """Of the logarithms of probabilities, over a part of standard deviations; shape (N, 6)."""
    out = np.zeros((len(counts.position), len(point)))
    for i, step in enumerate(_OVER * sd):
        up, down = point.copy(), point.copy()
        up[i] += step
        down[i] = max(down[i] - step, LOWEST[i])
        gained = after(counts, up).likely - after(counts, down).likely
        out[:, i] = gained / (up[i] - down[i])
    return out


def likely_at(counts: Counts, point: Floats) -> float:
    """Logarithm of the likelihood."""
    return float(np.sum(after(counts, point).likely))


def _inverse(slopes: Floats) -> Floats:
    """Covariance by the outer products of slopes.

    E. K. Berndt, B. H. Hall, R. E. Hall and J. A. Hausman, Annals of Economic and Social
    Measurement 3, 1974.
    """
    scale = lengths(slopes)
    scaled = slopes / scale
    inverse = np.linalg.inv(scaled.T @ scaled + _RIDGE * np.eye(len(scale)))
    return np.asarray(inverse / np.outer(scale, scale))


def _first_sd(counts: Counts, point: Floats) -> Floats:
    """What standard deviations may be at most, shape (6,), before anything is known of them."""
    size = float(np.std(counts.command))
    mass, damping = point[[MASS, DAMPING]]
    moves = [0.02 * mass, 0.06 * max(damping, mass), 0.02 * size, 0.02 * size]
    return np.array([*moves, 0.2 * counts.period_s, 0.2])


def ascend(counts: Counts, start: Floats, settled: float, steps: int = _STEPS) -> Likeliest:
    """Steps of Levenberg and Marquardt, the information by the slopes' outer products."""
    point, likely, damped = start, likely_at(counts, start), 1e-3
    most = _first_sd(counts, point)
    sd = most / 3
    done = False
    for _ in range(steps):
        slopes = slopes_of(counts, point, sd)
        covariance = _inverse(slopes)
        sd = np.clip(np.sqrt(np.diag(covariance)), most / 150, most)
        better, gain = None, 0.0
        for _ in range(TRIALS):
            trial = _moved(point, slopes, damped)
            gain = likely_at(counts, trial) - likely
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
        out = free & (point <= LOWEST) & (step < 0)
        if not np.any(out):
            break
        free &= ~out
    moved = np.maximum(point + step, LOWEST)
    moved[MASS] = np.clip(moved[MASS], 0.5 * point[MASS], 2 * point[MASS])
    moved[WHITE] = np.clip(moved[WHITE], point[WHITE] - 1.5, point[WHITE] + 1.5)
    return np.asarray(moved)
