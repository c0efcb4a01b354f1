"""Trials on a random recording: windows of noise, some to fit and others to judge on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.battery import model_tests, residual_tests
from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.diagnosis.residuals.supply import limit_tests
from bayeshaptic.diagnosis.samples.mend import SampleLook, look_at_samples, repair_measurement
from bayeshaptic.diagnosis.state import State, Trial, fit_part, log_likelihoods
from bayeshaptic.diagnosis.trials.beside import beside_tests
from bayeshaptic.diagnosis.trials.drift import drift_trials
from bayeshaptic.diagnosis.trials.linear import Sight, first_sight, linear_trials
from bayeshaptic.diagnosis.trials.nonlinear import nonlinear_trials
from bayeshaptic.diagnosis.trials.other_laws import found_anew, reconsidered
from bayeshaptic.diagnosis.trials.ripples import ripple_trials
from bayeshaptic.diagnosis.trials.taken_off import left_bare, undone
from bayeshaptic.diagnosis.trials.told_apart import told_apart
from bayeshaptic.effects.nonlinear.shapes import EXCESS_NOISE
from bayeshaptic.numerics.spending import Meter
from bayeshaptic.recordings.response.etfe import compress

# Excess of the linear tests over that of the tests of a force, from which the response is bent by
# more than a force. It is 0.04 and 0.26 in recordings in which a force alone was left, and 0.98 to
# 120 in nine in which a linear effect acted as well; but 5.7 with Dahl's friction, which is a
# spring at first: the effect that it was taken for is taken out again when the friction is found.
_AS_FAR = 0.5


class WindowTrials:
    """How candidates are fitted to a random recording, or to a table of a frequency response.

    Parameters
    ----------
    state : State
        As the loop begins.
    like : WindowTrials, optional
        Those of another model on the same recording, which has been looked at.
    """

    def __init__(self, state: State, like: WindowTrials | None = None) -> None:
        recording = state.etfe.unbroken
        self._look: SampleLook | None = None
        if like is not None:
            self._look = like._look
        elif recording is not None:
            self._look = look_at_samples(recording, state.etfe)
        self._sight: Sight | None = None  # of the state that was looked at last
        self.first = state

    def tests(self, state: State) -> tuple[Test, ...]:
        """The tests of its residual; samples that were mended are not looked at again."""
        limit = limit_tests(state.fit, state.etfe, state.accepted)
        if _is_mended(state):
            return (*model_tests(state.fit, state.etfe), *limit)
        return (*residual_tests(state.fit, state.etfe, self._look), *limit)

    def mended(self, state: State) -> State:
        """With what is wrong with the samples mended; the very same where nothing is.

        In closed loop the command answers to the samples as they were.
        """
        if state.etfe.through_reference:
            return state
        return state if _is_mended(state) else repair_measurement(state, self._look)

    def explains(self, state: State, tests: tuple[Test, ...], meter: Meter) -> bool | None:
        """Whether a linear effect explains everything at first sight; None where that is unasked.

        It is where a test looks for a force, or nothing linear is left.
        """
        if not _raised(tests, "linear") or _looks_like_a_force(tests):
            return None
        self._sight = first_sight(state, meter)
        return None if self._sight is None else self._sight.explains

    def trials(
        self,
        state: State,
        tests: tuple[Test, ...],
        meter: Meter,
        patient: bool = True,
    ) -> list[Trial]:
        """Trials of every class that a test raises.

        Without patience linear effects at first sight, and forces last where no test looks for
        one: what a hand does besides is noise, too.  Where the response is bent and a linear effect
        leaves noise at first sight, forces come after it in any case: they are dear, and are found
        beside it as well, which is taken out again where they make it needless.
        """
        raised = {test.name for test in tests if test.flagged}
        families = {test.family for test in tests if test.flagged}
        if state.etfe.through_reference and families != {"linear"}:
            return []  # forces are simulated under a command that answers to them in closed loop
        found: list[Trial] = []
        explained = False
        if "linear" in families:
            if self._sight is None or self._sight.state is not state:
                self._sight = first_sight(state, meter)
            found += linear_trials(state, meter, self._sight, patient)
            seen = self._sight is not None and self._sight.explains
            explained = seen and any(trial.convincing for trial in found) and _bends(tests)
        if "time-varying" in families:
            found += [_on_other_samples(trial) for trial in drift_trials(state, meter)]
        found += map(_on_other_samples, ripple_trials(state, raised, meter))
        now = patient or _looks_like_a_force(tests) or "linear" not in families
        if "nonlinear" in families and now and not explained:
            found += nonlinear_trials(state, raised, meter)
        return found

    def beside(self, state: State) -> tuple[Test, ...]:
        """Tests for another force beside those that a state has."""
        return beside_tests(state)

    def reconsidered(self, state: State, meter: Meter) -> State:
        """With another law in the place of an earlier force, or the very same."""
        return reconsidered(state, meter)

    def without_needless(self, state: State, meter: Meter) -> State:
        """The state without the earlier effect that is worth least, if that is next to nothing.

        A force that was found beside a linear effect is found anew without it: what the force
        explains may be what the effect was taken for, which must convince beside it, too.  The
        very same state where every effect is still needed.
        """
        full = _held_out(state)
        spare, without = np.inf, state
        for index, effect in enumerate(state.accepted[:-1]):
            if effect.change is None:
                continue
            other = undone(state, index)
            size = len(effect.parameters) + len(effect.estimates)
            worth = full - _held_out(other) - thresholds.A_PARAMETER * size
            if worth < spare:
                spare, without = worth, other
        if state.accepted[-1].family == "nonlinear" and without.model is not state.model:
            anew = found_anew(without, meter)
            if _held_out(anew) > max(full - thresholds.ENOUGH, _held_out(without)):
                return anew
        return without if spare < 0 else state

    def told_apart(self, state: State, meter: Meter) -> State:
        """With linear effects that tied before the last one was known decided beside it."""

        def trials(bare: State) -> list[Trial]:
            return linear_trials(bare, meter, patient=False)

        return told_apart(state, left_bare, trials)


def _raised(tests: tuple[Test, ...], family: str) -> set[str]:
    return {test.name for test in tests if test.flagged and test.family == family}


def _looks_like_a_force(tests: tuple[Test, ...]) -> bool:
    """Whether a test for a force is flagged, and not only one that there is more noise."""
    return bool(_raised(tests, "nonlinear") - {EXCESS_NOISE})


def _bends(tests: tuple[Test, ...]) -> bool:
    """Whether the response is further off than a force alone makes it, by the tests of both."""
    linear, force = (
        max((test.excess for test in tests if test.flagged and test.family == family), default=0.0)
        for family in ("linear", "nonlinear")
    )
    return linear > _AS_FAR * force


def _is_mended(state: State) -> bool:
    return any(effect.family == "measurement" for effect in state.accepted)


def _on_other_samples(trial: Trial) -> Trial:
    """The trial's state; what was taken off before can no longer be put back into other samples."""
    linear = tuple(
        effect if effect.change and effect.change.effect else replace(effect, change=None)
        for effect in trial.state.accepted
    )
    return replace(trial, state=replace(trial.state, accepted=linear))


def _held_out(state: State) -> float:
    """Log likelihood of windows to choose by, after a fit to those to fit."""
    windows = compress(state.etfe, state.fit.response)
    theta = fit_part(state.model, windows, state.fit.theta)
    return float(log_likelihoods(state.model, windows, theta)[1])
