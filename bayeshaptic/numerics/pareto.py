"""Generalised Pareto distributions: tails of importance weights, and of what was sampled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.types import Floats


@dataclass(frozen=True)
class ParetoTail:
    """P(excess > x) = (1 + shape x / scale)^(-1 / shape).

    Attributes
    ----------
    shape : float
        Below zero the tail ends, at zero it is exponential.
    scale : float
    """

    shape: float
    scale: float

    def quantile(self, beyond: float) -> float:
        """The excess that is exceeded with probability `beyond`."""
        logs = -np.log(beyond)
        if abs(self.shape * logs) < 1e-9:
            return float(self.scale * logs)
        return float(self.scale * np.expm1(self.shape * logs) / self.shape)

    def above(self, excess: Floats) -> Floats:
        """P(excess > x) at `excess`, of any shape."""
        if abs(self.shape) < 1e-9:
            return np.exp(-excess / self.scale)
        inner = np.maximum(1 + self.shape * excess / self.scale, 0.0)
        with np.errstate(divide="ignore"):
            return np.exp(-np.log(inner) / self.shape)

    def towards_exponential(self, draws: float) -> ParetoTail:
        """What is left of the shape where it was fitted to few `draws`, with the same mean.

        As if twenty more had been exponential: a shape that is low by chance promises too much.
        """
        believed = 20.0
        shape = self.shape * draws / (draws + believed)
        if self.shape >= 1:  # there is no mean
            return ParetoTail(shape, self.scale)
        return ParetoTail(shape, self.scale * (1 - shape) / (1 - self.shape))

    def variance(self, beyond: float, draws: float) -> float:
        """Variance of `quantile` where the parameters were fitted to `draws` independent excesses.

        By the information of the likelihood (S. Coles, "An introduction to statistical modeling of
        extreme values", Springer 2001, section 4.3; R. L. Smith, Biometrika 72, 1985), for a tail
        that is at least exponential: a shape that is low by chance would promise too much again.
        """
        k, scale, logs = max(self.shape, 1e-4), self.scale, -np.log(beyond)
        grown = np.expm1(k * logs) / k
        by_shape = scale * (logs * np.exp(k * logs) - grown) / k
        by_scale = grown
        own = (1 + k) ** 2 * by_shape**2 - 2 * (1 + k) * scale * by_shape * by_scale
        return float((own + 2 * (1 + k) * (scale * by_scale) ** 2) / draws)


def first_quartile(excess: Floats) -> float:
    """What a fit is scaled by, which must not be zero: many draws may be at the threshold."""
    return float(excess[max(int(len(excess) / 4 + 0.5) - 1, 0)])


def fit_pareto(excess: Floats) -> ParetoTail:
    """Fit a tail to `excess` of shape (n,), ascending, and positive from the first quartile on.

    J. Zhang and M. A. Stephens, "A new and efficient estimation method for the generalized Pareto
    distribution", Technometrics 51 (2009).
    """
    count = len(excess)
    points = 30 + int(np.sqrt(count))
    b = 1 - np.sqrt(points / (np.arange(1, points + 1) - 0.5))
    b = b / (3 * first_quartile(excess)) + 1 / excess[-1]
    k = np.mean(np.log1p(-b[:, None] * excess), axis=1)
    level = count * (np.log(-b / k) - k - 1)
    with np.errstate(over="ignore"):  # of a point without a share
        share = 1 / np.sum(np.exp(level - level[:, None]), axis=1)
    rate = float(share @ b)
    shape = float(np.mean(np.log1p(-rate * excess)))
    return ParetoTail(shape, -shape / rate)


def pareto_k(log_weight: Floats) -> float:
    """Shape k of a generalised Pareto distribution fitted to the largest weights.

    Below 0.5 averages converge as usual, above 0.7 they are not to be trusted (A. Vehtari, D.
    Simpson, A. Gelman, Y. Yao, J. Gabry, "Pareto smoothed importance sampling", Journal of Machine
    Learning Research 25, 2024).

    Parameters
    ----------
    log_weight : ndarray, shape (n,)

    Returns
    -------
    float
        -inf where all weights are equal.
    """
    count = len(log_weight)
    tail = int(min(0.2 * count, 3 * np.sqrt(count)))
    weight = np.sort(np.exp(log_weight - log_weight.max()))
    excess = weight[-tail:] - weight[-tail - 1]
    fewest = 5  # excesses that a shape can be fitted to
    if tail < fewest or excess[-1] <= 1e-12:
        return -np.inf
    shape = fit_pareto(np.maximum(excess, 1e-12 * excess[-1])).shape
    # Few points: towards 0.5, as ten points would.
    return (tail * shape + 10 * 0.5) / (tail + 10)
