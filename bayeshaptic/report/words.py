"""Sentences of the report that are made from numbers."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bayeshaptic.report.estimates import own_limit
from bayeshaptic.report.figures.residuals import third_octaves
from bayeshaptic.report.headline import misfit_factor, misfit_is_clear
from bayeshaptic.report.quantities import estimate, interval, percent, pure, quantity

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis

_DELAY = "delay_s"


def misfit(analysis: Analysis, loop: bool = False) -> str:
    """How the residual compares with the noise, and where it is worst."""
    fit = analysis.fit
    order = np.argsort(fit.frequency_hz)
    bands = third_octaves(fit.frequency_hz[order], fit.residual[order])
    outside = bands.rms > bands.high
    worst = int(np.argmax(bands.rms))
    hertz = quantity(float(bands.frequency_hz[worst]), "Hz")
    place = f"{pure(bands.rms[worst], 2)} times the noise around {hertz}"
    chi = f"reduced chi-square {pure(fit.reduced_chi_square)}, where 1 is pure noise"
    if misfit_is_clear(analysis):
        then = (
            "What was tried stands above; the limit is widened for what is left."
            if loop
            else "Until the cause is found and added to the model, nothing here says how wrong "
            "the limit may be."
        )
        return (
            f"The model does not explain this recording: the residual is {misfit_factor(analysis)} "
            f"times the noise ({chi}). It stands out in {outside.sum()} of {len(outside)} third "
            f"octaves and is worst at {place}. {then}"
        )
    if outside.any():
        return (
            f"Overall the residual is no larger than the noise ({chi}), but {outside.sum()} of "
            f"{len(outside)} third octaves lie above what 99 % of pure noise stays below; the "
            f"highest is {place}."
        )
    return (
        f"The residual is what pure noise would leave ({chi}): all {len(outside)} third octaves "
        "lie below the level that 99 % of pure noise stays below."
    )


def convergence(analysis: Analysis) -> str:
    """The sampler's own sentence, and its size."""
    posterior = analysis.posterior
    ensembles, steps, walkers, _ = posterior.chains.shape
    message = posterior.message[:1].upper() + posterior.message[1:].rstrip(".")
    return (
        f"{message}. {ensembles} independent ensembles of {walkers} walkers took {steps} steps "
        f"each, {posterior.chains[..., 0].size:,} draws in {quantity(posterior.seconds, 's')}, "
        f"seed {posterior.seed}."
    )


def checked(analysis: Analysis) -> str:
    """What the spectral radius said about the limits."""
    limit = analysis.limit
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
    column = analysis.posterior.draws[:, model.names.index(_DELAY)]
    low, high = (float(v) for v in np.quantile(column, (0.05, 0.95)))
    return (
        "The loop delay beyond the hold is uncertain and was estimated with the other parameters: "
        f"{interval(low, high, 's')} (90 %)."
    )


def agreement(analysis: Analysis) -> str:
    """The model's limit beside the measurement's own."""
    limit, own = analysis.limit, own_limit(analysis)
    if own is None:
        why = getattr(analysis.etfe_limit, "reason", None)
        return (
            "No limit can be read from the measured response alone, without a model"
            f"{': ' + why if why else ''}. Crossings outside the band rest on the model."
        )
    low, measured, high = own
    middle = limit.quantile(0.5)
    if not (math.isfinite(middle) and middle > 0 and measured > 0):
        return "The model and the measurement cannot be compared: one of them has no limit."
    difference = 20 * math.log10(middle / measured)
    overlap = low <= limit.quantile(0.95) and limit.quantile(0.05) <= high
    side = "above" if difference > 0 else "below"
    verdict = "their 90 % intervals overlap" if overlap else "their 90 % intervals do not overlap"
    return (
        f"Read from the measured response alone, without a model, the limit is "
        f"{estimate(measured, low, high, limit.unit)}. The model's "
        f"median lies {abs(difference):.2f} dB {side} that, and {verdict}."
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
