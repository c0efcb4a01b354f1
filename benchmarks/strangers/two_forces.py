"""Devices with two forces that are not linear, one, or none: what is recommended of each?

    python -m benchmarks.strangers.two_forces KINDS [COUNT] [FIRST] [FILE] [--held]

Nobody holds them, or somebody does, and pushes.  KINDS are joined by commas, each of parts of
`_SIZES` joined by "+", or "nothing"; they take turns.  Devices like both of the paper's, 30 %
around them; white noise of 10 to 30 s, nothing told but the recording: the way of the command
line's defaults.  FILE keeps what is done, a line a recording.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.signal import butter, lfilter

from bayeshaptic.recordings.recording import Recording
from benchmarks.strangers.__main__ import Row, analysed, kept
from benchmarks.strangers.draw import (
    BAND_HZ,
    COUNT,
    FORCE,
    FREE,
    HELD,
    UNITS,
    Case,
    Draw,
    base_of,
    hand_of,
    states_of,
)
from benchmarks.strangers.motion import STEPS, Forces, Motion

_PERIOD_S = 1e-3
# Of rms force, of the dampers at the rms velocity of the load, of the springs, of the stretch.
_SIZES = {
    "friction": (0.02, 0.4),
    "weak": (0.005, 0.05),
    "stribeck": (0.02, 0.4),
    "drag": (0.1, 2.0),
    "cubed": (0.1, 2.0),
    "hardening": (0.01, 0.3),
    "grounded": (0.1, 3.0),
    "gap": (0.02, 0.5),
    "warming": (0.05, 0.5),
}


def numbers_of(
    sizes: dict[str, float], scales: dict[str, float], rng: np.random.Generator
) -> dict[str, float]:
    """Numbers of the `Forces`, from the drawn sizes.

    Parameters
    ----------
    sizes : dict
        Of every part that was drawn.
    scales : dict
        Rms of the command, "force", and of the load's way and velocity, "far" and "speed"; and of
        the device its "mass", "damping" and "stretch" under that force.
    """
    force, far, speed = scales["force"], scales["far"], scales["speed"]
    units = {
        "friction": ("friction", force),
        "weak": ("friction", force),
        "stribeck": ("friction", force),
        "drag": ("drag", scales["damping"] / speed),
        "cubed": ("cubed", scales["damping"] / speed**2),
        "hardening": ("cubic", 1 / scales["stretch"] ** 2),
        "grounded": ("grounded", scales["mass"] * (2 * np.pi) ** 2 / far**2),
        "gap": ("gap", scales["stretch"]),
    }
    found = {units[part][0]: size * units[part][1] for part, size in sizes.items() if part in units}
    if "stribeck" in sizes:
        found |= {"sticking": float(rng.uniform(1.2, 2)), "stribeck_speed": 0.1 * speed}
    return found


def drawn(seed: int, held: bool) -> Draw:
    """A device like one of the paper's."""
    rng = np.random.default_rng([78, seed])
    like = str(rng.choice(list(FREE)))
    draw = Draw(rng, like, held, new=False)
    masses, *others = (HELD if held else FREE)[like].items()
    for name, value in (masses, *others):
        draw.values[name] = np.asarray(value) * np.exp(0.3 * rng.normal(size=np.shape(value)))
    return draw


def make(kind: str, seed: int, held: bool = False) -> Case | None:
    """The recording of a seed; none where the device runs away."""
    draw = drawn(seed, held)
    rng, between, values = draw.rng, draw.between, draw.values
    delay_s = round(between(1e-4, 4e-4) / _PERIOD_S * STEPS) / STEPS * _PERIOD_S
    samples = int(between(10, 30) / _PERIOD_S)
    edges = [2 * edge * _PERIOD_S for edge in BAND_HZ[draw.like]]
    force = lfilter(*butter(2, edges, "band"), rng.normal(size=samples))
    force *= FORCE[draw.like] * between(0.3, 3) / force.std()
    sizes = {part: between(*_SIZES[part]) for part in kind.split("+") if part != "nothing"}

    step_s, device = _PERIOD_S / STEPS, states_of(draw, {})
    every, factors = samples, np.ones(1)
    if "warming" in sizes:  # to so much of the damping, within some seconds
        every = int(0.25 / _PERIOD_S)
        passed = np.arange(samples // every + 1) * every * _PERIOD_S
        factors = 1 + sizes["warming"] * 2 * np.exp(-passed / 8)
    transitions = np.array(
        [states_of(draw, {}, rubbing=factor).held(step_s)[0] for factor in factors]
    )
    _, entry, entries = device.held(step_s)
    late = round(delay_s / step_s)
    motion = Motion(transitions, every, entry, entries, device.c, late)
    hand = hand_of(draw, samples, _PERIOD_S, force.std())
    linear = motion.under(force, hand, Forces())
    if linear is None:
        return None
    far, speed, rms = linear.std(), np.diff(linear).std() / _PERIOD_S, force.std()
    damping, spring = float(values["b1"] + values["b2"]), float(values["kc"])
    own = {"mass": float(values["m"].sum()), "damping": damping, "stretch": rms / spring}
    numbers = numbers_of(sizes, {"force": rms, "far": far, "speed": speed, **own}, rng)
    made = motion.under(force, hand, Forces(spring=spring, **numbers))
    if made is None or np.abs(made).max() > 100 * far:
        return None
    count = COUNT[draw.like] * between(0.3, 3)
    position = count * np.round(made / count)
    recording = Recording(force, position, _PERIOD_S, *UNITS[draw.like], f"{kind}-{seed}")
    what = f"{draw.like}{' held' if held else ''}, {samples * _PERIOD_S:.0f} s"
    inside = tuple(f"{part} {size:.3f}" for part, size in sizes.items())
    truth = device.critical_stiffness(_PERIOD_S, delay_s)
    return Case(recording, {}, what, inside, truth, *base_of(values))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="?", default="nothing")
    parser.add_argument("count", nargs="?", type=int, default=20)
    parser.add_argument("first", nargs="?", type=int, default=0)
    parser.add_argument("file", nargs="?", type=Path)
    parser.add_argument("--held", action="store_true", help="somebody holds them")
    asked = parser.parse_args()
    kinds = asked.kinds.split(",")

    def found(seed: int) -> Row:
        kind = kinds[seed % len(kinds)]
        return {"seed": seed, "kind": kind} | analysed(make(kind, seed, asked.held))

    kept(asked, found)


if __name__ == "__main__":
    main()
