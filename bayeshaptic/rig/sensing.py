"""The way of a position through the encoder into the controller, and into the log."""

from __future__ import annotations

import numpy as np

from bayeshaptic.rig.bench import Bench
from bayeshaptic.rig.dynamics.plant import Array
from bayeshaptic.rig.effects.effect import Effect, Log, Readings
from bayeshaptic.rig.noise import shaped_noise, tremor_density, wander_density
from bayeshaptic.rig.recording import SimulatedRecording


class Streams:
    """Independent random numbers for each source, so that adding one leaves the others alone."""

    def __init__(self, seed: int, effects: int) -> None:
        children = np.random.SeedSequence(seed).spawn(4 + 2 * effects)
        generators = [np.random.default_rng(child) for child in children]
        self.excitation, self.tremor, self.wander, self.sensor = generators[:4]
        self.sense = generators[4::2]
        self.log = generators[5::2]


def hand_force(bench: Bench, samples: int, streams: Streams) -> Array:
    """The hand's own force, tremor and wander.

    Parameters
    ----------
    bench : Bench
    samples : int
    streams : Streams

    Returns
    -------
    ndarray, shape (samples,)
        N or N m; zero where nobody holds the device.
    """
    force = np.zeros(samples)
    if bench.mechanism != "grasped":
        return force
    sources = (
        (bench.tremor_rms, tremor_density(bench.tremor_hz), streams.tremor),
        (bench.wander_rms, wander_density(bench.wander_hz), streams.wander),
    )
    for rms, density, rng in sources:
        if rms > 0:
            force += rms * shaped_noise(density, samples, bench.period_s, rng)
    return force


class Encoder:
    """What the controller reads: noise, effects on the sensor, counts."""

    def __init__(self, bench: Bench, streams: Streams) -> None:
        self.noise_rms = bench.sensor_noise_rms
        self.rng = streams.sensor
        self.resolution = bench.resolution
        self.effects = [
            (effect, rng)
            for effect, rng in zip(bench.effects, streams.sense, strict=True)
            if type(effect).sense is not Effect.sense
        ]

    def read(self, time_s: Array, position: Array, velocity: Array) -> Readings:
        """Read N positions.

        Parameters
        ----------
        time_s, position, velocity : ndarray, shape (N,)
            Of the motor, in front of the encoder.

        Returns
        -------
        Readings
            With the logger's time stamps, and positions in whole counts.
        """
        if self.noise_rms > 0:
            position = position + self.rng.normal(0.0, self.noise_rms, len(position))
        samples = Readings(time_s, position, velocity)
        for effect, rng in self.effects:
            samples = effect.sense(samples, rng)
        if self.resolution > 0:
            counts = np.round(samples.position / self.resolution)
            samples = Readings(samples.time_s, counts * self.resolution, samples.velocity)
        return samples

    def read_one(self, time_s: float, position: float, velocity: float) -> float:
        """One counted position, without the cost of arrays where nothing asks for them."""
        if not self.effects and not self.noise_rms:
            q = self.resolution
            return round(position / q) * q if q > 0 else position
        arrays = (np.array([number]) for number in (time_s, position, velocity))
        return float(self.read(*arrays).position[0])

    def stamped(self, time_s: Array, reading: Array) -> Readings:
        """What was read one by one, as samples; the stamps are the nominal ones."""
        return Readings(time_s, reading, np.zeros(len(reading)))


def actuate(bench: Bench, command: Array, progress: Array, time_s: Array) -> Array:
    """What the actuator gets of the commands, all effects on it one after the other.

    Parameters
    ----------
    bench : Bench
    command : ndarray, shape (N,)
    progress : ndarray, shape (N,)
        Part of the recording that is over, 0 to 1.
    time_s : ndarray, shape (N,)

    Returns
    -------
    ndarray, shape (N,)
    """
    for effect in bench.effects:
        command = effect.command(command, progress, time_s)
    return command


def write_down(
    bench: Bench,
    streams: Streams,
    samples: Readings,
    command: Array,
    true_position: Array,
    hand: Array,
) -> SimulatedRecording:
    """The recording that the logger makes of what was commanded and read.

    Parameters
    ----------
    bench : Bench
    streams : Streams
    samples : Readings
        What the encoder gave, N of them.
    command : ndarray, shape (N,)
        What was commanded.
    true_position : ndarray, shape (N,)
        In front of the encoder.
    hand : ndarray, shape (N,)
        The hand's force.

    Returns
    -------
    SimulatedRecording
        With fewer rows where the logger loses some.
    """
    log = Log(samples.time_s, command, samples.position)
    for effect, rng in zip(bench.effects, streams.log, strict=True):
        log = effect.log(log, rng)
    return SimulatedRecording(
        log.time_s,
        log.force,
        log.position,
        true_position,
        hand,
        bench.period_s,
        bench.force_unit,
        bench.position_unit,
        bench,
    )
