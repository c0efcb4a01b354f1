"""Widening the critical stiffness by what remains unexplained, so that its interval stays true.

A linear remainder multiplies the response by exp(delta), delta a complex Gaussian process over log
frequency whose size and smoothness the residual itself decides (M. C. Kennedy and A. O'Hagan,
"Bayesian calibration of computer models", J. R. Statist. Soc. B 63, 2001).  A nonlinear remainder
would invent crossings there.  Where nothing of its class was found it widens the limit downwards
instead, and keeps its upper end; where an effect was found and leaves a rest, the limit is
uncertain by that share of how far the effect has moved it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.residuals.excess import changing_share, noise_besides
from bayeshaptic.diagnosis.traced import UNEXPLAINED, Traced, share_left
from bayeshaptic.diagnosis.widening.deviation import Deviation, deviation, evidence, matern, merged
from bayeshaptic.diagnosis.widening.forces_left import forces_left
from bayeshaptic.diagnosis.widening.friction import with_friction_for_damping
from bayeshaptic.effects.laws import variables
from bayeshaptic.effects.nonlinear.shapes import (
    ALONG,
    EXCESS_NOISE,
    LOAD_VELOCITY,
    STRETCH_VELOCITY,
    VELOCITY,
)
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.stability.binding import as_known, binding_kinds, group_crossings
from bayeshaptic.stability.critical import CriticalStiffness, critical_stiffness
from bayeshaptic.types import Complexes, Floats

# Log stiffness that a remainder of each class widens the limit by at least.
_LEAST = {"nonlinear": 0.12, "time-varying": 0.12, "measurement": 0.03}


def with_discrepancy(
    limit: CriticalStiffness,
    posterior: Posterior,
    base: Fit,
    traced: Traced,
    seed: int = 0,
) -> CriticalStiffness:
    """The limit with the spread of accepted effects and of what is unexplained.

    Parameters
    ----------
    limit : CriticalStiffness
        Of the model with the accepted effects.
    posterior : Posterior
        Whose draws it is of.
    base : Fit
        Of the model as declared.
    traced : Traced
        With the fit of the accepted effects, and what is left.
    seed : int
    """
    rng = np.random.default_rng(seed)
    limit = _with_effects(limit, traced, rng)
    limit = _with_rest(limit, posterior, base, traced, rng)
    count = len(limit.samples)
    if (changing := changing_at_limit(limit, traced)) > 0:
        limit = _times(limit, -_blurred(changing) * rng.random(count))
    if (noise := noise_besides(traced.state.fit, traced.state.etfe)) is not None:
        # In the record of the command, and not at the motor, it makes the response smaller by its
        # share: nobody knows which.
        limit = _times(limit, -np.log1p(noise.share) * rng.integers(2, size=count))
    return limit


def _times(limit: CriticalStiffness, log_factor: Floats) -> CriticalStiffness:
    """The limit of each draw times exp(`log_factor`)."""
    return replace(limit, samples=limit.samples * np.exp(log_factor))


def _with_effects(
    limit: CriticalStiffness, traced: Traced, rng: np.random.Generator
) -> CriticalStiffness:
    """The limit with what the accepted effects leave open of it, and how they go on."""
    accepted, count = traced.state.accepted, len(limit.samples)
    spread = np.sqrt(sum(effect.limit_log_sd**2 for effect in accepted))
    if spread > 0:
        limit = _times(limit, spread * rng.standard_normal(count))
    fall = sum(effect.limit_log_fall for effect in accepted)
    if fall > 0:  # a step stays where it is, a ramp goes on; neither goes much further
        beyond = 1.25  # times a steady ramp
        limit = _times(limit, -fall * rng.uniform(0.0, beyond, size=count))
    further = sum(effect.limit_log_further for effect in accepted)
    if further > 0:  # it has settled, or goes on: nobody knows
        limit = _times(limit, -further * (rng.integers(2, size=count) * rng.random(count)))
    return limit


def _with_rest(
    limit: CriticalStiffness,
    posterior: Posterior,
    base: Fit,
    traced: Traced,
    rng: np.random.Generator,
) -> CriticalStiffness:
    """The limit with what remains of the residual, one class after the other."""
    found = {effect.family for effect in traced.state.accepted}
    flagged = {test.family for test in traced.after if test.flagged}
    left = flagged if traced.verdict == UNEXPLAINED else set()
    if "linear" in left and not traced.state.etfe.direct:
        limit = _with_linear(limit, posterior, traced.state.fit, rng)
    elif traced.state.etfe.direct and _is_noticed(traced, "linear"):
        # Windows that feedback biases do not show how the response deviates.
        rest = _rest(base, traced, "linear")
        limit = _times(limit, rest * rng.uniform(-1.0, 1.0, size=len(limit.samples)))
    # A law of a force is never quite right, even where what it leaves would pass for noise.
    up = 0.25  # of the least way down, and up as well: a remainder biases either way
    for family in sorted((found & {"nonlinear"}) | (left - {"linear"})):
        if family in found:
            low, high = -1.0, 1.0
            width = max(_rest(base, traced, family), _LEAST[family] * (family in left))
        else:
            width = _downwards(traced, family)
            low, high = -1.0, _upwards(limit, width) + up * _LEAST[family] / width
        limit = _times(limit, width * rng.uniform(low, high, size=len(limit.samples)))
    return limit


def changing_at_limit(limit: CriticalStiffness, traced: Traced) -> float:
    """Share of the response's power that changes from moment to moment where the limit is.

    Zero where no noise of the device is left.

    Parameters
    ----------
    limit : CriticalStiffness
    traced : Traced
    """
    if traced.verdict != UNEXPLAINED:
        return 0.0
    if not any(test.flagged and test.name == EXCESS_NOISE for test in traced.after):
        return 0.0
    at = [c.frequency_hz for c in limit.crossings if c.frequency_hz]
    state = traced.state
    return max((changing_share(state.fit, state.etfe, frequency) for frequency in at), default=0.0)


def _is_noticed(traced: Traced, family: str) -> bool:
    """Whether a test of the class would be flagged without the allowance for a force taken off.

    It decides whether to widen, not by how much.
    """
    return any(test.family == family and test.noticed for test in traced.after)


def _upwards(limit: CriticalStiffness, width: float) -> float:
    """How far up a uniform factor must reach, relative to its reach down, to keep the 95 % point.

    Of a uniform variable from -1 to a, 5 % lie above a - 0.05 (1 + a).
    """
    q50, q95 = limit.quantile(np.array([0.5, 0.95]))
    reach = float(np.log(q95 / q50)) / width if 0 < q50 < np.inf else 0.0
    return (min(reach, 1.0) + 0.05) / 0.95


def _rest(base: Fit, traced: Traced, family: str) -> float:
    """How far, in log stiffness, the rest of an effect may take the limit either way.

    It is what tests still see of the effect, as a share of what they saw before, times how far the
    effect moved the limit.  In closed loop tests see a force faintly, or in the linear residual
    alone, so that half of what they saw is noise and the share says little: there each test says
    how strong a force it still sees.
    """
    fit = traced.state.fit
    if family == "nonlinear" and traced.state.etfe.direct:
        return min(forces_left(fit, traced.after).limit_log, thresholds.FARTHEST)
    if family == "nonlinear":
        base = traced.without_forces or base
    limits = [critical_stiffness(one.model, one.theta).value for one in (base, fit)]
    moved = abs(float(np.log(max(limits[0], 1e-9) / max(limits[1], 1e-9))))
    return share_left(traced, family) * min(moved, thresholds.FARTHEST)


def _downwards(traced: Traced, family: str) -> float:
    """How far down, in log stiffness, a remainder of another class may take the limit."""
    fit = traced.state.fit
    here = critical_stiffness(fit.model, fit.theta).value
    others = [
        critical_stiffness(trial.state.model, trial.state.fit.theta).value
        for trial in traced.rejected
        if trial.accepted.family == family
    ]
    raised = {test.name for test in traced.after if test.flagged}
    if STRETCH_VELOCITY in variables(raised):
        less = with_friction_for_damping(fit, dampers=("bc",))
        others.append(critical_stiffness(fit.model, less).value)
    if {VELOCITY, LOAD_VELOCITY, ALONG} & variables(raised):
        others.append(critical_stiffness(fit.model, with_friction_for_damping(fit)).value)
    elif family == "nonlinear" and EXCESS_NOISE in raised:
        less = with_friction_for_damping(fit, traced.state.etfe)
        others.append(critical_stiffness(fit.model, less).value)
    if here == 0:  # never stable: it cannot go further down
        return _LEAST[family]
    lowest = min([here, *others])
    return max(_LEAST[family], float(np.log(here / max(lowest, 1e-3 * here))))


def _blurred(share: float) -> float:
    """How far down, in log stiffness, the limit may be where this share of the response changes.

    Of a mode that wanders a recording shows the mean, which is flatter and wider than the mode ever
    is.  Over a mode 1 / (1 + j d) at its top, d being the distance from there, the mean of the real
    part equals the mean of the power.  The limit of the mean response is therefore too high by the
    ratio of the mean power to the power of the mean, which is one plus the share that changes.

    Friction in the mode (a cable that slips) damps it, and stops damping in small motions.  Of the
    power of the sign of a normal variable 2 / pi is linear and the rest is noise, half of which
    stays around a mode: the share that changes is 0.28 times the square of friction's share of the
    damping.

    Both are derived, not measured.  A quarter is added because a mode is never alone and never all
    of the response, and a twentieth of the damping is taken to be viscous.
    """
    beyond, of_friction, least = 1.25, 0.28, 0.05
    rubs = float(np.sqrt(share / of_friction))
    return max(beyond * float(np.log1p(share)), -float(np.log(max(1 - rubs, least))))


def _draws_of_deviation(
    found: Deviation, at: Floats, count: int, rng: np.random.Generator
) -> Complexes:
    """Draws of delta at log frequencies `at`, over sizes and lengths by their evidence."""
    cases, weight = evidence(found)
    picked = rng.multinomial(count, weight)
    between = found.log_f[:, None] - found.log_f[None, :]
    parts = []
    for (size, length), number in zip(cases, picked, strict=True):
        if number == 0:
            continue
        own = size**2 * matern(between, length) + np.diag(found.variance)
        cross = size**2 * matern(at[:, None] - found.log_f[None, :], length)
        back = np.linalg.solve(own, cross.T).T
        mean = back @ found.value
        cover = size**2 * matern(at[:, None] - at[None, :], length) - back @ cross.T
        values, vectors = np.linalg.eigh(cover)
        root = vectors * np.sqrt(np.maximum(values, 0))
        normal = rng.standard_normal((2, len(at), number))
        parts.append(mean[:, None] + root @ (normal[0] + 1j * normal[1]) / np.sqrt(2))
    return np.concatenate(parts, axis=1).T


def _with_linear(
    limit: CriticalStiffness, posterior: Posterior, fit: Fit, rng: np.random.Generator
) -> CriticalStiffness:
    """Crossings of G exp(delta) over draws of both."""
    period = fit.model.period_s
    assert period is not None
    grid = 1500
    frequency = np.geomspace(0.05 * fit.frequency_hz.min(), 0.5 / period, grid)
    bend, _ = merged(deviation(fit))
    # Below the band the mechanism alone speaks; above it the deviation may go on.
    beyond = np.arange(bend.log_f[-1] + 0.05, np.log10(frequency[-1]), 0.05)
    knots = np.concatenate([bend.log_f, beyond])
    draws = 2000
    delta = _draws_of_deviation(bend, knots, draws, rng)
    rng.shuffle(delta)
    knots = np.concatenate([[knots[0] - 0.1], knots])
    delta = np.concatenate([np.zeros((draws, 1)), delta], axis=1)
    pick = rng.integers(len(posterior.draws), size=draws)
    samples, places = np.empty(draws), np.empty(draws)
    log_f = np.log10(frequency)
    step = 100
    for start in range(0, draws, step):
        rows = slice(start, start + step)
        g = fit.model.response(posterior.draws[pick[rows]], frequency)
        bent = np.stack(  # interpolated over log frequency
            [
                np.interp(log_f, knots, d.real) + 1j * np.interp(log_f, knots, d.imag)
                for d in delta[rows]
            ]
        )
        with np.errstate(all="ignore"):  # draws that overflow cross nowhere
            samples[rows], places[rows] = _lowest_crossing(g * np.exp(bent), frequency)
    kept = np.isfinite(samples)
    samples, places = samples[kept], places[kept]
    # A bent response may cross where none of the model's draws does: by what moves there.
    system = fit.model.system(posterior.draws[pick[kept]])
    bound = group_crossings(binding_kinds(system, places, period), places)
    crossings, group = as_known(*bound, limit.crossings)
    return CriticalStiffness(samples, places, limit.unit, crossings, group, notices=limit.notices)


def _lowest_crossing(g: Complexes, frequency: Floats) -> tuple[Floats, Floats]:
    """Smallest -1/Re G where Im G changes sign with Re G negative, and where that is.

    Infinite where it never does.
    """
    inverse = -1 / g
    before, after = inverse[:, :-1], inverse[:, 1:]
    share = before.imag / (before.imag - after.imag)
    stiffness = before.real + share * (after.real - before.real)
    turns = (before.imag * after.imag <= 0) & (stiffness > 0)
    stiffness = np.where(turns, stiffness, np.inf)
    index = np.argmin(stiffness, axis=1)
    rows = np.arange(len(g))
    place = frequency[index] + share[rows, index] * np.diff(frequency)[index]
    return stiffness[rows, index], place
