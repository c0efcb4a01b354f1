"""A small independent simulator of linear devices for the tests of the estimators."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm
from scipy.signal import lfilter

LHIFAM_FREE = {
    "masses": [0.19, 5.2],
    "ground": [(0.1, 0.0), (6.8, 0.0)],
    "links": [(15.0, 55.3e3)],
}
PHANTOM_FREE = {
    "masses": [0.895e-3, 0.155e-3],
    "ground": [(0.0085, 0.0), (0.0, 0.0)],
    "links": [(0.0057, 18.13)],
}
LHIFAM_HELD = {
    "masses": [0.2, 3.78, 1.42],
    "ground": [(0.1, 0.0), (4.0, 0.0), (18.34, 133.48)],
    "links": [(13.41, 61.36e3), (62.68, 56.03e3)],
}
PHANTOM_HELD = {
    "masses": [0.81e-3, 0.95e-3, 3.14e-3],
    "ground": [(0.057, 0.0), (0.0, 0.0), (0.099, 1.42)],
    "links": [(0.0084, 18.11), (0.017, 52.73)],
}
RIGID = {"masses": [5.39], "ground": [(6.9, 0.0)], "links": []}


class Device:
    """A chain of masses, force on the first, zero-order hold, delay e = delay_s < T."""

    def __init__(self, chain, period=1e-3, delay=0.2e-3):
        masses, n = np.array(chain["masses"]), len(chain["masses"])
        damping, stiffness = (
            np.diag([g[0] for g in chain["ground"]]),
            np.diag([g[1] for g in chain["ground"]]),
        )
        for i, (b, k) in enumerate(chain["links"]):
            pair = np.zeros(n)
            pair[i], pair[i + 1] = 1, -1
            damping = damping + b * np.outer(pair, pair)
            stiffness = stiffness + k * np.outer(pair, pair)
        inverse = np.diag(1 / masses)
        self.a = np.block(
            [[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness, -inverse @ damping]]
        )
        self.period, self.n = period, n
        self.ad = expm(self.a * period)
        self.drive = [self._inputs(np.eye(n)[:, [i]] / masses[i], delay) for i in range(n)]

    def _inputs(self, b, delay):
        late = self._hold(b, self.period - delay)
        early = self._hold(b, self.period) - late
        return late, early

    def _hold(self, b, t):
        m = len(self.a)
        block = np.zeros((m + 1, m + 1))
        block[:m, :m], block[:m, m:] = self.a, np.vstack([np.zeros((self.n, 1)), b])
        return expm(block * t)[:m, m:]

    def response(self, frequency, mass=0):
        z = np.exp(2j * np.pi * np.ravel(frequency) * self.period)
        late, early = self.drive[mass]
        resolvent = z[:, None, None] * np.eye(len(self.a)) - self.ad
        value = np.linalg.solve(resolvent, late + early / z[:, None, None])[:, 0, 0]
        return value.reshape(np.shape(frequency))

    def simulate(self, force, mass=0):
        """Position of the first mass, at rest before; one first-order filter a mode."""
        late, early = self.drive[mass]
        poles, modes = np.linalg.eig(self.ad)
        b = np.linalg.solve(modes, np.hstack([late, early]))
        # x[k + 1] = p x[k] + b0 u[k] + b1 u[k - 1]
        motion = [
            lfilter([0, b0, b1], [1, -p], force) for p, (b0, b1) in zip(poles, b, strict=True)
        ]
        return (modes[0] @ np.array(motion)).real


def _tremor_filters(period):
    angle, damping = 2 * np.pi * 9.0 * period, 0.1
    radius = np.exp(-damping * angle)
    peak = [1, -2 * radius * np.cos(angle), radius**2]
    return peak, [1, -np.exp(-2 * np.pi * 0.3 * period)]


def tremor(rng, samples, period):
    """Force of a hand: a tremor near 9 Hz and a slow wander, about unit variance."""
    lead = int(20 / period)
    both = [
        lfilter([1], a, rng.standard_normal(samples + lead))[lead:] / _spread(a)
        for a in _tremor_filters(period)
    ]
    return sum(both) / np.sqrt(2)


def tremor_density(frequency, period):
    """Variance of `tremor` a line of the DFT over sqrt(N)."""
    z = np.exp(2j * np.pi * frequency * period)
    return sum(
        np.abs(1 / np.polyval(a[::-1], 1 / z) / _spread(a)) ** 2 / 2
        for a in _tremor_filters(period)
    )


def _spread(a):
    return np.linalg.norm(lfilter([1], a, np.eye(1, 2**16)[0]))


def limited_noise(rng, samples, period, highest):
    """White noise of unit variance a line up to a highest frequency, Hz, and nothing above."""
    spectrum = np.fft.rfft(rng.standard_normal(samples))
    spectrum[np.fft.rfftfreq(samples, period) > highest] = 0
    return np.fft.irfft(spectrum, samples)


def multisine(rng, samples, harmonics):
    """One period of random phases on some harmonics, unit standard deviation."""
    spectrum = np.zeros(samples // 2 + 1, complex)
    spectrum[harmonics] = np.exp(2j * np.pi * rng.random(len(harmonics)))
    one = np.fft.irfft(spectrum, samples)
    return one / one.std()
