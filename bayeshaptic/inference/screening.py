"""Where to start fitting a model with one more effect: a dense grid, sieved cheaply."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.inference.coordinates import coordinates
from bayeshaptic.inference.fit import weighted_residuals
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.models import Model
from bayeshaptic.models.model import Extension
from bayeshaptic.models.structures import HAND
from bayeshaptic.numerics.gauss_newton import jacobian
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Floats


def starting_bases(model: Model, theta: Floats, elsewhere: Floats | None = None) -> Floats:
    """Base vectors to start from: the fit, where else its starts ended, and what is believed.

    The best fit of a model that lacks something may be bent so far that the way from it is barred;
    the valley where most starting points end is then the nearer one.  With a device file its own
    values too, and the fit with the file's hand: what the model lacks is often taken for a strange
    hand.

    Parameters
    ----------
    model : Model
        Without the effect.
    theta : ndarray, shape (P,)
        Its fit.
    elsewhere : ndarray, shape (V, P), optional
        `Fit.elsewhere`.

    Returns
    -------
    ndarray, shape (S, P)
    """
    believed = np.array([model.reference.get(name, np.nan) for name in model.names])
    nominal = np.where(np.isnan(believed), theta, believed)
    hand = np.isin(model.names, HAND)
    bases = np.stack([theta, nominal, np.where(hand, nominal, theta)])
    if elsewhere is not None and elsewhere.size:
        bases = np.concatenate([bases, elsewhere])
    return np.unique(bases, axis=0)


def promising_starts(
    model: Model, effect: Extension, windows: Windows, bases: Floats, own: Floats, keep: int = 24
) -> Floats:
    """The best starting vectors for ``model.with_effect(effect)``.

    Every value of the effect beside every base vector is judged by the sum of squares that is left
    when the base parameters may give way, to first order.  The base vectors have equal shares in
    what is kept: from a fit alone, bent to the data without the effect, the way to the optimum
    may be barred.

    Parameters
    ----------
    model : Model
        Without the effect.
    effect : Extension
    windows : Windows
    bases : ndarray, shape (S, P)
        Vectors of `model`: see `starting_bases`.
    own : ndarray, shape (N, number of the effect's parameters)
        Values of the effect: `Extension.starting_values`.
    keep : int

    Returns
    -------
    ndarray, shape (at most `keep`, P + number of the effect's parameters)
    """
    full = model.with_effect(effect)
    added = [parameter.name for parameter in effect.parameters]
    where_own = [full.names.index(name) for name in added]
    where_base = [full.names.index(name) for name in model.names]
    residuals = weighted_residuals(Likelihood(full, windows), coordinates(full))
    without = weighted_residuals(Likelihood(model, windows), coordinates(model))
    bases = np.atleast_2d(bases)
    kept = []
    for base in bases:
        starts = np.empty((len(own), full.size))
        starts[:, where_own], starts[:, where_base] = own, base
        with np.errstate(all="ignore"):
            left = residuals(coordinates(full).coordinate(starts))
            slope = jacobian(without, coordinates(model).coordinate(base[None]))[0]
        usable = np.all(np.isfinite(left), axis=1)
        left = np.where(usable[:, None], left, 0.0)
        q, _ = np.linalg.qr(np.nan_to_num(slope))
        cost = np.einsum("bn,bn->b", left, left) - np.einsum("bp,bp->b", *(2 * [left @ q]))
        order = _spread(own, np.where(usable, cost, np.inf))
        kept.append(starts[order[: keep // len(bases)]])
    return np.concatenate(kept)


def _spread(own: Floats, cost: Floats) -> NDArray[np.int_]:
    """Order of the values: the best of every row of the grid (along its first axis), then the next.

    The lowest costs alone are neighbours that lead to the same optimum.
    """
    row = np.unique(own[:, 1:], axis=0, return_inverse=True)[1].ravel()
    by_row = np.lexsort((cost, row))
    first = np.searchsorted(row[by_row], row[by_row])
    place = np.empty(len(own), int)
    place[by_row] = np.arange(len(own)) - first
    return np.lexsort((cost, place))
