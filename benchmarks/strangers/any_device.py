"""Devices of any size: of a millionth to a hundred units of mass, in loops of 0.1 to 4 ms.

    python -m benchmarks.strangers.any_device [COUNT] [FIRST] [FILE] [--clean]

What a device is made of is drawn in terms of its mass and its period, so that its mode may lie
anywhere in the band and above it, and either damper be next to nothing; hands are as quick as hands
are.  Six excitations, a hundred thousand to 20 counts in the motion, delays of up to four periods,
none, one or two effects of the strangers', their times in periods; nothing told but, of some,
whether somebody holds them and the delay.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.signal import butter, chirp, sosfilt

from bayeshaptic.recordings.recording import Recording
from benchmarks.strangers.__main__ import Row, analysed, kept, parser_of
from benchmarks.strangers.device import Array, States
from benchmarks.strangers.draw import (
    UNITS,
    Case,
    Draw,
    as_logged,
    base_of,
    effects_of,
    size_of,
    states_of,
)
from benchmarks.strangers.motion import STEPS
from benchmarks.strangers.recordings import simulated

PERIODS_S = (1e-4, 2.5e-4, 5e-4, 1e-3, 1e-3, 2e-3, 4e-3, 1 / 1500, 1 / 300)
EXCITATIONS = ("white", "white", "binary", "multisine", "sweeps", "coloured")
USUAL_S = 1e-3  # period that the times of effects are meant for


def make(seed: int, clean: bool = False) -> Case | None:
    """The recording of a seed; none where the device runs away."""
    rng = np.random.default_rng([52, seed])
    draw = Draw(rng, str(rng.choice(["lhifam", "phantom"])), bool(rng.random() < 0.4), True)
    period_s, mass = float(rng.choice(PERIODS_S)), 10 ** rng.uniform(-6, 2)
    draw.values = device_of(draw, mass, period_s)
    effects = effects_of(draw) if rng.random() < 0.7 else ()
    sizes = {name: size_in_periods(draw, name, period_s / USUAL_S) for name in effects if not clean}
    delay_s = delay_in_steps(draw, sizes, period_s, 4)
    device = states_of(draw, sizes)
    force = _force(draw, int(draw.between(4000, 50_000)), period_s)
    way = 10 ** rng.uniform(-3.3, -1)  # half a millimetre or milliradian to a hundred
    made = simulated(draw, sizes, device, force, period_s, delay_s, way)
    if made is None:
        return None
    force, motion, forces = made
    force, position, count = as_logged(draw, tuple(sizes), force, motion, period_s)
    if "coarse" not in sizes:
        count = position.std() / 10 ** rng.uniform(1.3, 5)
    position = count * np.round(position / count)
    told: dict[str, Any] = {"held": draw.held} if rng.random() < 0.5 else {}
    if rng.random() < 0.3 and "late" not in sizes:
        told["delay_s"] = delay_s
    recording = Recording(force, position, period_s, *UNITS[draw.like], f"any-{seed}")
    what = (
        f"{len(draw.values['m'])} masses {'held' if draw.held else 'free'}, {mass:.1e}, "
        f"{1e3 * period_s:.3g} ms, {len(force)} samples, told {', '.join(told) or 'nothing'}"
    )
    truth = limit_of(device, mass, period_s, delay_s) / (1 + forces.ripple)
    return Case(recording, told, what, tuple(sizes), truth, *base_of(draw.values))


def device_of(draw: Draw, mass: float, period_s: float) -> dict[str, Any]:
    """Masses, springs and dampers in terms of the whole mass and of the period."""
    between, turn = draw.between, 2 * np.pi
    ratio = between(0.05, 20)
    masses = np.array([mass / (1 + ratio), mass * ratio / (1 + ratio)])
    mode, moving = turn * between(0.01, 0.7) / period_s, masses.prod() / mass
    damping, share = mass * turn * between(1e-4, 1e-2) / period_s, draw.rng.beta(0.7, 0.7)
    values: dict[str, Any] = {"b1": damping * share, "b2": damping * (1 - share)}
    if not draw.held and draw.rng.random() < 0.25:
        return values | {"m": np.array([mass]), "b1": damping}
    values |= {"bc": 2 * between(0.002, 0.2) * moving * mode, "kc": moving * mode**2, "m": masses}
    if draw.held:
        # In kilograms a hand is a hand, however small the device; about an axis it goes with that.
        hand = between(0.01, 1.0) if draw.like == "lhifam" else mass * between(0.1, 3)
        grip, arm = turn * between(6, 40), turn * between(1, 5)
        values |= {"m": np.append(masses, hand), "ks": hand * grip**2, "kh": hand * arm**2}
        values |= {"bs": 2 * between(0.03, 0.6) * hand * grip}
        values |= {"bh": 2 * between(0.2, 1) * hand * arm}
    return values


def delay_in_steps(
    draw: Draw, sizes: dict[str, tuple[float, ...]], period_s: float, most: float
) -> float:
    """The loop's delay: none, or up to so many periods, and what an effect adds; whole steps."""
    own_s = draw.between(0.05, most) * period_s if draw.rng.random() < 0.8 else 0.0
    delay_s = own_s + (sizes["late"][0] if "late" in sizes else 0.0)
    return max(round(delay_s / period_s * STEPS), 1) / STEPS * period_s


def size_in_periods(draw: Draw, name: str, longer: float) -> tuple[float, ...]:
    """Of an effect, its rates and times in periods; a hand's are a hand's."""
    size = list(size_of(draw, name))
    if name in ("amplifier 1", "amplifier 2", "sensor", "base", "mode"):
        size[0] /= longer
    if name in ("late", "relaxing"):
        size[-1] *= longer
    return tuple(size)


def _force(draw: Draw, count: int, period_s: float) -> Array:
    """A command of any size, in a band from where hands are slow to half the sampling rate."""
    rng, between, excitation = draw.rng, draw.between, str(draw.rng.choice(EXCITATIONS))
    low_hz = between(0.3, 2) if draw.held else between(0.3, 3) * USUAL_S / period_s
    low, high = max(low_hz * period_s, 3 / count), between(0.15, 0.42)
    noise, time = rng.normal(size=count), np.arange(count)
    if excitation == "binary":
        force = np.repeat(np.sign(noise), int(rng.choice([1, 2, 4, 8])))[:count]
    elif excitation == "sweeps":
        length = count / int(rng.integers(2, 8))
        how = str(rng.choice(["linear", "logarithmic"]))
        force = chirp(time % length, low, length, high, method=how)
    elif excitation == "multisine":
        length = int(count / rng.uniform(2.5, 12))
        lines = np.zeros(length // 2 + 1, complex)
        last = int(high * length)
        lines[1:last] = np.exp(2j * np.pi * rng.random(last - 1))
        force = np.resize(np.fft.irfft(lines, length), count)
    else:
        order, top = (2, high) if excitation == "white" else (1, between(0.02, 0.1))
        top = max(top, 2 * low)
        force = sosfilt(butter(order, [2 * low, 2 * top], "band", output="sos"), noise)
    return np.asarray(force / force.std() * 10 ** rng.uniform(-3, 3))


def limit_of(device: States, mass: float, period_s: float, delay_s: float) -> float:
    """K_CR, searched for in units in which it is near one."""
    unit = 1e-4 * mass / period_s**2
    scaled = States(device.a, unit * device.b, device.c, device.g)
    return unit * scaled.critical_stiffness(period_s, delay_s)


def main(what: str | None, made: Callable[[int, bool], Case | None]) -> None:
    """What becomes of the recordings that are made of seeds, some without effects."""
    parser = parser_of(what)
    parser.add_argument("--clean", action="store_true", help="without effects")
    asked = parser.parse_args()

    def one(seed: int) -> Row:
        with np.errstate(all="ignore"):  # of a device that runs away
            case = made(seed, asked.clean)
        return {"seed": seed} | analysed(case)

    kept(asked, one)


if __name__ == "__main__":
    main(__doc__, make)
