"""The tail of importance weights: can an average with them be trusted?"""

from __future__ import annotations

import numpy as np

from bayeshaptic.types import Floats


def pareto_k(log_weight: Floats) -> float:
    """Shape k of a generalised Pareto distribution fitted to the largest weights.

    Below 0.5 averages converge as usual, above 0.7 they are not to be trusted (A. Vehtari, D.
    Simpson, A. Gelman, Y. Yao, J. Gabry, "Pareto smoothed importance sampling", Journal of Machine
    Learning Research 25, 2024).  Fitted as in J. Zhang and M. A. Stephens, "A new and efficient
    estimation method for the generalized Pareto distribution", Technometrics 51 (2009).

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
    if tail < 5 or excess[-1] <= 1e-12:
        return -np.inf
    excess = np.maximum(excess, 1e-12 * excess[-1])
    points = 30 + int(np.sqrt(tail))
    b = 1 - np.sqrt(points / (np.arange(1, points + 1) - 0.5))
    b = b / (3 * excess[int(tail / 4 + 0.5) - 1]) + 1 / excess[-1]
    k = np.mean(np.log1p(-b[:, None] * excess), axis=1)
    level = tail * (np.log(-b / k) - k - 1)
    with np.errstate(over="ignore"):  # of a point without a share
        share = 1 / np.sum(np.exp(level - level[:, None]), axis=1)
    shape = float(np.mean(np.log1p(-float(share @ b) * excess)))
    # Few points: towards 0.5, as ten points would.
    return (tail * shape + 10 * 0.5) / (tail + 10)
