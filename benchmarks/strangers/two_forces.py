"""Free devices with two forces that are not linear, one, or none: what is recommended of each?

    python -m benchmarks.strangers.two_forces KINDS [COUNT] [FIRST] [FILE]

KINDS are joined by commas, each of parts of `_SIZES` joined by "+", or "nothing"; they take turns.
Devices like both of the paper's, 30 % around them; white noise of 10 to 30 s, nothing told but the
recording: the way of the command line's defaults.  FILE keeps what is done, a line a recording.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.signal import butter, lfilter

from bayeshaptic.recordings.recording import Recording
from benchmarks.strangers.__main__ import Row, analysed, kept
from benchmarks.strangers.device import Masses
from benchmarks.strangers.draw import Case
from benchmarks.strangers.motion import STEPS, Forces, Motion

_PERIOD_S = 1e-3
# As in the tables of Diaz and Gil (2010); b2 of the PHANToM a little above its zero.
_DEVICES = {
    "lhifam": ((0.19, 5.2), 0.1, 15.0, 55.3e3, 6.8, 3.0, 3.14e-6, (0.3, 300.0)),
    "phantom": ((0.895e-3, 0.155e-3), 8.5e-3, 5.7e-3, 18.13, 1e-5, 0.02, 1.6e-4, (0.7, 200.0)),
}
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


def make(kind: str, seed: int) -> Case | None:
    """The recording of a seed; none where the device runs away."""
    rng = np.random.default_rng([78, seed])
    like = str(rng.choice(list(_DEVICES)))
    table = _DEVICES[like]
    m = np.array(table[0]) * np.exp(0.3 * rng.normal(size=2))
    b1, bc, kc, b2 = np.array(table[1:5]) * np.exp(0.3 * rng.normal(size=4))
    usual, count, band = table[5:]

    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    def states(rubbing: float = 1.0):  # type: ignore[no-untyped-def]
        row = Masses(list(m))
        row.tie(0, None, b1 * rubbing, 0.0)
        row.tie(0, 1, bc, kc)
        row.tie(1, None, b2 * rubbing, 0.0)
        return row.states()

    delay_s = round(between(1e-4, 4e-4) / _PERIOD_S * STEPS) / STEPS * _PERIOD_S
    samples = int(between(10, 30) / _PERIOD_S)
    edges = [2 * edge * _PERIOD_S for edge in band]
    force = lfilter(*butter(2, edges, "band"), rng.normal(size=samples))
    force *= usual * between(0.3, 3) / force.std()
    sizes = {part: between(*_SIZES[part]) for part in kind.split("+") if part != "nothing"}

    step_s, device = _PERIOD_S / STEPS, states()
    every, factors = samples, np.ones(1)
    if "warming" in sizes:  # to so much of the damping, within some seconds
        every = int(0.25 / _PERIOD_S)
        passed = np.arange(samples // every + 1) * every * _PERIOD_S
        factors = 1 + sizes["warming"] * 2 * np.exp(-passed / 8)
    transitions = np.array([states(factor).held(step_s)[0] for factor in factors])
    _, entry, entries = device.held(step_s)
    late = round(delay_s / step_s)
    motion = Motion(transitions, every, entry, entries, device.c, late)
    linear = motion.under(force, np.zeros(samples), Forces())
    if linear is None:
        return None
    far, speed, rms = linear.std(), np.diff(linear).std() / _PERIOD_S, force.std()
    own = {"mass": m.sum(), "damping": b1 + b2, "stretch": rms / kc}
    numbers = numbers_of(sizes, {"force": rms, "far": far, "speed": speed, **own}, rng)
    made = motion.under(force, np.zeros(samples), Forces(spring=float(kc), **numbers))
    if made is None or np.abs(made).max() > 100 * far:
        return None
    count *= between(0.3, 3)
    units = ("N", "m") if like == "lhifam" else ("Nm", "rad")
    recording = Recording(
        force, count * np.round(made / count), _PERIOD_S, *units, f"{kind}-{seed}"
    )
    what = f"{like}, {samples * _PERIOD_S:.0f} s"
    inside = tuple(f"{part} {size:.3f}" for part, size in sizes.items())
    truth = device.critical_stiffness(_PERIOD_S, delay_s)
    known = {"m1": m[0], "m2": m[1], "b1": b1, "bc": bc, "kc": kc, "b2": b2}
    parameters = {name: float(value) for name, value in known.items()}
    return Case(recording, {}, what, inside, truth, "free", parameters)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="?", default="nothing")
    parser.add_argument("count", nargs="?", type=int, default=20)
    parser.add_argument("first", nargs="?", type=int, default=0)
    parser.add_argument("file", nargs="?", type=Path)
    asked = parser.parse_args()
    kinds = asked.kinds.split(",")

    def found(seed: int) -> Row:
        kind = kinds[seed % len(kinds)]
        return {"seed": seed, "kind": kind} | analysed(make(kind, seed))

    kept(range(asked.first, asked.first + asked.count), asked.file, found)


if __name__ == "__main__":
    main()
