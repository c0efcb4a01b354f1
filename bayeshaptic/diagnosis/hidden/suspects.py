"""Which effects could hide in a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayeshaptic.effects.library import effects
from bayeshaptic.effects.unseen import Unseen
from bayeshaptic.models import Extension, Model
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class ForceSaid:
    """What tests of the residual say of a strength by themselves: normal, `mean` +- `sd`."""

    mean: float
    sd: float

    def log_likelihood(self, strength: Floats) -> Floats:
        """Over that of no strength."""
        return (strength * self.mean - 0.5 * strength**2) / self.sd**2


@dataclass(frozen=True)
class Suspect:
    """An effect that could hide, at one place.

    Attributes
    ----------
    name, title, family, told_apart_by : str
        The effect's.
    base : Model
        What was fitted.
    extension : Extension
        What it adds to the fitted response.
    unseen : Unseen
    tested : ForceSaid or None
    counts : bool
        Whether the loop of a wall has it as well.  A nonlinear force stands in the fit as the
        spring or damper that it looks like; the limit is that of the rest.
    share : float
        Of the effect's probability; the rest is for its other places.
    place : str
        Which of these.
    shared : str
        Whether another recording says something of the same one: "device", wherever the device is
        the same; "configuration", where its configuration is, too; or nothing, where the hand has
        it, or its size means something else in every recording.
    unit_size : float
        Of a strength of one, in a unit that recordings share.
    """

    name: str
    title: str
    family: str
    told_apart_by: str
    base: Model
    extension: Extension
    unseen: Unseen
    tested: ForceSaid | None = None
    counts: bool = True
    share: float = 1.0
    place: str = ""
    shared: str = ""
    unit_size: float = 1.0

    @property
    def model(self) -> Model:
        """The base model with what the effect adds to the response."""
        return self.base.with_effect(self.extension)

    def vectors(self, theta: Floats, own: Floats) -> Floats:
        """Vectors of `model`: base vectors (B, P) or (P,) with the effect's own (B, p)."""
        full = self.model
        out = np.empty((len(own), full.size))
        added = [parameter.name for parameter in self.extension.parameters]
        out[:, [full.names.index(name) for name in self.base.names]] = theta
        out[:, [full.names.index(name) for name in added]] = own
        return out


def linear_suspects(model: Model, etfe: Etfe) -> tuple[Suspect, ...]:
    """The linear effects of the library that `model` could lack."""
    found = []
    for kind in effects("linear"):
        present = any(isinstance(effect, kind) for effect in model.effects)
        if present and not kind.several:
            continue
        found += _places(kind.candidates(model, etfe), model, etfe)
    return tuple(found)


def _places(candidates: Sequence[Extension], model: Model, etfe: Etfe) -> list[Suspect]:
    sizes = [(one, one.unseen(model, etfe)) for one in candidates]  # type: ignore[attr-defined]
    asked = [(one, unseen) for one, unseen in sizes if unseen is not None]
    return [
        Suspect(
            one.name,  # type: ignore[attr-defined]
            one.title,  # type: ignore[attr-defined]
            one.family,  # type: ignore[attr-defined]
            one.told_apart_by,  # type: ignore[attr-defined]
            model,
            one,
            unseen,
            share=1 / len(asked),
            place=str(getattr(one, "on", "")),
            shared=one.belongs_to,  # type: ignore[attr-defined]
            unit_size=unseen.unit_size,
        )
        for one, unseen in asked
    ]
