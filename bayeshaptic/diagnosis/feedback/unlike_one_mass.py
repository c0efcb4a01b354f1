"""Forces that no single mass with friction has.

Damping that fades, what changes with time, and a motor that does not give what is commanded.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bayeshaptic.diagnosis.residuals.columns import ROUNDING
from bayeshaptic.diagnosis.residuals.supply import SPENT
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Floats

# Times within which damping fades, over that of the motion: fading much faster it is a mass and a
# damping, and much slower a spring.
_FADING = (0.1, 0.3, 1.0, 3.0)
_TINY = np.finfo(float).tiny


def unlike_one_mass(recording: Recording, velocity: Floats) -> Iterator[tuple[str, Floats]]:
    """Each force, shape (N,), after why a limit of one mass does not go with it.

    Parameters
    ----------
    recording : Recording
    velocity : ndarray, shape (N,)
        Of a motion without what the encoder adds.  Damping that fades fast is a mass and a damping
        but for a small part of it: of a measured motion, smoothed as it may be, that part is what
        counts add, and what a fit leaves is just that.
    """
    yield from _fading(velocity)
    yield from _changing(recording, velocity)
    yield from _out_of_proportion(recording.force)
    yield _spent_on_speed(recording.force, velocity)


def _fading(velocity: Floats) -> Iterator[tuple[str, Floats]]:
    """Damping that is gone within a time."""
    from scipy.signal import lfilter

    why = (
        "the damping is another at other frequencies, as with a base that gives or a connection "
        "that relaxes, and what it is at the limit's nobody saw"
    )
    hastens = float(np.std(np.diff(velocity))) / max(float(np.std(velocity)), _TINY)  # a sample
    for time in _FADING:
        kept = np.exp(-hastens / time)
        slow, _ = lfilter([1 - kept], [1, -kept], velocity, zi=[kept * velocity[0]])
        yield why, slow - velocity


def _changing(recording: Recording, velocity: Floats) -> Iterator[tuple[str, Floats]]:
    """Damping, dry friction and gain that grow with the time."""
    grows = np.linspace(-1, 1, recording.samples)
    slow = 0.02 * float(np.std(velocity))
    for name, force in (
        ("damping", velocity),
        ("dry friction", np.tanh(velocity / slow)),
        ("gain from force to motion", recording.force),
    ):
        yield f"the {name} changes in the course of the recording", grows * force


def _spent_on_speed(command: Floats, velocity: Floats) -> tuple[str, Floats]:
    """What a motor gives less of a command the faster it moves, which passes for damping."""
    usual = max(float(np.sqrt(np.mean(velocity**2))), _TINY)
    return SPENT, command * np.abs(velocity) / usual


def _out_of_proportion(command: Floats) -> Iterator[tuple[str, Floats]]:
    """What a motor gives more or less of larger commands, and of those one way."""
    size = float(np.sqrt(np.mean(command**2))) or 1.0
    saturates = (
        "the motor gives another share of large commands than of small ones, as where it saturates"
    )
    yield saturates, _beside(command, command * (command / size) ** 2)
    one_way = "the motor gives another share of commands one way than the other"
    yield one_way, _beside(command, np.abs(command))


def _beside(command: Floats, force: Floats) -> Floats:
    """What of a force is neither the command itself nor constant; zero where that is rounding.

    A power of a command of two levels is that command. A gain of its own is no gain that changes:
    with the mass it is what the mass is, but for what begins and what counts round.
    """
    alone = np.stack([np.ones_like(command), command], axis=1)
    rest = force - alone @ np.linalg.lstsq(alone, force, rcond=None)[0]
    is_it = float(np.linalg.norm(rest)) <= ROUNDING * float(np.linalg.norm(force))
    return np.zeros_like(force) if is_it else rest
