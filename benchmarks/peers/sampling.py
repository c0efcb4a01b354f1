"""Effective draws a CPU second beside other samplers, on the same density, in one run.

    python -m benchmarks.peers.sampling [--case NAME ...] [--only SAMPLER ...] [--old PATH]

The others are emcee's stretch and differential-evolution moves, the adaptive sampler of PINTS, and
NUTS by nutpie, NumPyro and BlackJAX (`pip install -e ".[bench]"`; what is not there is left out).
They begin at the fit and get coordinates in which the posterior's covariance there is the identity.
For NUTS a gradient costs one call of the compiled density with twice as many vectors as there are
parameters, which is less than automatic differentiation of it would take.  Compilation of the
density is left out, JAX's of a sampler (some 5 s) is not; tuning counts for everybody.  Effective
draws are ArviZ's, of walkers each walker a chain.  Limits whose medians differ by more than four
Monte-Carlo errors are marked.  This package's sampler, and its older version's, take a fraction of
a second: theirs are sums over five seeds.  --ess asks ours for more effective draws than
the default, as many as NUTS's 4,000 draws are worth, say.
--old adds the sampler of an older version of this package, on the posterior that it has of the same
recording (its priors and its noise are its own).
"""

from __future__ import annotations

import argparse
import os
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

import bayeshaptic as bh  # noqa: E402
from bayeshaptic.inference.sampler import DEFAULT_ESS  # noqa: E402
from benchmarks.peers.samplers import SAMPLERS, Target, by_older, target  # noqa: E402

SEEDS = 5  # of this package's sampler
OURS = "bayeshaptic"
CASES = {f"{device} {how}": (device, how == "held") for device in ("lhifam", "phantom")
         for how in ("free", "held")}  # fmt: skip


@dataclass(frozen=True)
class Counted:
    """What one sampler made of a posterior.

    Attributes
    ----------
    seconds : float
        Of CPU time.
    limit, slowest : float
        Effective draws of ln K_CR, and the fewest of a parameter.
    median, error : float
        Of ln K_CR, and its Monte-Carlo error.
    rhat : float
        Largest of all.
    """

    seconds: float
    limit: float
    slowest: float
    median: float
    error: float
    rhat: float


Run = list[tuple[np.ndarray, float]]
"""Natural values, shape (chains, draws, P), and CPU seconds, of one seed or several."""


def timed(known: Target, run: Callable[..., np.ndarray], seeds: int = 1, **asked: float) -> Run:
    """Of a sampler that is told which seed where there are several."""
    found = []
    for seed in range(seeds):
        own = {"seed": seed, **asked} if seeds > 1 else {}
        began = time.process_time()
        theta = run(known, **own)
        found.append((theta, time.process_time() - began))
    return found


def together(known: Target, run: Run) -> Counted:
    """The sums of seconds and effective draws over the seeds; the largest R-hat, the mean limit."""
    every = [counted(known, theta, seconds) for theta, seconds in run]
    return Counted(
        sum(one.seconds for one in every),
        sum(one.limit for one in every),
        sum(one.slowest for one in every),
        float(np.mean([one.median for one in every])),
        float(np.sqrt(np.sum([one.error**2 for one in every])) / len(every)),
        max(one.rhat for one in every),
    )


def counted(known: Target, theta: np.ndarray, seconds: float) -> Counted:
    import arviz as az

    kept = theta[:, :: max(1, theta.shape[0] * theta.shape[1] // 40_000)]
    flat = kept.reshape(-1, kept.shape[-1])
    limit = np.log(
        bh.critical_stiffness(known.fit.model, flat, max_draws=len(flat)).samples
    ).reshape(kept.shape[:2])
    everything = np.moveaxis(np.concatenate([kept, limit[..., None]], axis=-1), -1, 0)
    effective = [float(az.ess(one)) for one in everything]
    return Counted(
        seconds,
        effective[-1],
        min(effective[:-1]),
        float(np.median(limit)),
        float(1.25 * np.std(limit) / np.sqrt(effective[-1])),
        max(float(az.rhat(_joined(one))) for one in everything),
    )


def _joined(chains: np.ndarray) -> np.ndarray:
    """Chains, shape (n, draws); the walkers of an ensemble as one, in the order of time."""
    walkers = 64
    if len(chains) <= walkers:
        return chains
    by_time = np.swapaxes(chains.reshape(-1, walkers, chains.shape[1]), 1, 2)
    return by_time.reshape(len(by_time), -1)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--case", nargs="*", choices=CASES, default=list(CASES))
    parser.add_argument("--only", nargs="*", choices=SAMPLERS, default=list(SAMPLERS))
    parser.add_argument("--old", help="checkout of an older version")
    parser.add_argument("--ess", type=float, default=DEFAULT_ESS, help="effective draws, of ours")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")  # of the peers
    print("case | sampler | CPU s | ln K_CR, ESS/s | slowest, ESS/s | R-hat | K_CR, N/m")
    print("--- | --- | --- | --- | --- | --- | ---")
    for name in asked.case:
        for with_file in (True, False):
            known = target(*CASES[name], with_file)
            known(np.zeros((64, len(known.centre))))  # compiled once
            bh.sample(known.fit.model, known.etfe, start=known.fit, seed=1)  # imports
            reference: Counted | None = None
            runs = {n: partial(timed, run=run) for n, (module, run) in SAMPLERS.items()
                    if n in asked.only and find_spec(module)}  # fmt: skip
            if OURS in runs:
                runs[OURS] = partial(timed, run=SAMPLERS[OURS][1], seeds=SEEDS, ess=asked.ess)
            if asked.old:
                runs["the older version"] = partial(by_older, asked.old, seeds=SEEDS)
            for sampler, run in runs.items():
                try:
                    found = together(known, run(known))
                except KeyboardInterrupt:
                    raise
                except BaseException as failed:  # nutpie's panics are no exceptions
                    print(f"{name} | {sampler} | does not run: {failed}", flush=True)
                    continue
                reference = reference or found
                apart = abs(found.median - reference.median)
                mark = " (apart)" if apart > 4 * np.hypot(found.error, reference.error) else ""
                print(
                    f"{name}{'' if with_file else ', no file'} | {sampler} | {found.seconds:.1f} | "
                    f"{found.limit / found.seconds:.0f} | {found.slowest / found.seconds:.0f} | "
                    f"{found.rhat:.3f} | {np.exp(found.median):.1f}{mark}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
