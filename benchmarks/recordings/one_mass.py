"""One mass with friction under a controller: what `closed_loop.py` and `in_open_loop.py` read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.rig import Bench, run_loop
from bayeshaptic.rig.effects import Effect
from bayeshaptic.types import Floats

PERIOD_S = 1e-3
CONTROLLERS = ("P", "PD", "PI", "PID", "PD, filtered")
REFERENCES = ("steps", "ramps", "noise", "trajectory")
WAVES = 6


@dataclass(frozen=True)
class Track(Effect):
    """A force on the device that nobody commands: the last entry of a list that others write."""

    name = "track"
    force: tuple[list[float], ...] = ()

    def command(self, force: Floats, progress: Floats, time_s: Floats) -> Floats:
        return force + self.force[0][0]


@dataclass(frozen=True)
class Case:
    """A recording, the truth in the order of `NAMES`, and what disturbed it.

    `resolution` is the encoder's count, `noise` the sd of a white force that nobody commands.
    """

    recording: Recording
    truth: Floats
    what: str
    resolution: float
    noise: float


def reference(kind: str, count: int, stroke: float, rng: np.random.Generator) -> Floats:
    """What the controller follows, shape (count,)."""
    if kind == "noise":
        from scipy.signal import butter, sosfilt

        low = butter(2, rng.uniform(2, 8), fs=1 / PERIOD_S, output="sos")
        wander = sosfilt(low, rng.standard_normal(count + 2000))[2000:]
        return wander / wander.std() * stroke * 0.5
    pieces, last, total = [], 0.0, 0
    while total < count:
        length = int(rng.uniform(0.3, 0.9) / PERIOD_S)
        pause = int(rng.uniform(0, 0.2) / PERIOD_S) if kind == "trajectory" else 0
        goal = rng.uniform(-1, 1) * stroke
        share = np.arange(1, length + 1) / length
        shape = {
            "steps": np.ones(length),
            "ramps": share,
            "trajectory": share**3 * (10 - 15 * share + 6 * share**2),
        }[kind]
        pieces.append(np.append(last + (goal - last) * shape, np.full(pause, goal)))
        last, total = goal, total + length + pause
    return np.concatenate(pieces)[:count]


def gains(kind: str, mass: float, rng: np.random.Generator) -> tuple[float, ...]:
    """Damping of the device, and P, D, I and what the velocity's filter keeps."""
    if kind in ("P", "PI"):  # the device itself must damp the loop
        rate = rng.uniform(6, 25)
        omega = rate / (2 * rng.uniform(0.25, 0.7))
        derivative = 0.0
    else:
        rate = np.exp(rng.uniform(np.log(2), np.log(20)))
        omega = 2 * np.pi * rng.uniform(2, 12)
        derivative = max(2 * rng.uniform(0.4, 1) * mass * omega - mass * rate, 0.0)
    spring = mass * omega**2
    integral = spring * omega * rng.uniform(0.05, 0.15) if "I" in kind else 0.0
    filtered = kind in ("PID", "PD, filtered")
    keep = np.exp(-2 * np.pi * rng.uniform(60, 200) * PERIOD_S) if filtered else 0.0
    return mass * rate, spring, derivative, integral, keep


@dataclass(frozen=True)
class Along:
    """Forces along the way, each a sum of waves: 0 as such, 1 and 2 of friction, both ways."""

    number: Floats
    phase: Floats
    height: Floats

    @classmethod
    def drawn(cls, uneven: float, dry: float, stroke: float, rng: np.random.Generator) -> Along:
        """Of size `uneven`, those of friction a quarter of `dry`; waves as long as the stroke."""
        phase = rng.uniform(0, 2 * np.pi, (3, WAVES))
        height = rng.standard_normal((3, WAVES)) / np.sqrt(np.arange(1, WAVES + 1))
        height /= np.sqrt(np.sum(height**2, axis=1) / 2)[:, None]
        rubs = 0.25 * dry * bool(uneven)
        height *= np.array([uneven, rubs, rubs])[:, None]
        return cls(0.7 * np.pi * np.arange(1, WAVES + 1) / stroke, phase, height)

    def force(self, which: int, position: Floats | float) -> Floats:
        at = np.asarray(position)[..., None] * self.number + self.phase[which]
        return np.asarray(np.sum(self.height[which] * np.sin(at), axis=-1))


@dataclass(frozen=True)
class Besides:
    """What acts on the mass besides command, viscous damping and dry friction.

    Attributes
    ----------
    offset : float
        A constant force.
    apart : float
        By how much friction is larger forward than backward, halved.
    along : Along
    white : ndarray, shape (N,)
    slow : float
        Velocity up to which friction grows.
    """

    offset: float
    apart: float
    along: Along
    white: Floats
    slow: float

    def force(self, k: int, position: float, velocity: float) -> float:
        """At a sample."""
        moving = float(np.clip(velocity / self.slow, -1, 1))
        friction = float(self.along.force(1 if moving > 0 else 2, position))
        constant = self.offset + float(self.along.force(0, position))
        return constant - moving * friction - abs(moving) * self.apart + self.white[k]

    def means(self, position: Floats) -> tuple[float, float]:
        """Of its friction, and of a constant force that the command overcomes, where it moves."""
        at = position[:-1][np.diff(position) != 0]
        mean, forward, backward = (float(self.along.force(which, at).mean()) for which in range(3))
        return (forward + backward) / 2, (forward - backward) / 2 + self.apart - self.offset - mean


def make(seed: int, noise: float | None = None, along_too: bool = False) -> Case:
    """One recording; controllers and references in turn.

    With `noise` there is a white force, as a share of the command's size, and none along the way
    unless `along_too`.
    """
    rng = np.random.default_rng(seed)
    controller = CONTROLLERS[seed % 5]
    kind = REFERENCES[seed // 5 % 4]
    seconds = float(np.exp(rng.uniform(np.log(2), np.log(30))))
    mass = float(np.exp(rng.uniform(np.log(0.1), np.log(10))))
    stroke = rng.uniform(0.02, 0.1)
    damping, spring, derivative, integral, keep = gains(controller, mass, rng)
    wanted = reference(kind, round(seconds / PERIOD_S), stroke, rng)
    size = spring * stroke * (0.1 if kind == "trajectory" else 0.3)
    dry = 0.0 if rng.uniform() < 0.35 else rng.uniform(0.03, 0.3) * size
    uneven = 0.0 if rng.uniform() < 0.3 else rng.uniform(0.01, 0.06) * size
    white = np.zeros(len(wanted))
    if noise is not None:
        uneven = uneven if along_too else 0.0
        white = noise * size * np.random.default_rng([seed, 1]).standard_normal(len(wanted))
    offset = rng.uniform(-0.1, 0.1) * size
    apart = rng.uniform(-0.3, 0.3) * dry if uneven else 0.0
    delay = rng.uniform(0, 2) * PERIOD_S
    along = Along.drawn(uneven, dry, stroke, rng)
    besides = Besides(offset, apart, along, white, slow=0.02 * stroke * np.sqrt(spring / mass))
    force = [offset]
    now = dict.fromkeys(("position", "velocity", "sum", "smooth"), 0.0)

    def control(k: int, position: float) -> float:
        rate = (position - now["position"]) / PERIOD_S if k else 0.0
        now["position"] = position
        now["velocity"] = keep * now["velocity"] + (1 - keep) * rate
        now["sum"] += (wanted[k] - position) * PERIOD_S
        now["smooth"] = 0.8 * now["smooth"] + 0.2 * rate
        force[0] = besides.force(k, position, now["smooth"])
        follow = spring * (wanted[k] - position)
        return float(follow - derivative * now["velocity"] + integral * now["sum"])

    bench = Bench(
        "rigid",
        {"m": mass, "b": damping},
        delay_s=delay,
        encoder_resolution=10 ** rng.uniform(-6.3, -5),
    ).with_effect(Track((force,)))
    if dry:
        bench = bench.with_effect("coulomb_friction", force=dry)
    done = run_loop(bench, control, seconds, seed=seed, give_up=100 * stroke)
    rubs, pulls = besides.means(done.position)
    truth = np.array([mass, damping, dry + rubs, pulls, delay])
    recording = recording_from_arrays(done.force, done.position, PERIOD_S, name=f"seed {seed}")
    what = f"{controller}, {kind}, {seconds:.1f} s"
    return Case(recording, truth, what, bench.encoder_resolution, (noise or 0.0) * size)
