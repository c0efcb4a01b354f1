"""What a stranger's device is made of, what is in it that nobody declared, and how it is logged.

Drawn at random, strengths log-uniform from what cannot be seen to what spoils everything, some of
the effects of no kind that the library knows.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.signal import butter, lfilter

from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe
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

# As in the tables of Diaz and Gil (2010); b2 of the PHANToM a little above its zero.
FREE = {
    "lhifam": {"m": (0.19, 5.2), "b1": 0.1, "bc": 15.0, "kc": 55.3e3, "b2": 6.8},
    "phantom": {"m": (0.895e-3, 0.155e-3), "b1": 8.5e-3, "bc": 5.7e-3, "kc": 18.13, "b2": 1e-5},
}
HELD = {
    "lhifam": {"m": (0.2, 3.78, 1.42), "b1": 0.1, "bc": 13.41, "kc": 61.36e3, "b2": 4.0}
    | {"bs": 62.68, "ks": 56.03e3, "bh": 18.34, "kh": 133.48},
    "phantom": {"m": (0.81e-3, 0.95e-3, 3.14e-3), "b1": 0.057, "bc": 8.4e-3, "kc": 18.11}
    | {"b2": 1e-4, "bs": 0.017, "ks": 52.73, "bh": 0.099, "kh": 1.42},
}
DELAY_S = {"lhifam": 200e-6, "phantom": 150e-6}
BAND_HZ = {"lhifam": (0.3, 300.0), "phantom": (0.7, 200.0)}
FORCE = {"lhifam": 3.0, "phantom": 0.02}
UNITS = {"lhifam": ("N", "m"), "phantom": ("Nm", "rad")}
COUNT = {"lhifam": 3.14e-6, "phantom": 2 * np.pi / 40000}


@dataclass(frozen=True)
class Case:
    """A recording or a table, what is told of it, what is in it, and what it should show.

    `parameters` are those of the base model `base`, by the package's names.
    """

    recording: Recording | Etfe
    told: dict[str, Any]
    what: str
    effects: tuple[str, ...]
    truth: float
    base: str
    parameters: dict[str, float]


@dataclass
class Draw:
    """The random numbers of one recording, and what they made so far."""

    rng: np.random.Generator
    like: str
    held: bool
    new: bool
    values: dict[str, Any] = field(default_factory=dict)

    @property
    def kind(self) -> str:
        return f"{'new' if self.new else self.like} {'held' if self.held else 'free'}"

    def between(self, low: float, high: float) -> float:
        """Log-uniform."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))


def begun(rng: np.random.Generator) -> Draw:
    """A device like one of the paper's or a new one, held or not."""
    kind = str(rng.choice(["lhifam", "phantom", "new"]))
    like = kind if kind != "new" else str(rng.choice(["lhifam", "phantom"]))
    draw = Draw(rng, like, bool(rng.random() < 0.5), kind == "new")
    spread = 0.8 if draw.new else 0.2
    table = (HELD if draw.held else FREE)[like]
    draw.values = {
        name: np.exp(spread * rng.normal(size=np.shape(value))) * np.asarray(value)
        for name, value in table.items()
    }
    if draw.new and not draw.held and rng.random() < 0.3:
        draw.values["m"] = draw.values["m"].sum(keepdims=True)
    return draw


def motion_of(
    draw: Draw,
    sizes: dict[str, tuple[float, ...]],
    device: States,
    samples: int,
    period_s: float,
    delay_s: float,
) -> Motion:
    """The device over one step, as its grip and its damping change."""
    every, step_s = samples, period_s / STEPS
    transitions, entry, entries = device.held(step_s)
    changing = [transitions]
    if "grip" in sizes or "warming up" in sizes:
        every = int(0.25 / period_s)
        pieces = samples // every + 1
        slow = lfilter(*butter(1, 0.08), draw.rng.normal(size=pieces + 50))[50:]
        grip = np.exp(sizes.get("grip", (0.0,))[0] * slow / slow.std())
        warm = sizes["warming up"][0] if "warming up" in sizes else -1.0
        rubbing = 1 + 0.8 * (1 + warm) * np.exp(-np.arange(pieces) * 0.25 / 8)
        changing = [
            states_of(draw, sizes, *both).held(step_s)[0]
            for both in zip(grip, rubbing, strict=True)
        ]
    late = round(delay_s / step_s)
    return Motion(np.array(changing), every, entry, entries, device.c, late)


def hand_of(draw: Draw, samples: int, period_s: float, force_rms: float) -> Array:
    """What the hand pushes of its own accord; zero of a free device."""
    if not draw.held:
        return np.zeros(samples)
    band = [2 * 0.3 * period_s, 2 * 6 * period_s]
    hand = lfilter(*butter(2, band, "band"), draw.rng.normal(size=samples + 8000))[8000:]
    return np.asarray(hand * draw.between(0.02, 0.2) * force_rms / hand.std())


def delay_of(draw: Draw, sizes: dict[str, tuple[float, ...]], period_s: float) -> float:
    """Of the loop, in s: whole steps of the simulation."""
    delay_s = DELAY_S[draw.like] * draw.between(0.6, 1.6) * period_s / 1e-3
    delay_s += sizes["late"][0] if "late" in sizes else 0.0
    return round(delay_s / period_s * STEPS) / STEPS * period_s


def base_of(values: dict[str, Any]) -> tuple[str, dict[str, float]]:
    """The base model that the device is without its effects, and its parameters."""
    masses = values["m"]
    if len(masses) == 1:
        return "rigid", {"m": float(masses[0]), "b": float(values["b1"])}
    names = ("m1", "m2", "mh")[: len(masses)]
    found = dict(zip(names, map(float, masses), strict=True))
    found |= {name: float(value) for name, value in values.items() if name != "m"}
    return ("free" if len(masses) == 2 else "grasped"), found


def effects_of(draw: Draw) -> tuple[str, ...]:
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


def size_of(draw: Draw, name: str) -> tuple[float, ...]:
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


def states_of(
    draw: Draw, sizes: dict[str, tuple[float, ...]], grip: float = 1.0, rubbing: float = 1.0
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


def forces_of(
    draw: Draw, effects: tuple[str, ...], force: Array, motion: Array, period_s: float
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


def as_logged(
    draw: Draw, effects: tuple[str, ...], force: Array, position: Array, period_s: float
) -> tuple[Array, Array, float]:
    """Force, position and a count of the encoder as they are written down."""
    rng, size, far = draw.rng, draw.between, position.std()
    count = COUNT[draw.like] * size(0.3, 3)
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
