"""Trying drift: the recording in parts, some of the parameters free to differ between them.

The critical stiffness is then that of the worst part, and lower by what a drift that goes on does
between the middle of that part and its end, and after it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.residuals.drift import drift_tests
from bayeshaptic.diagnosis.state import Accepted, Estimate, State, Trial, fit_part, log_likelihoods
from bayeshaptic.effects.effect import LinearEffect
from bayeshaptic.effects.linear.extra_delay import ExtraDelay
from bayeshaptic.effects.linear.gain import Gain
from bayeshaptic.errors import InputError
from bayeshaptic.inference.fit import summarise
from bayeshaptic.inference.least_squares import least_squares, polish
from bayeshaptic.models import Model
from bayeshaptic.models.structures import HAND
from bayeshaptic.numerics.spending import Meter
from bayeshaptic.recordings.checks.sufficiency import shortest_s
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import Etfe, compress
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.types import Floats

PARTS = 3
# Share of the parts' misfit (reduced chi-squares above one) that a drift may leave. In the 11
# recordings that this was chosen on, drifts of the wrong kind leave 0.10 to 1 of it; the right ones
# leave at most 0.06, and less than noise, but for a step within a part (0.13, and more than noise:
# refused). Rates are not counted.
_LEFT = 0.3
# Share of the drift test's statistic that a steadied gain may leave: it leaves at most 0.05 in 60
# recordings whose gain drifts (statistics of 50 to 50,000), and 0.23 to 0.87 in 16 whose damper
# drifts, where a drift of the gain convinces all the same.
_UNSTEADY = 0.1
_KNOWN = 1.0  # log change from part to part: a parameter with more is one that parts do not see


@dataclass(frozen=True)
class _Kind:
    """Which parameters may drift together."""

    name: str
    title: str
    parameters: tuple[str, ...]


_GRIP = _Kind("grip_drift", "a grip that changes during the recording", HAND)
_GAIN = _Kind("gain_drift", "a gain that changes during the recording", ("gain",))
_DEVICE = _Kind(
    "device_drift", "a device that changes during the recording", ("b1", "bc", "kc", "b2", "m", "b")
)
_DELAY = _Kind(
    "delay_drift", "a delay that changes during the recording", ("delay_s", "extra_delay_s")
)
# What nobody declared, and is not seen but by its changes, joins the model: gain and delay.
_JOINS: dict[_Kind, type[LinearEffect]] = {_GAIN: Gain, _DELAY: ExtraDelay}


def drift_trials(state: State, meter: Meter) -> list[Trial]:
    """One trial for each group of parameters that may drift; none for short recordings.

    `meter` says whether one more is affordable.
    """
    recording = state.etfe.recording
    if recording is None or recording.duration_s < PARTS * shortest_s(recording.period_s):
        return []
    edges = np.linspace(0, recording.samples, PARTS + 1).astype(int)
    try:
        parts = [
            estimate_etfe(recording.part(a, b), state.etfe.band_hz, minimum_lines=12)
            for a, b in zip(edges[:-1], edges[1:], strict=True)
        ]
    except InputError:
        return []
    trials = []
    for kind in (_GRIP, _GAIN, _DEVICE, _DELAY):
        model = state.model
        for joining in _JOINS[kind].candidates(model, state.etfe) if kind in _JOINS else ():
            model = model.with_effect(joining)
        own = any(name in model.names for name in kind.parameters)
        if own and meter.affords(kind.title):
            meter.trying(kind.title)
            trials.append(_try(state, kind, model, parts))
    return trials


def _start(state: State, model: Model) -> dict[str, float]:
    """Where the parts begin: the fit, with a delay that is not the declared one if that may be."""
    start = {"gain": 1.0, "extra_delay_s": 0.0}
    start |= dict(zip(state.model.names, state.fit.theta, strict=True))
    if "extra_delay_s" in model.names and "extra_delay_s" not in state.model.names:
        theta = np.array([start[name] for name in model.names])
        fit = least_squares(model, state.etfe, start=theta)
        start = dict(zip(model.names, fit.theta, strict=True))
    return start


@dataclass(frozen=True)
class _Course:
    """The parameters that may drift, fitted to each part of the recording.

    Attributes
    ----------
    start : mapping of str to float
        Values in the whole recording.
    model : Model
        With all parameters known but those that may drift.
    found : ndarray, shape (parts, P)
        Their values in each part.
    gains : ndarray, shape (2,)
        Log likelihood that they gain, summed over the parts; see `log_likelihoods`.
    excess : ndarray, shape (2,)
        Reduced chi-squares above one, summed over the parts, before and after.
    """

    start: dict[str, float]
    model: Model
    found: Floats
    gains: Floats
    excess: Floats


def _course(state: State, kind: _Kind, model: Model, parts: list[Etfe]) -> _Course:
    start = _start(state, model)
    known = {name: start[name] for name in model.names if name not in kind.parameters}
    narrow = model.with_known(known)
    gains, excess = np.zeros(2), np.zeros(2)
    found = []
    for part in parts:
        windows = compress(part, state.fit.response)
        as_before = np.array([start[name] for name in narrow.names])
        theta = fit_part(narrow, windows, as_before)
        ways = (as_before, theta)
        before, after = (log_likelihoods(narrow, windows, way) for way in ways)
        gains += after - before
        excess += [max(summarise(narrow, windows, way).reduced_chi_square - 1, 0) for way in ways]
        found.append(theta)
    return _Course(start, narrow, np.stack(found), gains, excess)


def _try(state: State, kind: _Kind, model: Model, parts: list[Etfe]) -> Trial:
    course = _course(state, kind, model, parts)
    narrow, gains = course.model, course.gains
    limits = critical_stiffness(narrow, course.found).samples
    ends = critical_stiffness(narrow, _ends(course.found)).samples
    worst = int(np.argmin(limits))
    size = narrow.size * (PARTS - 1)
    accepted = Accepted(
        kind.name,
        kind.title,
        "time-varying",
        f"letting {', '.join(narrow.names)} differ between {PARTS} parts of the recording raises "
        f"the log likelihood of windows it was not fitted to by {gains[1]:.0f}; the limit is that "
        f"of part {worst + 1}",
        _estimates(course) | {"worst_part": Estimate(worst + 1.0, 0.0, "")},
        limit_log_fall=0.0 if kind is _GAIN else _fall(limits, ends),
        limit_log_further=_further(limits) if kind in (_DEVICE, _DELAY) else 0.0,
    )
    changed, good = state, thresholds.convincing(gains[0], gains[1], size)
    if good and kind is _GAIN:
        changed, spread = _with_steady_gain(state, narrow, course.start)
        accepted = replace(accepted, limit_log_sd=spread)
    elif good:
        changed = _in_part(state, model, parts[worst], course, worst)
    changed = replace(changed, accepted=(*state.accepted, accepted))
    # The state shows the worst part; the others count as well. A steady gain shows all of them, and
    # is one that drifts only if they are alike then.
    all_along = bool(course.excess[1] <= min(_LEFT * course.excess[0], PARTS))
    if kind is _GAIN:
        all_along = not good or _is_steady(state, changed)
    return Trial(accepted, changed, float(gains[0]), float(gains[1]), size, all_along)


def _in_part(state: State, model: Model, part: Etfe, course: _Course, number: int) -> State:
    """The state of one part of the recording, with which the loop goes on."""
    best = course.start | dict(zip(course.model.names, course.found[number], strict=True))
    theta = np.array([best[name] for name in model.names])
    return replace(state, etfe=part, fit=least_squares(model, part, start=theta))


def _is_steady(before: State, after: State) -> bool:
    """Whether what drifted was the gain: the recording with a steady one hardly changes."""
    was, now = (drift_tests(state.fit, state.etfe) for state in (before, after))
    seen = max((test.statistic for test in was), default=0.0)
    return not any(
        test.statistic > max(thresholds.MENDED * test.threshold, _UNSTEADY * seen) for test in now
    )


def _fall(limits: Floats, ends: Floats) -> float:
    """How much log K_CR falls from the middle of the worst part to the worse end of the recording.

    At least half of a steady ramp's fall from the part beside it, if the worst is the first or the
    last.  Another crossing may bind at an end, one that every part is far from: a limit that rises
    with the grip, part by part, may be lowest where the grip is firmest.

    Parameters
    ----------
    limits, ends : ndarray
        K_CR of every part, and of the parameters at both ends.
    """
    worst = int(np.argmin(limits))
    if limits[worst] <= 0:
        return 0.0
    falls = [float(np.log(limits[worst] / end)) for end in ends if end > 0]
    if worst in (0, len(limits) - 1):
        beside = limits[1] if worst == 0 else limits[-2]
        falls.append(0.5 * float(np.log(beside / limits[worst])))
    return max([0.0, *falls])


def _further(limits: Floats) -> float:
    """How much log K_CR may fall after the recording: as much again as in it, if to its end.

    What settles as exp(-t / tau) goes less far than that after a recording longer than tau.
    """
    if limits[-1] > 0 and np.argmin(limits) == len(limits) - 1:
        return float(np.log(limits[0] / limits[-1]))
    return 0.0


def _ends(found: Floats) -> Floats:
    """Parameters at both ends of the recording, (2, P): half a part on, as they drift all along."""
    with np.errstate(divide="ignore", invalid="ignore"):
        rate = np.log(found[-1] / found[0]) / (len(found) - 1)  # a part
    known = np.abs(rate) < _KNOWN  # not a number where both are zero
    further = np.where(known, np.exp(0.5 * np.where(known, rate, 0.0)), 1.0)
    return np.stack([found[0] / further, found[-1] * further])


def _with_steady_gain(state: State, narrow: Model, start: dict[str, float]) -> tuple[State, float]:
    """The recording with its command scaled by the gain found over time, and log K_CR's spread.

    The gain is set to one where it is largest: there the loop is nearest to instability, and the
    critical stiffness in units of the command is lowest.  How well that is known the roughness of
    the course tells.
    """
    from scipy.interpolate import CubicSpline

    recording = state.etfe.recording
    assert recording is not None
    gain_part_s = 3.0
    count = int(np.clip(recording.duration_s / gain_part_s, PARTS, 12))
    edges = np.linspace(0, recording.samples, count + 1).astype(int)
    gains = []
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        part = estimate_etfe(recording.part(a, b), state.etfe.band_hz, minimum_lines=12)
        windows = compress(part, state.fit.response)
        gains.append(float(polish(narrow, windows, np.array([start["gain"]]))[0]))
    centres = 0.5 * (edges[:-1] + edges[1:])
    course = CubicSpline(centres, gains, bc_type="natural")
    ends = [course(centres[0]) - course(centres[0], 1) * (centres[0] - edges[0])]
    ends.append(course(centres[-1]) + course(centres[-1], 1) * (edges[-1] - centres[-1]))
    times = np.concatenate([[edges[0]], centres, [edges[-1]]])
    gain = np.interp(np.arange(recording.samples), times, [ends[0], *gains, ends[1]])
    steady = replace(recording, force=recording.force * gain / gain.max())
    etfe = estimate_etfe(steady, state.etfe.band_hz)
    fit = least_squares(state.model, etfe, start=state.fit.theta)
    return replace(state, etfe=etfe, fit=fit), _edge_error(np.array(gains)) / float(gain.max())


def _edge_error(gains: Floats) -> float:
    """Standard deviation of a course's end, from what neighbours do not share with each other."""
    # Second differences of independent errors have six times their variance, half a step beyond
    # the last of them, 1.5 g0 - 0.5 g1, two and a half times.
    return float(np.sqrt(np.mean(np.diff(gains, 2) ** 2) / 6 * 2.5))


def _estimates(course: _Course) -> dict[str, Estimate]:
    """Last part over first, for every parameter that was free; of a delay, how much later."""
    estimates = {}
    for i, name in enumerate(course.model.names):
        first, last = float(course.found[0, i]), float(course.found[-1, i])
        if name in _DELAY.parameters:
            estimates["change_of_delay_s"] = Estimate(last - first, float("nan"), "s")
        elif first > 0:
            estimates[f"{name}_last_over_first"] = Estimate(last / first, float("nan"), "")
    return estimates
