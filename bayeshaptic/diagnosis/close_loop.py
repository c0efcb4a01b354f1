"""Closing the loop on one measurement: what the model lacks is found, added, and analysed again."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from bayeshaptic.diagnosis.analyse import finish, without_sampling
from bayeshaptic.diagnosis.analysis import Analysis
from bayeshaptic.diagnosis.base.alignment import perhaps_late
from bayeshaptic.diagnosis.base.asked import measurement_of
from bayeshaptic.diagnosis.base.begun import Begun, fitted
from bayeshaptic.diagnosis.base.best_base import traced_as_of_the_loop
from bayeshaptic.diagnosis.base.opened import Opened, opened
from bayeshaptic.diagnosis.closed import Closed, error_beside, limit_alone, model_error
from bayeshaptic.diagnosis.direct_method import by_direct_method
from bayeshaptic.diagnosis.feedback.explain import (
    ForceExplained,
    explain_force,
    left_alone,
    trace_force,
)
from bayeshaptic.diagnosis.feedback.mode_above_band import mode_above_band
from bayeshaptic.diagnosis.hidden.hidden import with_hidden
from bayeshaptic.diagnosis.hidden.prior import HiddenPrior
from bayeshaptic.diagnosis.one_mass import analyse_one_mass, traced_of_one_mass
from bayeshaptic.diagnosis.options import Options, options_from
from bayeshaptic.diagnosis.residuals.excess import noise_besides
from bayeshaptic.diagnosis.samples.command_times import command_times
from bayeshaptic.diagnosis.traced import UNEXPLAINED, Traced
from bayeshaptic.diagnosis.widening.discrepancy import with_discrepancy
from bayeshaptic.diagnosis.widening.law_error import with_law_error
from bayeshaptic.diagnosis.widening.rest import with_rest
from bayeshaptic.diagnosis.widening.rivals import with_rivals
from bayeshaptic.errors import Notice
from bayeshaptic.models import Model
from bayeshaptic.recordings.checks.sufficiency import told_too_little
from bayeshaptic.recordings.checks.unlike_pieces import still_unlike
from bayeshaptic.recordings.feedback import has_feedback, is_certain
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.threads import single_threaded


@single_threaded
def close_loop(
    measurement: Recording | Etfe | str | Path,
    model: str | Model = "auto",
    options: Options | None = None,
    **changes: Any,
) -> Closed:
    """Find what the model lacks, add it, and analyse again.

    Parameters
    ----------
    measurement : Recording, Etfe or path
    model : {"auto", "rigid", "free", "grasped"} or Model
        With the option `modes` a chain of masses.
    options : Options, optional
    **changes
        Single options by name, as in `bayeshaptic.analyse`.

    Returns
    -------
    Closed

    Raises
    ------
    InputError
        Where the measurement cannot be used.
    """
    chosen = options_from(options, changes)
    prior = HiddenPrior.from_table(chosen.effects)
    found = opened(measurement_of(measurement, model, chosen), model, chosen.within(0.0, 0.5))
    direct = by_direct_method(found, model, chosen)
    if isinstance(direct, Closed):
        return with_average(direct, prior, chosen) if chosen.hidden else direct
    found = direct
    in_time = has_feedback(found.notices) or told_too_little(found.notices)
    force = explain_force(found.etfe.recording) if in_time else None
    if force is not None and (followed := _in_loop(found, force, chosen)) is not None:
        return followed
    begun = fitted(found, model, chosen.within(0.0, 0.5))
    if force is not None or is_certain(begun.notices):
        return _refused(begun, force, chosen)
    began = time.perf_counter()
    begun, traced = traced_as_of_the_loop(begun, model, chosen.within(0.05, 0.4))
    tracing = time.perf_counter() - began
    if traced.verdict == UNEXPLAINED and begun.etfe.through_reference:
        instead = _one_mass_instead(measurement, begun, model, chosen)
        if instead is None:
            instead = _longest_piece_instead(found, model, chosen)
        if instead is not None:
            return instead
    closed = _before_and_after(begun, traced, tracing, chosen)
    return with_average(closed, prior, chosen) if chosen.hidden else closed


def _before_and_after(begun: Begun, traced: Traced, tracing_s: float, options: Options) -> Closed:
    """The base model analysed, and that with what was found, widened by what it leaves open."""
    state, seed = traced.state, options.seed
    # Of coarser counts than were said the fit knows nothing: what was sampled once holds for both.
    alike = not state.accepted or state.fit is begun.fit
    base = finish(begun, begun.etfe, begun.fit, options.within(0.4, 0.6), small_risks=alike)
    analysis = replace(base, recording=state.etfe.recording, etfe=state.etfe)
    if not alike:
        analysis = finish(
            begun,
            state.etfe,
            state.fit,
            options.within(0.6, 0.9),
            witness=base.etfe_limit if state.etfe is begun.etfe else None,
        )
    limit, traced = with_rivals(analysis.limit, traced, seed)
    limit = with_discrepancy(limit, analysis.posterior, begun.fit, traced, seed)
    notices = still_unlike(analysis.notices, state.etfe)
    notices += traced.notices + perhaps_late(state.fit)
    if state.etfe.through_reference and not state.etfe.moved_throughout:
        notices += mode_above_band(state.fit, state.etfe, analysis.limit)
    if (noise := noise_besides(state.fit, state.etfe)) is not None:
        notices += (noise.notice(state.etfe),)
    if (times := command_times(state.fit, state.etfe)) is not None:
        notices += times.notices
    seconds = _stages(begun.seconds, tracing_s, base.seconds, analysis.seconds)
    wide = with_law_error(analysis.posterior, begun.fit, traced, seed)
    stated, louder = wide or analysis.posterior, analysis.noise_scale
    wide = with_rest(stated, state.fit, traced, louder, seed) or wide
    analysis = replace(analysis, limit=limit, notices=notices, seconds=seconds, widened=wide)
    before_like_after = None if state.etfe is begun.etfe else error_beside(base, analysis)
    return Closed(
        base,
        analysis,
        traced,
        model_error(base),
        model_error(analysis),
        before_like_after=before_like_after,
    )


def _in_loop(found: Opened, force: ForceExplained, options: Options) -> Closed | None:
    """The closed loop by following the motion of one mass; None where it cannot be followed."""
    analysis = analyse_one_mass(found, options.within(0.3, 0.95))
    if analysis is None:
        return None
    traced = traced_of_one_mass(trace_force(analysis.etfe, analysis.fit, force), analysis)
    error = limit_alone(analysis)
    return Closed(analysis, analysis, traced, error, error, force)


def _one_mass_instead(
    measurement: Recording | Etfe | str | Path, begun: Begun, model: str | Model, options: Options
) -> Closed | None:
    """The closed loop by following one mass, where the reference shows no more than one mass.

    A response that is read through a reference is linear, so that dry friction comes out as
    damping.  A mass that is followed in time has friction of its own.  The result is used only
    where nothing speaks against it.
    """
    if begun.fit.model.name != "rigid":
        return None
    found = opened(measurement_of(measurement, model, options), "rigid", options)
    force = explain_force(found.etfe.recording)
    closed = None if force is None else _in_loop(found, force, options)
    return None if closed is None or closed.verdict == UNEXPLAINED else closed


def _longest_piece_instead(found: Opened, model: str | Model, options: Options) -> Closed | None:
    """The closed loop by the direct method of the longest piece, where it leaves noise alone."""
    if found.etfe.unbroken is not None:  # it was asked before
        return None
    direct = by_direct_method(found, model, options, longest=True)
    return direct if isinstance(direct, Closed) else None


def _refused(begun: Begun, force: ForceExplained | None, options: Options) -> Closed:
    """The result where feedback biases the response and no motion can be followed.

    Nothing is sampled, and no effect is looked for in the response: whatever is found there may be
    the controller.
    """
    analysis = without_sampling(begun, options)
    traced = left_alone(begun.etfe, begun.fit, force)
    error = model_error(analysis)
    return Closed(analysis, analysis, traced, error, error, force)


def with_average(closed: Closed, prior: HiddenPrior, options: Options) -> Closed:
    """The result with a limit that allows for what tests cannot see, where that can be computed.

    Parameters
    ----------
    closed : Closed
        Without.
    prior : HiddenPrior
    options : Options
    """
    analysis, traced = closed.analysis, closed.traced
    if closed.force is not None or traced.verdict == UNEXPLAINED:
        return closed
    if not analysis.posterior.converged:
        return closed
    began = time.perf_counter()
    try:
        found = with_hidden(
            analysis.limit,
            analysis.posterior,
            analysis.etfe,
            traced.after,
            [effect.name for effect in traced.state.accepted],
            prior,
            options.seed,
        )
    except Exception as error:  # the declared limit stands, whatever happens to what is beside it
        return replace(closed, analysis=_declared_alone(analysis, error))
    if found is None:
        return closed
    seconds = {**analysis.seconds, "what could hide": time.perf_counter() - began}
    analysis = replace(analysis, limit=found[0], hidden=found[1], seconds=seconds)
    # Windows of a loop cannot be held out by themselves: there the limit alone is an error.
    after = limit_alone(analysis) if analysis.etfe.direct else model_error(analysis)
    after = {key: after.get(key, value) for key, value in closed.after.items()}
    return replace(closed, analysis=analysis, after=after)


def _declared_alone(analysis: Analysis, error: Exception) -> Analysis:
    text = (
        f"What could hide was not found out ({type(error).__name__}: {error}): the limit is that "
        "of the model if it is exact, with no allowance for effects too small to be seen. Please "
        "report this with the recording."
    )
    return replace(analysis, notices=(*analysis.notices, Notice("warning", "hidden", text)))


def _stages(
    begun: Mapping[str, float],
    tracing: float,
    base: Mapping[str, float],
    after: Mapping[str, float],
) -> dict[str, float]:
    """The time of every stage, in order; of two samplings the declared model's comes first."""
    stages = {**begun, "closing the loop": tracing}
    if after is not base:
        stages["the model as declared"] = sum(base.values()) - sum(begun.values())
    return stages | {name: spent for name, spent in after.items() if name not in begun}
