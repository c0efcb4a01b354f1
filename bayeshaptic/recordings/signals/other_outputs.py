r"""Recordings of a velocity, an acceleration or a measured force, as command and position.

A velocity is integrated to a position, an acceleration twice.  A force that a sensor measured acts
at its very instant, where a command is held for a period: it becomes the command whose hold gives
it, half a period earlier and larger by what the hold takes away,

.. math:: U'(f) = U(f) \, \frac{j 2 \pi f T}{1 - e^{-j 2 \pi f T}}.

Between the samples signals are splines of the fifth order, within 1e-3 up to a fifth of the
sampling rate. What these, and what is between the samples, make of it is put right where a model is
fitted (`bayeshaptic.models.response.between_samples`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.sensed import ORDER, Sensed
from bayeshaptic.types import Floats

NO_LOOP = "hold"  # topic of what says that a measurement is not of a loop: its delay is not in it
MEASURED_FORCE = "measured_force"
DERIVATIVES = {"position": 0, "velocity": 1, "acceleration": 2}
_FEWEST = 2 * ORDER


def as_command_and_position(recording: Recording, force: str, position: str) -> Recording:
    """The recording, of what its columns are, as a command and the position that it led to.

    Parameters
    ----------
    recording : Recording
        With its signals as they were recorded.
    force : {"force", "measured_force"}
    position : {"position", "velocity", "acceleration"}

    Raises
    ------
    InputError
        For an acceleration beside a command: it jumps when the command does, and whether that was
        before the sample or after nobody knows, half a period of delay.
    """
    measured, times = force == MEASURED_FORCE, DERIVATIVES[position]
    if not measured and not times:
        return recording
    where = recording.source or recording.name
    if position == "acceleration" and not measured:
        raise InputError(
            f"{where}: an acceleration jumps with a commanded force, which leaves half a period of "
            f"delay open; record the position or the velocity, or give {MEASURED_FORCE}=..."
        )
    if recording.samples < _FEWEST:
        raise InputError(f"{where}: {recording.samples} samples are too few for a {position}")
    command, motion = recording.force, integrated(recording.position, recording.period_s, times)
    if measured:
        command, motion = held_equivalent(command), motion[:-1]
    notices = (*recording.notices, *_told(measured, position, recording.period_s))
    return replace(
        recording,
        force=command,
        position=motion,
        notices=notices,
        sensed=Sensed(measured, times, recording.force, recording.position).part(0, len(motion)),
    )


def integrated(signal: Floats, period_s: float, times: int) -> Floats:
    """The signal integrated so often, from its mean each time; shape (N,)."""
    from scipy.interpolate import make_interp_spline

    for _ in range(times):
        clock = np.arange(len(signal)) * period_s
        spline = make_interp_spline(clock, signal - signal.mean(), ORDER)
        signal = np.asarray(spline.antiderivative()(clock), dtype=np.float64)
    return signal


def held_equivalent(force: Floats) -> Floats:
    """The command that, held for a period, is `force` at low frequencies; shape (N - 1,).

    The mean over a period of s is s + s''/24 + s''''/1920 + ..., in periods; this is its inverse.
    """
    from scipy.interpolate import make_interp_spline

    spline = make_interp_spline(np.arange(len(force)), force, ORDER)
    middle = np.arange(len(force) - 1) + 0.5
    command = spline(middle) - spline(middle, 2) / 24 + 7 * spline(middle, 4) / 5760
    return np.asarray(command, dtype=np.float64)


def with_loop_delay(recording: Recording, delay_s: float) -> Recording:
    """A recording with a measured force, as of a loop whose command acts `delay_s` later.

    A drive's delay is before the force that its sensor measures: only the loop knows of it, and the
    limit depends on it.
    """
    from scipy.interpolate import make_interp_spline

    later = delay_s / recording.period_s
    kept = recording.samples - int(np.ceil(later))
    spline = make_interp_spline(np.arange(recording.samples), recording.force, ORDER)
    command = np.asarray(spline(np.arange(kept) + later), dtype=np.float64)
    sensed = recording.sensed
    if sensed is not None:
        sensed = replace(sensed.part(0, kept), later=later)
    return replace(recording, force=command, position=recording.position[:kept], sensed=sensed)


def _told(measured: bool, position: str, period_s: float) -> tuple[Notice, ...]:
    r"""What was done; and what a velocity shows of a held command's steps, which a position hides.

    Its images, of a mass :math:`m_1` at the motor, are :math:`(2 \pi f T)^2 / 12` of
    :math:`1/(m_1 \omega^2)`.
    """
    found = []
    if measured:
        text = (
            "The force is a measured one: it was turned into the command whose hold gives it. "
            "Feedback through whatever drives the device (a shaker, an amplifier) is not told "
            "from a controller's."
        )
        found.append(Notice("note", NO_LOOP, text))
    if position != "position":
        text = f"The position is the integral of the recorded {position}."
        if not measured:
            text += (
                " It shows the steps of a held command, which a fitted model takes off: up to 3.3 "
                f"% of the response of the motor's mass alone at {0.1 / period_s:.3g} Hz."
            )
        found.append(Notice("note", "columns", text))
    return tuple(found)
