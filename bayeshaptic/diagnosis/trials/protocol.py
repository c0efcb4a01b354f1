"""What the loop asks of the trials of a kind of measurement."""

from __future__ import annotations

from typing import Protocol

from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.diagnosis.state import State, Trial
from bayeshaptic.numerics.spending import Meter


class Trials(Protocol):
    """How candidates are fitted to a kind of recording, and on what they are judged."""

    @property
    def first(self) -> State:
        """The state that the loop begins with."""

    def tests(self, state: State) -> tuple[Test, ...]:
        """The tests of a state's residual."""

    def mended(self, state: State) -> State:
        """With what is wrong with the samples mended; the very same where nothing is."""

    def explains(self, state: State, tests: tuple[Test, ...], meter: Meter) -> bool | None:
        """Whether an effect explains everything at first sight; None where that is no question."""

    def trials(
        self, state: State, tests: tuple[Test, ...], meter: Meter, patient: bool = True
    ) -> list[Trial]:
        """Trials of every class that a test raises; at first sight where there is no patience."""

    def beside(self, state: State) -> tuple[Test, ...]:
        """Tests for another force beside those that a state has."""

    def reconsidered(self, state: State, meter: Meter) -> State:
        """With another law in the place of an earlier force, or the very same."""

    def without_needless(self, state: State, meter: Meter) -> State:
        """Without the earlier effect that a later one made needless, or the very same."""

    def told_apart(self, state: State, meter: Meter) -> State:
        """With linear effects that tied before the last one was known decided beside it."""
