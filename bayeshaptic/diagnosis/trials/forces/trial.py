"""What fitted forces would mean: the state with them, and what it would be worth."""

from __future__ import annotations

from dataclasses import replace

from bayeshaptic.diagnosis.state import Accepted, Estimate, State, Trial, describe_gain
from bayeshaptic.diagnosis.trials.forces.in_doubt import in_doubt
from bayeshaptic.diagnosis.trials.forces.tryout import Point, Tryout
from bayeshaptic.effects.nonlinear.internal_force import CONNECTION, LOAD
from bayeshaptic.effects.nonlinear.protocol import Acting, CommandEffect, NonlinearEffect
from bayeshaptic.inference.fit import Fit, summarise
from bayeshaptic.inference.least_squares import polish
from bayeshaptic.models import Model
from bayeshaptic.models.parameter import unit_of
from bayeshaptic.recordings.response.estimators.random_excitation import points as points_of
from bayeshaptic.recordings.response.etfe import Etfe


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
    found = points_of(etfe.spectra.windows(fit.response))
    return replace(
        etfe,
        frequency_hz=found.frequency_hz,
        value=found.value,
        variance=found.variance,
        coherence=found.coherence,
    )


def _where(effect: NonlinearEffect) -> str:
    if isinstance(effect, CommandEffect):
        return ""
    where = {CONNECTION: " in the connection", LOAD: " at the load"}.get(
        effect.place, " at the motor"
    )
    return "" if effect.title.endswith(where) else where
