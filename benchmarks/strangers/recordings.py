"""Recordings as strangers bring them: any device, any excitation, effects that nobody declared.

Drawn at random, strengths log-uniform from what cannot be seen to what spoils everything, some of
them of no kind that the library knows.  Simulated by code that shares nothing with the package.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.signal import butter, chirp, lfilter

from bayeshaptic.recordings.recording import Recording
from benchmarks.strangers.device import Array, Masses, States
from benchmarks.strangers.motion import STEPS, Forces, Motion

LINEAR = (
    *("amplifier 1", "amplifier 2", "sensor"),
    *("base", "relaxing", "mode", "hand mode", "eddy"),
    "late",
)
FORCES = ("coulomb", "stribeck", "backlash", "hardening", "drag", "cogging", "ripple", "compressed")
CHANGES = ("grip", "warming up")
FAULTS = ("noise of force", "wavy encoder", "jitter", "drift", "coarse")
EXCITATIONS = ("white", "white", "white", "coloured", "binary", "sweeps", "multisine")

# As in the tables of Diaz and Gil (2010); b2 of the PHANToM a little above its zero.
_FREE = {
    "lhifam": {"m": (0.19, 5.2), "b1": 0.1, "bc": 15.0, "kc": 55.3e3, "b2": 6.8},
    "phantom": {"m": (0.895e-3, 0.155e-3), "b1": 8.5e-3, "bc": 5.7e-3, "kc": 18.13, "b2": 1e-5},
}
_HELD = {
    "lhifam": {"m": (0.2, 3.78, 1.42), "b1": 0.1, "bc": 13.41, "kc": 61.36e3, "b2": 4.0}
    | {"bs": 62.68, "ks": 56.03e3, "bh": 18.34, "kh": 133.48},
    "phantom": {"m": (0.81e-3, 0.95e-3, 3.14e-3), "b1": 0.057, "bc": 8.4e-3, "kc": 18.11}
    | {"b2": 1e-4, "bs": 0.017, "ks": 52.73, "bh": 0.099, "kh": 1.42},
}
_DELAY_S = {"lhifam": 200e-6, "phantom": 150e-6}
_BAND_HZ = {"lhifam": (0.3, 300.0), "phantom": (0.7, 200.0)}
_FORCE = {"lhifam": 3.0, "phantom": 0.02}
_COUNT = {"lhifam": 3.14e-6, "phantom": 2 * np.pi / 40000}


@dataclass(frozen=True)
class Case:
    """A recording, what is told of it, what is in it, and what it should show.

    `parameters` are those of the base model `base`, by the package's names.
    """

    recording: Recording
    told: dict[str, Any]
    what: str
    effects: tuple[str, ...]
    truth: float
    base: str
    parameters: dict[str, float]


@dataclass
class _Draw:
    """The random numbers of one recording, and what they made so far."""

    rng: np.random.Generator
    like: str
    held: bool
    new: bool
    values: dict[str, Any] = field(default_factory=dict)

    def between(self, low: float, high: float) -> float:
        """Log-uniform."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))


def make(seed: int) -> Case | None:
    """The recording of a seed; none where the device runs away."""
    rng = np.random.default_rng([77, seed])
    kind = str(rng.choice(["lhifam", "phantom", "new"]))
    like = kind if kind != "new" else str(rng.choice(["lhifam", "phantom"]))
    draw = _Draw(rng, like, bool(rng.random() < 0.5), kind == "new")
    spread = 0.8 if draw.new else 0.2
    table = (_HELD if draw.held else _FREE)[like]
    draw.values = {
        name: np.exp(spread * rng.normal(size=np.shape(value))) * np.asarray(value)
        for name, value in table.items()
    }
    if draw.new and not draw.held and rng.random() < 0.3:
        draw.values["m"] = draw.values["m"].sum(keepdims=True)
    effects = _effects(draw)
    sizes = {name: _size(draw, name) for name in effects}
    period_s = float(rng.choice([5e-4, 1e-3, 2e-3])) if draw.new else 1e-3
    delay_s = _DELAY_S[like] * draw.between(0.6, 1.6) * period_s / 1e-3
    delay_s += sizes["late"][0] if "late" in effects else 0.0
    delay_s = round(delay_s / period_s * STEPS) / STEPS * period_s
    device = _states(draw, sizes)
    truth = device.critical_stiffness(period_s, delay_s)
    seconds, excitation = draw.between(6, 40), str(rng.choice(EXCITATIONS))
    force = _force(draw, excitation, seconds, period_s)
    made = _simulated(draw, sizes, device, force, period_s, delay_s)
    if made is None:
        return None
    force, position, count = _as_logged(draw, effects, force, made, period_s)
    units = ("N", "m") if like == "lhifam" else ("Nm", "rad")
    recording = Recording(
        force, count * np.round(position / count), period_s, units[0], units[1], f"stranger-{seed}"
    )
    told: dict[str, Any] = {}
    if not draw.new and rng.random() < 0.5:
        told["device"] = like
    if rng.random() < 0.5:
        told["held"] = draw.held
    if (rng.random() < 0.3 or "device" in told) and "late" not in effects:
        told["delay_s"] = delay_s
    who = "held" if draw.held else "free"
    what = f"{kind} {who}, {excitation}, {seconds:.0f} s, told {', '.join(told) or 'nothing'}"
    return Case(recording, told, what, effects, truth, *_base(draw.values))


def _base(values: dict[str, Any]) -> tuple[str, dict[str, float]]:
    """The base model that the device is without its effects, and its parameters."""
    masses = values["m"]
    if len(masses) == 1:
        return "rigid", {"m": float(masses[0]), "b": float(values["b1"] + values["b2"])}
    names = ("m1", "m2", "mh")[: len(masses)]
    found = dict(zip(names, map(float, masses), strict=True))
    found |= {name: float(value) for name, value in values.items() if name != "m"}
    return ("free" if len(masses) == 2 else "grasped"), found


def _effects(draw: _Draw) -> tuple[str, ...]:
    """None, one or two; the linear ones twice as often."""
    possible = [*LINEAR * 2, *FORCES, *CHANGES, *FAULTS]
    hands, springs = ("hand mode", "grip"), ("relaxing", "mode", "backlash", "hardening")
    absent = (() if draw.held else hands) + (springs if len(draw.values["m"]) < 2 else ())
    possible = [name for name in possible if name not in absent]
    count = int(draw.rng.choice([0, 1, 2], p=[0.2, 0.5, 0.3]))
    found: list[str] = []
    while len(found) < count:
        name = str(draw.rng.choice(possible))
        found += [name] * (name not in found)
    return tuple(found)


def _size(draw: _Draw, name: str) -> tuple[float, ...]:
    """Of a linear effect."""
    turn, size, rng = 2 * np.pi, draw.between, draw.rng
    sizes = {
        "amplifier 1": lambda: (turn * size(120, 3000),),
        "amplifier 2": lambda: (turn * size(150, 1500), rng.uniform(0.4, 0.9)),
        "sensor": lambda: (turn * size(120, 2000),),
        "base": lambda: (turn * size(12, 60), size(1, 20), size(0.01, 0.1)),
        "relaxing": lambda: (size(0.03, 1), size(1e-3, 0.1)),
        "mode": lambda: (turn * size(25, 180), size(0.01, 0.3), size(0.005, 0.05)),
        "hand mode": lambda: (turn * size(6, 40), size(0.05, 0.5), size(0.05, 0.4)),
        "eddy": lambda: (size(0.2, 3),),
        "late": lambda: (size(2e-5, 1e-3),),
        "grip": lambda: (size(0.05, 0.5),),
        "warming up": lambda: (size(0.05, 0.5),),
    }
    return sizes[name]() if name in sizes else ()


def _states(
    draw: _Draw, sizes: dict[str, tuple[float, ...]], grip: float = 1.0, rubbing: float = 1.0
) -> States:
    """The device with its linear effects; the grip's stiffness and the damping as factors."""
    v, m = draw.values, draw.values["m"]
    body = min(len(m) - 1, 1)
    row = Masses(list(m))
    row.tie(0, None, v["b1"] * rubbing, 0.0)
    if len(m) > 1:
        row.tie(0, 1, v["bc"], v["kc"])
        row.tie(1, None, v["b2"] * rubbing, 0.0)
    if len(m) > 2:
        row.tie(1, 2, v["bs"] * np.sqrt(grip), v["ks"] * grip)
        row.tie(2, None, v["bh"], v["kh"])
    for name, on in (("mode", body), ("hand mode", 2)):
        if name in sizes:
            rad_s, share, ratio = sizes[name]
            row.hang(on, share * m[on], rad_s, ratio)
    if "base" in sizes:
        rad_s, share, ratio = sizes["base"]
        row.on_a_base(share * m.sum(), rad_s, ratio)
    if "relaxing" in sizes:
        row.relax(0, 1, sizes["relaxing"][0] * v["kc"], sizes["relaxing"][1])
    for time_s in (2e-3, 1e-2, 5e-2) if "eddy" in sizes else ():
        row.relax(body, None, sizes["eddy"][0] * (v["b1"] + v["b2"]) / time_s / 3, time_s)
    states = row.states()
    if "amplifier 1" in sizes:
        (rad_s,) = sizes["amplifier 1"]
        states = states.with_drive(np.array([[-rad_s]]), np.array([rad_s]), np.ones(1))
    if "amplifier 2" in sizes:
        rad_s, ratio = sizes["amplifier 2"]
        poles = np.array([[0.0, 1.0], [-(rad_s**2), -2 * ratio * rad_s]])
        states = states.with_drive(poles, np.array([0.0, rad_s**2]), np.array([1.0, 0.0]))
    return states.with_sensor(*sizes["sensor"]) if "sensor" in sizes else states


def _force(draw: _Draw, excitation: str, seconds: float, period_s: float) -> Array:
    """The command, of 0.3 to 3 times the usual size."""
    rng, count = draw.rng, int(seconds / period_s)
    low, high = _BAND_HZ[draw.like]
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
    return np.asarray(force * _FORCE[draw.like] * draw.between(0.3, 3) / force.std())


def _simulated(
    draw: _Draw,
    sizes: dict[str, tuple[float, ...]],
    device: States,
    force: Array,
    period_s: float,
    delay_s: float,
) -> Array | None:
    """The motion; first without forces, for the scale of these."""
    rng, samples, step_s = draw.rng, len(force), period_s / STEPS
    every, transitions = samples, [device.held(step_s)[0]]
    if "grip" in sizes or "warming up" in sizes:
        every = int(0.25 / period_s)
        pieces = samples // every + 1
        slow = lfilter(*butter(1, 0.08), rng.normal(size=pieces + 50))[50:]
        grip = np.exp(sizes.get("grip", (0.0,))[0] * slow / slow.std())
        warm = sizes["warming up"][0] if "warming up" in sizes else -1.0
        rubbing = 1 + 0.8 * (1 + warm) * np.exp(-np.arange(pieces) * 0.25 / 8)
        transitions = [
            _states(draw, sizes, *both).held(step_s)[0] for both in zip(grip, rubbing, strict=True)
        ]
    _, entry, entries = device.held(step_s)
    late = round(delay_s / step_s)
    motion = Motion(np.array(transitions), every, entry, entries, device.c, late)
    hand = np.zeros(samples)
    if draw.held:
        band = [2 * 0.3 * period_s, 2 * 6 * period_s]
        hand = lfilter(*butter(2, band, "band"), rng.normal(size=samples + 8000))[8000:]
        hand *= draw.between(0.02, 0.2) * force.std() / hand.std()

    linear = motion.under(force, hand, Forces())
    if linear is None:
        return None
    made = motion.under(force, hand, _forces(draw, tuple(sizes), force, linear, period_s))
    far = 100.0
    return made if made is not None and np.abs(made).max() < far * linear.std() else None


def _forces(
    draw: _Draw, effects: tuple[str, ...], force: Array, motion: Array, period_s: float
) -> Forces:
    """Sizes in terms of the command, of the linear motion, and of what it stretches."""
    values, size, rms = draw.values, draw.between, force.std()
    far, speed = motion.std(), np.diff(motion).std() / period_s
    stretch = rms / values.get("kc", 1.0)
    rubbing = float(values["b1"] + values["b2"])

    def periods() -> float:
        return float(2 * np.pi / (far * size(0.1, 2)))

    sizes = {
        "coulomb": lambda: {"friction": rms * size(0.005, 0.3)},
        "stribeck": lambda: {
            "friction": rms * size(0.005, 0.3),
            "sticking": draw.rng.uniform(1.2, 2),
            "stribeck_speed": 0.1 * speed,
        },
        "backlash": lambda: {"gap": stretch * size(0.01, 0.5)},
        "hardening": lambda: {"cubic": size(0.005, 0.3) / stretch**2},
        "drag": lambda: {"drag": size(0.05, 2) * rubbing / speed},
        "cogging": lambda: {"cogging": rms * size(0.005, 0.2), "cogs": periods()},
        "ripple": lambda: {"ripple": size(0.005, 0.2), "ripples": periods()},
        "compressed": lambda: {"compressed": size(0.02, 0.8) / rms},
    }
    found = {"spring": float(values.get("kc", 0.0))}
    for name in effects:
        found |= sizes[name]() if name in sizes else {}
    return Forces(**found)


def _as_logged(
    draw: _Draw, effects: tuple[str, ...], force: Array, position: Array, period_s: float
) -> tuple[Array, Array, float]:
    """Force, position and a count of the encoder as they are written down."""
    rng, size, far = draw.rng, draw.between, position.std()
    count = _COUNT[draw.like] * size(0.3, 3)
    noise = rng.normal(size=len(position))
    for name in effects:
        if name == "wavy encoder":
            wave = np.sin(2 * np.pi * position / (far * size(0.2, 2)))
            position = position + far * size(0.001, 0.03) * wave
        elif name == "jitter":
            position = position + np.gradient(position) * noise * size(0.005, 0.1)
        elif name == "drift":
            position = position + np.cumsum(noise) * far * size(0.02, 0.5) / np.sqrt(len(noise))
        elif name == "noise of force":
            force = force + force.std() * size(0.003, 0.1) * noise
        elif name == "coarse":
            count = far / size(5, 30)
    return force, position, count
