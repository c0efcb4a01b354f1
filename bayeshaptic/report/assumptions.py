"""Everything that a reader must believe in order to believe the report."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from bayeshaptic.models.structures import QUANTITIES
from bayeshaptic.quantities import interval, pretty_unit, pure, quantity
from bayeshaptic.recordings.signals.sweeps import is_sweep
from bayeshaptic.report import words
from bayeshaptic.report.listed import listed

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis
    from bayeshaptic.diagnosis.closed import Closed
    from bayeshaptic.recordings.response.etfe import Etfe


def assumptions(analysis: Analysis, closed: Closed | None = None) -> tuple[str, ...]:
    """The assumptions in sentences, the data's first."""
    etfe = analysis.etfe
    unit = pretty_unit(etfe.force_unit)
    return (
        "The device, its configuration and the way it is held are those of the recording: another "
        "person, posture or configuration has another limit.",
        "Whatever moved or held the device beside the force that was recorded was there, too: the "
        "limit is that of the device with it. Virtual damping, a compensation of friction or "
        "gravity or another controller, whose forces are not in the command's column, must then "
        "stay switched on beside the wall; without virtual damping the limit may be far lower.",
        "The wall is a pure stiffness: the commanded force is −K times the sampled position, "
        f"every {quantity(etfe.period_s, 's')}, without virtual damping.",
        "The commanded force is held between samples (zero-order hold). Hold and delay, also a "
        "fraction of a period, are computed exactly, not by a continuous approximation.",
        words.delay(analysis),
        "Command and position stand in the recording as they were sent and read. What was done to "
        "one of them in the record alone (a mean of commands, a drift taken off the position, a "
        "position that was integrated, which is half a period early) looks like more or less delay "
        "or damping of the device, and the limit may then be too high.",
        f"The force is in command units ({unit}): a wrong force constant makes masses, dampers and "
        "springs wrong by its factor, but cancels in the stiffness that may be commanded.",
        _constancy(analysis, closed),
        _model(analysis, closed),
        *_widening(closed),
        *_noise(analysis),
        *_force_sensor(analysis),
        *_sampling(analysis),
    )


def _sampling(analysis: Analysis) -> tuple[str, ...]:
    if not analysis.sampled:
        return ()
    posterior = analysis.posterior
    ensembles, steps, walkers, _ = posterior.chains.shape
    return (
        "Priors as in the table below. Intervals are 90 % and equal-tailed: from the 5 % to the "
        f"95 % quantile. {ensembles} ensembles of {walkers} walkers, {steps} steps, seed "
        f"{posterior.seed}.",
    )


def _noise(analysis: Analysis) -> tuple[str, ...]:
    """What is taken to be noise, and where it was looked at."""
    if analysis.in_loop is not None:
        motion = analysis.in_loop.motion
        return (
            f"The device is one mass up to {quantity(motion.bandwidth_hz, 'Hz')}, where the "
            "command has its power, and at the frequency of the limit.",
            "What is left of the motion may be correlated, and depend on position and direction; "
            "it widens the intervals by its own correlation, and by what changes when slower "
            "motion counts more. It has the same mean however the mass moves.",
        )
    etfe = analysis.etfe
    said = []
    if etfe.direct:
        said.append(
            "The command depends on the motion before it alone, not on what is to come; by which "
            "controller is no matter."
        )
    if etfe.through_reference:
        said.append(
            "What the response is read through (what the controller followed, or what of the "
            "command neither its past nor the motion up to then foretells) owes nothing to the "
            "noise."
        )
    said.append(_scatter(etfe))
    if analysis.noise_scale != 1.0:
        said.append(
            "Because what the fit leaves is more than that, the posterior takes "
            f"{pure(analysis.noise_scale)} times that variance."
        )
    return (
        f"Frequencies from {interval(*etfe.band_hz, 'Hz')} decide; outside this band the model "
        "extrapolates.",
        " ".join(said),
    )


def _force_sensor(analysis: Analysis) -> tuple[str, ...]:
    """What a command must not be made of; of a mass that is followed nobody holds it."""
    if analysis.in_loop is not None or analysis.etfe.recording is None:
        return ()
    return (
        "No force that a sensor measured between hand and device was in the command (power "
        "assist, admittance control). It tells of the hand before the motion does, so that the "
        "response holds the hand's force, too: the limit is then another, lower or higher, and "
        "nothing in command and position shows it.",
    )


def _scatter(etfe: Etfe) -> str:
    """What the noise is, by how the response was measured."""
    if etfe.recording is None:
        return (
            "The noise is Gaussian, independent from row to row of the table, and as large as the "
            "table says."
        )
    if etfe.period_lines is not None:
        return (
            "The noise is Gaussian: at each excited line it is what does not repeat from period to "
            "period, and its variance is integrated out. The device has settled in the periods "
            "that were kept; whether it changes from one to the next is tested where there are "
            "four or more."
        )
    return (
        "The noise is Gaussian, with a spectrum that is unknown and smooth: its variance is "
        "estimated in each window of lines and integrated out. The leakage of a random "
        "excitation is removed in each window; what is left over is independent from window to "
        "window."
    )


def _constancy(analysis: Analysis, closed: Closed | None) -> str:
    found = [] if closed is None else closed.effects
    names = [effect.title for effect in found if effect.family in ("nonlinear", "time-varying")]
    but = f", but for what was found ({listed(names)})" if names else ""
    text = (
        f"The device is linear and does not change during the recording{but}. The limit is that "
        "of the linear part: it holds at amplitudes where dry friction no longer helps."
    )
    if any(effect.family == "time-varying" for effect in found):
        text += " Of a device or a grip that changes, the limit is that of the worst part."
    if (recording := analysis.etfe.recording) is not None and is_sweep(recording.force):
        text += (
            " A sweep comes by each frequency at a moment of its own: a grip that grew firmer "
            "meanwhile looks like another device, and the limit is that of the moments at which "
            "its frequency came by."
        )
    return text


def _model(analysis: Analysis, closed: Closed | None) -> str:
    names = [effect.name for effect in analysis.model.effects]
    if closed is not None:
        names = [effect.title for effect in closed.effects if effect.family != "measurement"]
    effects = f"with {listed(names)}" if names else "no effect has been added to it"
    return f"Model: {analysis.model.structure.title}; {effects}."


def _widening(closed: Closed | None) -> tuple[str, ...]:
    if closed is None or closed.analysis.in_loop is not None:
        return ()
    spread = math.sqrt(sum(effect.limit_log_sd**2 for effect in closed.effects))
    found = []
    if spread > 0:
        found.append(
            "The uncertainty of the effects that are not in the posterior adds "
            f"{pure(100 * spread, 2)} % (sd) to the limit."
        )
    if any(effect.family == "nonlinear" for effect in closed.effects):
        found.append(
            "A law of a force is never quite right: limit and parameters are widened either way "
            "by what the tests still see of it, as a share of what they saw before, times how far "
            "the force moved them."
        )
    fall = sum(effect.limit_log_fall for effect in closed.effects)
    if fall > 0:
        found.append(
            "The limit is that of the worst part of the recording, and up to "
            f"{pure(100 * fall, 2)} % lower at one of its ends if the drift is steady."
        )
    further = sum(effect.limit_log_further for effect in closed.effects)
    if further > 0:
        found.append(
            "The device was still changing when the recording ended. For half of the draws it "
            "goes on to change, so that the limit is up to "
            f"{pure(-100 * math.expm1(-further), 2)} % lower: as far again as in the recording."
        )
    if closed.verdict == "unexplained" and closed.analysis.etfe.direct:
        found.append(
            "The limit is widened by what the friction that was found leaves unexplained: by that "
            "share of how far it moved the limit. This is an estimate, not a bound."
        )
    elif closed.verdict == "unexplained":
        found.append(
            "The limit is widened by what is left unexplained. Where the rest is linear, the "
            "response is multiplied by a random smooth deviation as large as the residual shows; "
            "where it is not, the limit is taken down as far as the rejected candidates and the "
            "damping in doubt would take it, its upper end left about where it was; or, where an "
            "effect of the class was found, it is widened by what is left of that. This is an "
            "estimate of what an unknown effect does, not a bound."
        )
    return tuple(found)


def priors(analysis: Analysis) -> tuple[tuple[str, str, str], ...]:
    """(name, what it is, prior in words) of every parameter; known ones as such."""
    model = analysis.model
    rows = [
        (p.name, p.title, model.prior(p.name).describe(pretty_unit(model.unit(p.name))))
        for p in model.parameters
    ]
    for name, value in model.fixed.items():
        rows.append((name, QUANTITIES[name][1], f"known: {quantity(value, 's')}"))
    return tuple(rows)
