"""Recordings from the bench in open loop."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from bayeshaptic.errors import InputError
from bayeshaptic.rig.bench import Bench
from bayeshaptic.rig.dynamics.stepper import HALVINGS, SUBSTEPS
from bayeshaptic.rig.excitation import Excitation, Prescribed, WhiteNoise
from bayeshaptic.rig.motion import Start, respond
from bayeshaptic.rig.recording import SimulatedRecording
from bayeshaptic.rig.sensing import Encoder, Streams, actuate, hand_force, write_down


def simulate(
    bench: Bench,
    excitation: Excitation | ArrayLike | None = None,
    seed: int = 0,
    settle_s: float = 0.0,
    start: Start | None = None,
    substeps: int = SUBSTEPS,
    halvings: int = HALVINGS,
) -> SimulatedRecording:
    """Excite the bench and record it.

    Parameters
    ----------
    bench : Bench
    excitation : WhiteNoise, Multisine, array of shape (N,), or None
        None: 30 s of white noise at the bench's usual level, in its usual band. The force of an
        array is commanded sample by sample.
    seed : int
        The same seed gives the same recording; each source of randomness has its own stream, so
        that the excitation and the tremor stay when an effect is added.
    settle_s : float
        How long the excitation acts before the recording begins. 0: it begins from rest.
    start : mapping of str to (position, velocity), optional
        Motion of the masses ("m1", "m2", "hand") at the very beginning.
    substeps : int
        Steps a period where there are nonlinear or delayed forces.
    halvings : int
        How finely a reversal of dry friction is located: step/2^halvings.

    Returns
    -------
    SimulatedRecording
        The force u[k] is commanded at the instant of sample k, the position y[k] read then.

    Raises
    ------
    InputError
        For an excitation that the bench cannot give, and a negative settle_s.
    """
    chosen = _excitation(bench, excitation)
    if settle_s < 0:
        raise InputError(f"settle_s is {settle_s:g} s; give at least zero")
    lead = round(settle_s / bench.period_s)
    streams = Streams(seed, len(bench.effects))
    command = chosen.force(lead, bench.period_s, streams.excitation)
    time_s = (np.arange(len(command)) - lead) * bench.period_s
    progress = np.clip(time_s / time_s[-1], 0.0, 1.0)
    hand = hand_force(bench, len(command) + 1, streams)
    force = actuate(bench, command, progress, time_s)
    position, velocity = respond(bench, force, hand, progress, start, substeps, halvings)
    kept = slice(lead, None)
    samples = Encoder(bench, streams).read(time_s[kept], position[kept], velocity[kept])
    return write_down(bench, streams, samples, command[kept], position[kept], hand[lead:-1])


def _excitation(bench: Bench, excitation: Excitation | ArrayLike | None) -> Excitation:
    """The excitation that is meant: given, an array of commands, or the bench's usual noise.

    Raises
    ------
    InputError
        For an array that is no command.
    """
    if excitation is None:
        return WhiteNoise(bench.force_rms, bench.band_hz[1], bench.band_hz[0])
    if isinstance(excitation, Excitation):
        return excitation
    command = np.asarray(excitation, dtype=float)
    if command.ndim != 1 or len(command) < 2 or not np.all(np.isfinite(command)):
        raise InputError(
            f"the commanded force has shape {command.shape} or values that are not finite; "
            "give one finite number a sample, two samples at least"
        )
    return Prescribed(command)
