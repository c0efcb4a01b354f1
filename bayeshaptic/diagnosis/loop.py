"""Closing the loop: find the residual, trace it, add what explains it, and look again.

One loop for every kind of excitation.  How candidates are fitted, and on what they are judged, is
that of a `Trials`; what is accepted is in `bayeshaptic.diagnosis.acceptance`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Protocol

from bayeshaptic.diagnosis import acceptance
from bayeshaptic.diagnosis.battery import is_periodic
from bayeshaptic.diagnosis.periodic.lines import LineTrials
from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.diagnosis.state import State, Trial, compared_errors, worth
from bayeshaptic.diagnosis.traced import Candidate, Traced
from bayeshaptic.diagnosis.trials.windows import WindowTrials
from bayeshaptic.inference.fit import Fit
from bayeshaptic.numerics.spending import BUDGET_S, RATE, Meter, metered
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.types import Progress, Tick


class Trials(Protocol):
    """How candidates are fitted to a kind of recording, and on what they are judged."""

    @property
    def first(self) -> State:
        """The state that the loop begins with."""

    def tests(self, state: State) -> tuple[Test, ...]:
        """The tests of a state's residual."""

    def mended(self, state: State) -> State:
        """With what is wrong with the samples mended; the very same where nothing is."""

    def trials(
        self, state: State, tests: tuple[Test, ...], meter: Meter, tick: Tick
    ) -> list[Trial]:
        """Trials of every class that a test raises."""

    def without_needless(self, state: State) -> tuple[State, str | None]:
        """Without the earlier effect that a later one made needless, and its name; or as it is."""


def trials_for(etfe: Etfe, fit: Fit) -> Trials:
    """The trials of a base model fitted to a measurement of its kind."""
    return LineTrials(etfe, fit) if is_periodic(etfe) else WindowTrials(State(etfe, fit))


def trace(
    etfe: Etfe,
    fit: Fit,
    progress: Progress | None = None,
    budget_s: float = BUDGET_S,
    trials: Trials | None = None,
) -> Traced:
    """Run the loop on a fitted base model.

    Each round tests the residual, tries the candidates of every class that a test raises, each
    fitted to half of the windows, and accepts the one that best predicts another quarter, unless
    it raises the error held out or that of all windows; then takes out again what that made
    needless; until nothing is raised, nothing convinces, or the budget is spent.

    Parameters
    ----------
    etfe : Etfe
    fit : Fit
        Of the base model.
    progress : callable, optional
        Called with the share done and what is being tried.
    budget_s : float
        In nominal seconds; counted in evaluations, so that the verdict is the same on every
        machine.
    trials : Trials, optional
        By default those of the measurement's kind.

    Returns
    -------
    Traced
    """
    with metered(budget_s * RATE) as meter:
        return _Loop(trials or trials_for(etfe, fit), meter, progress).run()


@dataclass
class _Loop:
    """The loop's own memory."""

    kind: Trials
    meter: Meter
    progress: Progress | None
    seen: tuple[Test, ...] = ()
    candidates: list[Candidate] = field(default_factory=list)
    rejected: tuple[Trial, ...] = ()
    path: list[State] = field(default_factory=list)
    number: int = 0
    told: int = 0  # the round that progress was told of last, and how many candidates of it
    tried: int = 0

    def run(self) -> Traced:
        state = self.kind.first
        before = self.seen = self.kind.tests(state)
        self.path = [state]
        state, tests = self._mended(state, before)
        while any(test.flagged for test in tests):
            self.number += 1
            found = self._round(state, tests)
            if found is None:
                break
            state, tests = self._mended(*found)
        tests = acceptance.with_misfit(tests, state)
        verdict, residual_class = acceptance.verdict_of(state.accepted, tests)
        return Traced(
            verdict,
            residual_class,
            state,
            before,
            tests,
            tuple(self.candidates),
            self.rejected,
            tuple(self.path),
            tuple(self.meter.skipped),
        )

    def _mended(self, state: State, tests: tuple[Test, ...]) -> tuple[State, tuple[Test, ...]]:
        """With the samples mended, where that does not raise the held-out error.

        Tried again after every round: what the model lacked may have looked like a fault.
        """
        mended = self.kind.mended(state)
        if mended is state or _raises(state, mended):
            return state, tests
        new = mended.accepted[len(state.accepted) :]
        self.candidates += [
            Candidate(e.name, e.title, _statistic(e.name, tests), True, self.number) for e in new
        ]
        return self._accepted(mended, self._remaining(mended))

    def _round(
        self, state: State, tests: tuple[Test, ...]
    ) -> tuple[State, tuple[Test, ...]] | None:
        """The state with one more effect, and what is left; None where nothing convinces."""
        trials = self.kind.trials(state, tests, self.meter, self._tick)
        left: dict[int, tuple[Test, ...]] = {}

        def remaining(trial: Trial) -> tuple[Test, ...]:
            if id(trial) not in left:
                left[id(trial)] = self._remaining(trial.state)
            return left[id(trial)]

        open_ = [t for t in trials if t.convincing and not _raises(state, t.state)]
        chosen = acceptance.choose(
            open_,
            lambda trial: acceptance.excess(remaining(trial)),
            lambda trial: worth(trial.state.fit),
        )
        self.candidates += [
            Candidate(t.name, t.accepted.title, t.score, t is chosen, self.number)
            for t in sorted(trials, key=lambda trial: -trial.score)
        ]
        self.rejected = tuple(trial for trial in open_ if trial is not chosen)
        if chosen is None:
            return None
        found, tests = acceptance.with_ties(chosen, open_), remaining(chosen)
        lighter, gone = self.kind.without_needless(found)
        if gone is not None:
            found, tests = lighter, self._remaining(lighter)
            self.candidates = [
                replace(c, taken_out=c.taken_out or (c.accepted and c.name == gone))
                for c in self.candidates
            ]
        return self._accepted(found, tests)

    def _accepted(self, state: State, tests: tuple[Test, ...]) -> tuple[State, tuple[Test, ...]]:
        self.seen = (*self.seen, *tests)
        self.path.append(state)
        return state, tests

    def _remaining(self, state: State) -> tuple[Test, ...]:
        return acceptance.remaining(self.kind.tests(state), state.accepted, self.seen)

    def _tick(self, what: str) -> None:
        if self.progress:
            # Each round is half of what is left, and each candidate a fifth of what is left of it:
            # nobody knows how many there will be.
            self.tried = 1 if self.number != self.told else self.tried + 1
            self.told = self.number
            share = 1 - 0.5 ** (self.number - 1) * (1 - 0.5 * (1 - 0.8 ** (self.tried - 1)))
            self.progress(share, f"round {self.number}: trying {what}")


def _raises(before: State, after: State) -> bool:
    return any(map(acceptance.raises_error, *compared_errors(before, after)))


def _statistic(name: str, tests: tuple[Test, ...]) -> float:
    """The statistic of a measurement effect's own test."""
    return max((test.statistic for test in tests if test.name == name), default=0.0)
