"""How probable each hidden effect is before the recording is looked at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from bayeshaptic.effects.library import effects
from bayeshaptic.errors import InputError, nearest_or_all

# With the dozen effects that a device can have, it has none of them with a probability of a third.
PROBABILITY = 0.08


@dataclass(frozen=True)
class HiddenPrior:
    """Prior probabilities that a device has an effect too small to be seen, each by itself.

    Attributes
    ----------
    each : float
        Of every effect that is not named.
    named : mapping
        Effect to probability.
    """

    each: float = PROBABILITY
    named: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        known = [effect.name for effect in effects()]
        for name, probability in {**self.named, "every effect": self.each}.items():
            if name not in (*known, "every effect"):
                raise InputError(
                    f"prior probabilities: there is no effect {name!r}{nearest_or_all(name, known)}"
                )
            if not 0 <= probability < 1:
                raise InputError(
                    f"prior probability of {name}: {probability:g} must be at least 0 and below 1."
                )

    @classmethod
    def from_table(cls, table: Mapping[str, float]) -> HiddenPrior:
        """The prior from probabilities by name, as callers give them; "each" is for the others."""
        named = {name: float(value) for name, value in table.items() if name != "each"}
        return cls(float(table.get("each", PROBABILITY)), named)

    def of(self, name: str) -> float:
        """The probability of the effect called `name`."""
        return float(self.named.get(name, self.each))

    def without(self, name: str) -> HiddenPrior:
        """The same with a probability of zero for the effect called `name`."""
        return HiddenPrior(self.each, {**self.named, name: 0.0})

    def times(self, factor: float) -> HiddenPrior:
        """The same with every probability multiplied by a factor, at most a half."""
        named = {name: min(factor * p, 0.5) for name, p in self.named.items()}
        return HiddenPrior(min(factor * self.each, 0.5), named)
