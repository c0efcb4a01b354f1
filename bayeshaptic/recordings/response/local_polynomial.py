"""The local polynomial method: response, leakage and noise in windows of neighbouring DFT lines.

In a window the DFT of the position is Y = G U + T + V: the response to the force, the leakage of a
record that does not end as it began, and noise of nearly constant variance. Leakage is smooth over
the lines; near zero frequency it looks like that of an integrator, 1/f and 1/f^2. After
R. Pintelon and J. Schoukens, "System Identification: A Frequency Domain Approach", 2nd ed.,
Wiley, 2012, chapter 7.
"""

from __future__ import annotations

from bisect import bisect_left
from typing import Any

import numpy as np
from numpy.typing import NDArray

NODES = np.array([-np.sqrt(0.75), 0.0, np.sqrt(0.75)])
"""Chebyshev nodes of a parabola on [-1, 1]; the middle one is the window's centre."""

LEAKAGE_TERMS = 5


def default_minimum_lines(duration_s: float) -> int:
    """Lines in the narrowest window: 24, but 12 where 24 would be wider than 2.4 Hz."""
    return 24 if duration_s >= 10 else 12


def leakage_terms(
    position: NDArray[Any], frequency: NDArray[Any], centre: NDArray[Any]
) -> NDArray[Any]:
    """1, x, x^2, 1/f and 1/f^2, scaled to the size of one.

    Parameters
    ----------
    position : ndarray, shape (..., w)
        x, about -1 to 1 over the window.
    frequency : ndarray, shape (..., w)
        Any unit.
    centre : ndarray, shape (..., 1)
        The frequency where the last two terms are 1.

    Returns
    -------
    ndarray, shape (..., w, 5)
    """
    inverse = centre / frequency
    one = np.ones_like(position)
    return np.stack([one, position, position**2, inverse, inverse**2], axis=-1)


def interpolation(position: NDArray[Any], nodes: NDArray[Any] = NODES) -> NDArray[Any]:
    """Weights of the polynomial through the values at nodes, by default a parabola, (..., w, k)."""
    if nodes is not NODES:
        return _lagrange(position, nodes)
    outer = NODES[2]
    x = position / outer
    return np.stack([x * (x - 1) / 2, 1 - x**2, x * (x + 1) / 2], axis=-1)


def _lagrange(position: NDArray[Any], nodes: NDArray[Any]) -> NDArray[Any]:
    weights = np.ones((*position.shape, len(nodes)))
    for i, node in enumerate(nodes):
        for other in np.delete(nodes, i):
            weights[..., i] *= (position - other) / (node - other)
    return weights


def project_out(basis: NDArray[Any], columns: NDArray[Any]) -> NDArray[Any]:
    """What is left of the columns (..., w, c) outside the span of the basis (..., w, b)."""
    if np.iscomplexobj(columns) and not np.iscomplexobj(basis):
        # Products with a real basis cost half as much by parts; made complex, it would be copied.
        parts = np.ascontiguousarray(columns).view(columns.real.dtype)
        return np.asarray(project_out(basis, parts).view(columns.dtype))
    inside = basis @ (np.swapaxes(basis.conj(), -1, -2) @ columns)
    return np.asarray(np.subtract(columns, inside, out=inside))


# Wide enough to lose little to leakage, and still narrow enough for a parabola if it is a
# tenth of the frequency.
ENOUGH_LINES, STILL_NARROW = 24, 1 / 25


def window_edges(
    frequency: NDArray[Any], minimum_lines: int, decades: float = 1 / 80
) -> NDArray[np.int64]:
    """Where windows begin and end: at least `minimum_lines` and `decades` wide.

    Windows below 24 lines grow to 24 as soon as that is less than a tenth of the frequency.

    Parameters
    ----------
    frequency : ndarray, shape (L,)
        Lines, evenly spaced, Hz.
    minimum_lines : int
    decades : float
        Relative width of the windows at high frequencies.

    Returns
    -------
    ndarray of int, shape (W + 1,)
        Window w holds the lines edges[w]:edges[w + 1]. What is left at the upper end is shared
        by the last window.
    """
    edges = [0]
    far, near = 10**decades, 10**STILL_NARROW
    while (start := edges[-1]) + minimum_lines <= len(frequency):
        low = frequency[start]
        narrow = bisect_left(frequency, low * near) - start
        least = max(minimum_lines, min(ENOUGH_LINES, narrow))
        edges.append(max(start + least, bisect_left(frequency, low * far)))
    if len(edges) > 2 and edges[-1] > len(frequency):
        edges.pop()
    if len(edges) > 1:
        edges[-1] = len(frequency)
    return np.array(edges)
