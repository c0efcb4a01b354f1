"""The least width that K_CR of a held device allows: Cramer and Rao.

What no command explains of the position is the encoder's noise and the motion that a hand makes by
itself.  Its covariance is taken as known, and whatever the controller is, the innovations of that
are what is new in a sample (L. Ljung, *System Identification*, 1999, chapter 13).  An encoder's
rounding is no white noise where the device moves by less than a count a sample: it has the spectrum
that it had.  A posterior has to find the covariance, so that its width may be more.  Where nothing
is known of it, what noise made of the command tells nothing (U. Forssell and L. Ljung, Automatica
35, 1999): that bound takes the command of the same loop without noise.  The priors count as in a
posterior: nobody knows a hand without.  A damper that is zero counts as known: a posterior finds it
at the edge of its prior.
"""

from __future__ import annotations

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq
from scipy.linalg import solve_toeplitz

from bayeshaptic.models import Model
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.rig import Bench
from bayeshaptic.rig.noise import tremor_density, wander_density
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.types import Floats

_STEP = 1e-4  # of the logarithm of a parameter
_WIDE = 0.05  # the same for what a prior says
_SAME = 1e-6  # free motions that differ by less are one
_SEEN = 30  # over so many lines the spectrum of rounding is taken for smooth


def bound_db(
    recording: Recording, bench: Bench, model: Model, rounding: Floats | None = None
) -> float:
    """Least standard deviation of K_CR in dB, the model's parameters and its state unknown.

    Parameters
    ----------
    recording : Recording
        Or one with a command that no noise is in.
    bench : Bench
        Held, without friction.
    model : Model
        `grasped` with its priors, for the response, the names and the limit.
    rounding : ndarray, shape (N,), optional
        That of `noise_covariance`.
    """
    truth = np.array([bench.values.get(name, bench.delay_s) for name in model.names])
    ways = np.eye(model.size)[truth > 0]
    up, down = (truth * np.exp(sign * _STEP * ways) for sign in (1, -1))
    driven = (_motions(model, up, recording) - _motions(model, down, recording)) / (2 * _STEP)
    own = _free_motions(model, truth, recording)
    covariance = noise_covariance(bench, recording.samples, rounding)
    slopes = np.concatenate([driven, own]).T
    told = slopes.T @ solve_toeplitz(covariance, slopes)
    count = len(ways)
    beside = told[:count, count:]
    information = told[:count, :count] - beside @ np.linalg.solve(told[count:, count:], beside.T)
    information += np.diag(_told_before(model, truth, ways))
    limits = 20 * np.log10(critical_stiffness(model, np.concatenate([up, down])).samples)
    gradient = (limits[:count] - limits[count:]) / (2 * _STEP)
    return float(np.sqrt(gradient @ np.linalg.solve(information, gradient)))


def noise_covariance(bench: Bench, samples: int, rounding: Floats | None = None) -> Floats:
    """Of what no command explains of a position: at lags of 0 to N - 1 samples.

    Parameters
    ----------
    bench : Bench
    samples : int
    rounding : ndarray, shape (N,), optional
        What the encoder added to the position; without, a white noise of the variance of rounding.
    """
    plant = bench.plant()
    grid = _grid(samples)
    frequency_hz = rfftfreq(grid, bench.period_s)
    turns = 2j * np.pi * frequency_hz[:, None, None] * np.eye(plant.states)
    moved = np.linalg.solve(turns - plant.dynamics, plant.hand[:, None])[..., 0]
    compliance = np.abs(moved @ plant.position) ** 2
    spectrum = np.zeros(len(frequency_hz))
    tremor = bench.tremor_rms, tremor_density(bench.tremor_hz)
    wander = bench.wander_rms, wander_density(bench.wander_hz)
    for rms, density in (tremor, wander):
        shape = np.asarray(density(frequency_hz))
        spectrum += compliance * rms**2 * shape / shape.mean()
    found = np.asarray(irfft(spectrum, grid)[:samples])
    if rounding is not None:
        return found + _autocovariance(rounding)
    found[0] += bench.encoder_resolution**2 / 12 + bench.sensor_noise_rms**2
    return found


def _autocovariance(noise: Floats) -> Floats:
    """At all lags, with the window of Parzen, whose spectrum is nowhere negative."""
    samples = len(noise)
    power = np.abs(rfft(noise - noise.mean(), _grid(samples))) ** 2
    found = irfft(power, _grid(samples))[:samples] / samples
    lag = np.minimum(_SEEN * np.arange(samples) / samples, 1.0)
    near, far = 1 - 6 * lag**2 + 6 * lag**3, 2 * (1 - lag) ** 3
    return np.asarray(found * np.where(lag < 0.5, near, far))


def _grid(samples: int) -> int:
    """An even length of transforms in which what goes round has died away."""
    return 2 * int(next_fast_len(2 * samples))


def _motions(model: Model, values: Floats, recording: Recording) -> Floats:
    """Positions of devices under the recorded command, from rest, (P, N)."""
    grid = _grid(recording.samples)
    response = model.response(values, rfftfreq(grid, recording.period_s))
    moved = irfft(response * rfft(recording.force, grid), grid)
    return np.asarray(moved[:, : recording.samples])


def _free_motions(model: Model, truth: Floats, recording: Recording) -> Floats:
    """What the device does of any state, as rows at right angles."""
    poles = model.system(truth).poles()[0][0]
    turned = np.exp(np.outer(poles, recording.period_s * np.arange(recording.samples)))
    rows = np.concatenate([turned.real, turned.imag])
    size = np.linalg.norm(rows, axis=1)
    rows = rows[size > 0] / size[size > 0, None]
    _, weight, found = np.linalg.svd(rows, full_matrices=False)
    return np.asarray(found[weight > _SAME * weight[0]])


def _told_before(model: Model, truth: Floats, ways: Floats) -> Floats:
    """What the priors say of the logarithm of each parameter by itself."""
    up, down = (model.log_prior(truth * np.exp(sign * _WIDE * ways)) for sign in (1, -1))
    return np.maximum((2 * model.log_prior(truth[None]) - up - down) / _WIDE**2, 0.0)
