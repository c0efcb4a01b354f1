"""Recordings as strangers bring them: any device, any excitation, effects that nobody declared.

Simulated by code that shares nothing with the package.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.signal import butter, chirp, lfilter

from bayeshaptic.recordings.recording import Recording
from benchmarks.strangers.device import Array, States
from benchmarks.strangers.draw import (
    BAND_HZ,
    FORCE,
    UNITS,
    Case,
    Draw,
    as_logged,
    base_of,
    begun,
    delay_of,
    effects_of,
    forces_of,
    hand_of,
    motion_of,
    size_of,
    states_of,
)
from benchmarks.strangers.motion import Forces

EXCITATIONS = ("white", "white", "white", "coloured", "binary", "sweeps", "multisine")


def make(seed: int) -> Case | None:
    """The recording of a seed; none where the device runs away."""
    rng = np.random.default_rng([77, seed])
    draw = begun(rng)
    effects = effects_of(draw)
    sizes = {name: size_of(draw, name) for name in effects}
    period_s = float(rng.choice([5e-4, 1e-3, 2e-3])) if draw.new else 1e-3
    delay_s = delay_of(draw, sizes, period_s)
    device = states_of(draw, sizes)
    seconds, excitation = draw.between(6, 40), str(rng.choice(EXCITATIONS))
    force = force_of(draw, excitation, seconds, period_s)
    made = simulated(draw, sizes, device, force, period_s, delay_s)
    if made is None:
        return None
    force, motion, forces = made
    # Somewhere along the way the motor gives that much more than was commanded.
    truth = device.critical_stiffness(period_s, delay_s) / (1 + forces.ripple)
    force, position, count = as_logged(draw, effects, force, motion, period_s)
    position = count * np.round(position / count)
    recording = Recording(force, position, period_s, *UNITS[draw.like], f"stranger-{seed}")
    told: dict[str, Any] = {}
    if not draw.new and rng.random() < 0.5:
        told["device"] = draw.like
    if rng.random() < 0.5:
        told["held"] = draw.held
    if (rng.random() < 0.3 or "device" in told) and "late" not in effects:
        told["delay_s"] = delay_s
    what = f"{draw.kind}, {excitation}, {seconds:.0f} s, told {', '.join(told) or 'nothing'}"
    return Case(recording, told, what, effects, truth, *base_of(draw.values))


def force_of(draw: Draw, excitation: str, seconds: float, period_s: float) -> Array:
    """The command, of 0.3 to 3 times the usual size."""
    rng, count = draw.rng, int(seconds / period_s)
    low, high = BAND_HZ[draw.like]
    high = min(high, 0.4 / period_s)
    time = np.arange(count) * period_s
    noise = rng.normal(size=count)
    if excitation == "white":
        force = lfilter(*butter(2, [2 * low * period_s, 2 * high * period_s], "band"), noise)
    elif excitation == "coloured":
        high = draw.between(20, 100)
        force = lfilter(*butter(1, [2 * low * period_s, 2 * high * period_s], "band"), noise)
    elif excitation == "binary":
        force = np.repeat(np.sign(noise), int(rng.choice([1, 2, 4, 8])))[:count]
    elif excitation == "sweeps":
        length = seconds / rng.integers(3, 9)
        force = chirp(time % length, 0.5, length, high)
    else:
        length = int(rng.uniform(1, 4) / period_s)
        lines = np.zeros(length // 2 + 1, dtype=complex)
        last = int(high * length * period_s)
        lines[1:last] = np.exp(2j * np.pi * rng.random(last - 1))
        force = np.resize(np.fft.irfft(lines, length), count)
    return np.asarray(force * FORCE[draw.like] * draw.between(0.3, 3) / force.std())


def simulated(
    draw: Draw,
    sizes: dict[str, tuple[float, ...]],
    device: States,
    force: Array,
    period_s: float,
    delay_s: float,
    way: float | None = None,
) -> tuple[Array, Array, Forces] | None:
    """Force, motion, and the forces in it; first without them, for their scale.

    The force, and what the hand pushes, are made larger until the motion is `way` large.
    """
    motion = motion_of(draw, sizes, device, len(force), period_s, delay_s)
    hand = hand_of(draw, len(force), period_s, force.std())
    linear = motion.under(force, hand, Forces())
    if linear is None:
        return None
    if way is not None:
        larger = way / linear.std()
        force, hand, linear = larger * force, larger * hand, larger * linear
    forces = forces_of(draw, tuple(sizes), force, linear, period_s)
    made = motion.under(force, hand, forces)
    far = 100.0
    if made is None or np.abs(made).max() > far * linear.std():
        return None
    return force, made, forces
