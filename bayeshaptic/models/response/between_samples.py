r"""What a position sampled in the loop shows beyond what another sensor saw.

A sampled position holds the images of what moves between the samples, :math:`P(s_k)/s_k` at
:math:`s_k = s + j 2 \pi k / T`. The integral of a sampled velocity holds :math:`P(s_k)/s` instead,
and a force that was measured where it acts none of them. Both differ from the loop's response by a
smooth function of the frequency, a few thousandths at a tenth of the sampling rate and a fifth at a
third of it, which a fitted model knows far better than that; what it makes of the command is added
to the position. A table of a continuous structure, put under a hold, lacks them as a measured force
does.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.frf_kinds import of_a_hold
from bayeshaptic.types import Complexes, Floats

_POINTS = 400  # of the smooth function
# Range of the function, over the Nyquist frequency.  Below it the function keeps its value at the
# lower end; above it is left out: the command that stands for a measured force vanishes at the
# Nyquist frequency itself.
_LOWEST, _HIGHEST = 1e-3, 0.95


def with_images(recording: Recording, system: LinearSystem) -> Recording:
    """The recording as of a sampled position beside a held command.

    Parameters
    ----------
    recording : Recording
        As it was read; back as it is where that is what it holds.
    system : LinearSystem
        A batch of one.
    """
    if recording.sensed is None:
        return recording
    from scipy.interpolate import make_interp_spline

    length = 2 * recording.samples
    theta = np.pi * np.linspace(_LOWEST, _HIGHEST, _POINTS)
    smooth = make_interp_spline(theta, images(recording, system, theta), 3)
    lines = np.maximum(2 * np.pi * np.fft.rfftfreq(length), theta[0])
    command = np.fft.rfft(recording.force - recording.force.mean(), length)
    shown = np.where(lines < theta[-1], smooth(lines) * command, 0.0)
    shown = np.fft.irfft(shown, length)[: recording.samples]
    return replace(recording, position=recording.position + shown)


def images(recording: Recording, system: LinearSystem, theta: Floats) -> Complexes:
    """The loop's response less that of the recording as it is, at angles w T; shape (L,)."""
    sensed, period_s = recording.sensed, recording.period_s
    assert sensed is not None
    frequency_hz = theta / (2 * np.pi * period_s)
    loop = system.sampled_response(frequency_hz, period_s)[0]
    integral = sensed.integral(theta) * period_s**sensed.derivatives
    s: Complexes = np.multiply(1j, theta / period_s)
    if sensed.measured_force:
        own_delay = system.delay_s[0] - sensed.later * period_s
        seen = _between(system, s, own_delay)
        seen = seen * s**sensed.derivatives / sensed.command(theta)
    else:
        power = np.zeros((sensed.derivatives + 1, 1))
        power[-1] = 1.0
        seen = system.with_filter(power, np.ones((1, 1))).sampled_response(frequency_hz, period_s)
        seen = seen[0]
    return np.asarray(loop - seen * integral)


def hidden_by_structure(system: LinearSystem, frequency_hz: Floats, period_s: float) -> Complexes:
    """The loop's response less that of its continuous structure under a hold; shape (L,).

    Parameters
    ----------
    system : LinearSystem
        A batch of one.
    frequency_hz : ndarray, shape (L,)
    period_s : float
    """
    s: Complexes = np.multiply(2j * np.pi, frequency_hz)
    held = _between(system, s, system.delay_s[0]) * of_a_hold(frequency_hz, period_s)
    return np.asarray(system.sampled_response(frequency_hz, period_s)[0] - held)


def _between(system: LinearSystem, s: Complexes, delay_s: float) -> Complexes:
    """The motion at every instant over a force that changes at any, with a delay; shape (L,)."""
    return np.asarray(system.continuous_response(s)[0] * np.exp(-s * delay_s))
