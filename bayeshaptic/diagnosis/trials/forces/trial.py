"""What fitted forces would mean: the state with them, its worth, and what they leave open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.state import Accepted, Estimate, State, Trial, describe_gain
from bayeshaptic.diagnosis.trials.forces.slopes import spread
from bayeshaptic.diagnosis.trials.forces.tryout import Point, Tryout
from bayeshaptic.effects.nonlinear.internal_force import CONNECTION, LOAD
from bayeshaptic.effects.nonlinear.protocol import Acting, CommandEffect, NonlinearEffect
from bayeshaptic.inference.fit import Fit, search_box, summarise
from bayeshaptic.inference.least_squares import polish
from bayeshaptic.models import Model
from bayeshaptic.models.parameter import unit_of
from bayeshaptic.recordings.response.estimate import mean_of_longest
from bayeshaptic.recordings.response.estimators.random_excitation import points as points_of
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.types import Floats


def force_trial(tryout: Tryout, point: Point) -> Trial:
    """The trial of the point's last force, with those before it as they are beside it."""
    theta = polish(tryout.model, point.windows, point.theta)
    fit = summarise(tryout.model, point.windows, theta)
    accepted = _accepted(tryout, point)
    state = State(_with_points(point.etfe, fit), fit, accepted)
    # Those before it may have got simpler beside it, or not.
    size = 1 + sum(len(force.effect.shape) for force in point.forces)
    return Trial(accepted[-1], state, point.gain_fit, point.gain_choose, size)


def _accepted(tryout: Tryout, point: Point) -> tuple[Accepted, ...]:
    """What is accepted with a point: forces before it are what they are beside the new one."""
    (*earlier, own), (*sds, own_sd), limit_log_sd = point.changes, *in_doubt(tryout, point)
    effect = point.effect
    new = Accepted(
        effect.name,
        effect.title + _where(effect),
        effect.family,
        describe_gain(point.gain_choose),
        _estimates(tryout.model, point.forces[-1], own_sd),
        ties=effect.ties,
        told_apart_by=effect.told_apart_by,
        limit_log_sd=limit_log_sd,
        change=own,
    )
    there = iter(zip(earlier, sds, strict=True))
    found = []
    for one in tryout.state.accepted:
        if one.change and one.change.acting:
            change, sd = next(there)
            assert change.acting
            law = change.acting.effect  # a simpler one, perhaps
            one = replace(
                one,
                name=law.name,
                title=law.title + _where(law),
                estimates=_estimates(tryout.model, change.acting, sd),
                change=change,
                # What the earlier force leaves open is counted in the new one's; what another law
                # of it would change is not.
                limit_log_sd=one.limit_log_sd if one.ties else 0.0,
            )
        found.append(one)
    return (*found, new)


def _estimates(model: Model, force: Acting, sd: float) -> dict[str, Estimate]:
    """Strength and shape."""
    effect, units = force.effect, (model.force_unit, model.position_unit)
    name, dimension = effect.strength
    found = {name: Estimate(force.strength, sd, unit_of(dimension, *units))}
    for key, value in effect.shape.items():
        found[key] = Estimate(value, float("nan"), unit_of(effect.dimensions[key], *units))
    return found


def _with_points(etfe: Etfe, fit: Fit) -> Etfe:
    """With what a person sees of it made from its own spectra."""
    parts = tuple(_with_points(part, fit) for part in etfe.parts)
    found = mean_of_longest(parts) if parts else points_of(etfe.spectra.windows(fit.response))
    return replace(
        etfe,
        frequency_hz=found.frequency_hz,
        value=found.value,
        variance=found.variance,
        coherence=found.coherence,
        parts=parts,
    )


def _where(effect: NonlinearEffect) -> str:
    if isinstance(effect, CommandEffect):
        return ""
    where = {CONNECTION: " in the connection", LOAD: " at the load"}.get(
        effect.place, " at the motor"
    )
    return "" if effect.title.endswith(where) else where


def in_doubt(tryout: Tryout, point: Point) -> tuple[list[float], float]:
    """Standard deviations of the strengths, and of log K_CR because of strengths and shapes.

    Parameters
    ----------
    tryout : Tryout
    point : Point
        Fitted.

    Returns
    -------
    strengths : list of float, one a force
    limit_log_sd : float
        1 at most.
    """
    covariance, along = spread(tryout, point)
    tuned = [len(one.effect.tuned) for one in point.forces]
    strengths = np.cumsum([0, *(1 + count for count in tuned[:-1])])
    here, low, high = search_box(tryout.model)
    step = 1e-3
    sides = here.coordinate(point.theta[None]) + step * np.concatenate([along.T, -along.T])
    more, less = _log_limits(tryout, here.natural(np.clip(sides, low, high))).reshape(2, -1)
    slope = (more - less) / (2 * step)
    by_law = _by_law(tryout, point, thresholds.LAW_SD * float(np.linalg.norm(slope[strengths])))
    relative = np.sqrt(np.diag(covariance)[strengths] + thresholds.LAW_SD**2)
    sds = np.minimum(relative, 0.5) * [abs(one.strength) for one in point.forces]
    return sds.tolist(), min(float(np.sqrt(slope @ covariance @ slope + by_law**2)), 1.0)


def _by_law(tryout: Tryout, point: Point, by_slopes: float) -> float:
    """How far log K_CR goes with the error of a law.

    The slope of the limit at the fit is used, within bounds: at least, in proportion, the way that
    the linear parameters went when the forces were taken off, and at most twice that.  The slope
    alone holds no further than the force is known, perhaps a thousandth of the law's error.  For
    three of nine forces it said 0.04, 0.05 and 0.61, where fits with that much more and less of the
    force moved the limit by 0.23, 0.93 and 0.02; the bounded value is 0.21, 1.9 and 0.02.
    """
    here, *ends = search_box(tryout.model)
    low, high = (here.natural(end[None])[0] for end in ends)
    moved = thresholds.LAW_SD * (point.theta - tryout.simulation.usual)
    limits = _log_limits(
        tryout, np.clip(point.theta + np.outer([0.0, -1.0, 1.0], moved), low, high)
    )
    on_the_way = float(np.abs(limits - limits[0]).max())
    return min(max(by_slopes, on_the_way), 2 * on_the_way)


def _log_limits(tryout: Tryout, theta: Floats) -> Floats:
    return np.log(np.maximum(critical_stiffness(tryout.model, theta).samples, 1e-9))
