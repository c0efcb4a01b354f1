"""Closing the loop: find the residual, trace it, add what explains it, and look again.

One loop for every kind of excitation.  How candidates are fitted, and on what they are judged, is
that of its `Trials`; what is accepted is in `bayeshaptic.diagnosis.acceptance`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

from bayeshaptic.diagnosis import acceptance
from bayeshaptic.diagnosis.battery import is_periodic
from bayeshaptic.diagnosis.periodic.lines import LineTrials
from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.diagnosis.state import State, Trial, compared_errors, worth
from bayeshaptic.diagnosis.traced import Candidate, Traced
from bayeshaptic.diagnosis.trials.protocol import Trials
from bayeshaptic.diagnosis.trials.windows import WindowTrials
from bayeshaptic.inference.fit import Fit
from bayeshaptic.numerics.spending import BUDGET_S, RATE, Meter, counting
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.types import Progress


def trials_for(etfe: Etfe, fit: Fit, like: Trials | None = None) -> Trials:
    """The trials of a base model fitted to a measurement of its kind.

    `like` are those of another model on the same measurement.
    """
    if is_periodic(etfe):
        return LineTrials(etfe, fit)
    return WindowTrials(State(etfe, fit), like if isinstance(like, WindowTrials) else None)


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
    loop = Loop(etfe, fit, budget_s, progress, trials)
    while not loop.done:
        loop.go_on()
    return loop.traced


class Loop:
    """The loop on one base model, a round at a time.

    Parameters
    ----------
    etfe, fit, budget_s, progress, trials
        Those of `trace`.
    like : Loop, optional
        That on another base model, of the same measurement.

    Attributes
    ----------
    meter : Meter
        What it has cost, and may.
    state : State
        With what has been accepted so far.
    done : bool
        Nothing is left, or nothing convinces.
    """

    def __init__(
        self,
        etfe: Etfe,
        fit: Fit,
        budget_s: float,
        progress: Progress | None = None,
        trials: Trials | None = None,
        like: Loop | None = None,
    ) -> None:
        self.meter = Meter(budget_s * RATE, tick=self._tick)
        self.state, self.done = State(etfe, fit), False
        self._given, self._like, self._progress = trials, like, progress
        self._path: list[State] = []
        self._before: tuple[Test, ...] = ()
        self._tests: tuple[Test, ...] = ()  # of what is left
        self._before_forces: tuple[Test, ...] = ()
        self._candidates: list[Candidate] = []
        self._rejected: tuple[Trial, ...] = ()
        self._number = 0
        self._told, self._tried = 0, 0  # the round that was told of, how many candidates of it

    def glance(self) -> bool | None:
        """Whether the next round will explain everything; None where first sight does not tell.

        What is found is kept for that round.
        """
        with counting(self.meter):
            if not self._path:
                self._begin()
            wanted = self._wanted
            return self._kind.explains(self.state, wanted, self.meter)

    def go_on(self, patient: bool = True) -> None:
        """One more round; without patience only of what is seen at first sight."""
        with counting(self.meter):
            if not self._path:
                self._begin()
            if wanted := self._wanted:
                self._number += 1
                if self._round(wanted, patient) or self._round(self._look_beside(), patient):
                    self._mend()
                else:
                    self.done = True
            self.done |= not self._wanted

    @property
    def misfits(self) -> bool:
        """Whether something is left that an effect is wanted for."""
        if not self._path:
            return self.state.fit.misfits
        return any(test.flagged for test in self._tests)

    @property
    def _wanted(self) -> tuple[Test, ...]:
        """The tests that call for one more round."""
        return acceptance.wanted(self._tests, self.state.accepted) if self._path else ()

    @property
    def traced(self) -> Traced:
        """What has been found so far."""
        tests = acceptance.with_misfit(self._tests, self.state)
        verdict, residual_class = acceptance.verdict_of(self.state.accepted, tests)
        return Traced(
            verdict,
            residual_class,
            self.state,
            self._before,
            tests,
            tuple(self._candidates),
            self._rejected,
            tuple(self._path),
            tuple(self.meter.skipped),
            self._before_forces,
        )

    @cached_property
    def _kind(self) -> Trials:
        like = self._like._kind if self._like else None
        return self._given or trials_for(self.state.etfe, self.state.fit, like)

    def _begin(self) -> None:
        self.state = self._kind.first
        self._path = [self.state]
        self._before = self._tests = self._kind.tests(self.state)
        self._mend()

    def _mend(self) -> None:
        """Go on with the samples mended, where that does not raise the held-out error.

        It is tried again after every round: what the model lacked may have looked like a fault of
        the samples.
        """
        mended = self._kind.mended(self.state)
        if mended is self.state or _raises(self.state, mended):
            return
        self._candidates += [
            Candidate(e.name, e.title, _statistic(e.name, self._tests), True, self._number)
            for e in mended.accepted[len(self.state.accepted) :]
        ]
        self._accept(mended, self._remaining(mended))

    def _round(self, wanted: tuple[Test, ...], patient: bool) -> bool:
        """Go on to one more effect, and what is left; False where nothing convinces."""
        if not wanted:
            return False
        trials = self._kind.trials(self.state, wanted, self.meter, patient)
        left: dict[int, tuple[Test, ...]] = {}

        def remaining(trial: Trial) -> tuple[Test, ...]:
            if id(trial) not in left:
                left[id(trial)] = self._remaining(trial.state)
            return left[id(trial)]

        near = [t for t in trials if t.score > 0 and not _raises(self.state, t.state)]
        open_ = acceptance.possible([t for t in near if t.convincing and t.all_along])
        chosen = acceptance.choose(
            open_,
            lambda trial: acceptance.excess(remaining(trial)),
            lambda trial: worth(trial.state.fit),
        )
        self._note(trials, chosen)
        self._rejected = tuple(t for t in near if t is not chosen and _may_be(t))
        if chosen is None:
            return False
        found, tests = acceptance.with_ties(chosen, open_), remaining(chosen)
        better = self._kind.reconsidered(found, self.meter)
        lighter = self._kind.without_needless(better, self.meter)
        settled = self._kind.told_apart(lighter, self.meter)
        if settled is not found:
            found, tests = settled, self._remaining(settled)
        self._note_taken_out(found)
        self._accept(found, tests)
        return True

    def _note(self, trials: Sequence[Trial], chosen: Trial | None) -> None:
        """Write down what was tried in this round, the best first, and what of it is accepted."""
        together = _came_with(chosen, self.state) if chosen else set()
        self._candidates += [
            Candidate(
                t.name,
                t.accepted.title,
                t.score,
                t is chosen or t.accepted.title in together,
                self._number,
            )
            for t in sorted(trials, key=lambda trial: -trial.score)
        ]

    def _note_taken_out(self, kept: State) -> None:
        """Write down which of what was accepted is no longer there."""
        there = {effect.name for effect in kept.accepted}
        self._candidates = [
            replace(c, taken_out=c.accepted and c.name not in there) for c in self._candidates
        ]

    def _look_beside(self) -> tuple[Test, ...]:
        """Look for a force in what tests of the residual take for linear; what is seen is left.

        Under a sweep each frequency comes at one speed, so that drag looks like another linear
        response.  Where no law explains it either, it stays unexplained.
        """
        if acceptance.force_acts(self.state.accepted):
            return ()
        found = tuple(test for test in self._kind.beside(self.state) if test.flagged)
        self._before, self._tests = (*self._before, *found), (*self._tests, *found)
        return found

    def _accept(self, state: State, tests: tuple[Test, ...]) -> None:
        if acceptance.force_acts(state.accepted) and not any(test.flagged for test in tests):
            beside = self._kind.beside(state)
            tests = (*tests, *acceptance.remaining(beside, state.accepted))
        if acceptance.force_acts(state.accepted) and not acceptance.force_acts(self.state.accepted):
            self._before_forces = self._tests
        self._path.append(state)
        self.state, self._tests = state, tests

    def _remaining(self, state: State) -> tuple[Test, ...]:
        return acceptance.remaining(self._kind.tests(state), state.accepted)

    def _tick(self, what: str) -> None:
        if self._progress:
            # Each round is half of what is left, and each candidate a fifth of what is left of it:
            # nobody knows how many there will be.
            self._tried = 1 if self._number != self._told else self._tried + 1
            self._told = self._number
            share = 1 - 0.5 ** (self._number - 1) * (1 - 0.5 * (1 - 0.8 ** (self._tried - 1)))
            self._progress(share, f"round {self._number}: trying {what}")


def _may_be(trial: Trial) -> bool:
    """Whether a candidate may be what is left: it convinces, or is a force under another law."""
    return trial.convincing or trial.accepted.family == "nonlinear"


def _came_with(chosen: Trial, before: State) -> set[str]:
    """Titles of what is accepted besides a trial's own effect: two forces may replace one."""
    known = {effect.title for effect in before.accepted}
    return {effect.title for effect in chosen.state.accepted[:-1]} - known


def _raises(before: State, after: State) -> bool:
    return any(map(acceptance.raises_error, *compared_errors(before, after)))


def _statistic(name: str, tests: tuple[Test, ...]) -> float:
    """The statistic of a measurement effect's own test."""
    return max((test.statistic for test in tests if test.name == name), default=0.0)
