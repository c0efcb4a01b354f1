"""Each sample from those before it: what must have been there where one is missing or wrong.

A position answers to the force linearly and is disturbed by noise that is nearly Gaussian, so that
a regression of each sample on the past of both, without any mechanical model, predicts it to within
a fraction of an encoder count.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve, solveh_banded

from bayeshaptic.types import Bools, Floats

ORDER = 48  # samples of the past
TINY = 1e-8  # of the motion: errors where it is predicted to within rounding


@dataclass(frozen=True)
class Predictor:
    r"""A regression of the position on its own past and on the force.

    .. math:: \sum_{i=0}^n a_i y_{k-i} = \sum_{i=0}^n b_i u_{k-i} + c + e_k, \quad a_0 = 1

    Attributes
    ----------
    past, force : ndarray, shape (n + 1,)
        a and b.
    constant : float
    spread : float
        Standard deviation of e, from the median of its magnitude: few bad samples leave it alone.
    """

    past: Floats
    force: Floats
    constant: float
    spread: float

    @property
    def order(self) -> int:
        return len(self.past) - 1

    def errors(self, position: Floats, force: Floats) -> Floats:
        """e at every sample, shape (N,); zero at the first n."""
        count = len(position)
        found = np.convolve(position, self.past)[:count] - np.convolve(force, self.force)[:count]
        found -= self.constant
        found[: self.order] = 0.0
        return found

    def fill(self, position: Floats, force: Floats, missing: Bools) -> Floats:
        """The position with its missing samples replaced by their expectation given all others.

        They minimise the sum of e^2 (A. Janssen, R. Veldhuis and L. Vries, "Adaptive interpolation
        of discrete-time signals that can be modeled as autoregressive processes", IEEE Trans.
        Acoust., Speech, Signal Process. 34(2), 1986; here with a known force).

        Parameters
        ----------
        position, force : ndarray, shape (N,)
        missing : ndarray of bool, shape (N,)
        """
        where = np.flatnonzero(missing)
        if len(where) == 0:
            return position
        filled = position.copy()
        known = np.flatnonzero(~missing)
        filled[where] = np.interp(where, known, position[known])
        errors = self.errors(filled, force)
        slope = np.convolve(errors[::-1], self.past)[: len(position)][::-1]
        bands = self._normal_equations(missing, where)
        filled[where] -= solveh_banded(bands, slope[where], lower=True)
        return filled

    def _normal_equations(self, missing: Bools, where: NDArray[np.intp]) -> Floats:
        """Second derivatives of half the sum of e^2, the missing samples alone, in bands."""
        count, n = len(missing), self.order
        rank = np.cumsum(missing) - 1
        last = count - 1 - where  # how many equations follow each sample
        bands = np.zeros((n + 1, len(where)))
        for apart in range(n + 1):
            both = np.flatnonzero(missing[: count - apart] & missing[apart:])
            if len(both) == 0:
                continue
            products = self.past[: n + 1 - apart] * self.past[apart:]
            sums = np.concatenate([[0.0], np.cumsum(products)])
            here = rank[both]
            # Sample s takes part in the equations s .. s + n, of which the first is n.
            low = np.clip(n - apart - both, 0, n + 1 - apart)
            high = np.clip(last[here] - apart + 1, 0, n + 1 - apart)
            bands[rank[both + apart] - here, here] = sums[high] - sums[low]
        # Long gaps are all but singular; where the data say nothing, stay near the straight line.
        bands[0] += 1e-13 * self.past @ self.past
        return bands


def fill_both(
    position: Floats, force: Floats, missing: Bools, of_position: Predictor, of_force: Predictor
) -> tuple[Floats, Floats, Floats]:
    """Position and force where both are missing: what explains all others best.

    The motion after a lost row tells of its force, as far as it stands out from what disturbs it.

    Parameters
    ----------
    position, force : ndarray, shape (N,)
        Anything where they are missing.
    missing : ndarray of bool, shape (N,)
    of_position, of_force : Predictor
        Of the same order; that of the force takes nothing but its own past.

    Returns
    -------
    position, force : ndarray, shape (N,)
    variance : ndarray
        Of what was put in for each missing force.
    """
    position, force, order = position.copy(), force.copy(), of_position.order
    errors = (of_position.errors(position, force), of_force.errors(force, np.zeros(len(force))))
    whole = np.convolve(missing, np.ones(order + 1))[: len(missing)] < 1
    tiny = 1e-9  # of a signal, where it is predicted exactly
    spreads = (
        max(of_position.spread, tiny * float(np.std(position))),
        # Of a force that is constant most of the time the median error says nothing of its steps.
        max(float(np.std(errors[1][whole])), tiny * float(np.std(force))),
    )
    where, variance = np.flatnonzero(missing), []
    for near in np.split(where, np.flatnonzero(np.diff(where) > order) + 1):
        rows = slice(near[0], near[-1] + order + 1)
        left = [error[rows] / spread for error, spread in zip(errors, spreads, strict=True)]
        design = np.zeros((2, len(left[0]), 2, len(near)))
        for column, at in enumerate(near - near[0]):
            after = slice(at, at + order + 1)
            count = len(left[0][after])
            design[0, after, 0, column] = of_position.past[:count] / spreads[0]
            design[0, after, 1, column] = -of_position.force[:count] / spreads[0]
            design[1, after, 1, column] = of_force.past[:count] / spreads[1]
        flat = design.reshape(2 * len(left[0]), -1)
        scale = np.abs(flat).max(axis=0)
        inverse = np.linalg.pinv(flat / scale, rcond=1e-12) / scale[:, None]
        change = -(inverse @ np.concatenate(left)).reshape(2, -1)
        position[near] += change[0]
        force[near] += change[1]
        variance.append(np.sum(inverse[len(near) :] ** 2, axis=1))
    return position, force, np.concatenate(variance)


def _regression(design: Floats, target: Floats, ridge: Floats) -> Floats:
    """Coefficients by least squares, each held to zero by its number in `ridge`.

    By normal equations, in a quarter of the time, where these are not lost in rounding: the counts
    of an encoder keep its lags apart, and a simulated motion without any does not.
    """
    normal = design.T @ design + np.diag(ridge**2)
    size = np.sqrt(np.diag(normal))
    apart = 1e-5  # what is left of a column, over all of it, beside those before
    with suppress(np.linalg.LinAlgError):
        # Of a column of zeros, a force that is none, this fails.
        triangle = np.linalg.cholesky(
            normal / np.maximum(np.outer(size, size), np.finfo(float).tiny)
        )
        if np.diag(triangle).min() > apart:
            return np.asarray(cho_solve((triangle, True), design.T @ target / size) / size)
    own = np.flatnonzero(ridge)
    held = np.zeros((len(own), len(ridge)))
    held[np.arange(len(own)), own] = ridge[own]
    stacked = np.concatenate([design, held]), np.append(target, np.zeros(len(own)))
    return np.asarray(np.linalg.lstsq(*stacked, rcond=1e-13)[0])


def fit_predictor(position: Floats, force: Floats, missing: Bools) -> Predictor | None:
    """The regression over all samples that are there, with all of their past.

    Parameters
    ----------
    position, force : ndarray, shape (N,)
        Without a force, zeros, it is a regression of a signal on itself.
    missing : ndarray of bool, shape (N,)

    Returns
    -------
    Predictor or None
        None where there are too few such samples.
    """
    gaps = np.concatenate([[0], np.cumsum(missing)])
    rows = np.arange(ORDER, len(position))
    rows = rows[gaps[rows + 1] == gaps[rows - ORDER]]
    columns = 2 * ORDER + 2
    rows_a_column = 8
    if len(rows) < rows_a_column * columns:
        return None
    most_rows = 20_000  # a regression on more gains nothing
    rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), most_rows)).astype(int)]
    centre = float(position[~missing].mean())
    lags = np.arange(ORDER + 1)
    tiny = np.finfo(float).tiny
    sizes = (np.ptp(position[~missing]), max(np.abs(force).max(), tiny))
    design = np.empty((len(rows), columns))
    design[:, :ORDER] = (position[rows[:, None] - lags[1:]] - centre) / sizes[0]
    design[:, ORDER:-1] = force[rows[:, None] - lags] / sizes[1]
    design[:, -1] = 1.0
    target = (position[rows] - centre) / sizes[0]
    # Where the force has no power its coefficients are anything; they had better be zero.
    ridge = np.zeros(columns)
    unseen = 1e-8  # power of the force, over all of it, below which nothing is learnt from it
    ridge[ORDER:-1] = np.sqrt(unseen) * np.linalg.norm(design[:, ORDER])
    found = _regression(design, target, ridge)
    spread = 1.4826 * float(np.median(np.abs(target - design @ found)))
    past = np.concatenate([[1.0], -found[:ORDER]])
    return Predictor(
        past,
        found[ORDER:-1] * sizes[0] / sizes[1],
        float(found[-1] * sizes[0] + centre * past.sum()),
        spread * sizes[0],
    )
