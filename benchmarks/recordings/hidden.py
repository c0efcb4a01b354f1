"""What `hidden.py` records: which effects, and how large they are.

A third of the recordings have no effect; each of the others has one of `EFFECTS`, all alike.  Its
strength is log-uniform from a thirtieth of what the tests see to three times that; where a mode
sits, and how it is damped, is log-uniform in the band and from 1 % to 10 %.  What the tests see is
taken from a clean recording of the same device and length: where a strength takes 18 of the log
likelihood of the windows and of the tests for forces, after everything else has given way.  Where
pairs are asked for, every recording has two effects, each with a strength of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.closed import Closed
from bayeshaptic.diagnosis.hidden.forces import force_suspects
from bayeshaptic.diagnosis.hidden.regression import around
from bayeshaptic.diagnosis.hidden.sizes import seen_of
from bayeshaptic.diagnosis.hidden.suspects import Suspect, linear_suspects
from bayeshaptic.rig import Bench
from benchmarks.recordings.blind import CASES, cases_for, recorded

LENGTHS_S = (10.0, 30.0)
LEAST, MOST = 1 / 30, 3.0
NONE = "none"
EFFECTS = (
    "extra_delay",
    "actuator_lag",
    "position_filter",
    "second_mode",
    "base_compliance",
    "centring_stiffness",
    "structural_damping",
    "reflex",
    "coulomb_friction",
    "drag",
    "hardening_spring",
    "hardening_connection",
    "grip_drift",
)
_GRIP = 0.5  # log change of a grip that the tests see


@dataclass(frozen=True)
class Job:
    """One recording.

    `file` is whether the analysis has the device's file, `also` a second effect and its strength.
    """

    case: str
    seconds: float
    effect: str
    share: float
    seed: int
    file: bool
    also: tuple[str, float] | None = None


def jobs(count: int, seed: int, pairs: bool = False) -> list[Job]:
    """`count` recordings, the devices, lengths, and device file or none in turn."""
    rng = np.random.default_rng([seed, 15])
    out = []
    for number in range(count):
        case = list(CASES)[number % len(CASES)]
        drawn = str(rng.choice(possible(case)))
        effect = NONE if rng.uniform() < 1 / 3 and not pairs else drawn
        share = _share(rng)
        turn = number // len(CASES)
        length, file = LENGTHS_S[turn % 2], turn // 2 % 2 == 0
        others = [name for name in possible(case) if name != effect]
        also = (str(rng.choice(others)), _share(rng)) if pairs else None
        out.append(Job(case, length, effect, share, 1000 * seed + number, file, also))
    return out


def _share(rng: np.random.Generator) -> float:
    return float(np.exp(rng.uniform(np.log(LEAST), np.log(MOST))))


def possible(case: str) -> list[str]:
    """The effects that a device may have."""
    return [effect for effect in EFFECTS if case in cases_for(effect)]


def clean_bench(case: str) -> Bench:
    """The device as declared."""
    device, held = CASES[case]
    return Bench.from_device(device, held=held)


def seen_in(case: str, seconds: float) -> dict[str, Callable[[float], float]]:
    """For each effect, the strength that the tests see, as a function of a mode's frequency."""
    device, held = CASES[case]
    clean = recorded(clean_bench(case), seconds, 1)
    closed = close_loop(clean, device=device, held=held, hidden=False)
    found: dict[str, Callable[[float], float]] = {"grip_drift": lambda _: _GRIP}
    for suspect, scale in _scales(closed):
        found.setdefault(suspect.name, scale)  # of an effect with several places the motor's
    return found


def _scales(closed: Closed):  # type: ignore[no-untyped-def]
    analysis = closed.analysis
    known = around(analysis.posterior, 200, np.random.default_rng(0))
    rms = float(np.std(analysis.recording.force))  # type: ignore[union-attr]
    suspects = (
        *linear_suspects(analysis.model, analysis.etfe),
        *force_suspects(analysis.model, closed.traced.after, (), rms),
    )
    for suspect in suspects:
        seen = np.minimum(seen_of(suspect, known), suspect.unseen.largest / MOST)
        yield _named(suspect), _by_frequency(suspect, seen)


def _named(suspect: Suspect) -> Suspect:
    over = getattr(suspect.extension, "over", "")
    if suspect.name == "hardening_spring" and over == "stretch":
        return replace(suspect, name="hardening_connection")
    return suspect


def _by_frequency(suspect: Suspect, seen: np.ndarray) -> Callable[[float], float]:
    shapes = suspect.unseen.shapes
    if len(shapes) < 10:
        return lambda _: float(np.median(seen))
    places = np.unique(shapes[:, 0])
    middle = [float(np.exp(np.mean(np.log(seen[shapes[:, 0] == f])))) for f in places]
    return lambda f: float(np.exp(np.interp(np.log(f), np.log(places), np.log(middle))))


def bench_of(job: Job, seen: dict[str, Callable[[float], float]]) -> Bench:
    """The bench with the job's effects."""
    bench = clean_bench(job.case)
    rng = np.random.default_rng([job.seed, 3])
    for effect, share in ((job.effect, job.share), *([job.also] if job.also else [])):
        if effect != NONE:
            bench = _with_effect(bench, effect, share, seen[effect], rng)
    return bench


def _with_effect(
    bench: Bench,
    effect: str,
    share: float,
    seen: Callable[[float], float],
    rng: np.random.Generator,
) -> Bench:
    low, high = bench.band_hz
    frequency = float(np.exp(rng.uniform(np.log(1.5 * low), np.log(high / 1.5))))
    damping = float(np.exp(rng.uniform(np.log(0.01), np.log(0.1))))
    strength = share * seen(frequency)
    scales = bench.scales()
    mode = {"frequency_hz": frequency, "damping_ratio": damping}
    kinds = {
        "extra_delay": {"delay_s": strength},
        "actuator_lag": {"time_constant_s": strength},
        "position_filter": {"cutoff_hz": 1 / (2 * np.pi * strength), "order": 2},
        "second_mode": {"mass_ratio": strength, **mode},
        "base_compliance": {"mass_ratio": 1 / strength, **mode},
        "centring_stiffness": {"stiffness": strength},
        "structural_damping": {"loss_factor": strength},
        "reflex": {
            "stiffness": strength * bench.values.get("kh", 0.0),
            "damping": strength * bench.values.get("bh", 0.0),
        },
        "coulomb_friction": {"force": strength},
        "drag": {"coefficient": strength / scales.velocity**2},
        "hardening_spring": {"stiffness": strength / scales.position**3},
        "hardening_connection": {"stiffness": strength / max(scales.stretch, 1e-30) ** 3},
        "grip_drift": {"ratio": float(np.exp(strength))},
    }
    return bench.with_effect(effect, **kinds[effect])
