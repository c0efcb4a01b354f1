"""A low-pass before the masses or behind them: which of the two it is, forces between them tell.

To the response it is the same whether the force follows late or the position is read late.  But dry
friction opposes the motion of the masses, not the one that a filter makes of it, and what it does
is read late behind a filter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.effects.effect import LinearEffect
from bayeshaptic.models import Model
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class OtherSide:
    """A model with its low-pass on the other side of the masses.

    Attributes
    ----------
    index : int
        Of the effect among those of the model that it was.
    effect : LinearEffect
        In its place.
    model : Model
    theta : ndarray, shape (P,)
        Of the same response, or of one that is near it.
    """

    index: int
    effect: LinearEffect
    model: Model
    theta: Floats


def on_the_other_side(model: Model, etfe: Etfe, theta: Floats) -> OtherSide | None:
    """The model with the first of its low-passes on the other side; None without one.

    Parameters
    ----------
    model : Model
    etfe : Etfe
    theta : ndarray, shape (P,)
    """
    values = dict(zip(model.names, theta.tolist(), strict=True))
    for index, effect in enumerate(model.effects):
        if not isinstance(effect, LinearEffect):
            continue
        bare = model.without_effect(effect)
        own = np.array([values[parameter.name] for parameter in effect.parameters])
        found = effect.on_the_other_side(bare, etfe, own)
        if found is None:
            continue
        other, there = found
        names = (parameter.name for parameter in other.parameters)
        known = values | dict(zip(names, there.tolist(), strict=True))
        whole = bare.with_effect(other)
        return OtherSide(index, other, whole, np.array([known[name] for name in whole.names]))
    return None
