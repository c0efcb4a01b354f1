"""When a sampler may stop: what it is asked for, and how far it has come."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bayeshaptic.inference.diagnostics import RHAT_LIMIT, Diagnostics, diagnose
from bayeshaptic.models import Model
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class Verdict:
    """What a rule says of chains.

    Attributes
    ----------
    diagnostics : Diagnostics
        Of the parameters.
    known : bool
        Whether what an interval rests on is known as well as was asked for.
    done : bool
        Whether nothing else is waited for either.
    share : float
        Of the draws asked for, those that are there; 1 or more where they are enough.
    facts : str
        What was reached, in words and numbers.
    asked : str
        What was asked for.
    """

    diagnostics: Diagnostics
    known: bool
    done: bool
    share: float
    facts: str
    asked: str


Rule = Callable[[Floats], Verdict]
"""Judges chains of natural values, shape (ensembles, S, walkers, P).

One with an attribute `key`, a text that says everything that it asks for, may be interrupted and
gone on with.
"""


@dataclass(frozen=True)
class EveryParameter:
    """Every parameter has `ess` effective draws, bulk and tail, and R-hat below 1.01.

    Attributes
    ----------
    model : Model
    ess : float
    """

    model: Model
    ess: float

    @property
    def key(self) -> str:
        return f"every parameter {self.ess!r}"

    def __call__(self, chains: Floats) -> Verdict:
        found = diagnose(chains, self.ess)
        worst = self.model.names[int(np.argmax(found.rhat))]
        fewest = self.model.names[int(np.argmin(found.fewest))]
        known = bool(found.ess >= self.ess and found.rhat.max() < RHAT_LIMIT)
        return Verdict(
            found,
            known,
            known,
            found.ess / self.ess,
            f"R-hat between the independent ensembles is at most {found.rhat.max():.4f} "
            f"({worst}) and every parameter has at least {found.ess:.0f} effective draws, bulk and "
            f"tail ({fewest} has the fewest)",
            f"{RHAT_LIMIT} and {self.ess:.0f}",
        )
