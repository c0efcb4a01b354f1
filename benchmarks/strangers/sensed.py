"""Velocities, accelerations, measured forces and tables of another simulation.

    python -m benchmarks.strangers.sensed [COUNT] [FIRST] [FILE]

Devices like those of Diaz and Gil, free and held, with nothing in them but what the sensors do:
tachometers and differences of an encoder beside a command; position, velocity or acceleration
beside a force whose sensor is fast, or lets pass 100 to 1000 Hz; and tables of a continuous
structure. Half of the motions behind a force were low-passed with it before they were sampled, as
good loggers do. Some are told their delay, some whether somebody holds them.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import butter, cheby2, lfilter, sosfilt

from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.frf_table import read_frf
from bayeshaptic.recordings.signals.other_outputs import as_command_and_position
from benchmarks.strangers.__main__ import run
from benchmarks.strangers.device import Array, States
from benchmarks.strangers.draw import (
    BAND_HZ,
    COUNT,
    DELAY_S,
    FORCE,
    UNITS,
    Case,
    Draw,
    base_of,
    begun as drawn,
    hand_of,
    states_of,
)

STEPS = 16  # a period
COMMANDED = ("velocity", "differences")
FORCED = ("position", "velocity", "acceleration", "lagging sensor")
TABLES = {"receptance": 0, "mobility": 1, "accelerance": 2}
KINDS = (
    *(f"{kind} beside a command" for kind in COMMANDED),
    *(f"{kind} beside a force" for kind in FORCED),
    *TABLES,
)


def make(seed: int) -> Case:
    """A recording or a table, what is told of it, and its limit."""
    rng = np.random.default_rng([61, seed])
    draw, kind = drawn(rng), KINDS[seed % len(KINDS)]
    period_s = float(rng.choice([5e-4, 1e-3, 1e-3, 2e-3]))
    delay_s = DELAY_S[draw.like] * draw.between(0.6, 4.0)
    delay_s = max(round(delay_s / period_s * STEPS), 1) / STEPS * period_s
    device = states_of(draw, {}, 1.0, 1.0)
    sensed = "command" not in kind
    told: dict[str, Any] = {"delay_s": delay_s} if sensed or rng.random() < 0.5 else {}
    if rng.random() < 0.5:
        told["held"] = draw.held
    if kind in TABLES:
        measured, how = _table(kind, draw, device, period_s)
    elif sensed:
        measured, how = _beside_force(kind, draw, device, period_s)
    else:
        measured, how = _beside_command(kind, draw, device, period_s, delay_s)
    base, parameters = base_of(draw.values)
    what = f"{draw.kind}, {kind}{how}, {1e3 * period_s:g} ms, told {sorted(told)}"
    truth = device.critical_stiffness(period_s, delay_s)
    return Case(measured, told, what, (), truth, base, parameters)


def _beside_command(
    kind: str, draw: Draw, device: States, period_s: float, delay_s: float
) -> tuple[Recording, str]:
    """A velocity, of a tachometer or of an encoder's differences."""
    samples, step_s = int(draw.between(6, 30) / period_s), period_s / STEPS
    command = _in_band(draw, samples, period_s, period_s)
    late = round(delay_s / step_s)
    force = np.concatenate([np.zeros(late), np.repeat(command, STEPS)])[: samples * STEPS]
    hand = np.repeat(hand_of(draw, samples, period_s, command.std()), STEPS)
    position, velocity, _ = (one[::STEPS] for one in _moved(device, step_s, force, hand))
    if kind.startswith("differences"):
        read = np.diff(_counted(draw, position), prepend=0.0) / period_s
    else:
        read = velocity + _noise(draw, velocity, 0.05)
    recording = Recording(command, read, period_s, *UNITS[draw.like])
    return as_command_and_position(recording, "force", "velocity"), ""


def _beside_force(kind: str, draw: Draw, device: States, period_s: float) -> tuple[Recording, str]:
    """A motion beside a force that changes at any instant; and its sensors in words."""
    samples, step_s = int(draw.between(6, 30) / period_s), period_s / STEPS
    low = cheby2(8, 70, 2 * 0.45 / STEPS, output="sos")
    both, how = bool(draw.rng.random() < 0.5), ""
    force = _in_band(draw, samples * STEPS, step_s, period_s)
    if not both:  # nothing to low-pass
        force = sosfilt(low, force)
    hand = np.repeat(hand_of(draw, samples, period_s, force.std()), STEPS)
    name = next((name for name in FORCED[:3] if kind.startswith(name)), "position")
    output = _moved(device, step_s, force, hand)[FORCED.index(name)]
    seen = _about_steps(force)
    if kind.startswith("lagging"):
        corner = draw.between(100, 1000)
        seen, how = lfilter(*butter(1, 2 * corner * step_s), seen), f" ({corner:.0f} Hz)"
    if both:
        seen, output, how = sosfilt(low, seen), sosfilt(low, output), how + ", both low-passed"
    seen, output = seen[::STEPS], output[::STEPS]
    seen = seen + _noise(draw, seen, 0.01)
    noise = _noise(draw, output, 0.03)
    output = _counted(draw, output) if name == "position" else output + noise
    recording = Recording(seen, output, period_s, *UNITS[draw.like])
    return as_command_and_position(recording, "measured_force", name), how


def _table(kind: str, draw: Draw, device: States, period_s: float) -> tuple[Etfe, str]:
    """A table of 40 to 2000 lines with known standard deviations."""
    lines = int(draw.between(40, 2000))
    low_hz, top_hz = BAND_HZ[draw.like][0], draw.between(0.13, 0.45) / period_s
    frequency = np.linspace(max(low_hz, top_hz / lines), top_hz, lines)
    if draw.rng.random() < 0.4:
        frequency = np.geomspace(low_hz, top_hz, lines)
    s = 2j * np.pi * frequency
    eye = np.eye(len(device.a))
    true = np.array([device.c @ np.linalg.solve(each * eye - device.a, device.b) for each in s])
    true = true * s ** TABLES[kind]
    size = draw.between(0.002, 0.1)
    sd = size * (np.abs(true) + 0.3 * np.median(np.abs(true)))
    normal = draw.rng.normal(size=(2, lines)) / np.sqrt(2)
    seen = true + sd * (normal[0] + 1j * normal[1])
    header = f"frequency_hz,{kind}_db,phase_deg,sd"
    columns = [frequency, 20 * np.log10(np.abs(seen)), np.degrees(np.angle(seen)), sd]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "table.csv"
        np.savetxt(path, np.stack(columns, axis=1), delimiter=",", header=header, comments="")
        force, position = UNITS[draw.like]
        table = read_frf(path, period_s, force_unit=force, position_unit=position)
    return table, f" of {lines} lines to {top_hz:.0f} Hz, {100 * size:.1f} %"


def _moved(device: States, step_s: float, force: Array, hand: Array) -> tuple[Array, Array, Array]:
    """Position, velocity and acceleration of the motor at every step, of a force held over each.

    Where the force steps, the acceleration is the mean of that before and after.
    """
    transition, entry, entries = device.held(step_s)
    push = entries[:, -1]
    state, states = np.zeros(len(entry)), np.empty((len(force), len(entry)))
    for step in range(len(force)):
        states[step] = state
        state = transition @ state + entry * force[step] + push * hand[step]
    to_velocity = device.c @ device.a
    acceleration = states @ (to_velocity @ device.a) + (to_velocity @ device.b) * _about_steps(
        force
    )
    return states @ device.c, states @ to_velocity, acceleration


def _about_steps(force: Array) -> Array:
    """Of a force that is held over every step, the mean before and after each."""
    return np.asarray((force + np.concatenate([[0.0], force[:-1]])) / 2)


def _in_band(draw: Draw, samples: int, step_s: float, period_s: float) -> Array:
    """Noise in the band of Diaz and Gil's experiments, up to 0.3 of the sampling rate."""
    low_hz, high_hz = BAND_HZ[draw.like]
    band = 2 * step_s * np.array([low_hz, min(high_hz, 0.3 / period_s)])
    noise = lfilter(*butter(2, band, "band"), draw.rng.normal(size=samples))
    return np.asarray(noise * FORCE[draw.like] * draw.between(0.3, 3) / noise.std())


def _counted(draw: Draw, position: Array) -> Array:
    count = COUNT[draw.like] * draw.between(0.3, 3)
    return np.asarray(count * np.round(position / count))


def _noise(draw: Draw, signal: Array, most: float) -> Array:
    """A sensor's, a thousandth of the signal to `most` of it."""
    return signal.std() * draw.between(0.001, most) * draw.rng.normal(size=len(signal))


if __name__ == "__main__":
    run(__doc__, make)
