"""Where a force of two levels switches: a relay's does where the position passes the same places.

Upwards at one place and downwards at another, about one set point or a few, a few samples later.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.types import Bools, Floats, Ints

# Error rates of these numbers are in docs/door.md.
FEWEST_SWITCHES = 16
OF_SWITCHES = 0.8  # share of all that come where the position passes a place
_AT_LEVEL = 0.99  # share of the samples at the two levels: a recording may begin at zero
_LATEST = 4  # samples from the passage to the switch
_LATE = 0.1  # of the time between two switches, by which one may be earlier or later
_LATE_SAMPLES = 2


@dataclass(frozen=True)
class Stretch:
    """Switches about one set point.

    Attributes
    ----------
    first, stop : int
        Samples from the first switch to the last.
    middle : float
        The place between those of the switches up and down: the set point.
    at_places : int
        How many of the switches come where the position first passes their place.
    """

    first: int
    stop: int
    middle: float
    at_places: int


def switches_of(force: Floats) -> Ints:
    """The first sample after each switch of a force (N,) between two levels, shape (S,)."""
    return np.flatnonzero(np.diff(_pushes_up(force))) + 1


def _pushes_up(force: Floats) -> Bools:
    """Where a force of two levels is nearer to the upper one."""
    return np.asarray(force > (force.min() + force.max()) / 2)


def _at_a_level(force: Floats) -> Bools:
    """Where a force is at its lowest or its highest."""
    low, high = force.min(), force.max()
    near = 1e-6 * (high - low)
    return np.asarray((force - low <= near) | (high - force <= near))


def stretches(force: Floats, position: Floats) -> tuple[Stretch, ...]:
    """Switches of a force of two levels, parted where the middle of the oscillation jumps."""
    at = switches_of(force)
    if len(at) < FEWEST_SWITCHES:
        return ()
    up = _pushes_up(force)[at]
    holds = np.maximum.reduceat(position, at), np.minimum.reduceat(position, at)
    top, bottom = (np.asarray(side[:-1]) for side in holds)
    # Over a whole oscillation, a hold up and one down.
    high, low = np.maximum(top[1:], top[:-1]), np.minimum(bottom[1:], bottom[:-1])
    swing, middle = float(np.median(high - low)), (high + low) / 2
    order = np.sort(middle)
    borders = order[:-1][np.diff(order) > swing] + swing / 2
    about = np.searchsorted(borders, middle)
    parts = np.split(np.arange(len(about)), np.flatnonzero(np.diff(about)) + 1)
    found = []
    for part in parts:
        # The holds of an oscillation lie after its switches; the last of them ends it.
        chosen = np.arange(part[0], part[-1] + 3)
        found.append(_stretch(position, at[chosen], up[chosen]))
    return tuple(found)


def _stretch(position: Floats, at: Ints, up: Bools) -> Stretch:
    best, middle = -1, 0.0
    for lag in range(_LATEST + 1):
        after, before = (np.maximum(at - lag - k, 0) for k in (0, 1))
        passed = (position[after] + position[before]) / 2
        places = [float(np.median(passed[side])) for side in (up, ~up)]
        count = _at_places(position, at, up, lag, places)
        if count > best:
            best, middle = count, (places[0] + places[1]) / 2
    return Stretch(int(at[0]), int(at[-1]), middle, best)


def _at_places(position: Floats, at: Ints, up: Bools, lag: int, places: list[float]) -> int:
    """Switches that come `lag` samples after the position is first beyond their place."""
    count = 0
    for begin, end, turns_up in zip(at[:-1], at[1:], up[1:], strict=True):
        late = min(int(_LATE * (end - begin)), _LATE_SAMPLES)
        first = max(begin - lag, 0)
        seen = position[first : max(first, end - lag + late + 1)]
        beyond = seen <= places[0] if turns_up else seen >= places[1]
        if beyond.any():
            passage = first + int(np.argmax(beyond))
            count += abs(end - lag - passage) <= late
    return count


def is_relay(force: Floats, position: Floats) -> bool:
    """Whether a force of two levels opposes the position, taken from zero or from its middle.

    Parameters
    ----------
    force, position : ndarray, shape (N,)
    """
    if not np.all(_at_a_level(force)):
        return False
    pushes_up = _pushes_up(force)
    if not 0.2 < np.mean(pushes_up) < 0.8:
        return False
    levels = (0.0, float(np.median(position)), float((position.min() + position.max()) / 2))
    for level in levels:
        # Close to the level counts, noise and a hysteresis decide.
        away = np.abs(position - level)
        clear = away > np.quantile(away, 0.2)
        for lag in range(3):
            sides = (pushes_up == np.roll(position < level, lag))[clear & np.roll(clear, lag)]
            if np.mean(sides) > 0.99:
                return True
    return False


def is_switched(force: Floats, position: Floats) -> bool:
    """A force of two levels that switches where the position passes the same places.

    Under a square wave of a clock the motion is as regular as that: nothing is said of a force
    whose switches come in equal times but for a sample.
    """
    if np.mean(_at_a_level(force)) < _AT_LEVEL:
        return False
    at = switches_of(force)
    if len(at) < FEWEST_SWITCHES or _clocked(at):
        return False
    found = stretches(force, position)
    return sum(part.at_places for part in found) >= OF_SWITCHES * len(at)


def _clocked(at: Ints) -> bool:
    """Times between switches, each direction's, are the same but for one sample."""
    times = np.diff(at)
    sides = (times[::2], times[1::2])
    return all(np.ptp(np.quantile(side, [0.05, 0.95])) <= 1 for side in sides)
