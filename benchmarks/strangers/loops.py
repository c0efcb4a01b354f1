"""Recordings of strangers that were not made with noise in open loop: what becomes of each?

    python -m benchmarks.strangers.loops [COUNT] [FIRST] [FILE] [--one-mass | --open-loop]

Devices and undeclared effects of `draw`, half of the free ones of one mass.  Two in three are in a
loop of a P, PD, PI, PID or filtered controller that reads the counts, now and then cut off at its
limits, and follows steps, ramps, smooth ways with pauses, or noise; the others are steps, pulses or
a tone in open loop. 1 to 20 s, with and without device file, `held`, a model, the reference as a
column, a declared controller.  FILE keeps what is done, a line a recording.

With --one-mass those that are free, of one mass, in a loop and 2.5 s long at least, and said to be
one mass and free: there a stiffness can be had without a reference.

With --open-loop those under steps, pulses or a tone in open loop, free, of one mass and said to be
so: which parameters are told, and how often their 90 % intervals hold the truth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.signal import butter, sosfilt

from bayeshaptic.recordings.feedback import Feedback
from bayeshaptic.recordings.recording import Recording
from benchmarks.strangers.__main__ import Row, analysed, kept, parser_of
from benchmarks.strangers.device import Array, States
from benchmarks.strangers.draw import (
    COUNT,
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
from benchmarks.strangers.motion import Forces, Law

CONTROLLERS = ("P", "PD", "PD", "PI", "PID", "PD filtered", "PID filtered")
REFERENCES = ("steps", "ramps", "way", "noise")
OPEN = ("force steps", "pulses", "tone")
LAGS = {"amplifier 1", "amplifier 2", "sensor"}  # which the loop's delay has to stand for


def make(seed: int) -> Case | None:
    """The recording of a seed; none where the device, or the loop, runs away."""
    rng = np.random.default_rng([79, seed])
    draw = begun(rng)
    if not draw.held and rng.random() < 0.5:
        draw.values["m"] = np.atleast_1d(draw.values["m"].sum())
    effects = effects_of(draw)
    sizes = {name: size_of(draw, name) for name in effects}
    period_s = float(rng.choice([5e-4, 1e-3, 2e-3])) if draw.new else 1e-3
    delay_s = delay_of(draw, sizes, period_s)
    device = states_of(draw, sizes)
    truth = device.critical_stiffness(period_s, delay_s)
    seconds = draw.between(1, 20)
    samples = int(seconds / period_s)
    closed = bool(rng.random() < 2 / 3)
    kind = str(rng.choice(REFERENCES if closed else OPEN))
    law, name = law_of(draw, truth, period_s) if closed else (None, "open loop")
    wanted = wanted_of(draw, kind, samples, period_s)
    if law is not None:
        wanted *= FORCE[draw.like] * draw.between(1, 30) / law.spring / wanted.std()
        if rng.random() < 0.2:  # cut off at its limits now and then
            law = replace(law, most=law.spring * wanted.std() * rng.uniform(0.7, 2))
    else:
        wanted *= FORCE[draw.like] * draw.between(0.3, 3) / wanted.std()
    made = simulated(draw, sizes, device, wanted, law, period_s, delay_s)
    if made is None:
        return None
    force, position, friction = made
    force, position, count = as_logged(draw, effects, force, position, period_s)
    if law is not None and "coarse" not in effects:
        count = law.count
    position = count * np.round(position / count)
    recording = Recording(force, position, period_s, *UNITS[draw.like], f"loop-{seed}")
    told: dict[str, Any] = {}
    if not draw.new and len(draw.values["m"]) > 1 and rng.random() < 0.4:
        told["device"] = draw.like
    if rng.random() < 0.5:
        told["held"] = draw.held
    if rng.random() < 0.5:
        told["model"] = base_of(draw.values)[0]
    if "late" not in effects and ("device" in told or rng.random() < 0.4):
        told["delay_s"] = delay_s
    also: tuple[str, ...] = ()
    if law is not None:
        recording, also = with_loop_told(rng, recording, law, wanted)
    known = ", ".join([*told, *also]) or "nothing"
    masses = len(draw.values["m"])
    what = f"{draw.kind} {masses}, {name}, {kind}, {seconds:.1f} s, told {known}"
    return Case(recording, told, what, effects, truth, *known_of(draw, effects, delay_s, friction))


def with_loop_told(
    rng: np.random.Generator, recording: Recording, law: Law, wanted: Array
) -> tuple[Recording, tuple[str, ...]]:
    """The recording with its reference, or its controller declared, or neither; and which."""
    if rng.random() < 0.3:
        return replace(recording, reference=wanted), ("reference",)
    if np.isinf(law.most) and rng.random() < 0.3:
        return replace(recording, feedback=declared(law, recording.period_s)), ("controller",)
    return recording, ()


def known_of(
    draw: Draw, effects: Sequence[str], delay_s: float, friction: float
) -> tuple[str, dict[str, float]]:
    """The base model, and the true values of its parameters that are one number each."""
    base, parameters = base_of(draw.values)
    if base == "rigid" and not set(effects) & LAGS:
        parameters["delay_s"] = delay_s
    if base == "rigid" and set(effects) & {"warming up", "eddy"}:
        del parameters["b"]  # it is not one number
    if base == "rigid" and "coulomb" in effects:
        parameters["coulomb"] = friction
    return base, parameters


def law_of(draw: Draw, truth: float, period_s: float, longer: float = 1.0) -> tuple[Law, str]:
    """A controller that one mass would be well damped by, far below what is critical.

    Its times are `longer` than those of haptic devices; the count is that of the paper's devices.
    """
    name, v = str(draw.rng.choice(CONTROLLERS)), draw.values
    mass, damping = float(np.sum(v["m"])), float(v["b1"] + v["b2"])
    spring = min(mass * (2 * np.pi * draw.between(1, 8) / longer) ** 2, 0.2 * truth)
    rad_s = np.sqrt(spring / mass)
    damper = max(2 * draw.rng.uniform(0.4, 1) * mass * rad_s - damping, 0.0)
    damper = damper / period_s if "D" in name else 0.0
    integral = spring * rad_s * draw.rng.uniform(0.05, 0.15) * period_s if "I" in name else 0.0
    keep = 0.0
    if "filtered" in name:
        keep = float(np.exp(-2 * np.pi * draw.between(40, 200) / longer * period_s))
    count = COUNT[draw.like] * draw.between(0.1, 1)
    return Law(spring, damper, integral, keep, np.inf, count), name


def declared(law: Law, period_s: float) -> Feedback:
    """As a person writes it down."""
    filter_hz = -np.log(law.keep) / (2 * np.pi * period_s) if law.keep else None
    return Feedback(law.spring, law.damper * period_s, law.integral / period_s, filter_hz)


def wanted_of(draw: Draw, kind: str, samples: int, period_s: float, longer: float = 1.0) -> Array:
    """What a controller follows, or the command of an open loop, in no unit yet.

    Its times are `longer` than what a person would have a haptic device do.
    """
    rng, period_s = draw.rng, period_s / longer
    time = np.arange(samples) * period_s
    if kind == "tone":
        return np.asarray(np.sin(2 * np.pi * draw.between(0.5, 20) * time))
    if kind == "noise":
        low = butter(2, draw.between(1, 30), fs=1 / period_s, output="sos")
        return np.asarray(sosfilt(low, rng.normal(size=samples + 5000))[5000:])
    pieces, last, total, sign = [np.zeros(int(0.05 / period_s))], 0.0, 0, 1
    while total < samples:
        long, pause = (int(draw.between(0.1, 0.8) / period_s) for _ in range(2))
        share = np.arange(1, long + 1) / long
        if kind in OPEN:  # there and back, so that it stays near
            sign = -sign
            height, pause = sign * rng.uniform(0.3, 1), pause if kind == "pulses" else 0
            goal, piece = 0.0, np.full(long, height)
        else:
            goal = rng.uniform(-1, 1)
            shape = {"steps": np.ones(long), "ramps": share}.get(
                kind, share**3 * (10 - 15 * share + 6 * share**2)
            )
            piece = last + (goal - last) * shape
        pieces += [piece, np.full(pause, goal)]
        last, total = goal, total + long + pause
    return np.concatenate(pieces)[:samples]


def simulated(
    draw: Draw,
    sizes: dict[str, tuple[float, ...]],
    device: States,
    wanted: Array,
    law: Law | None,
    period_s: float,
    delay_s: float,
) -> tuple[Array, Array, float] | None:
    """Command, motion and dry friction; first without forces, for the scale of these."""
    motion = motion_of(draw, sizes, device, len(wanted), period_s, delay_s)
    quiet, command = np.zeros(len(wanted)), wanted.copy()
    linear = motion.under(command, quiet, Forces(), law)
    if linear is None or not command.std() > 0:
        return None
    hand = hand_of(draw, len(wanted), period_s, command.std())
    forces = forces_of(draw, tuple(sizes), command, linear, period_s)
    command = wanted.copy()
    made = motion.under(command, hand, forces, law)
    far = 20.0
    if made is None or np.abs(made).max() > far * np.abs(linear).max() or not made.std() > 0:
        return None
    return command, made, forces.friction


def one(seed: int) -> Row:
    """What became of the recording of a seed."""
    return {"seed": seed} | analysed(make(seed))


def one_mass(seed: int) -> Row:
    """The same, said to be of one mass and free; none if it is not, or not in a loop."""
    case = make(seed)
    short_s = 2.5
    if (
        case is None
        or case.base != "rigid"
        or "open loop" in case.what
        or case.recording.duration_s < short_s
    ):
        return {"seed": seed} | analysed(None)
    told = {"model": "rigid", "held": False}
    told |= {name: value for name, value in case.told.items() if name == "delay_s"}
    return {"seed": seed} | analysed(replace(case, told=told))


def open_loop(seed: int) -> Row:
    """The same in open loop, of any length; delay and friction are parameters, too."""
    case = make(seed)
    if case is None or case.base != "rigid" or "open loop" not in case.what:
        return {"seed": seed} | analysed(None)
    told = {"model": "rigid", "held": False}
    return {"seed": seed} | analysed(replace(case, told=told))


def main() -> None:
    parser = parser_of(__doc__)
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--one-mass", dest="one", action="store_const", const=one_mass, default=one)
    which.add_argument("--open-loop", dest="one", action="store_const", const=open_loop)
    asked = parser.parse_args()
    kept(asked, asked.one)


if __name__ == "__main__":
    main()
