"""Closing the loop: find the residual, trace it, add what explains it, and look again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayeshaptic.diagnosis.periodic.loop import is_periodic
from bayeshaptic.diagnosis.residuals.columns import nonlinear_tests
from bayeshaptic.diagnosis.residuals.drift import drift_tests
from bayeshaptic.diagnosis.residuals.residual import Test, frequency_tests
from bayeshaptic.diagnosis.samples.mend import measurement_tests, repair_measurement
from bayeshaptic.diagnosis.state import State, Trial
from bayeshaptic.diagnosis.traced import CONSISTENT, EXPLAINED, UNEXPLAINED, Candidate, Traced
from bayeshaptic.diagnosis.trials.drift import drift_trials
from bayeshaptic.diagnosis.trials.linear import linear_trials
from bayeshaptic.diagnosis.trials.nonlinear import nonlinear_trials
from bayeshaptic.inference.least_squares import Fit
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.types import Tick

ROUNDS = 3
_LAW_ERROR = 0.2  # of the statistic that raised a nonlinear force
_LAW_REST = 3.0  # what one law may leave more than another, in thresholds
_MENDED = 1.5  # factor on the thresholds of a recording that something was taken off
_LINEAR_FIRST = 10.0  # reduced chi-square from which the linear misfit is mended first
_RIVAL = 0.85  # share of the best score that a rival has at least
_NINETY = 1.645  # the 90 % interval reaches what a tie would make of the limit
_TIE = 6.0  # difference of scores that one recording does not decide


def residual_tests(fit: Fit, etfe: Etfe) -> tuple[Test, ...]:
    """All tests of the residual of a fit."""
    return (
        *frequency_tests(fit),
        *nonlinear_tests(fit, etfe),
        *drift_tests(fit, etfe),
        *measurement_tests(fit, etfe),
    )


def trace(etfe: Etfe, fit: Fit, tick: Tick | None = None) -> Traced:
    """Run the loop on a fitted base model.

    Each round tests the residual, tries the candidates of every class that a test raises, each
    fitted to half of the windows, and accepts the one that best predicts another quarter; until
    nothing is raised, nothing convinces, or three rounds are over.

    Parameters
    ----------
    etfe : Etfe
    fit : Fit
        Of the base model.
    tick : callable, optional
        Called with what is being tried.

    Returns
    -------
    Traced
    """
    if is_periodic(etfe):  # its residual repeats: lines are held out, not windows of noise
        from bayeshaptic.diagnosis.periodic.trace import trace_periodic

        return trace_periodic(etfe, fit, tick)
    before = tests = seen = residual_tests(fit, etfe)
    state = repair_measurement(State(etfe, fit))
    candidates = [
        Candidate(e.name, e.title, _score_of(e.name, before), True, 0) for e in state.accepted
    ]
    if state.accepted:
        tests = _remaining_tests(state, seen)
    rejected: tuple[Trial, ...] = ()
    for number in range(1, ROUNDS + 1):
        if not any(test.flagged for test in tests):
            break
        seen = (*seen, *tests)
        trials = _trials(state, tests, tick)
        chosen = _choose(trials, seen)
        candidates += [
            Candidate(t.name, t.accepted.title, t.score, t is chosen, number) for t in trials
        ]
        rejected = tuple(t for t in trials if t.convincing and t is not chosen)
        if chosen is None:
            break
        state = _with_ties(chosen, trials)
        tests = _remaining_tests(state, seen)
    verdict, residual_class = verdict_of(state, tests)
    return Traced(verdict, residual_class, state, before, tests, tuple(candidates), rejected)


def _score_of(name: str, tests: tuple[Test, ...]) -> float:
    """The statistic of a measurement effect's own test."""
    return max((test.statistic for test in tests if test.name == name), default=0.0)


def _remaining_tests(state: State, seen: tuple[Test, ...]) -> tuple[Test, ...]:
    """The tests of what is left, and how much of it counts, after those `seen` so far.

    Where the response drifts the limit is that of the worst part; that the part drifts a little
    too is no news.  A law of friction is an approximation: a fifth of what it explained may
    remain; and a recording that was mended, or goes on in part, is not as good as a sound one.
    """
    known = {effect.name for effect in state.accepted if effect.family == "measurement"}
    tests = tuple(t for t in residual_tests(state.fit, state.etfe) if t.name not in known)
    if known:  # which is where the excess of noise comes from
        tests = tuple(test for test in tests if test.family != "measurement")
    families = {effect.family for effect in state.accepted}
    if "time-varying" in families:
        tests = tuple(test for test in tests if test.family != "time-varying")
    explained = 0.0
    if "nonlinear" in families:
        explained = max((t.statistic for t in seen if t.family == "nonlinear"), default=0.0)
    if families & {"nonlinear", "measurement", "time-varying"}:
        tests = tuple(_allowing(test, explained) for test in tests)
    return tests


def _allowing(test: Test, explained: float) -> Test:
    """`test` with the threshold that it has after something was taken off the recording."""
    least = _LAW_ERROR * explained if test.family == "nonlinear" else 0.0
    return replace(test, threshold=max(_MENDED * test.threshold, least))


def _trials(state: State, tests: tuple[Test, ...], tick: Tick | None) -> list[Trial]:
    """Trials of every class that a test raises, best score first."""
    raised = {test.name for test in tests if test.flagged}
    families = {test.family for test in tests if test.flagged}
    trials: list[Trial] = []
    if "linear" in families:
        trials += linear_trials(state, tick)
        # On a model that is far off, a nonlinear force cannot be sized: first things first.
        far_off = state.fit.reduced_chi_square > _LINEAR_FIRST
        if far_off and any(trial.convincing for trial in trials):
            families = {"linear"}
    if "time-varying" in families:
        trials += drift_trials(state, tick)
    if "nonlinear" in families:
        trials += nonlinear_trials(state, raised, tick)
    return sorted(trials, key=lambda trial: -trial.score)


def _choose(trials: list[Trial], seen: tuple[Test, ...]) -> Trial | None:
    """The convincing trial that leaves least; of those that leave nothing, the best.

    A wrong effect can gain nearly as much as the right one and then need another to mend it: an
    alternative is better than an addition.
    """
    good = [trial for trial in trials if trial.convincing]
    if not good:
        return None
    rivals = [trial for trial in good if trial.score > _RIVAL * good[0].score]
    left = [_left(_remaining_tests(trial.state, seen)) for trial in rivals]
    least = min(left)
    # Laws of one force differ in what they leave by chance; linear effects do not.
    more = _LAW_REST if good[0].accepted.family == "nonlinear" else 0.0
    best = [t for t, rest in zip(rivals, left, strict=True) if rest <= 1.2 * least + more]
    close = [trial for trial in best if _ties(best[0], trial)]
    return min(close, key=lambda trial: (trial.size, -trial.score))


def _left(tests: tuple[Test, ...]) -> float:
    """How far tests are over their thresholds, all together."""
    return sum(test.excess for test in tests if test.flagged)


def _ties(best: Trial, other: Trial) -> bool:
    """Whether the recording hardly tells two effects of a class apart.

    Two laws of friction differ by less than either differs from the truth: there a twentieth of
    the score counts as nothing.
    """
    if other.accepted.family != best.accepted.family:
        return False
    law = 0.05 * best.score if best.accepted.family == "nonlinear" else 0.0
    return abs(best.score - other.score) < max(_TIE, law)


def _with_ties(chosen: Trial, trials: list[Trial]) -> State:
    """The chosen trial's state, its effect naming those that do as well, and their spread."""
    rivals = [t for t in trials if t is not chosen and t.convincing and _ties(chosen, t)]
    *earlier, own = chosen.state.accepted
    spread = own.limit_log_sd
    if rivals:
        here, *others = (
            critical_stiffness(t.state.model, t.state.fit.theta).value for t in (chosen, *rivals)
        )
        apart = max(abs(np.log(max(other, 1e-9) / max(here, 1e-9))) for other in others)
        spread = float(np.hypot(spread, apart / _NINETY))
    names = tuple(dict.fromkeys((*own.ties, *(t.name for t in rivals))))
    own = replace(own, ties=names, limit_log_sd=spread)
    return replace(chosen.state, accepted=(*earlier, own))


def verdict_of(state: State, tests: tuple[Test, ...]) -> tuple[str, str | None]:
    """The verdict on what is left, and its class."""
    left = [test for test in tests if test.flagged]
    if left:
        return UNEXPLAINED, max(left, key=lambda test: test.excess).family
    if state.accepted:
        return EXPLAINED, state.accepted[0].family
    return CONSISTENT, None
