"""How far do effects of encoder, clock and logger that no test sees move the limit?

    python -m benchmarks.measured_unseen [--recordings 12] [--seconds 10 30] [--effects ...]

Both devices, free and held.  Each effect is halved until the tests see it in at most one recording
of three; then recordings are made with it and without, everything else alike.  Of those in which no
test sees it (the first number: how many) is shown what it does to ln K_CR, estimated to first order
around the truth, in 90 % intervals of its own and of the clean
recording: on average (what would be a bias), and how far the estimates with it lie from the truth
in standard deviations of their own (one, where the interval allows for the noise that it makes).
What the tests see is mended, and not looked at here.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

from bayeshaptic.diagnosis.battery import residual_tests  # noqa: E402
from bayeshaptic.diagnosis.hidden.regression import log_limits  # noqa: E402
from bayeshaptic.inference.coordinates import coordinates  # noqa: E402
from bayeshaptic.inference.fit import summarise, weighted_residuals  # noqa: E402
from bayeshaptic.inference.likelihood import Likelihood  # noqa: E402
from bayeshaptic.models import LogNormal, Model, build_model  # noqa: E402
from bayeshaptic.numerics.gauss_newton import jacobian  # noqa: E402
from bayeshaptic.recordings.response.estimate import estimate_etfe  # noqa: E402
from bayeshaptic.recordings.response.etfe import Etfe, compress  # noqa: E402
from bayeshaptic.rig import Bench, Effect  # noqa: E402
from bayeshaptic.rig.effects.effect import Log  # noqa: E402
from bayeshaptic.types import Floats  # noqa: E402
from benchmarks.recordings.blind import CASES, recorded  # noqa: E402

LOOKED_AT = 3  # recordings of each strength that the tests look at
WIDTH = 3.29  # of a 90 % interval, in standard deviations


@dataclass(frozen=True)
class WildSamples(Effect):
    """Single positions that are off by `size`, one in a thousand."""

    name: ClassVar[str] = "wild_samples"
    size: float = 1e-4

    def log(self, log: Log, rng: np.random.Generator) -> Log:
        off = np.zeros(len(log.position))
        at = rng.random(len(off)) < 1e-3
        off[at] = self.size * rng.choice([-1.0, 1.0], int(at.sum()))
        return replace(log, position=log.position + off)


# The bench with an effect of a strength: one is what nobody misses.
EFFECTS: dict[str, Callable[[Bench, float], Bench]] = {
    "quantisation": lambda b, s: b.with_effect("quantisation", count=(1 + 5 * s) * b.resolution),
    "mains_tone": lambda b, s: b.with_effect("mains_tone", amplitude=0.03 * s * _rms(b)),
    "held_samples": lambda b, s: b.with_effect("held_samples", probability=0.01 * s),
    "dropped_samples": lambda b, s: b.with_effect("dropped_samples", probability=1e-3 * s),
    "position_clipping": lambda b, s: b.with_effect(
        "position_clipping", limit=(1.5 - 0.2 * np.log2(s)) * _rms(b)
    ),
    "sample_jitter": lambda b, s: b.with_effect("sample_jitter", sd_s=0.05 * s * b.period_s),
    "wild_samples": lambda b, s: b.with_effect(WildSamples(0.1 * s * _rms(b))),
}


def _rms(bench: Bench) -> float:
    return bench.scales().position


@dataclass(frozen=True)
class Cell:
    """One effect on one device, at the largest strength that hides: see the head of the file.

    Attributes
    ----------
    strength : float
    moved, pull : ndarray, shape (R,)
        How far each recording's estimate moves, in 90 % intervals of the clean one, and of its own.
    off, clean : ndarray, shape (R,)
        How far the estimates with it and without lie from the truth, in their own sds.
    wider : ndarray, shape (R,)
        Width of the interval over that without it.
    """

    strength: float
    moved: Floats
    pull: Floats
    off: Floats
    clean: Floats
    wider: Floats


def cell(case: str, effect: str, seconds: float, count: int) -> Cell:
    """The largest strength that hides, and what it does."""
    device, held = CASES[case]
    bench = Bench.from_device(device, held=held)
    model = build_model("grasped" if held else "free", device)
    nearly_none = 1e-12
    truth = np.array([bench.values[name] or nearly_none for name in model.names])
    strength, least = 1.0, 2.0**-14
    while strength > least and _seen(EFFECTS[effect](bench, strength), model, truth, seconds):
        strength /= 2
    with_it = EFFECTS[effect](bench, strength)
    rows = []
    for seed in range(100, 100 + count):
        clean = estimate_etfe(recorded(bench, seconds, seed))
        other = estimate_etfe(recorded(with_it, seconds, seed), clean.band_hz)
        if _flagged(other, model, truth):
            continue
        rows.append((*limit(model, clean, truth), *limit(model, other, truth)))
    before, sd, after, its_sd = np.array(rows).reshape(-1, 4).T
    moved = (after - before) / WIDTH
    return Cell(strength, moved / sd, moved / its_sd, after / its_sd, before / sd, its_sd / sd)


def _seen(bench: Bench, model: Model, truth: Floats, seconds: float) -> bool:
    """Whether a test sees it in more than one recording of three."""
    seeds = range(1, 1 + LOOKED_AT)
    found = [estimate_etfe(recorded(bench, seconds, seed)) for seed in seeds]
    return sum(_flagged(etfe, model, truth) for etfe in found) > LOOKED_AT / 3


def _flagged(etfe: Etfe, model: Model, truth: Floats) -> bool:
    fit = summarise(model, _windows(model, etfe, truth), truth)
    return any(test.flagged for test in residual_tests(fit, etfe))


def limit(model: Model, etfe: Etfe, truth: Floats) -> tuple[float, float]:
    """Estimate of ln K_CR less the truth, and its standard deviation; to first order."""
    here = coordinates(model)
    phi = here.coordinate(truth[None])
    residuals = weighted_residuals(Likelihood(model, _windows(model, etfe, truth)), here)
    left, slope = residuals(phi)[0], jacobian(residuals, phi)[0]
    priors = [model.prior(name) for name in model.names]
    sd = [
        prior.log_sd if isinstance(prior, LogNormal) else prior.scale / scale  # type: ignore[attr-defined]
        for prior, scale in zip(priors, here.scale, strict=True)
    ]
    covariance = np.linalg.inv(slope.T @ slope + np.diag(np.array(sd) ** -2.0))
    step = 1e-4 * np.eye(len(sd))
    up, down = (log_limits(model, here.natural(phi + sign * step)) for sign in (1, -1))
    gradient = (up - down) / 2e-4
    moved = -covariance @ (slope.T @ left)
    return float(gradient @ moved), float(np.sqrt(gradient @ covariance @ gradient))


def _windows(model: Model, etfe: Etfe, truth: Floats):  # type: ignore[no-untyped-def]
    return compress(etfe, lambda frequency_hz: model.response(truth, frequency_hz))


def row(name: str, cells: list[Cell]) -> str:
    """One line of the table."""
    pull, moved, off, clean, wider = (
        np.concatenate([getattr(one, field) for one in cells])
        for field in ("pull", "moved", "off", "clean", "wider")
    )
    root = len(pull) ** 0.5
    return (
        f"{name:30s} {len(pull):4d}   {pull.mean():+6.3f} +- {pull.std() / root:.3f}   "
        f"{np.sqrt(np.mean(off**2)):5.2f}   {np.sqrt(np.mean(clean**2)):5.2f}   "
        f"{np.median(wider):5.2f}   {moved.mean():+6.3f} +- {moved.std() / root:.3f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--recordings", type=int, default=12, help="of each device and length")
    parser.add_argument("--seconds", type=float, nargs="+", default=[10.0, 30.0])
    parser.add_argument("--effects", nargs="+", default=list(EFFECTS))
    parser.add_argument("--cases", nargs="+", default=list(CASES))
    asked = parser.parse_args()
    print(f"{'effect':30s}    n   moved, own interval   off   clean   wider   clean interval")
    for effect in asked.effects:
        cells = []
        for case in asked.cases:
            for seconds in asked.seconds:
                cells.append(cell(case, effect, seconds, asked.recordings))
                name = f"  {case} {seconds:g} s, {cells[-1].strength:.2g}"
                print(row(name, cells[-1:]), flush=True)
        print(row(effect, cells), flush=True)


if __name__ == "__main__":
    main()
