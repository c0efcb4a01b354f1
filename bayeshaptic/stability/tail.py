"""How long a sampler must run until a small risk can be stated."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from bayeshaptic.models.model import Model
from bayeshaptic.stability.critical import (
    ENOUGH_BELOW,
    CriticalStiffness,
    critical_stiffness,
    most_draws,
)
from bayeshaptic.types import Floats

LEAST_RISK = 0.001
_MARGIN = 1.1
_FEWEST = 2.0  # effective draws in the tail, below which the forecast takes that many


@dataclass(frozen=True)
class _Chains:
    """What `critical_stiffness` reads of a posterior."""

    model: Model
    chains: Floats


@dataclass
class TailWatch:
    """Follows growing chains until enough effective draws lie below the stiffness of a small risk.

    Attributes
    ----------
    model : Model
    risk : float
    limit : CriticalStiffness or None
        Of the chains that were seen last.
    """

    model: Model
    risk: float = LEAST_RISK
    limit: CriticalStiffness | None = field(default=None, init=False)

    def steps_wanted(self, chains: Floats) -> int:
        """Steps that chains of shape (ensembles, S, walkers, P) should have in all.

        S or fewer where they are long enough already, or as long as can be afforded.
        """
        steps, draws = chains.shape[1], chains[..., 0].size
        model = self.model
        most = most_draws(model, chains[0, 0, 0])
        if draws >= most:
            return steps
        self.limit = critical_stiffness(_Chains(model, chains), before=self.limit)
        below = self.limit.effective_below(self.risk)
        if below >= ENOUGH_BELOW:
            return steps
        # Within a factor of three: the forecast from a few draws is rough.
        wanted = min(_MARGIN * ENOUGH_BELOW / max(below, _FEWEST), 3.0) * steps
        return int(min(wanted, most * steps // draws))

    def limit_of(self, posterior: Any) -> CriticalStiffness:
        """The limit over all draws of `posterior`, whose chains were watched."""
        return critical_stiffness(posterior, before=self.limit)
