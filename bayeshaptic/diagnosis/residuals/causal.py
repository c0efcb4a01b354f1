"""Is the model right, where feedback may bias the response?  Scores of causal changes tell.

Around the fit of a direct likelihood (`recordings/response/estimators/direct.py`) every window may
deviate, by as much as the controller makes of the noise.  What must vanish is the sum over all of
them of the score of any change that is causal: of the response by a filter, of the motion by a
force, of a parameter in time.  Its variance is that of a regression in which the noise itself
excites nothing.

An encoder's rounding is not quite a noise that knows nothing of the motion, and the scores are
large beside it where a device moves by few counts, or for a few seconds.  What was measured less
the fitted motion, rounded likewise, knows nothing of it, and is nothing where the model is right.
And a hand's own motion falls steeply within the lowest windows: as steeply as what the model leaves
says, where a window's own response takes some of it for the controller's answer.  So what is
flagged is looked at a second time, with both known: what stands out of one of the two alone is
noise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.residuals.columns import columns, force_test
from bayeshaptic.diagnosis.residuals.drift import SHAPES
from bayeshaptic.diagnosis.residuals.lines import Lines
from bayeshaptic.diagnosis.residuals.residual import ForceSeen, Test, chi_square_score
from bayeshaptic.diagnosis.residuals.unforced import fitted_motion
from bayeshaptic.inference.coordinates import believed, coordinates
from bayeshaptic.inference.fit import Fit
from bayeshaptic.recordings.response.estimators.direct import DirectSpectra
from bayeshaptic.recordings.response.estimators.noise_slope import noise_slopes
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.types import Complexes, Floats

# Clean loops that they flag, and what rubs: docs/closed-loop.md.
_FILTERS = 12  # of first and of second order, evenly over log frequency
_DAMPED = 0.2  # damping ratio of those of second order
# Share of a change's power that is none of the parameters', from which on it is one: of the
# response, where a parabola in each window stands for no finer difference, and of a motion.
_LEAST, _LEAST_MOTION = 1e-5, 1e-8
_STEP = 1e-5


@dataclass(frozen=True)
class Scores:
    """Scores of changes, each over its size, and their covariance where the model is true."""

    score: Floats
    covariance: Floats
    size: Floats

    def beside(self, count: int) -> Scores:
        """The scores of all but the first `count` changes, with what those can do taken off."""
        known, new = slice(0, count), slice(count, None)
        inverse = np.linalg.pinv(self.covariance[known, known], rcond=1e-12, hermitian=True)
        share = self.covariance[new, known] @ inverse
        left = self.covariance[new, new] - share @ self.covariance[known, new]
        return Scores(self.score[new] - share @ self.score[known], left, self.size[new])

    def followed(self, spread: Floats) -> tuple[float, ...]:
        """How far the first changes go, fitted anew, with a unit of the last one.

        `spread` are the standard deviations of their priors: what only these know stays there.
        """
        own, size = slice(0, len(spread)), self.size[: len(spread)]
        known = self.covariance[own, own] * np.outer(size, size) + np.diag(spread**-2)
        along = self.covariance[own, -1] * size * self.size[-1]
        return tuple((-np.linalg.solve(known, along)).tolist())


def causal_tests(fit: Fit, etfe: Etfe, acted: Floats | float = 0.0) -> tuple[Test, ...]:
    """Tests for another linear response, for forces, and for a device that changes in time.

    Parameters
    ----------
    fit : Fit
    etfe : Etfe
        With all lines, without what forces do.
    acted : ndarray, shape (N,), or 0
        What they add to the position.
    """
    found = _tests(fit, etfe)
    if not any(test.flagged for test in found):
        return found
    both = zip(found, _tests(*_closer(fit, etfe, acted)), strict=True)
    return tuple(min(pair, key=lambda test: test.statistic) for pair in both)


def _tests(fit: Fit, etfe: Etfe) -> tuple[Test, ...]:
    own_changes = _own_changes(fit, fit.windows.frequency_hz)
    smooth = np.concatenate([own_changes, _filtered(fit)], axis=2)
    own = fit.model.size
    linear = scores(fit, fit.windows, smooth).beside(own)
    others = *_force_tests(fit, etfe, smooth), *_time_tests(fit, etfe, smooth)
    return (_linear_test(linear), *others)


def _closer(fit: Fit, etfe: Etfe, acted: Floats | float) -> tuple[Fit, Etfe]:
    """The measurement less the fitted motion's rounding, with the noise that the fit leaves."""
    recording, spectra = etfe.unbroken, etfe.spectra
    assert recording is not None and isinstance(spectra, DirectSpectra)
    measured, position = recording.position + acted, spectra.position
    if (count := increment_unit(measured)) is not None:
        motion = fitted_motion(fit, recording, acted)
        rounded = count * np.rint((motion - measured[0]) / count) + measured[0]
        position = position - Lines.of(etfe, recording)(rounded - motion)
    closer = replace(spectra, position=position)
    slopes = noise_slopes(closer, closer.left(fit.response))
    etfe = replace(etfe, spectra=replace(closer, noise_slope=slopes))
    return replace(fit, windows=etfe.spectra.windows(fit.response)), etfe


def scores(fit: Fit, windows: Windows, changes: Complexes) -> Scores:
    """Scores of changes of the response at the nodes, (W, k, C), and then of further inputs."""
    nodes = windows.frequency_hz
    response = fit.response(nodes)
    own, further = windows.design[:, :, : nodes.shape[1]], windows.design[:, :, nodes.shape[1] :]
    left = windows.without_common(windows.target - (own @ response[..., None])[None, ..., 0])[0]
    moved = np.moveaxis(np.concatenate([own @ changes, further], axis=2), 2, 0)
    moved = np.moveaxis(windows.without_common(moved), 0, 2)
    power = windows.scatter + np.sum(np.abs(left) ** 2, axis=1)
    weight = 2 * (windows.lines - 1) / power
    along = np.einsum("wkc,wk->wc", moved.conj(), left)
    # What of a change goes with the noise itself is the controller's answer, and tells nothing.
    both = _products(np.sqrt(weight)[:, None, None] * moved)
    answers = _products(np.sqrt(weight / power)[:, None] * along)
    size = np.sqrt(np.maximum(np.diag(both), np.finfo(float).tiny))
    return Scores(
        (weight[:, None] * along.real).sum(axis=0) / size,
        (both - answers) / np.outer(size, size),
        size,
    )


def _products(columns: Complexes) -> Floats:
    """Real parts of all inner products of columns, shape (..., C): shape (C, C)."""
    flat = columns.reshape(-1, columns.shape[-1])
    parts = np.concatenate([flat.real, flat.imag])
    return np.asarray(parts.T @ parts)


def _own_changes(fit: Fit, frequency_hz: Floats) -> Complexes:
    """What each parameter does to the response at frequencies of any shape, (..., P)."""
    here = coordinates(fit.model)
    phi = np.repeat(here.coordinate(fit.theta[None]), fit.model.size + 1, axis=0)
    phi[1:] += _STEP * np.eye(fit.model.size)
    response = fit.model.response(here.natural(phi), frequency_hz.ravel(), measured=True)
    slope = (response[1:] - response[0]) / _STEP
    return np.moveaxis(slope.reshape(-1, *frequency_hz.shape), 0, -1)


def _filtered(fit: Fit) -> Complexes:
    """The response behind stable filters, (W, k, C): what a causal change may be made of."""
    nodes = fit.windows.frequency_hz
    response = fit.response(nodes)
    at = np.geomspace(nodes.min(), nodes.max() / 2, _FILTERS)
    s = 1j * nodes[..., None] / at
    second = 1 / (1 + 2 * _DAMPED * s + s**2)
    period_s = fit.model.period_s
    assert period_s is not None
    # A sample later, or, with the other sign, earlier: a delay that was given may be another.
    later = np.exp(-2j * np.pi * nodes[..., None] * period_s)
    filters = np.concatenate([1 / (1 + s), second, s * second, later], axis=-1)
    return response[..., None] * filters


def _together(found: Scores) -> float:
    """All scores as one number, standard normal where the model is right."""
    sizes, directions = np.linalg.eigh(found.covariance)
    kept = sizes > _LEAST * max(float(sizes.max()), _LEAST)
    along = directions[:, kept].T @ found.score
    return chi_square_score(float(np.sum(along**2 / sizes[kept])), int(kept.sum()))


def _linear_test(found: Scores) -> Test:
    z = _together(found)
    text = f"a causal change of the response would explain it ({z:.1f} standard deviations)"
    return Test("causal change", "linear", z, thresholds.SMOOTH, None, text)


def _force_tests(fit: Fit, etfe: Etfe, smooth: Complexes) -> list[Test]:
    """Of forces by their shapes, what any linear response can do taken off."""
    recording = etfe.unbroken
    assert recording is not None
    found = []
    moved = columns(fit, recording, Lines.of(etfe, recording), in_loop=True)
    for name, inputs, rms in moved:
        score, sd, moves = _beside_linear(fit, etfe, smooth, inputs[0])
        found.append(force_test(name, abs(score), ForceSeen(score * sd, sd, rms, moves)))
    return found


def _time_tests(fit: Fit, etfe: Etfe, smooth: Complexes) -> list[Test]:
    """Of parameters and a gain that change in time, what any steady response can do taken off."""
    recording = etfe.unbroken
    assert recording is not None
    at_lines, time = Lines.of(etfe, recording), np.linspace(-1.0, 1.0, recording.samples)
    gain = fit.response(at_lines.frequency_hz)[:, None]
    changes = np.concatenate([_own_changes(fit, at_lines.frequency_hz), gain], axis=1).T
    found = []
    for name, shape in SHAPES.items():
        windows = etfe.spectra.windows(
            fit.response, changes * at_lines(recording.force * shape(time))
        )
        z = _together(scores(fit, windows, smooth).beside(smooth.shape[2]))
        text = f"{name} of the device during the recording ({z:.1f} standard deviations)"
        found.append(Test(name, "time-varying", z, thresholds.SMOOTH, None, text))
    return found


def _beside_linear(
    fit: Fit, etfe: Etfe, smooth: Complexes, motion: Complexes
) -> tuple[float, float, tuple[float, ...]]:
    """Score of a motion, the standard deviation of its strength, and what a unit of it moves."""
    windows = etfe.spectra.windows(fit.response, motion[None])
    every = scores(fit, windows, smooth)
    found = every.beside(smooth.shape[2])
    information = float(found.covariance[0, 0])
    if information < _LEAST_MOTION:
        return 0.0, np.inf, ()
    spread = believed(fit.model, coordinates(fit.model))
    sd = float(1 / (found.size[0] * information**0.5))
    return float(found.score[0] / information**0.5), sd, every.followed(spread)
