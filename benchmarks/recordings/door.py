"""What the benchmark of the door records: open loops of every usual kind, and closed ones."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import butter, sosfilt

from bayeshaptic.recordings.from_arrays import recording_from_arrays
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.rig import Bench, Multisine, WhiteNoise, run_loop, simulate
from bayeshaptic.types import Floats
from benchmarks.recordings.controllers import Law, controller_of, low_passed, steps

CONTROLLERS = ("P", "PD", "PI", "PID", "PD filtered", "PID saturated")
REFERENCES = ("steps", "ramps", "noise", "wall with dither")
EXCITATIONS = ("white", "coloured", "multisine", "sweep", "binary", "steps")
LOGGED = ("at the sample", "a sample early", "a sample late", "a late command")
# A loop that shakes at its limit is another experiment; so is one that does not move.
_FARTHEST = 20.0  # times the reference's size
_FEWEST_COUNTS = 20.0


@dataclass(frozen=True)
class Case:
    """One simulated recording, and what it is.

    Attributes
    ----------
    closed : bool
    kind : str
        Excitation in open loop, controller in closed loop.
    reference : str
    logged : str
        When the position was written down beside the command.
    device : str
    friction : bool
    answer : float
        Of a closed loop: share of the force's power that answers to chance, which is what the hand
        and the counts of the encoder do. It is this share that biases: friction alone moves with
        the force, and an open loop with the same force shows the same motion.
    recording : Recording
    bench : Bench
    law : Law or None
        The controller of a closed loop.
    """

    closed: bool
    kind: str
    reference: str
    logged: str
    device: str
    friction: bool
    answer: float
    recording: Recording
    bench: Bench
    law: Law | None = None

    @property
    def weight(self) -> float:
        """Power of the force's answer to chance, over that of the chance of one sample in all.

        Its root bounds the bias of any parameter, in standard deviations, for a white force.
        """
        return self.answer * self.recording.samples


def open_case(seed: int) -> Case:
    """An open-loop recording of a random device."""
    rng = np.random.default_rng((1, seed))
    while True:
        bench, device, friction = _bench(rng)
        kind = EXCITATIONS[seed % len(EXCITATIONS)]
        seconds = float(np.exp(rng.uniform(np.log(2.0), np.log(30.0))))
        made = simulate(bench, _excitation(kind, bench, seconds, rng), seed=int(rng.integers(1e9)))
        logged = LOGGED[rng.choice(3, p=(0.5, 0.25, 0.25))]
        if np.ptp(made.position) > _FEWEST_COUNTS * bench.encoder_resolution:
            break
    recording = written_down(made.force, made.position, bench, logged)
    return Case(False, kind, "", logged, device, friction, 0.0, recording, bench)


def band_case(seed: int) -> Case:
    """An open-loop recording of a random device under noise that was band-passed.

    From 0.002 to 0.02 of the sampling rate on, up to 0.2 to 0.45 of it.
    """
    rng = np.random.default_rng((4, seed))
    while True:
        bench, device, friction = _bench(rng)
        samples = round(float(np.exp(rng.uniform(np.log(8.0), np.log(30.0)))) / bench.period_s)
        low, high = float(10 ** rng.uniform(-2.7, -1.7)), float(rng.uniform(0.2, 0.45))
        order = int(rng.choice([1, 2, 2, 4]))
        edges = butter(order, [2 * low, 2 * high], "band", output="sos")
        noise = sosfilt(edges, rng.standard_normal(samples))
        force = bench.force_rms * noise / noise.std()
        made = simulate(bench, force, seed=int(rng.integers(1e9)))
        if np.ptp(made.position) > _FEWEST_COUNTS * bench.encoder_resolution:
            break
    recording = written_down(made.force, made.position, bench, LOGGED[0])
    return Case(False, "band", "", LOGGED[0], device, friction, 0.0, recording, bench)


def closed_case(seed: int, reference: str | None = None) -> Case:
    """A closed-loop recording of a random device under a random controller.

    It follows `reference`, or one of `REFERENCES` in turn.
    """
    rng = np.random.default_rng((2, seed))
    kind = CONTROLLERS[seed % len(CONTROLLERS)]
    reference = reference or REFERENCES[seed // len(CONTROLLERS) % len(REFERENCES)]
    while True:
        bench, device, friction = _bench(rng)
        seconds = float(np.exp(rng.uniform(np.log(2.0), np.log(30.0))))
        logged = LOGGED[rng.choice(4, p=(0.4, 0.15, 0.15, 0.3))]
        law = controller_of(kind, reference, bench, seconds, rng, logged)
        noise = int(rng.integers(1e9))
        made = run_loop(bench, law.begin(), seconds, noise, give_up=_FARTHEST * law.size)
        whole = len(made.force) >= round(seconds / bench.period_s) - 1
        if whole and np.ptp(made.position) > _FEWEST_COUNTS * bench.encoder_resolution:
            break
    ideal = run_loop(bench.quiet(), law.begin(), seconds, noise)
    answer = _answer(made.force, ideal.force)
    recording = written_down(made.force, made.position, bench, logged)
    return Case(True, kind, reference, logged, device, friction, answer, recording, bench, law)


def _bench(rng: np.random.Generator) -> tuple[Bench, str, bool]:
    """A device with parameters, delay, encoder and friction of its own, held or not."""
    name = str(rng.choice(["lhifam", "phantom"]))
    mechanism = str(rng.choice(["rigid", "free", "grasped"]))
    bench = Bench.from_device(name, mechanism == "grasped", mechanism)
    values = {key: v * float(np.exp(rng.normal(0, 0.3))) for key, v in bench.values.items()}
    period = float(rng.choice([5e-4, 1e-3, 1e-3, 2e-3]))
    bench = replace(
        bench,
        values=values,
        period_s=period,
        delay_s=float(rng.uniform(0, 3)) * period,
        encoder_resolution=bench.encoder_resolution * float(10 ** rng.uniform(-1.5, 0.5)),
    )
    friction = bool(rng.random() < 0.5)
    if friction:
        force = bench.force_rms * float(10 ** rng.uniform(-2, -0.5))
        bench = bench.with_effect("coulomb_friction", force=force)
    return bench, f"{name} {mechanism}", friction


def _excitation(
    kind: str, bench: Bench, seconds: float, rng: np.random.Generator
) -> WhiteNoise | Multisine | Floats:
    period = bench.period_s
    nyquist = 0.5 / period
    samples = round(seconds / period)
    time = np.arange(samples) * period
    rms = bench.force_rms
    if kind == "white":
        return WhiteNoise(rms, nyquist * float(rng.uniform(0.1, 1.0)), 0.5, seconds)
    if kind == "multisine":
        spacing = float(rng.choice([1.0, 2.0, 5.0]))
        phase = str(rng.choice(["schroeder", "random"]))
        last = nyquist * float(rng.uniform(0.2, 0.9))
        periods = max(2, int(seconds * spacing))
        return Multisine(rms, spacing, last, spacing, periods, phase)
    if kind == "sweep":
        low, high = 0.5, nyquist * rng.uniform(0.1, 0.8)
        rate = np.log(high / low) / seconds
        return np.sqrt(2) * rms * np.sin(2 * np.pi * low * np.expm1(rate * time) / rate)
    if kind == "binary":
        clock = int(rng.integers(1, 20))
        bits = rng.choice([-1.0, 1.0], samples // clock + 1)
        return rms * np.repeat(bits, clock)[:samples]
    if kind == "steps":
        return rms * steps(samples, period, rng)
    pole = float(np.exp(-2 * np.pi * rng.uniform(5, 100) * period))
    noise = low_passed(rng.normal(size=samples), pole)
    return rms * noise / noise.std()


def _answer(force: Floats, ideal: Floats) -> float:
    """Share of a force's power that a device without noise would not have caused."""
    return float(np.var(force - ideal) / np.var(force))


def written_down(force: Floats, position: Floats, bench: Bench, logged: str) -> Recording:
    """The recording, with each position beside the force that `logged` says."""
    if logged == "a sample early":
        force, position = force[:-1], position[1:]
    elif logged == "a sample late":
        force, position = force[1:], position[:-1]
    return recording_from_arrays(
        force, position, period_s=bench.period_s, force_unit=bench.force_unit
    )
