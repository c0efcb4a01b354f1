"""The analysis by the motion of one mass that is followed in time, with or without feedback."""

from __future__ import annotations

import time
from dataclasses import replace

from bayeshaptic.diagnosis.analyse import NO_WITNESS
from bayeshaptic.diagnosis.analysis import Analysis
from bayeshaptic.diagnosis.base.opened import Opened
from bayeshaptic.diagnosis.feedback.against_one_mass import contradictions, open_questions
from bayeshaptic.diagnosis.feedback.in_loop import UNSEEN, follow_in_loop
from bayeshaptic.diagnosis.feedback.lacking import Lacking
from bayeshaptic.diagnosis.feedback.tones_in_motion import tones_of
from bayeshaptic.diagnosis.feedback.units_in_loop import with_units_of
from bayeshaptic.diagnosis.limit_known import LimitKnown, asked_of_sampler
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.diagnosis.residuals.supply import SPENT, speed_tests
from bayeshaptic.diagnosis.samples.sinusoids import in_words
from bayeshaptic.diagnosis.state import Accepted, Estimate
from bayeshaptic.diagnosis.traced import CONSISTENT, EXPLAINED, UNEXPLAINED, Traced
from bayeshaptic.effects.measurement import MainsTone
from bayeshaptic.errors import Notice
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.inference.sampler import sample_around
from bayeshaptic.inference.time_domain.likelihood import in_loop_fit
from bayeshaptic.inference.time_domain.mass_in_loop import DRY
from bayeshaptic.inference.time_domain.model import rigid_with_friction
from bayeshaptic.models import build_model
from bayeshaptic.models.parameter import unit_of
from bayeshaptic.quantities import percent
from bayeshaptic.recordings.checks.sufficiency import TOO_LITTLE, few_tones, told_too_little
from bayeshaptic.recordings.feedback import has_feedback, is_certain
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.stability.critical import CriticalStiffness
from bayeshaptic.stability.from_etfe import EtfeCriticalStiffness

_SEEN = 2.9  # Student's t of eight degrees of freedom: 1 in 100
_BIASED = (
    "The force was computed from the motion, so that the measured response is biased, and shown "
    "for comparison only. The parameters and the limit are not read from it: they come from the "
    "motion of one mass with friction, simulated in the same loop beside the measured one."
)
_OPEN = (
    "The recording was made in open loop: no feedback is seen in it (if there was some, what "
    "follows holds all the same). The parameters are not read from the response, but come from the "
    "motion of one mass with friction, simulated under the same command beside the measured one. "
    "They are those of this motion: at other frequencies, and under other forces, "
    "the device may be another, so that no stiffness follows from them."
)
_TONES = (
    "What is like one mass at a tone's frequency, such as a base that gives, a tone cannot tell "
    f"from one: {percent(UNSEEN)} of the force is allowed for that in mass and damping (sd)."
)


def analyse_one_mass(begun: Opened, options: Options) -> Analysis | None:
    """The analysis by the motion of one mass, which feedback does not bias.

    It is for recordings in closed loop, and for those in open loop that say too little for a
    response.  None where no motion can be followed; in open loop, also where anything speaks
    against the motion.

    Parameters
    ----------
    begun : Opened
        Where the device was not declared to be one mass no limit is recommended.
    options : Options
    """
    began = time.perf_counter()
    recording = begun.etfe.recording
    options.report(0.0, "following one mass in time")
    found = None if recording is None else follow_in_loop(recording)
    if recording is None or found is None:
        return None
    open_loop = told_too_little(begun.notices) is not None
    if open_loop and found.doubts:
        return None
    delay = options.delay_s, options.delay_sd_s
    model = rigid_with_friction(recording, found.motion, begun.device, *delay, options.prior)
    fit = in_loop_fit(model, begun.etfe, found.motion, found.misfit)
    posterior, limit = _sampled(fit, begun.etfe, options)
    doubts = found.doubts + contradictions(found.motion, posterior) + _if_open(begun, options)
    if open_loop and doubts:
        return None
    questions = open_questions(found, posterior, limit, begun.one_mass)
    told = tuple(replace(n, text=_BIASED) if n.topic == "feedback" else n for n in begun.notices)
    if not open_loop:
        told = with_units_of(fit, recording, begun.device, told)
    return Analysis(
        recording=recording,
        etfe=begun.etfe,
        device=begun.device,
        model=model,
        choice=None,
        fit=fit,
        posterior=posterior,
        limit=limit,
        etfe_limit=EtfeCriticalStiffness(None, None, None, None, limit.unit, NO_WITNESS),
        notices=told
        + _set_aside(begun, options)
        + (_open_loop(recording) if open_loop else limit.notices),
        seconds={**begun.seconds, "motion in the loop": time.perf_counter() - began},
        lever_m=begun.lever_m,
        in_loop=replace(found, doubts=doubts, questions=questions),
    )


def _if_open(begun: Opened, options: Options) -> tuple[str, ...]:
    """What would speak against the limit in open loop, where feedback is only a doubt.

    An actuator that is spent on speed is what new force and past position have in common.  Under
    the motion of one mass its damping hides it but for less than the encoder's counts.
    """
    if is_certain(begun.notices) or not has_feedback(begun.notices):
        return ()
    delay = options.delay_s, options.delay_sd_s
    model = build_model("rigid", begun.device, *delay, begun.etfe.period_s)
    fit = least_squares(model, begun.etfe, options.seed)
    return tuple(SPENT for test in speed_tests(fit, begun.etfe) if test.flagged)


def _sampled(fit: Fit, etfe: Etfe, options: Options) -> tuple[Posterior, CriticalStiffness]:
    """The posterior of a motion that was fitted, and its limit."""
    watch = LimitKnown(fit.model)
    posterior = sample_around(fit, etfe, asked_of_sampler(watch, options))
    # What the response says is no part of this likelihood.
    posterior = replace(posterior, windows=None, etfe=None)
    return posterior, watch.limit_of(posterior)


def _set_aside(begun: Opened, options: Options) -> tuple[Notice, ...]:
    """A warning of what was said of the device and cannot hold of one mass that nobody holds."""
    if begun.asked not in ("auto", "rigid"):
        what = f"the base model {begun.asked} that was asked for"
    elif options.held:
        what = "that somebody held the device"
    else:
        return ()
    text = (
        f"Set aside: {what}. The measured response is biased, so that no model can be fitted to "
        "it, and the motion is followed as that of one mass that nobody holds, whatever is asked."
    )
    return (Notice("warning", "feedback", text),)


def _open_loop(recording: Recording) -> tuple[Notice, ...]:
    """A note of what the parameters of a motion in open loop are worth."""
    text = _OPEN if few_tones(recording) is None else f"{_OPEN} {_TONES}"
    return (Notice("note", TOO_LITTLE, text),)


def traced_of_one_mass(traced: Traced, analysis: Analysis) -> Traced:
    """The record of the loop: what was found in the force, with numbers, and a verdict.

    "explained" and "consistent" mean here that each half of the recording predicts the other; a
    remaining force that is not noise is in the widths.
    """
    assert analysis.in_loop is not None
    names = ("coulomb", "offset")
    laws = tuple(_accepted(law, analysis) for law in analysis.in_loop.laws)
    # Another law of dry friction has Coulomb's in it; and the motion knows better than the force.
    motion = analysis.in_loop.motion
    rubs = motion.values[DRY] > _SEEN * motion.sd[DRY]
    named = any(law.effect.sticks for law in analysis.in_loop.laws)
    dry = traced.state.accepted if rubs and not named else ()
    accepted = (*(replace(effect, estimates={}, parameters=names) for effect in dry), *laws)
    accepted += _humming(analysis)
    verdict, left = (EXPLAINED, accepted[0].family) if accepted else (CONSISTENT, None)
    if analysis.in_loop.doubts:
        verdict, left = UNEXPLAINED, traced.residual_class
    state = replace(traced.state, accepted=accepted)
    return replace(traced, verdict=verdict, residual_class=left, state=state)


def _humming(analysis: Analysis) -> tuple[Accepted, ...]:
    """The tones that were fitted with the motion, as one accepted effect."""
    assert analysis.in_loop is not None
    tones = tones_of(analysis.in_loop.motion)
    if not tones:
        return ()
    estimates = {}
    for number, tone in enumerate(tones, 1):
        estimates[f"frequency_{number}_hz"] = Estimate(
            tone.frequency_hz, tone.frequency_sd_hz, "Hz"
        )
        size = abs(tone.amplitude), tone.amplitude_sd, analysis.model.force_unit
        estimates[f"amplitude_{number}"] = Estimate(*size)
    evidence = (
        f"far above the lines beside it in what the motion leaves: "
        f"{in_words(tones, analysis.model.force_unit)}; fitted with it, as a force on the mass"
    )
    return (Accepted(MainsTone.name, "tone in the motion", MainsTone.family, evidence, estimates),)


def _accepted(law: Lacking, analysis: Analysis) -> Accepted:
    """A law that joined the mass, as an accepted effect."""
    evidence = (
        f"takes away {percent(1 - law.score.left)} of the error's power "
        f"(t = {law.score.t:.3g}, everything else fitted with it)"
    )
    effect, units = law.effect, (analysis.model.force_unit, analysis.model.position_unit)
    dimensions = dict([effect.strength]) | dict(effect.dimensions)
    estimates = {
        name: Estimate(*found, unit_of(dimensions[name], *units))
        for name, found in law.estimates.items()
    }
    parameters = ("coulomb",) if effect.sticks else ()
    return Accepted(effect.name, effect.title, "nonlinear", evidence, estimates, parameters)
