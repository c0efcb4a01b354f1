"""Trying ripples along the way: the recording with the force that the motor gave."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.residuals.ripples import (
    WAVES,
    Ripple,
    Wave,
    find_ripple,
    place_of_action,
)
from bayeshaptic.diagnosis.state import (
    Accepted,
    Estimate,
    State,
    Trial,
    describe_gain,
    log_likelihoods,
)
from bayeshaptic.effects.linear.centring_stiffness import CentringStiffness
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.numerics.spending import Meter
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import compress
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.types import Floats

_SIZE = 3  # parameters: the period, and both parts of the ripple
_MOST = 0.9  # of the mean gain that a ripple may be


def ripple_trials(state: State, raised: set[str], meter: Meter) -> list[Trial]:
    """One trial for each ripple that a test has raised.

    Parameters
    ----------
    state : State
    raised : set of str
        Names of tests.
    meter : Meter
    """
    recording = state.etfe.recording
    trials = []
    for wave in WAVES:
        if recording is None or wave.test not in raised or not meter.affords(wave.title):
            continue
        meter.trying(wave.title)
        ripple = find_ripple(wave, state.fit, state.etfe)
        if ripple is not None and (trial := _try(state, recording, wave, ripple)) is not None:
            trials.append(trial)
    return trials


def _try(state: State, recording: Recording, wave: Wave, ripple: Ripple) -> Trial | None:
    if wave.of_the_gain and ripple.size > _MOST:
        return None
    given = _given(state, recording, wave, ripple)
    etfe = estimate_etfe(replace(recording, force=given), state.etfe.band_hz)
    fit = least_squares(state.model, etfe, start=state.fit.theta)
    before, after = (
        log_likelihoods(one.model, compress(of, one.response), one.theta)
        for of, one in ((state.etfe, state.fit), (etfe, fit))
    )
    gains = after - before
    unit = "" if wave.of_the_gain else recording.force_unit
    accepted = Accepted(
        wave.effect,
        wave.title,
        "nonlinear",
        f"{wave.title} {describe_gain(float(gains[1]))}; the limit is that of the worst place",
        {
            "ripple": Estimate(ripple.size, ripple.sd, unit),
            "ripple_period": Estimate(
                2 * np.pi / ripple.rate, float("nan"), recording.position_unit
            ),
        },
        limit_log_sd=_log_sd(ripple) if wave.of_the_gain else 0.0,
        limit_log_fall=0.0 if wave.of_the_gain else _lowered(State(etfe, fit), ripple),
    )
    changed = State(etfe, fit, (*state.accepted, accepted))
    return Trial(accepted, changed, float(gains[0]), float(gains[1]), _SIZE)


def _given(state: State, recording: Recording, wave: Wave, ripple: Ripple) -> Floats:
    """The force of the motor, shape (N,).

    Of a gain over the largest: there the loop is nearest to instability, and the critical
    stiffness in units of the command is lowest.
    """
    at = ripple.at(place_of_action(state.fit, recording))
    if wave.of_the_gain:
        return np.asarray(recording.force * (1 + at) / (1 + ripple.size))
    return np.asarray(recording.force + at)


def _log_sd(ripple: Ripple) -> float:
    """Of log K_CR, as the largest gain is known: no motor's ripple is one sine."""
    return float(np.hypot(ripple.sd, thresholds.LAW_SD * ripple.size)) / (1 + ripple.size)


def _lowered(state: State, ripple: Ripple) -> float:
    """How much log K_CR is lower where cogging is stiffest: a spring to the frame."""
    model, values = state.model, dict(zip(state.model.names, state.fit.theta, strict=True))
    (spring,) = CentringStiffness.candidates(model, state.etfe)
    (parameter,) = spring.parameters
    stiffer = model.with_effect(spring)
    values[parameter.name] = ripple.size * ripple.rate
    theta = np.array([values[name] for name in stiffer.names])
    limits = (critical_stiffness(model, state.fit.theta), critical_stiffness(stiffer, theta))
    here, there = (max(float(limit.value), 1e-300) for limit in limits)
    return float(np.clip(np.log(here / there), 0.0, thresholds.FARTHEST))
