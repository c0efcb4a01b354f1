"""A response's scale and delay: most likely values, and the least width there is."""

from __future__ import annotations

import numpy as np
from linear_bench import limited_noise, tremor

from bayeshaptic.recordings.recording import Recording

PERIOD = 1e-3
HIGHEST_HZ = 200.0


def record(device, rng, samples, force=1.0, encoder=5e-7, hand=0.2):
    """White force up to 200 Hz; a hand's tremor on the last mass, white noise on the position."""
    u = force * limited_noise(rng, samples, PERIOD, HIGHEST_HZ)
    y = device.simulate(u) + encoder * rng.standard_normal(samples)
    if hand:
        y = y + device.simulate(hand * force * tremor(rng, samples, PERIOD), device.n - 1)
    return Recording(u, y, PERIOD)


def scale_and_delay(windows, response):
    """Most likely log scale and delay (in periods) of a response, and their sd, from the truth."""
    frequency = windows.frequency_hz
    g = response(frequency)
    columns = np.stack([g, -2j * np.pi * frequency * PERIOD * g], axis=-1)
    columns = windows.design @ columns
    rest = windows.target - np.einsum("wij,wj->wi", windows.design, g)
    theta = np.zeros(2)
    # Iterated weights, of which every step goes uphill; the exact curvature at the top.
    for _ in range(30):
        e = rest - columns @ theta
        weight = 2 * (windows.lines - 1) / (windows.scatter + np.sum(np.abs(e) ** 2, axis=1))
        slope = np.einsum("wip,wi->wp", columns.conj(), e).real
        curvature = np.einsum("w,wip,wiq->pq", weight, columns.conj(), columns).real
        theta = theta + np.linalg.solve(curvature, weight @ slope)
    curvature -= np.einsum("w,wp,wq->pq", weight**2 / (windows.lines - 1), slope, slope)
    return theta, np.sqrt(np.diag(np.linalg.inv(curvature)))


def cramer_rao(recording, band_hz, response, density):
    """The sd of log scale and delay where the noise is known and nothing leaks."""
    frequency = np.fft.rfftfreq(recording.samples, PERIOD)
    force = np.fft.rfft(recording.force) / np.sqrt(recording.samples)
    inside = (frequency > band_hz[0] - 1e-9) & (frequency < band_hz[1] + 1e-9)
    frequency = frequency[inside]
    column = force[inside] * response(frequency)
    columns = np.stack([column, -2j * np.pi * frequency * PERIOD * column])
    information = 2 * (columns.conj() / density(frequency) @ columns.T).real
    return np.sqrt(np.diag(np.linalg.inv(information)))
