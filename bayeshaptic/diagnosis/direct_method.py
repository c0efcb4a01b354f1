"""Closing the loop on a recording that was made in feedback, by the direct method.

The direct method fits all lines of the spectrum alike, so that feedback does not bias the fit,
whatever the controller was (`recordings/response/estimators/direct.py`).
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np

from bayeshaptic.diagnosis.analyse import NO_WITNESS, finish
from bayeshaptic.diagnosis.analysis import Analysis
from bayeshaptic.diagnosis.base.begun import fitted
from bayeshaptic.diagnosis.base.best_direct import traced_directly
from bayeshaptic.diagnosis.base.direct import against_direct, opened_directly
from bayeshaptic.diagnosis.base.free_motion import by_free_motion
from bayeshaptic.diagnosis.base.opened import Opened
from bayeshaptic.diagnosis.closed import Closed, limit_alone
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.diagnosis.trials.direct import stands
from bayeshaptic.diagnosis.widening.discrepancy import with_discrepancy
from bayeshaptic.diagnosis.widening.law_error import with_law_error
from bayeshaptic.diagnosis.widening.rivals import with_rivals
from bayeshaptic.errors import InputError
from bayeshaptic.inference.fit import Fit
from bayeshaptic.models import Model
from bayeshaptic.numerics.spending import RATE, Meter, counting
from bayeshaptic.stability.from_etfe import EtfeCriticalStiffness


def by_direct_method(
    found: Opened, model: str | Model, options: Options, longest: bool = False
) -> Closed | Opened:
    """The closed loop by the direct method; or `found`, with a notice of what speaks against it.

    The method is not for one mass, which is followed in time with its friction.  Its fit stands
    where linear effects and dry friction leave noise, or next to it; where more is left, `found` is
    handed back and analysed in another way.

    Parameters
    ----------
    found : Opened
    model : str or Model
        As asked for.
    options : Options
    longest : bool
        See `opened_directly`.
    """
    lines = opened_directly(found, options, longest)
    if lines is None:
        return found
    try:
        begun = fitted(lines, model, options.within(0.0, 0.3))
    except InputError:
        return found
    began = time.perf_counter()
    trying = options.within(0.3, 0.5)
    meter = Meter(options.budget_s * RATE, tick=lambda title: trying.report(0.5, f"trying {title}"))
    with counting(meter):
        begun, traced = traced_directly(begun, meter)
    tracing_s = time.perf_counter() - began
    fit = traced.state.fit
    if not stands(traced) or fit.impossible:
        against = against_direct(fit, traced.before, found.etfe.through_reference)
        return replace(found, notices=(*found.notices, *against))
    if fit.model.name == "rigid":
        return found
    nothing = EtfeCriticalStiffness(None, None, None, None, fit.model.stiffness_unit, NO_WITNESS)
    sharper, accepted = by_free_motion(traced.state), traced.state.accepted
    of_base = None if accepted else sharper
    base = finish(begun, begun.etfe, begun.fit, options.within(0.5, 0.7), True, nothing, of_base)
    analysis = base
    if accepted:
        etfe, seed, last = traced.state.etfe, options.seed, options.within(0.7, 0.95)
        analysis = finish(begun, etfe, fit, last, witness=nothing, sharper=sharper)
        limit, traced = with_rivals(analysis.limit, traced, seed)
        limit = with_discrepancy(limit, analysis.posterior, begun.fit, traced, seed)
        analysis = replace(
            analysis,
            limit=limit,
            widened=with_law_error(analysis.posterior, begun.fit, traced, seed),
            recording=begun.etfe.recording,
            seconds={**analysis.seconds, "closing the loop": tracing_s},
        )
    before, after = _error(base, begun.fit, fit), _error(analysis, fit, fit)
    return Closed(base, analysis, traced, before, after)


def _error(analysis: Analysis, fit: Fit, last: Fit) -> dict[str, Any]:
    """The limit, and what a fit leaves over the noise: that is what the last fit leaves."""
    left = fit.likelihood.noise_variance / last.likelihood.noise_variance
    return {**limit_alone(analysis), "weighted_rms": float(np.sqrt(left.mean()))}
