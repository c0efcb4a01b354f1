"""Forces that no single mass with friction has.

Damping that fades, what changes with time, and a motor that does not give what is commanded.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bayeshaptic.diagnosis.feedback.smooth_motion import SmoothMotion
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Floats

_FADING_S = (3e-3, 1e-2, 3e-2, 0.1)  # times within which damping fades


def unlike_one_mass(recording: Recording, path: SmoothMotion) -> Iterator[tuple[str, Floats]]:
    """Each force, shape (N,), after why a limit of one mass does not go with it."""
    yield from _fading(recording, path)
    yield from _changing(recording, path)
    yield from _out_of_proportion(recording.force)


def _fading(recording: Recording, path: SmoothMotion) -> Iterator[tuple[str, Floats]]:
    """Damping that is gone within a time."""
    from scipy.signal import lfilter

    why = (
        "the damping is another at other frequencies, as with a base that gives or a connection "
        "that relaxes, and what it is at the limit's nobody saw"
    )
    for time_s in _FADING_S:
        kept = np.exp(-recording.period_s / time_s)
        v = path.velocity
        slow, _ = lfilter([1 - kept], [1, -kept], v, zi=[kept * v[0]])
        yield why, slow - v


def _changing(recording: Recording, path: SmoothMotion) -> Iterator[tuple[str, Floats]]:
    """Damping, dry friction and gain that grow with the time."""
    grows = np.linspace(-1, 1, recording.samples)
    slow = 0.02 * float(np.std(path.velocity))
    for name, force in (
        ("damping", path.velocity),
        ("dry friction", np.tanh(path.velocity / slow)),
        ("gain from force to motion", recording.force),
    ):
        yield f"the {name} changes in the course of the recording", grows * force


def _out_of_proportion(command: Floats) -> Iterator[tuple[str, Floats]]:
    """What a motor gives more or less of larger commands, and of those one way."""
    size = float(np.sqrt(np.mean(command**2))) or 1.0
    saturates = (
        "the motor gives another share of large commands than of small ones, as where it saturates"
    )
    yield saturates, command * (command / size) ** 2
    yield "the motor gives another share of commands one way than the other", np.abs(command)
