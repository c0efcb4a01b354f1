"""The bench with its loop closed: any controller, a relay, a virtual wall."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.rig.bench import Bench
from bayeshaptic.rig.dynamics.plant import Array
from bayeshaptic.rig.dynamics.propagate import split_delay
from bayeshaptic.rig.dynamics.stepper import SUBSTEPS, Stepper
from bayeshaptic.rig.effects import Effect
from bayeshaptic.rig.excitation import sample_count
from bayeshaptic.rig.motion import Start, epochs, initial_state
from bayeshaptic.rig.recording import SimulatedRecording
from bayeshaptic.rig.sensing import Encoder, Streams, actuate, hand_force, write_down
from bayeshaptic.rig.truth import smoothing_of

Controller = Callable[[int, float], float]


def run_loop(
    bench: Bench,
    controller: Controller,
    seconds: float,
    seed: int = 0,
    start: Start | None = None,
    give_up: float = np.inf,
    substeps: int = SUBSTEPS,
) -> SimulatedRecording:
    """Record the bench with its loop closed through a controller.

    Parameters
    ----------
    bench : Bench
        Its effects on the sensor act on what the controller reads, those on the log do not.
    controller : callable
        (k, position read) -> force commanded at sample k.
    seconds : float
    seed : int
    start : mapping of str to (position, velocity), optional
        Motion of the masses at the beginning.
    give_up : float
        Stop where the position leaves +-give_up; the recording is then shorter.
    substeps : int
        Steps a period where there are nonlinear or delayed forces.

    Returns
    -------
    SimulatedRecording
    """
    count = sample_count(seconds, bench.period_s)
    run = _Run(bench, controller, count, seed, start, substeps)
    run.go(give_up)
    done = slice(0, run.done)
    samples = run.encoder.stamped(run.time_s[done], run.reading[done])
    return write_down(
        bench,
        run.streams,
        samples,
        run.command[done],
        run.position[done],
        run.hand[done],
    )


class _Run:
    """One closed-loop run, sample by sample."""

    def __init__(
        self,
        bench: Bench,
        controller: Controller,
        count: int,
        seed: int,
        start: Start | None,
        substeps: int,
    ) -> None:
        self.bench, self.controller = bench, controller
        self.streams = Streams(seed, len(bench.effects))
        self.encoder = Encoder(bench, self.streams)
        self.hand = hand_force(bench, count + 1, self.streams)
        self.time_s = np.arange(count) * bench.period_s
        self.progress = self.time_s / self.time_s[-1]
        self.parts = epochs(bench, self.progress)
        self.plant = self.parts[0].plant
        self.stepper = Stepper(self.plant, bench.period_s, substeps)
        self.stepper.start(initial_state(self.plant, start))
        self.command, self.position, self.reading = np.zeros((3, count))
        self.plain = all(type(e).command is Effect.command for e in bench.effects)
        self.done = 0

    def go(self, give_up: float) -> None:
        """Run to the end, or until the position leaves +-give_up; `done` counts the samples."""
        whole, _ = split_delay(self.plant.delay_s, self.bench.period_s)
        acting = [0.0] * (whole + 1)
        hand = self.hand.tolist()
        for block in self.parts:
            if block.first:
                self.stepper.retune(block.plant)
            for k in range(block.first, block.stop):
                acting.append(self._act(k))
                self.done = k + 1
                if not abs(self.position[k]) <= give_up:
                    return
                self.stepper.advance(acting[k], acting[k + 1], hand[k], hand[k + 1])

    def _act(self, k: int) -> float:
        """Read, command, and what the actuator gets of it."""
        state, encoder = self.stepper.state, self.encoder
        position = float(self.plant.position @ state)
        velocity = float(self.plant.velocity @ state) if encoder.effects else 0.0
        reading = encoder.read_one(self.time_s[k], position, velocity)
        force = self.controller(k, reading)
        self.position[k], self.reading[k], self.command[k] = position, reading, force
        if self.plain:
            return force
        now = slice(k, k + 1)
        return float(
            actuate(self.bench, self.command[now], self.progress[now], self.time_s[now])[0]
        )


def run_relay(
    bench: Bench,
    amplitude: float | None = None,
    seconds: float = 30.0,
    hysteresis: float = 0.0,
    seed: int = 0,
    start: Start | None = None,
) -> SimulatedRecording:
    """A relay experiment: the force is -amplitude sign(position).

    The loop settles into an oscillation near the frequency where the phase is -180 degrees, and its
    amplitude tells the gain there (Astrom and Hagglund, Automatica 20, 1984). A relay that switches
    at samples does so up to a period late, where a held stiffness is late by half a period: it may
    settle to either side of that frequency, on half periods of whole samples, unless a hand that
    wanders keeps it moving.

    Parameters
    ----------
    bench : Bench
    amplitude : float, optional
        N or N m. By default three times the usual excitation: a hand that wanders is then no match.
    seconds : float
    hysteresis : float
        The relay switches where the position has passed zero by this much.
    seed : int
    start : mapping of str to (position, velocity), optional

    Returns
    -------
    SimulatedRecording

    Raises
    ------
    InputError
        For an amplitude that is not above zero, and a hysteresis below zero.
    """
    amplitude = 3 * bench.force_rms if amplitude is None else amplitude
    if not amplitude > 0 or not hysteresis >= 0:
        raise InputError(
            f"a relay of {amplitude:g} with a hysteresis of {hysteresis:g} cannot be; "
            "give an amplitude above zero and a hysteresis of at least zero"
        )
    force = amplitude

    def relay(k: int, position: float) -> float:
        nonlocal force
        if position > hysteresis:
            force = -amplitude
        elif position < -hysteresis:
            force = amplitude
        return force

    return run_loop(bench, relay, seconds, seed, start)


@dataclass(frozen=True)
class WallRun:
    """A virtual wall, pushed and left alone.

    Attributes
    ----------
    recording : SimulatedRecording
    growth_per_s : float
        Rate of the oscillation's exponential in the second half; negative: it dies out.
    """

    recording: SimulatedRecording = field(repr=False)
    growth_per_s: float

    @property
    def stable(self) -> bool:
        """Whether the oscillation dies out."""
        return self.growth_per_s < 0


def run_wall(
    bench: Bench,
    stiffness: float,
    damping: float = 0.0,
    seconds: float = 20.0,
    push: float | None = None,
    seed: int = 0,
    substeps: int = SUBSTEPS,
    cutoff_hz: float | None = None,
) -> WallRun:
    """Render a virtual wall on both sides of the present position, and see whether it shakes.

    The force is -stiffness y[k] - damping v[k], v[k] = (y[k] - y[k-1])/T, or with a cut-off
    v[k] = a v[k-1] + (1 - a)(y[k] - y[k-1])/T, a = exp(-2 pi cutoff_hz T).
    For a verdict on the linear loop use `bench.quiet()`: an encoder's counts keep small
    oscillations alive, tremor goes on for ever.

    Parameters
    ----------
    bench : Bench
    stiffness, damping : float
        N/m and N s/m, or N m/rad and N m s/rad.
    seconds : float
        Long enough for the faster modes to die out and the slowest to show its trend.
    push : float, optional
        Velocity of the motor at the beginning; by default a tenth of its usual one.
    seed : int
    substeps : int
    cutoff_hz : float, optional
        Of a first-order low-pass on the velocity; by default none.

    Returns
    -------
    WallRun
    """
    push = 0.1 * bench.scales().velocity if push is None else push
    smoothing = smoothing_of(cutoff_hz, bench.period_s)
    before = rate = 0.0

    def wall(k: int, position: float) -> float:
        nonlocal before, rate
        step = (position - before) / bench.period_s if k else 0.0
        rate = smoothing * rate + (1 - smoothing) * step
        before = position
        return -stiffness * position - damping * rate

    largest = 1e6 * abs(push) * seconds or np.inf
    recording = run_loop(bench, wall, seconds, seed, {"m1": (0.0, push)}, largest, substeps)
    return WallRun(recording, _growth(recording.true_position, bench.period_s))


def _growth(position: Array, period_s: float) -> float:
    """Rate of the oscillation's envelope, by Hann-weighted root mean squares of ten blocks."""
    half = position[len(position) // 2 :]
    length = len(half) // 10
    if length < 2:
        return np.inf
    pieces = half[-10 * length :].reshape(10, length)
    window = np.hanning(length + 2)[1:-1] ** 2
    window /= window.sum()
    swing = pieces - (window * pieces).sum(axis=1)[:, None]
    power = (window * swing**2).sum(axis=1)
    # Where friction holds it, nothing swings any more but the last digit.
    if not np.all(power > 1e-24 * np.max(pieces**2)):
        return -np.inf
    middles = (np.arange(10) - 4.5) * length * period_s
    return float(0.5 * np.log(power) @ middles / (middles @ middles))
