"""Controllers of the benchmarks' closed loops, and what they follow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from bayeshaptic.rig import Bench
from bayeshaptic.types import Floats

TRAPEZOIDS = "trapezoids"  # of their own: they repeat, so that little in such a loop is chance


def steps(samples: int, period: float, rng: np.random.Generator) -> Floats:
    """Levels that are held for some 0.2 to 2 s."""
    hold = rng.uniform(0.2, 2.0)
    edges = np.cumsum(rng.uniform(0.5, 1.5, samples) * hold / period).astype(int)
    levels = rng.normal(size=samples)
    return np.asarray(levels[np.searchsorted(edges, np.arange(samples), side="right")])


def low_passed(signal: Floats, pole: float) -> Floats:
    """A signal behind a low-pass of first order, of gain one at rest."""
    return np.asarray(lfilter([1 - pole], [1, -pole], signal))


def _reference(
    kind: str, samples: int, period: float, bandwidth: float, rng: np.random.Generator
) -> tuple[Floats, LowPassed | None]:
    """A position to follow, of size one; and which noise it is, where it is noise."""
    if kind == "steps":
        return steps(samples, period, rng), None
    if kind == "ramps":
        corners = steps(samples, period, rng)
        changes = np.flatnonzero(np.diff(corners))
        at = np.concatenate([[0], changes, [samples]])
        return np.interp(np.arange(samples), at, rng.normal(size=len(at))), None
    if kind == TRAPEZOIDS:
        phase = np.arange(samples) * period / rng.uniform(1.2, 3.0) % 1.0
        return np.interp(phase, [0.0, 0.2, 0.5, 0.7, 1.0], [0.0, 1.0, 1.0, 0.0, 0.0]), None
    if kind == "noise":
        pole = float(np.exp(-2 * np.pi * bandwidth * rng.uniform(0.5, 5.0) * period))
        return LowPassed.of_size(1.0, (pole, pole), rng.normal(size=samples))
    return np.zeros(samples), None


@dataclass(frozen=True)
class LowPassed:
    """Noise that is played on a loop: white, through low-passes of first order.

    Attributes
    ----------
    scale : float
        By which noise of variance one that went through them is multiplied.
    poles : tuple of float
        One each.
    """

    scale: float
    poles: tuple[float, ...]

    @classmethod
    def of_size(
        cls, size: float, poles: tuple[float, ...], white: Floats
    ) -> tuple[Floats, LowPassed]:
        """Such noise of a root mean square, made of white noise."""
        spread = cls(1.0, poles).of(white).std()
        return size * (cls(1.0, poles).of(white) / spread), cls(size / spread, poles)

    def of(self, white: Floats) -> Floats:
        """The noise that white noise of variance one becomes."""
        for pole in self.poles:
            white = low_passed(white, pole)
        return self.scale * white

    @property
    def new(self) -> float:
        """Root mean square of what is new in every sample of it."""
        return self.scale * float(np.prod([1 - pole for pole in self.poles]))


@dataclass(frozen=True)
class Law:
    """A controller of the bench, and what is played on it.

    Attributes
    ----------
    stiffness, damping, integral : float
        Gains on the error, on the rate of the filtered position, and on the sum of the errors.
    most : float
        Its largest force.
    pole : float
        Of the low-pass on the position.
    late : bool
        The command is made of the position of the sample before.
    period_s : float
    wanted, added : ndarray
        A position to follow, and a force that is added, at each sample.
    size : float
        Of what it follows.
    noise : LowPassed or None
        What it follows, or what is added, where that is noise.
    """

    stiffness: float
    damping: float
    integral: float
    most: float
    pole: float
    late: bool
    period_s: float
    wanted: Floats
    added: Floats
    size: float
    noise: LowPassed | None = None

    @property
    def gain(self) -> float:
        """Of the force over the noise, within the sample."""
        return 1.0 if np.any(self.added) else self.stiffness + self.integral

    def under(self, noise: Floats) -> Law:
        """The same controller under other noise in the place of its own."""
        still = np.zeros(len(noise))
        if np.any(self.added):
            return replace(self, wanted=still, added=noise)
        return replace(self, wanted=noise, added=still)

    def begin(self) -> Callable[[int, float], float]:
        """(sample, position) -> force, from rest."""
        smooth = last = total = read = 0.0

        def control(k: int, position: float) -> float:
            nonlocal smooth, last, total, read
            now, read = (read if self.late else position), position
            smooth = self.pole * smooth + (1 - self.pole) * now
            error = self.wanted[k] - smooth
            rate, last = (smooth - last) / self.period_s, smooth
            total += self.integral * error
            force = self.stiffness * error + total - self.damping * rate + self.added[k]
            return float(np.clip(force, -self.most, self.most))

        return control


def controller_of(
    kind: str,
    reference: str,
    bench: Bench,
    seconds: float,
    rng: np.random.Generator,
    logged: str,
) -> Law:
    """A controller of some hertz of bandwidth."""
    period = bench.period_s
    samples = round(seconds / period)
    mass = sum(v for key, v in bench.values.items() if key.startswith("m"))
    bandwidth = float(np.exp(rng.uniform(np.log(0.8), np.log(12.0))))
    omega = 2 * np.pi * bandwidth
    stiffness = min(mass * omega**2, 0.3 * bench.true_critical_stiffness())
    omega = float(np.sqrt(stiffness / mass))
    damping = 2 * rng.uniform(0.3, 1.0) * mass * omega if "D" in kind else 0.0
    integral = stiffness * omega * rng.uniform(0.02, 0.1) if "I" in kind else 0.0
    size = rng.uniform(0.5, 3.0) * bench.force_rms / stiffness
    most = stiffness * size * rng.uniform(0.5, 1.0) if "saturated" in kind else np.inf
    filtered = "filtered" in kind or rng.random() < 0.3
    pole = float(np.exp(-2 * np.pi * rng.uniform(20, 150) * period)) if filtered else 0.0
    followed, noise = _reference(reference, samples, period, bandwidth, rng)
    if noise is not None:
        noise = replace(noise, scale=size * noise.scale)
    added = np.zeros(samples)
    if reference == "wall with dither":
        white, smooth = rng.normal(size=samples), float(rng.uniform(0, 0.9))
        rms = bench.force_rms * rng.uniform(0.3, 1.0)
        added, noise = LowPassed.of_size(rms, (smooth,), white)
    return Law(
        stiffness=stiffness,
        damping=damping,
        integral=integral * period,
        most=most,
        pole=pole,
        late=logged == "a late command",
        period_s=period,
        wanted=size * followed,
        added=added,
        size=size,
        noise=noise,
    )
