"""A few lines of simulation for tests: recordings side by side, in and out of closed loop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.linalg import expm
from scipy.signal import butter, sosfilt

from bayeshaptic.devices import load_device

PERIOD = 1e-3
DELAY = 0.2  # of a period
CASES = ("lhifam free", "lhifam grasped", "phantom free", "phantom grasped")
# Excitation, encoder count, tremor force, friction, critical stiffness; by device.
SCALE: dict[str, dict[str, Any]] = {
    "lhifam": {"rms": 3.0, "count": 3.14e-6, "tremor": 1.0, "friction": 0.3},
    "phantom": {"rms": 0.05, "count": 2e-4, "tremor": 0.02, "friction": 0.01},
}
CRITICAL = dict(zip(CASES, (2.2e4, 2.2e4, 13.0, 111.0), strict=True))

Control = Callable[[int, np.ndarray, np.ndarray], np.ndarray]


def chain(case: str) -> tuple[np.ndarray, np.ndarray]:
    """State matrix of the two or three masses, and inputs: force on the first, on the last."""
    name, structure = case.split()
    p = load_device(name).parameters[structure]
    n = 3 if structure == "grasped" else 2
    mass = np.array([p["m1"], p["m2"], p.get("mh", 1.0)][:n])
    stiffness, damping = np.zeros((n, n)), np.diag([p["b1"], p["b2"], p.get("bh", 0.0)][:n])
    for i, (k, b) in enumerate((("kc", "bc"), ("ks", "bs"))[: n - 1]):
        link = np.array([[1.0, -1.0], [-1.0, 1.0]])
        stiffness[i : i + 2, i : i + 2] += p[k] * link
        damping[i : i + 2, i : i + 2] += p[b] * link
    if n == 3:
        stiffness[2, 2] += p["kh"]
    a = np.zeros((2 * n, 2 * n))
    a[:n, n:] = np.eye(n)
    a[n:, :n], a[n:, n:] = -stiffness / mass[:, None], -damping / mass[:, None]
    b = np.zeros((2 * n, 2))
    b[n, 0], b[-1, 1] = 1 / mass[0], 1 / mass[-1]
    return a, b


def hold(a: np.ndarray, b: np.ndarray, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    n, m = b.shape
    both = expm(np.block([[a, b], [np.zeros((m, n + m))]]) * seconds)
    return both[:n, :n], both[:n, n:]


def band_noise(rng: np.random.Generator, shape: tuple[int, int], high_hz: float) -> np.ndarray:
    """Unit white noise below `high_hz` (all of it at 500), the odd rows with a brick wall."""
    noise = rng.normal(size=shape)
    if high_hz < 0.5 / PERIOD:
        steep = np.fft.rfft(noise[1::2])
        steep[:, np.fft.rfftfreq(shape[1], PERIOD) > high_hz] = 0
        noise[1::2] = np.fft.irfft(steep, shape[1])
        gentle = butter(4, high_hz, fs=1 / PERIOD, output="sos")
        noise[::2] = sosfilt(gentle, noise[::2], axis=1)
    return noise / noise.std(axis=1, keepdims=True)


def tremor(rng: np.random.Generator, shape: tuple[int, int]) -> np.ndarray:
    """A hand: tremor at 8 to 12 Hz, and wandering."""
    noise = rng.normal(size=shape)
    fast = sosfilt(butter(2, [8, 12], "band", fs=1 / PERIOD, output="sos"), noise, axis=1)
    slow = sosfilt(butter(1, 0.5, fs=1 / PERIOD, output="sos"), noise, axis=1)
    return fast / fast.std() + slow / slow.std()


def relay(k: int, position: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Three newtons, or newton metres, against the position."""
    return np.where(position[:, k] < 0, 3.0, -3.0)


def record(
    case: str,
    excitation: np.ndarray,
    rng: np.random.Generator,
    friction: np.ndarray | float = 0.0,
    control: Control | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Force and encoder reading, shape (R, N) each, of R recordings side by side.

    `control(k, position so far, excitation of sample k)` gives the force where there is a loop.
    """
    device, structure = case.split()
    scale = SCALE[device]
    runs, samples = excitation.shape
    a, b = chain(case)
    early, late = hold(a, b, DELAY * PERIOD), hold(a, b, (1 - DELAY) * PERIOD)
    hand = np.zeros((runs, samples))
    if structure == "grasped":
        hand = scale["tremor"] * tremor(rng, (runs, samples))
    state, before = np.zeros((runs, len(a))), np.zeros(runs)
    force, position = np.empty((runs, samples)), np.empty((runs, samples))
    for k in range(samples):
        position[:, k] = np.round(state[:, 0] / scale["count"]) * scale["count"]
        wanted = excitation[:, k]
        force[:, k] = wanted if control is None else control(k, position, wanted)
        for (transition, entry), held in ((early, before), (late, force[:, k])):
            drag = friction * np.tanh(state[:, len(a) // 2] / (0.05 if device == "lhifam" else 1))
            inputs = np.stack([held - drag, hand[:, k]], axis=1)
            state = state @ transition.T + inputs @ entry.T
        before = force[:, k]
    return force, position
