"""Why a report recommends no stiffness."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from bayeshaptic.diagnosis.base.alignment import LATER, LESS, LESS_DELAY, MOVED
from bayeshaptic.diagnosis.base.high_passed import TOPIC as HIGH_PASSED
from bayeshaptic.diagnosis.residuals.ripples import GAIN
from bayeshaptic.diagnosis.residuals.supply import LIMIT, SPEED, SPENT
from bayeshaptic.diagnosis.result import Result
from bayeshaptic.effects.laws import variables
from bayeshaptic.effects.nonlinear.shapes import ALONG, LOAD_VELOCITY, VELOCITY
from bayeshaptic.quantities import percent, pure, quantity
from bayeshaptic.recordings.checks.loop_period import doubts_of_the_loop, rows_are_uneven
from bayeshaptic.recordings.checks.sufficiency import told_too_little
from bayeshaptic.recordings.checks.units_in_doubt import in_doubt
from bayeshaptic.recordings.checks.unlike_pieces import named_unlike
from bayeshaptic.recordings.feedback import has_feedback, how_computed, is_certain
from bayeshaptic.recordings.signals.other_outputs import NO_LOOP
from bayeshaptic.recordings.units import is_assumed
from bayeshaptic.report.beside_command import beside_command, what_changes
from bayeshaptic.report.beyond_band import beyond_band
from bayeshaptic.report.in_closed_loop import in_closed_loop
from bayeshaptic.report.numbers.estimates import HEADLINE_RISKS
from bayeshaptic.report.numbers.held_still import held_still
from bayeshaptic.report.numbers.misfit import (
    is_far_off,
    misfit_factor,
    misfit_is_clear,
    residual_is_noticed,
)
from bayeshaptic.report.numbers.result import said_who_holds
from bayeshaptic.report.numbers.stand_ins import MOSTLY, is_the_rest, stand_ins
from bayeshaptic.report.numbers.stiffest import too_stiff
from bayeshaptic.report.numbers.unstated import unstated

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis
    from bayeshaptic.diagnosis.closed import Closed

_OPEN = 10.0  # times the lower end of the limit's 90 % interval: a median beyond that is open
# Share of the response's power that changes from moment to moment at the limit, up to which a
# stiffness is recommended: from 0.28 on friction may be all of the damping there. It is asked only
# where the noise of the device is flagged: in none of 60 clean recordings.
_CHANGES = 0.25
_NO_LAW = {
    GAIN.test: "the gain of the actuator ripples along the way, which was not taken off, and where "
    "it is largest the limit is lower by that",
    **dict.fromkeys((SPEED, LIMIT), SPENT),
}
_LAGS = {"extra_delay", "position_filter", "actuator_lag"}


def why_none(result: Result) -> tuple[str, ...]:
    """Why no stiffness can be recommended; empty where one can."""
    analysis, closed = result.analysis, result.closed
    if told_too_little(analysis.notices) and (reason := unstated(analysis)) is not None:
        return (reason,)
    if rows_are_uneven(analysis.notices):  # what else is seen of them comes of it
        return tuple(doubts_of_the_loop(analysis.notices))
    found = _of_the_analysis(analysis, closed.diagnosis if closed else None)
    return tuple(found + (_of_the_loop(closed) if closed else []))


def _of_the_loop(closed: Closed) -> list[str]:
    """What closing the loop found that a limit cannot be read beside."""
    found = []
    if _rubs_otherwise(closed):
        through = closed.analysis.etfe.through_reference  # where no law is asked
        why = "is not fitted through a reference" if through else "no law of friction explains"
        found.append(
            f"a force that goes with the velocity is left, which {why}, and what the model takes "
            "for damping may be its part"
        )
    if is_the_rest(closed):
        found.append(
            "a force was taken off that made the limit look more than "
            f"{MOSTLY:.0f} times as high, so that what is left of the damping is less than an "
            "error of a tenth in that force"
        )
    reasons = (held_still(closed), stand_ins(closed), beyond_band(closed))
    found += [why for why in reasons if why]
    found += [why for test, why in _NO_LAW.items() if test in _left(closed)]
    if closed.may_be_held_by_friction:
        found.append(
            "beside the force that was found the device makes noise of its own, as one does that "
            "friction holds for most of the time, and what the model takes for damping may be that "
            "friction"
        )
    if closed.changing_at_limit > _CHANGES:
        found.append(
            "what the device does at the frequency of the limit is not the same from moment to "
            f"moment, by as much as it answers there ({what_changes(closed.analysis)}): the limit "
            "of the mean is not that of the device"
        )
    if changes(closed):
        found.append(
            "the device is not the same at the end of the recording as at its beginning, and what "
            "changes was not found"
        )
    return found


def _of_the_analysis(analysis: Analysis, diagnosis: Any) -> list[str]:
    verdict = (diagnosis or {}).get("verdict")
    return [
        *_of_the_misfit(analysis, verdict),
        *_of_the_recording(analysis, diagnosis, verdict),
        *_of_the_limit(analysis),
    ]


def _of_the_misfit(analysis: Analysis, verdict: str | None) -> list[str]:
    found = []
    if verdict == "unexplained" and is_far_off(analysis) and not has_feedback(analysis.notices):
        found.append(
            f"what the model leaves over is {misfit_factor(analysis)} times the noise, and no "
            "effect that was tried explains it"
        )
    if verdict != "unexplained" and analysis.sampled and misfit_is_clear(analysis):
        found.append(
            "the model does not explain the data (what it leaves over is "
            f"{misfit_factor(analysis)} times the noise, reduced chi-square "
            f"{pure(analysis.fit.reduced_chi_square)})"
        )
    if verdict is None and analysis.sampled and residual_is_noticed(analysis):
        found.append(
            "the residual is not noise, and the loop that would trace it was left open (--no-loop)"
        )
    return found


def _of_the_recording(analysis: Analysis, diagnosis: Any, verdict: str | None) -> list[str]:
    found = []
    found += _of_the_units(analysis)
    found += doubts_of_the_loop(analysis.notices)
    if unlike := named_unlike(analysis.notices):
        found.append(
            f"the pieces that count together do not have one response ({', '.join(unlike)}), as "
            "those of one device have"
        )
    if analysis.in_loop is not None:
        found += [*analysis.in_loop.doubts, *analysis.in_loop.questions]
    if has_feedback(analysis.notices) and analysis.in_loop is None:
        found.append(
            f"the force {how_computed(analysis.notices)} (feedback), and that biases the response "
            "which everything here is read from"
        )
    found += in_closed_loop(analysis, verdict)
    found += _of_the_alignment(analysis)
    recording = analysis.recording
    if recording is not None and recording.sensed is not None and _LAGS & set(_added(diagnosis)):
        found.append(
            "what was sensed lags beyond the delay that is known, and whether that is in the loop "
            "or in the sensor of force or motion, which the loop does without, nobody can tell"
        )
    if any(notice.topic == HIGH_PASSED for notice in analysis.notices):
        hand = ", or say --held yes, if somebody held it and nothing was filtered"
        found.append(
            "a device explains the recording better if its position was high-passed before it was "
            "written down, and its limit is lower: record positions as they are read, with "
            f"whatever drift{'' if said_who_holds(analysis) else hand}"
        )
    if (moved := beside_command(analysis)) is not None:
        found.append(moved)
    return found


def _of_the_alignment(analysis: Analysis) -> list[str]:
    """Where force and position may not be of the same sample."""
    found = []
    sensed = any(notice.topic == NO_LOOP for notice in analysis.notices)
    if analysis.sampled and analysis.fit.impossible and not sensed:
        said = "delay_s" not in analysis.model.names
        why = (
            "something else that the model lacks looks like it, as a spring to the ground does; "
            "say --modes and --held, where they are known"
            if said
            else "force and position may not be of the same sample, so that less delay is seen "
            "than the loop has (a position written down a sample early); say the loop's delay with "
            "--delay-s, also where it is zero"
        )
        ends = ", ".join(analysis.fit.impossible)
        found.append(f"the best fit ends at a bound ({ends}), where no device is: {why}")
    moved = any(notice.topic == MOVED for notice in analysis.notices)
    if moved and "delay_s" in analysis.model.names:
        found.append(
            "the position was written down before its command acts, and by how many samples only "
            "the loop's delay would tell: say it with --delay-s, or record again"
        )
    if any(notice.topic == LESS_DELAY for notice in analysis.notices):
        found.append(
            "a model explains the recording with less delay than was told, as where a "
            "position is written down before its command acts, and with that delay the limit is "
            "lower: correct the columns, or --delay-s"
        )
    if (less_s := _less_delay_s(analysis)) is not None:
        found.append(
            f"the recording shows {quantity(less_s, 's')} less delay than was told, as where a "
            "position is written down before its command acts, and with the delay that was told "
            "the limit is lower: correct the columns, or --delay-s"
        )
    return found


def _of_the_units(analysis: Analysis) -> list[str]:
    found = []
    if in_doubt("position", analysis.notices):
        assumed = is_assumed("position", analysis.notices)
        who = "nobody said the position's unit, and" if assumed else "a unit is in doubt:"
        found.append(f"{who} what was recorded does not look like {analysis.model.position_unit}")
    if in_doubt("time", analysis.notices):
        found.append("no haptic loop has this sampling period: the unit of the time is in doubt")
    if not found and analysis.sampled and (stiff := too_stiff(analysis)) is not None:
        found.append(stiff)
    return found


def unconfirmed(analysis: Analysis) -> bool:
    """Whether the closed loop's poles do not confirm some of the limits."""
    return any(n.topic == "critical stiffness" and n.level == "warning" for n in analysis.notices)


def _of_the_limit(analysis: Analysis) -> list[str]:
    found = []
    if analysis.sampled and (far := unstated(analysis)) is not None:
        found.append(far)
    if not analysis.posterior.converged:
        found.append("the sampler has not converged, so the interval may be too narrow")
    if unconfirmed(analysis):
        found.append("the closed loop's poles do not confirm some of the limits")
    if analysis.sampled and is_open(analysis):
        found.append(
            "the recording does not say how small the limit may be, and what it leaves open (the "
            "damping of what moves slowly, mostly) only the prior fills"
        )
    never = float((analysis.limit.samples <= 0).mean())
    if never > min(HEADLINE_RISKS) and not is_certain(analysis.notices):  # biased, too
        found.append(
            f"with probability {percent(never)} the loop is unstable however soft the wall is"
        )
    return found


def _less_delay_s(analysis: Analysis) -> float | None:
    """How much less delay than was told is found; None for less than a quarter of a period."""
    model, least_s = analysis.model, LESS * analysis.etfe.period_s
    if not analysis.sampled or LATER not in model.names:
        return None
    draws = analysis.posterior.draws[:, model.names.index(LATER)]
    return -float(np.median(draws)) if np.quantile(draws, 0.95) < -least_s else None


def is_open(analysis: Analysis) -> bool:
    """Whether the limit's 90 % interval reaches below a tenth of its median.

    A rare crossing far below is no such case: its share of the draws is a probability.  Of 103
    limits of recordings from another simulator one was that open (docs/door.md).
    """
    low, middle = (analysis.limit.quantile(p) for p in (0.05, 0.5))
    return bool(low * _OPEN < middle < math.inf)


def _added(diagnosis: Any) -> tuple[str, ...]:
    """Names of the effects that were found."""
    return tuple(effect["name"] for effect in (diagnosis or {}).get("effects", ()))


def _left(closed: Closed) -> set[str]:
    """Names of the tests that stay where something is unexplained."""
    if closed.diagnosis["verdict"] != "unexplained":
        return set()
    return {test.name for test in closed.traced.after if test.flagged}


def changes(closed: Closed) -> bool:
    """Whether the device changes by more than noise, and no drift explains it."""
    if closed.diagnosis["verdict"] != "unexplained":
        return False
    return any(test.flagged and test.family == "time-varying" for test in closed.traced.after)


def _rubs_otherwise(closed: Closed) -> bool:
    """Whether a force over the velocity stays unexplained: such a damping ends in small motions.

    After a force was taken off, a test's threshold is higher.  Where nobody holds the device, what
    is noticed below that threshold may be another force, which was looked for and not found: that
    is so in none of 17 recordings with one force or none, and in one of 18 with two.  Where all
    lines of a loop are fitted, the limit's interval holds what such a force would do to it.
    """
    left = _left(closed)
    acts = any(effect.family == "nonlinear" for effect in closed.effects)
    direct = closed.analysis.etfe.direct
    if acts and closed.force is None and not (direct or closed.model.held):
        left |= {test.name for test in closed.traced.after if test.noticed}
    return bool(variables(left) & {VELOCITY, LOAD_VELOCITY, ALONG})
