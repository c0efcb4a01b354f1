"""Closing the loop on several base models, one round of each at a time."""

from __future__ import annotations

from collections.abc import Sequence

from bayeshaptic.diagnosis.base.begun import Begun, base_of
from bayeshaptic.diagnosis.loop import Loop
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.diagnosis.state import State
from bayeshaptic.diagnosis.traced import UNEXPLAINED
from bayeshaptic.numerics.spending import RATE


class LoopsInTurn:
    """The loops on all base models in question, which go on one round at a time.

    Once a model with few parameters explains everything, those that would need more are given up.

    Parameters
    ----------
    begun : Begun
    options : Options

    Attributes
    ----------
    running : mapping
        Name of a base model to its loop; the one that was chosen first.
    given_up : set of str
    """

    def __init__(self, begun: Begun, options: Options) -> None:
        self._begun, self._options = begun, options
        self._whole = options.budget_s * RATE
        self.running: dict[str, Loop] = {}
        self.given_up: set[str] = set()

    def begin(self, name: str, budget_s: float) -> Loop:
        """The loop on a base model, before its first round."""
        etfe, fit = base_of(self._begun, name)
        own = next(iter(self.running.values()), None)
        self.running[name] = Loop(etfe, fit, budget_s, self._options.report, like=own)
        return self.running[name]

    @property
    def patient(self) -> bool:
        """Whether no loop explains everything yet, so that a long search is worth it."""
        return not self._explained

    def glance(self, rivals: Sequence[str]) -> None:
        """One round of the first rival that explains at first sight, if the chosen model does not.

        It comes before the long search on a base model that is the wrong one.
        """
        (own,) = self.running.values()
        if not rivals or own.glance() is not False:
            return
        for name in rivals:
            other = self.begin(name, 0.0)
            other.meter.limit = (self._whole - own.meter.spent) / len(rivals)
            if other.glance():
                other.go_on()
                break

    def take_turns(self, rivals: Sequence[str]) -> None:
        """Go on with all loops until each is done or given up.

        The chosen base model has had one round already: the others come first.
        """
        chosen, own = next(iter(self.running.items()))
        others = [self.running.get(name) or self.begin(name, 0.0) for name in rivals]
        order = (*rivals, chosen)
        own_share = own.meter.limit
        while open_ := [name for name in order if not self._ended(name)]:
            for name in open_:
                if self._needs_no_less(name):
                    self.given_up.add(name)
                    continue
                for other in others:
                    other.meter.limit = (self._whole - own.meter.spent) / len(others)
                spent = sum(other.meter.spent for other in others)
                own.meter.limit = min(own_share, self._whole - spent)
                self.running[name].go_on(self.patient)

    def _ended(self, name: str) -> bool:
        return self.running[name].done or name in self.given_up

    def _needs_no_less(self, name: str) -> bool:
        """Whether a loop would need at least as many parameters as one that explains everything.

        An effect counts as one parameter more than it has, because which effect it is was chosen,
        too.
        """
        loop = self.running[name]
        if not loop.misfits:
            return False
        least_effect = 2  # one parameter, and that it is this one
        least = parameters_of(loop.state) + least_effect
        return any(least >= parameters_of(other.state) for other in self._explained)

    @property
    def _explained(self) -> list[Loop]:
        """The loops in which nothing is left to explain."""
        done = [loop for loop in self.running.values() if loop.done]
        return [loop for loop in done if loop.traced.verdict != UNEXPLAINED]


def parameters_of(state: State) -> int:
    """Number of parameters: of the model, of its forces, and one for the choice of each effect."""
    beside = sum(len(effect.estimates) + 1 for effect in state.accepted)
    return int(state.fit.model.size) + beside
