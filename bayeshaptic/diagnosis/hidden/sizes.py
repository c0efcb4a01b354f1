"""The sizes that an effect may have and not be seen, on the scale of what this recording sees."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bayeshaptic.diagnosis.hidden.regression import Around
from bayeshaptic.diagnosis.hidden.suspects import Suspect
from bayeshaptic.types import Floats

# The square root of twice the log likelihood that an effect takes where the tests begin to see it.
SEEN = 6.0
# Log-uniform in between, as shares of what is seen.
LEAST, MOST = 1 / 30, 3.0
_PROBE = 1e-3  # of the largest strength: small enough to be linear


@dataclass(frozen=True)
class Sizes:
    """Cases of an effect.

    Attributes
    ----------
    strength : ndarray, shape (C,)
    own : ndarray, shape (C, p)
        Values of the effect's parameters.
    shape : ndarray, shape (C, K)
        See `Unseen`.
    weight : ndarray, shape (C,)
        Prior probabilities, given that the effect is there and hides.
    """

    strength: Floats = field(repr=False)
    own: Floats = field(repr=False)
    shape: Floats = field(repr=False)
    weight: Floats = field(repr=False)


def ladder(steps: int) -> Floats:
    """The middles of steps of one ratio from `LEAST` to `MOST`, shape (steps,)."""
    return np.asarray(np.exp(np.linspace(np.log(LEAST), np.log(MOST), 2 * steps + 1)[1::2]))


def sizes_of(suspect: Suspect, known: Around) -> Sizes:
    """Sizes for every shape: from a thirtieth of what is seen to three times that.

    No size is beyond the effect's largest, because what is larger would have been seen and be in
    the model.
    """
    unseen = suspect.unseen
    seen = seen_of(suspect, known)
    fine, coarse = 60, 12  # steps: of one number, and beside a grid of shapes
    steps = fine if len(seen) == 1 else coarse
    strength = (np.minimum(seen, unseen.largest / MOST)[:, None] * ladder(steps)).ravel()
    shape = np.repeat(np.arange(len(seen)), steps)
    weight = unseen.weight[shape] / steps
    if unseen.lowest < 0:
        other = np.flatnonzero(-strength > unseen.lowest)
        shape = np.concatenate([shape, shape[other]])
        weight = np.concatenate([weight, weight[other]])
        strength = np.concatenate([strength, -strength[other]])
    own = unseen.own(strength, unseen.shapes[shape])
    return Sizes(strength, own, unseen.shapes[shape], weight / weight.sum())


def seen_of(suspect: Suspect, known: Around) -> Floats:
    """The strength that this recording sees of every shape, shape (S,)."""
    unseen = suspect.unseen
    probe = np.full(len(unseen.shapes), _PROBE * unseen.largest)
    own = unseen.own(probe, unseen.shapes)
    power = known.power(known.changes(suspect.model, suspect.vectors(known.theta, own)))
    if suspect.tested is not None:
        power = power + (probe / suspect.tested.sd) ** 2
    return np.asarray(SEEN * probe / np.sqrt(np.maximum(power, 1e-300)))
