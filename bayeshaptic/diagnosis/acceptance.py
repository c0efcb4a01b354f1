"""What closing the loop accepts: which candidate, what it may leave, and what the verdict is.

Pure functions of tests and trials, the same for every kind of excitation; the numbers are in
`bayeshaptic.diagnosis.thresholds`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.diagnosis.state import Accepted, State, Trial
from bayeshaptic.diagnosis.traced import CONSISTENT, EXPLAINED, UNEXPLAINED
from bayeshaptic.effects.measurement import Quantisation
from bayeshaptic.inference.fit import MISFIT
from bayeshaptic.stability.critical import critical_stiffness

_OF_THE_DATA = {"nonlinear", "measurement", "time-varying"}  # families that change the recording


def choose(
    trials: Sequence[Trial], left: Callable[[Trial], float], worth: Callable[[Trial], float]
) -> Trial | None:
    """The convincing trial that leaves least; of those that leave nothing, the best one.

    A wrong effect can gain nearly as much as the right one and then need another to mend it, so an
    alternative is tried before an addition.  Of linear effects that do as well on windows that they
    were not fitted to, the one is taken that is worth most on all windows.

    Parameters
    ----------
    trials : sequence of Trial
    left : callable
        How far the tests of a trial's state are over their thresholds, all together.
    worth : callable
        Of a linear trial, `bayeshaptic.diagnosis.state.worth` of its fit.

    Returns
    -------
    Trial or None
        None where none is convincing.
    """
    rivals = rivals_of(trials)
    if len(rivals) < 2:
        return rivals[0] if rivals else None
    rests = [left(trial) for trial in rivals]
    # Laws of one force differ in what they leave by chance; linear effects do not.
    more = thresholds.LAW_REST if rivals[0].accepted.family == "nonlinear" else 0.0
    most = thresholds.LEAST * min(rests) + more
    best = [trial for trial, rest in zip(rivals, rests, strict=True) if rest <= most]
    close = [trial for trial in best if ties(best[0], trial)]
    if best[0].accepted.family == "linear":
        return max(close, key=worth)
    return min(close, key=simplicity)


def simplicity(trial: Trial) -> tuple[int, float]:
    """A key by which the simplest of several laws that do as well comes first.

    Of laws with as many numbers the one that is likelier on all windows comes first.
    """
    return trial.size, -trial.gain_fit - trial.gain_choose


def possible(trials: list[Trial]) -> list[Trial]:
    """The trials in whose fit no mass has run away (`Fit.run_away`); all, where one has in each."""
    return [trial for trial in trials if not trial.state.fit.run_away] or trials


def rivals_of(trials: Sequence[Trial]) -> list[Trial]:
    """The convincing trials that come near the best one in score, best first."""
    good = sorted((t for t in trials if t.convincing), key=lambda trial: -trial.score)
    return [trial for trial in good if trial.score >= thresholds.RIVAL * good[0].score]


def ties(best: Trial, other: Trial) -> bool:
    """Whether the recording hardly tells two effects of a class apart."""
    if other.accepted.family != best.accepted.family:
        return False
    law = thresholds.LAW_TIE * best.score if best.accepted.family == "nonlinear" else 0.0
    return abs(best.score - other.score) <= max(thresholds.TIE, law)


def with_ties(chosen: Trial, trials: Sequence[Trial]) -> State:
    """The chosen trial's state; its effect names those that do as well, and has their spread."""
    others = [t for t in trials if t is not chosen and t.convincing and ties(chosen, t)]
    *earlier, own = chosen.state.accepted
    spread = own.limit_log_sd
    if others:
        here, *there = (
            critical_stiffness(t.state.model, t.state.fit.theta).value for t in (chosen, *others)
        )
        apart = max(abs(np.log(max(limit, 1e-9) / max(here, 1e-9))) for limit in there)
        ninety = 1.645  # the 90 % interval reaches what a tie would make of the limit
        spread = float(np.hypot(spread, apart / ninety))
    names = tuple(dict.fromkeys((*own.ties, *(t.name for t in others))))
    own = replace(own, ties=names, limit_log_sd=spread)
    return replace(chosen.state, accepted=(*earlier, own))


def remaining(tests: Iterable[Test], accepted: Sequence[Accepted]) -> tuple[Test, ...]:
    """The tests that still count of what is left, with the thresholds that it may be held to.

    Where drift was accepted, the limit is that of the worst part, and that this part drifts a
    little as well is no news; nor is what else a faulty measurement shows.  After samples were
    mended, a force was taken off, or a part was chosen, the recording is not as good as a sound
    one, and thresholds are higher.  Rounded positions excuse nothing: of 19 such recordings in
    which no force acts none is flagged.
    """
    no_news = {effect.family for effect in accepted} & {"measurement", "time-varying"}
    tests = tuple(test for test in tests if test.family not in no_news)
    taken_off = {effect.family for effect in accepted if effect.name != Quantisation.name}
    if not taken_off & _OF_THE_DATA:
        return tests
    return tuple(
        replace(test, threshold=thresholds.MENDED * test.threshold, usual=test.threshold)
        for test in tests
    )


def force_acts(accepted: Sequence[Accepted]) -> bool:
    """Whether a force that is simulated is among what was accepted."""
    return any(one.acts for one in accepted)


def wanted(tests: Sequence[Test], accepted: Sequence[Accepted]) -> tuple[Test, ...]:
    """The tests that call for one more effect.

    Higher thresholds after a force was taken off are for the verdict only: what is left may be
    another force beside it, which is tried.
    """
    if any(test.flagged for test in tests):
        return tuple(tests)
    if not force_acts(accepted):
        return ()
    noticed = [test for test in tests if test.family == "nonlinear" and test.noticed]
    return tuple(replace(test, threshold=test.usual or test.threshold) for test in noticed)


def excess(tests: Iterable[Test]) -> float:
    """How far tests are over their thresholds, all together."""
    return sum(test.excess for test in tests if test.flagged)


def needless(loss: float, size: int) -> bool:
    """Whether an accepted effect of `size` parameters may go.

    Parameters
    ----------
    loss : float
        Of log likelihood without it, on windows that took no part in the fit.
    size : int
    """
    return loss < thresholds.A_PARAMETER * size


def raises_error(before: float, after: float) -> bool:
    """Whether an explanation raises the held-out weighted rms, so that it explains nothing.

    An error that is next to the noise may move within the noise.
    """
    return after > thresholds.WORSE * max(before, 1.0)


def with_misfit(tests: tuple[Test, ...], state: State) -> tuple[Test, ...]:
    """The tests of what is left in the end, and one of the whole misfit that nothing excuses.

    Allowances help to decide whether to go on; a recording that is called explained must leave
    noise.
    """
    found = state.fit.reduced_chi_square
    if not state.fit.misfits or any(test.flagged for test in tests):
        return tests
    families = [e.family for e in state.accepted if e.family == "nonlinear"]
    text = f"what the model leaves over is {np.sqrt(found):.2g} times the noise"
    return (*tests, Test("misfit", (*families, "linear")[0], found, MISFIT, None, text))


def verdict_of(accepted: Sequence[Accepted], tests: Iterable[Test]) -> tuple[str, str | None]:
    """The verdict on what is left, and its class."""
    left = [test for test in tests if test.flagged]
    if left:
        return UNEXPLAINED, max(left, key=lambda test: test.excess).family
    if accepted:
        return EXPLAINED, accepted[0].family
    return CONSISTENT, None
