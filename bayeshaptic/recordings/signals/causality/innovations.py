"""Whether the force's innovations, what is new in it, answer to those of the position before.

Where both are predicted as well as their pasts allow, nothing of the one that is left may be
correlated with the other one's past (L. D. Haugh, *JASA* 71, 1976). A past that one prediction
lacks does no harm while the other has it: errors of both together are needed to feign an answer,
so that far less than a share of the force can be seen than by comparing two predictions.
"""

from __future__ import annotations

import numpy as np

from bayeshaptic.recordings.signals.causality.prediction import Prediction, within_the_usual
from bayeshaptic.types import Floats

# Samples later at which the force answers: sums over wider and wider spans, fewer than the
# prediction of the force reaches back.
_SPANS = ((1, 2), (2, 3), (3, 5), (5, 9), (9, 17), (17, 33))
_LAST = _SPANS[-1][1]
# A force that is predicted to less than this (of its increments' power), or not at all, has
# nothing new in it that chance made; nor has one whose innovations come in jumps, or foretell each
# other.
_FAINTEST, _STRONGEST = 2.5e-3, 1.2


def innovations_answer(of_force: Prediction, of_position: Prediction) -> float:
    """How the force's innovations answer to earlier ones of the position.

    Parameters
    ----------
    of_force, of_position : Prediction
        Each from both pasts; the position of all samples.

    Returns
    -------
    float
        Chi-square of six spans of delay, and of an answer against the motion within the sample;
        zero where the force is not such that it can be told.
    """
    force, position = (within_the_usual(e) for e in (of_force.own, of_position.full))
    in_jumps = 0.1
    usual = 1 - _power(force) / max(_power(of_force.own), np.finfo(float).tiny) < in_jumps
    if not (usual and _FAINTEST < _power(of_force.own) < _STRONGEST and _is_white(force)):
        return 0.0
    force, position = force - force.mean(), position - position.mean()
    # Row k of the force among those of the position, and none whose past is of another piece.
    rows, at = of_position.rows, np.searchsorted(of_position.rows, of_force.rows)
    inside = at >= _LAST
    inside[inside] = rows[at[inside]] - rows[at[inside] - _LAST] == _LAST
    force, at = force[inside], at[inside]
    summed = np.concatenate([[0.0], np.cumsum(position)])
    spans = np.array([summed[at - low + 1] - summed[at - high + 1] for low, high in _SPANS])
    against = min(_z(force * position[at]), 0.0)
    return _chi_square(force * spans) + against**2


def _power(signal: Floats) -> float:
    return float(np.mean(signal**2))


def _is_white(signal: Floats) -> bool:
    """Whether a signal hardly foretells itself, as far as the spans reach."""
    centred = signal - signal.mean()
    power = centred @ centred + np.finfo(float).tiny
    own = [centred[lag:] @ centred[:-lag] / power for lag in range(1, _LAST)]
    foretold = 5e-3
    return float(np.sum(np.square(own))) < 2 * _LAST / len(signal) + foretold


def _chi_square(products: Floats) -> float:
    """Of the sums of several products, each of mean zero and new in every sample.

    Their covariance counts: where the position's innovations foretell each other (a coarse encoder,
    rows that are not there, a force that is not linear), the spans see one chance several times.
    """
    total = products.sum(axis=1)
    size = np.sqrt(np.sum(products**2, axis=1)) + np.finfo(float).tiny
    z, scaled = total / size, products / size[:, None]
    # Directions that hardly any of the products has are none.
    faintest = 1e-6
    return float(z @ np.linalg.pinv(scaled @ scaled.T, rcond=faintest, hermitian=True) @ z)


def _z(products: Floats) -> float:
    return float(products.sum() / (np.sqrt(products @ products) + np.finfo(float).tiny))
