"""Sentences of the report that are made from numbers."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import bdtrc

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.diagnosis.traced import UNEXPLAINED
from bayeshaptic.quantities import decibel, estimate, interval, percent, pure, quantity
from bayeshaptic.report.loop.motion_words import motion_words
from bayeshaptic.report.numbers.estimates import Witness, correction, witnesses
from bayeshaptic.report.numbers.misfit import misfit_factor, misfit_is_clear, residual_is_noticed
from bayeshaptic.report.numbers.octaves import EXPECTED, third_octaves
from bayeshaptic.report.numbers.result import families_of, is_unexplained
from bayeshaptic.report.numbers.trust import doubtful_parameters

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis
    from bayeshaptic.diagnosis.closed import Closed
    from bayeshaptic.inference.fit import Fit

_DELAY = "delay_s"
_ALONG = (
    "That alone is no contradiction: where the phase runs along \N{MINUS SIGN}180 degrees for "
    "long, the measurement's interval misses the true limit in one recording of four."
)
_WIDER = 3.0  # times the model's interval, from which it is worth a word why


def misfit(analysis: Analysis, closed: Closed | None = None) -> str:
    """How the residual compares with the noise, and where it is worst."""
    if analysis.in_loop is not None:
        return (
            f"{motion_words(analysis).response} The model was not fitted to it but to the motion: "
            "where the two differ here, the response is wrong, or more than one mass moves."
        )
    if not analysis.sampled:
        return (
            "Feedback biases the measured response. What a model leaves over of it says nothing of "
            "the device."
        )
    fit = analysis.fit
    chi = f"reduced chi-square {quantity(fit.reduced_chi_square, '')}, where 1 is pure noise"
    above, octaves, place = _octaves_above(fit)
    if misfit_is_clear(analysis):
        then = (
            "What was tried stands above; the limit is widened for what is left."
            if closed is not None
            else "Until the cause is found and added to the model, nothing here says how wrong "
            "the limit may be."
        )
        return (
            f"The model does not explain this recording: the residual is {misfit_factor(analysis)} "
            f"times the noise ({chi}). It stands out in {above} of {octaves} third "
            f"octaves and is worst at {place}. {then}"
        )
    if closed is not None and closed.verdict == UNEXPLAINED:
        return (
            f"Over frequency the residual is no larger than the noise ({chi}). But it is not "
            "noise: what was found in it stands under What the model lacked."
        )
    if above:
        by_chance = float(bdtrc(float(above - 1), octaves, 1 - EXPECTED[1]))
        return (
            f"Overall the residual is no larger than the noise ({chi}), but {above} of "
            f"{octaves} third octaves {'lies' if above == 1 else 'lie'} above what "
            f"99.5 % of pure noise stays below; the highest is {place}. By chance that happens in "
            f"{percent(by_chance)} of recordings."
        )
    if residual_is_noticed(analysis):
        return (
            f"Over frequency the residual is no larger than the noise ({chi}). But it is not "
            "noise: a test of it over time found more, as the warning above says."
        )
    return (
        f"The residual is what pure noise would leave ({chi}): all {octaves} third octaves "
        "lie below the level that 99.5 % of pure noise stays below."
    )


def _octaves_above(fit: Fit) -> tuple[int, int, str]:
    """How many third octaves of the residual lie above noise, of how many; the highest, in words.

    "Above noise" is above what 99.5 % of pure noise stays below.
    """
    order = np.argsort(fit.frequency_hz)
    bands = third_octaves(fit.frequency_hz[order], fit.residual[order])
    worst = int(np.argmax(bands.rms))
    hertz = quantity(float(bands.frequency_hz[worst]), "Hz")
    place = f"{pure(bands.rms[worst], 2)} times the noise around {hertz}"
    return int(np.sum(bands.rms > bands.high)), len(bands.rms), place


def convergence(analysis: Analysis) -> str:
    """The sampler's own sentence, and its size."""
    posterior = analysis.posterior
    if not analysis.sampled:
        return "It was not run: no limit would be stated from what it says."
    ensembles, steps, walkers, _ = posterior.chains.shape
    message = posterior.message[:1].upper() + posterior.message[1:].rstrip(".")
    return (
        f"{message}. {ensembles} independent ensembles of {walkers} walkers took {steps} steps "
        f"each: {posterior.chains[..., 0].size:,} draws, seed {posterior.seed}."
    )


def checked(analysis: Analysis) -> str:
    """What the spectral radius said about the limits."""
    limit = analysis.limit
    if not analysis.sampled:
        return ""
    if not limit.checked:
        return "No draw's limit was checked by the poles of the closed loop."
    return (
        f"For {limit.confirmed} of {limit.checked} checked draws the poles of the closed loop are "
        "inside the unit circle just below the limit and outside just above it."
    )


def delay(analysis: Analysis) -> str:
    """What was assumed of the loop delay."""
    model = analysis.model
    if _DELAY in model.fixed:
        return (
            f"The loop delay beyond the hold is taken as known exactly: "
            f"{quantity(model.fixed[_DELAY], 's')}. If it is not, the limit's interval is too "
            "narrow; give --delay-sd-s."
        )
    column = analysis.stated.draws[:, model.names.index(_DELAY)]  # as in the table of parameters
    low, high = (float(v) for v in np.quantile(column, (0.05, 0.95)))
    return (
        "The loop delay beyond the hold is uncertain and was estimated with the other parameters: "
        f"{interval(low, high, 's')} (90 %)."
    )


def agreement(result: Result) -> str:
    """The model's limit beside the measurement's own, as measured and as it was corrected."""
    analysis, limit = result.analysis, result.analysis.limit
    found = {w.key: w for w in witnesses(result)}
    raw, own = found.get("etfe"), found.get("corrected", found.get("etfe"))
    if own is None or own.middle is None or own.low is None or own.high is None:
        why = getattr(analysis.etfe_limit, "reason", None)
        return (
            "No limit can be read from the measured response alone, without a model"
            f"{': ' + why if why else ''}. Crossings outside the band rest on the model."
        )
    middle = limit.quantile(0.5)
    if not (math.isfinite(middle) and middle > 0 and own.middle > 0):
        return "The model and the measurement cannot be compared: one of them has no limit."
    how = correction(result) if own is not raw else "alone, without a model"
    if "force_lag_s" in analysis.model.names:
        how += " but for the lag of the force's sensor"
    text = (
        f"Read from the measured response {how}, the limit is "
        f"{estimate(own.middle, own.low, own.high, limit.unit)}. {_apart(analysis, own)}"
    )
    if raw is not None and raw is not own and None not in (raw.low, raw.middle, raw.high):
        text += (
            " As it was measured, without any model, the response says "
            f"{estimate(raw.middle, raw.low, raw.high, limit.unit)}."  # type: ignore[arg-type]
        )
    return text


def _apart(analysis: Analysis, own: Witness) -> str:
    """How far the model's median is from a witness, and why that may be."""
    limit = analysis.limit
    assert own.middle is not None and own.low is not None and own.high is not None
    difference = decibel(limit.quantile(0.5)) - decibel(own.middle)
    overlap = own.low <= limit.quantile(0.95) and limit.quantile(0.05) <= own.high
    side = "above" if difference > 0 else "below"
    verdict = "their 90 % intervals overlap" if overlap else "their 90 % intervals do not overlap"
    shown = f"{abs(difference):.2f}"
    where = f"lies {shown} dB {side} that" if float(shown) else "is the same to 0.01 dB"
    text = f"The model's median {where}, and {verdict}."
    low, high = limit.quantile(0.05), limit.quantile(0.95)
    if min(own.low, low) <= 0:
        return text
    if not overlap:
        text += f" {_ALONG}"
    wider = math.log(own.high / own.low) > _WIDER * math.log(high / low)
    return f"{text} {_why_wide(analysis)}" if wider else text


def _why_wide(analysis: Analysis) -> str:
    """Why the measurement knows its own limit less well than the model does."""
    own = analysis.etfe_limit
    assert own.frequency_hz is not None and own.phase_sd_deg is not None
    assert own.db_per_degree is not None
    return (
        "The measurement's is the wider one because it sees the frequencies around its crossing "
        f"alone. Near {quantity(own.frequency_hz, 'Hz')} the phase is known to "
        f"{pure(own.phase_sd_deg, 2)} degrees (sd), and each tenth of a degree moves this limit by "
        f"{pure(own.db_per_degree / 10, 2)} dB. The model uses all frequencies."
    )


def hump(analysis: Analysis) -> str:
    """A warning where more than one crossing may bind."""
    crossings = [c for c in analysis.limit.crossings if c.probability >= 0.01]
    if len(crossings) < 2:
        return ""
    parts = [f"{c.label} with probability {percent(c.probability)}" for c in crossings]
    return (
        f"More than one crossing may set the limit: {', '.join(parts)}. A mean or a single best "
        "fit hides this; the quantiles do not."
    )


def doubtful(result: Result) -> str:
    """Which parameters a misfit makes doubtful; empty where none is."""
    found = doubtful_parameters(result)
    if not found:
        return ""
    if len(found) == len(result.analysis.model.names):
        (why,) = set(found.values())
        return f"None of these intervals is to be trusted: {why}."
    reasons = " or ".join(dict.fromkeys(found.values()))
    return (
        f"The intervals of {', '.join(found)} are not to be trusted ({reasons}): they may miss the "
        "true value by many times their width. That of the limit is widened for it."
    )


def widened(result: Result) -> str:
    """Which intervals a force or what is unexplained makes wider; empty where neither does."""
    analysis = result.analysis
    if analysis.widened is None:
        return ""
    ratio = analysis.widened.draws.std(axis=0) / analysis.posterior.draws.std(axis=0)
    worth = 1.1  # times the posterior's width, from which an interval was widened
    names = [n for n, more in zip(analysis.model.names, ratio, strict=True) if more > worth]
    if not names:
        return ""
    why = []
    if "nonlinear" in families_of(result):
        why.append("the force that was taken off is known with an error, its law never quite right")
    if is_unexplained(result):
        why.append("what is unexplained may bend the response that they are read from")
    return (
        f"The intervals of {', '.join(names)} are wider than the posterior's, as that of the limit "
        f"is: {', and '.join(why)}."
    )


def response_caption(result: Result) -> str:
    """Under the frequency response."""
    text = (
        "Measured response (empirical transfer function estimate) with error bars of two standard "
        "deviations"
    )
    if not result.analysis.sampled:
        return f"{text}; feedback biases it."
    text += (
        ", and the model's 90 % band. The band is often narrower than the line; the third panel "
        "shows it enlarged."
    )
    if result.analysis.etfe.direct:
        text += (
            " Feedback biases the points, most where the coherence is low; the model is fitted so "
            "that it is not biased, and need not go through them."
        )
    closed = result.closed
    if closed is not None and closed.effects and closed.force is None:
        text += " Dashed: the model as declared, before what it lacked was added" + (
            "; crosses: the response as it was measured." if correction(result) else "."
        )
    return text
