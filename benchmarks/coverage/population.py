"""Is what a study says of people true?  Simulated studies of people from a known population.

    python -m benchmarks.coverage.population [--studies 5] [--ess 500] [--first 1]
        [--device phantom ...] [--without-device] [--damper 0.05] [--keep FOLDER] [--known]

Each study has 12 users, 30 s each, on the virtual bench; hands are drawn around the paper's Table
I (PHANToM) or II (LHIfAM), with correlations, the device is the same for all.  Shown are how many
population means lie in their 90 % intervals, how many of 40 further people have their critical
stiffness in the predictive 90 % interval, how many have it below the stiffness of 1 % risk, how
many of a crowd of 4000 lie in that interval, how the users' own limits stand to theirs, and the
time from 12 recordings to the critical stiffness of a new person, in one process.  With --damper
the load's damper is that share of the tables' sum (the PHANToM-like device has none).  With --keep
a run that was stopped goes on.

With --known nothing is recorded: the hands of the same users are known exactly, and so is the
device.  That is what twelve people by themselves say of others, by the same hierarchy and priors,
in a fraction of the time; further people are then 4000.
"""

from __future__ import annotations

import argparse
import os
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

import bayeshaptic as bh  # noqa: E402
from bayeshaptic.diagnosis.hidden.regression import log_limits  # noqa: E402
from bayeshaptic.inference.population.below import draw_below  # noqa: E402
from bayeshaptic.inference.population.gaussian_likelihood import GaussianLikelihood  # noqa: E402
from bayeshaptic.inference.population.hierarchy import Hierarchy  # noqa: E402
from bayeshaptic.inference.population.sampler import sample_level  # noqa: E402
from bayeshaptic.models import build_model  # noqa: E402
from bayeshaptic.rig import Bench, simulate  # noqa: E402
from bayeshaptic.rig.recording import SimulatedRecording  # noqa: E402
from benchmarks.coverage.study_outcomes import Outcome, kept, row  # noqa: E402

HAND = ("mh", "bh", "kh", "bs", "ks")
LOG_SD = {"phantom": 0.55, "lhifam": 0.30}  # K_CR: 1.6 dB from 5 to 95 %, and 0.03 dB (sd)
CORRELATION = {
    ("mh", "kh"): 0.4, ("bh", "kh"): 0.5, ("bs", "ks"): 0.5, ("mh", "ks"): 0.2, ("mh", "bh"): 0.3
}  # fmt: skip
USERS, FURTHER, EACH = 12, 40, 1
DRAWS = 4000  # of a user's own limit
CROWD, KNOWN_DRAWS, KNOWN_STEPS = 4000, 4000, 300  # of what --known does


def people(
    device: str, seed: int, further: int = FURTHER, damper: float | None = None
) -> tuple[Bench, np.ndarray]:
    """The held bench, and the hands of the users and of further people: (USERS + further, 5)."""
    bench = Bench.from_device(device, held=True)
    if damper is not None:
        whole = bench.values["b1"] + bench.values["b2"]
        bench = replace(bench, values=dict(bench.values) | {"b2": damper * whole})
    correlation = np.eye(len(HAND))
    for (one, other), value in CORRELATION.items():
        i, j = HAND.index(one), HAND.index(other)
        correlation[i, j] = correlation[j, i] = value
    root = LOG_SD[device] * np.linalg.cholesky(correlation)
    rng = np.random.default_rng([seed, len(device)])
    middle = np.array([bench.values[name] for name in HAND])
    return bench, middle * np.exp(rng.standard_normal((USERS + further, len(HAND))) @ root.T)


def held_by(bench: Bench, hand: np.ndarray) -> Bench:
    """The bench in the hand of one person."""
    return replace(bench, values=dict(bench.values) | dict(zip(HAND, hand.tolist(), strict=True)))


def run(device: str, seed: int, ess: float, file: bool, damper: float | None) -> Outcome:
    """Simulate one study, analyse it, and compare it with the truth."""
    bench, hands = people(device, seed, CROWD, damper)
    recordings = [
        simulate(held_by(bench, hand), seed=1000 * seed + number)
        for number, hand in enumerate(hands[:USERS])
    ]
    seen = hands[: USERS + FURTHER]
    limits = np.array([held_by(bench, hand).true_critical_stiffness() for hand in seen])
    truth = limits[USERS:]
    told = {"device": device} if file else {"delay_s": bench.delay_s, "period_s": bench.period_s}
    model = build_model("grasped", **told)
    began, processor = time.perf_counter(), time.process_time()
    posteriors = [posterior(one, model, ess, seed) for one in recordings]
    between = time.perf_counter()
    population = bh.infer_population(posteriors, [str(n) for n in range(USERS)], seed=seed)
    draws = population.new_person(np.random.default_rng(seed), EACH)
    limit = replace(bh.critical_stiffness(population.model, draws), chains=population.walkers)
    seconds = (between - began, time.perf_counter() - between)
    users, pull = own_limits(population, limits[:USERS])
    low, high = limit.quantile(np.array([0.05, 0.95]))
    safe = limit.safe(0.01)
    crowd = np.exp(log_limits(population.model, held(population.model, bench, hands[USERS:])))
    middle = np.log([bench.values[name] for name in population.parameters])
    return Outcome(
        device,
        inside(population.log_mean, middle),
        inside(population.log_sd, np.full(len(HAND), LOG_SD[device])),
        float(np.mean((truth >= low) & (truth <= high))),
        float(np.mean(truth < safe)) if safe is not None else float("nan"),
        float(np.mean((crowd >= low) & (crowd <= high))),
        users,
        pull,
        decibels(np.quantile(truth, [0.05, 0.95])),
        decibels(np.array([low, high])),
        max(one.pareto_k for one in population.recordings),
        seconds,
        time.process_time() - processor,
    )


def run_known(device: str, seed: int, ess: float) -> Outcome:
    """The same people, their hands and the device known exactly."""
    bench, hands = people(device, seed, CROWD)
    model = bh.grasped(device=device)
    priors = [model.prior(name) for name in HAND]
    began, processor = time.perf_counter(), time.process_time()
    sure = 1e-4  # standard deviation of a logarithm
    exact = np.eye(len(HAND))
    known = Hierarchy(
        [
            GaussianLikelihood(np.log(h), exact / sure**2, exact * sure**2, 0.0)
            for h in hands[:USERS]
        ],
        np.arange(USERS),
        np.zeros(USERS, int),
        np.arange(len(HAND)),
        np.arange(0),
        np.log([float(prior.quantile(0.5)) for prior in priors]),
        np.array([prior.log_sd for prior in priors]),  # type: ignore[attr-defined]
    )
    rng = np.random.default_rng(seed)
    chains = sample_level(known, np.random.SeedSequence(seed), steps=KNOWN_STEPS)
    phi = chains.thinned(KNOWN_DRAWS, rng)
    draws = draw_below(known, phi, np.full(len(HAND), -np.inf), rng)
    root = draws.level.hand_sd[:, :, None] * draws.level.correlation_root
    new = draws.beta + np.einsum("nij,nj->ni", root, rng.standard_normal(draws.beta.shape))
    truth, limits = (
        np.exp(log_limits(model, held(model, bench, h))) for h in (hands[USERS:], np.exp(new))
    )
    low1, low, high = np.quantile(limits, [0.01, 0.05, 0.95])
    middle = np.log([bench.values[name] for name in HAND])
    return Outcome(
        device,
        inside(draws.beta, middle),
        inside(draws.level.hand_sd, np.full(len(HAND), LOG_SD[device])),
        float(np.mean((truth >= low) & (truth <= high))),
        float(np.mean(truth < low1)),
        float(np.mean((truth >= low) & (truth <= high))),
        float("nan"),
        float("nan"),
        decibels(np.quantile(truth, [0.05, 0.95])),
        decibels(np.array([low, high])),
        float("nan"),
        (0.0, time.perf_counter() - began),
        time.process_time() - processor,
    )


def held(model: bh.Model, bench: Bench, hands: np.ndarray) -> np.ndarray:
    """Vectors of the model: the bench's device in each of the hands, (n, P)."""
    vectors = np.tile([bench.values[name] for name in model.names], (len(hands), 1))
    vectors[:, [model.names.index(name) for name in HAND]] = hands
    return vectors


def posterior(recorded: SimulatedRecording, model: bh.Model, ess: float, seed: int) -> bh.Posterior:
    """The posterior of one recording, as `analyse` finds it."""
    etfe = bh.estimate_etfe(bh.recording_from_arrays(**recorded.signals))
    fit = bh.least_squares(model, etfe, seed=seed)
    return bh.sample(fit.model, etfe, fit, ess=ess, seed=seed)


def own_limits(population: bh.Population, truth: np.ndarray) -> tuple[float, float]:
    """How the limits of the users stand to their truths: share held, mean pull."""
    samples = [
        bh.critical_stiffness(population.model, one.draws[:DRAWS]).samples
        for one in population.recordings
    ]
    low, high = np.array([np.quantile(own, [0.05, 0.95]) for own in samples]).T  # some have fewer
    pull = [(own.mean() - true) / own.std() for own, true in zip(samples, truth, strict=True)]
    return float(np.mean((low <= truth) & (truth <= high))), float(np.mean(pull))


def inside(draws: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Which truths lie in the 90 % intervals of draws, shape (n, H)."""
    low, high = np.quantile(draws, [0.05, 0.95], axis=0)
    return (truth >= low) & (truth <= high)


def decibels(stiffness: np.ndarray) -> tuple[float, float]:
    low, high = 20 * np.log10(stiffness)
    return float(low), float(high)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--studies", type=int, default=5, help="of each device")
    parser.add_argument("--ess", type=float, default=500, help="effective draws a recording")
    parser.add_argument("--first", type=int, default=1, help="first seed")
    parser.add_argument("--device", nargs="+", default=["phantom", "lhifam"])
    parser.add_argument("--without-device", action="store_true", help="the analysis has no file")
    parser.add_argument("--damper", type=float, help="b2 as a share of the tables' b1 + b2")
    parser.add_argument("--keep", type=Path, help="folder for the outcomes: goes on from there")
    parser.add_argument("--known", action="store_true", help="the users' hands, without recordings")
    asked = parser.parse_args()
    alike = partial(run, file=not asked.without_device, damper=asked.damper)
    study = run_known if asked.known else alike
    print(
        "study        n    means   spreads  K_CR 90 %  < 1 %   crowd   users   pull   "
        "true 90 %, dB  predicted, dB   worst k   seconds   processor",
        flush=True,
    )
    outcomes = []
    for seed in range(asked.first, asked.first + asked.studies):
        for device in asked.device:
            outcomes.append(kept(asked.keep, partial(study, device, seed, asked.ess), device, seed))
            print(row(f"{device} {seed}", outcomes[-1:]), flush=True)
    for device in asked.device:
        print(row(device, [one for one in outcomes if one.device == device]))
    print(row("all", outcomes))


if __name__ == "__main__":
    main()
