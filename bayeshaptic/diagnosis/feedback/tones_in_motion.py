"""Tones in what the motion of one mass leaves: the mains, or something that turns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayeshaptic.diagnosis.feedback.refit import Refit
from bayeshaptic.diagnosis.samples.sinusoids import Tone
from bayeshaptic.diagnosis.samples.tones import find_tones
from bayeshaptic.inference.time_domain.fit import MotionFit
from bayeshaptic.inference.time_domain.mass_in_loop import MASS, SHARED, Hum
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.types import Complexes, Floats

_MOST = 4  # the mains and its harmonics
_HIGHEST = 0.45  # of the sampling rate
# Counts: a steady motion that is rounded makes tones of a third of one.
_LEAST = 0.5


def with_tones(motion: MotionFit, refit: Refit) -> MotionFit:
    """The motion, fitted with the tones that stand out of its error and are worth it.

    Parameters
    ----------
    motion : MotionFit
    refit : Refit
        Of the same recording.
    """
    start = motion.inside
    for _ in range(_MOST):
        hum = _strongest(motion, refit.recording)
        if hum is None:
            break
        more = refit.with_more(motion, start, hums=(*motion.hums, hum))
        if more is None:
            break
        motion = more
    return motion


def tones_of(motion: MotionFit) -> tuple[Tone, ...]:
    """The tones that were fitted, as forces on the mass in the first piece.

    Their frequencies are those of the error's lines, known far better than anything asks for.
    """
    first = SHARED + 2  # behind where the piece begins
    sd = motion.whole_sd[first : first + 2 * len(motion.hums)].reshape(2, -1)
    both = zip(motion.hums, np.sqrt(np.mean(sd**2, axis=0)), strict=True)
    return tuple(Tone(hum.frequency_hz, 0.0, hum.amplitude, float(own)) for hum, own in both)


def _strongest(motion: MotionFit, recording: Recording) -> Hum | None:
    """What makes the strongest line in the error of the first piece; None where none stands out.

    Above the frequencies at which the command moves the mass: below, its forces make lines, too.
    """
    here = motion.loop(recording).pieces[0]
    error = (recording.position - motion.simulated)[here]
    # Lines are sought beside those of a force; of noise, none stands out.
    noise = np.random.default_rng(0).standard_normal(len(error))
    left = replace(recording.part(here.start, here.stop), force=noise, position=error)
    band = motion.bandwidth_hz, _HIGHEST / recording.period_s
    found = find_tones(left, band, _flat).tones
    count = increment_unit(recording.position) or 0.0
    loud = [tone for tone in found if abs(tone.amplitude) > _LEAST * count]
    if not loud:
        return None
    tone = max(loud, key=lambda tone: abs(tone.amplitude))
    rad_s = 2 * np.pi * tone.frequency_hz
    # As if nothing but the mass held it: friction may, and then nothing answers to a little more.
    return Hum(tone.frequency_hz, complex(-motion.inside[MASS] * rad_s**2 * tone.amplitude))


def _flat(frequency_hz: Floats) -> Complexes:
    return np.ones(len(frequency_hz), dtype=np.complex128)
