"""Is the evidence of what could hide right?  Beside long runs with the effect in the model.

    python -m benchmarks.hidden_evidence [--seed 1] [--ess 4000] [--cases "LHIfAM free" ...]

Recordings of 10 s, clean and with a lag of half of what the tests see.  The average takes an
effect's evidence, its strength and what it does to K_CR from 400 draws that are moved and weighed
(`diagnosis/hidden/weighed.py`).  Here the effect is a parameter of the model, flat from zero, and
emcee samples all of it.  The density of its draws over that at zero is the evidence of each
strength (J. M. Dickey, Annals of Mathematical Statistics 42, 1971); weighed by the average's prior,
which is flat in the logarithm, it is the evidence of the effect.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

import bayeshaptic as bh  # noqa: E402
from bayeshaptic.diagnosis.hidden.regression import Around, around, log_limits  # noqa: E402
from bayeshaptic.diagnosis.hidden.sizes import LEAST, MOST, seen_of  # noqa: E402
from bayeshaptic.diagnosis.hidden.suspects import Suspect, linear_suspects  # noqa: E402
from bayeshaptic.diagnosis.hidden.weighed import weigh  # noqa: E402
from bayeshaptic.models import Uniform  # noqa: E402
from bayeshaptic.numerics.weights import systematic  # noqa: E402
from bayeshaptic.rig import Bench  # noqa: E402
from benchmarks.recordings.blind import CASES, recorded  # noqa: E402

SECONDS = 10.0
LAG = "actuator_lag"


@dataclass(frozen=True)
class Found:
    """What one way says of an effect.

    Attributes
    ----------
    log_evidence : float
        Over that of nothing more.
    strength : float
        95 % end, of what the tests see.
    limit_db : (low, middle)
        5 and 50 % points of K_CR where the effect is there.
    doubt : float
        Pareto k of the average's weights; of a long run R-hat less one.
    """

    log_evidence: float
    strength: float
    limit_db: tuple[float, float]
    doubt: float


def of_average(suspect: Suspect, known: Around, seen: float) -> Found:
    """As the average has it."""
    rng = np.random.default_rng(15)
    found = weigh(suspect, known, rng)
    moved = rng.choice(known.log_limit, (20, len(found.log_factor))) + found.log_factor
    end = float(np.quantile(found.strength, 0.95)) / seen
    return Found(found.log_evidence, end, db(moved), found.pareto_k)


def of_long_run(suspect: Suspect, etfe: bh.Etfe, seen: float, ess: float, seed: int) -> Found:
    """The effect a parameter like all others."""
    (own,) = (parameter.name for parameter in suspect.extension.parameters)
    least, most = LEAST * seen, MOST * seen
    model = suspect.model.with_prior({own: Uniform(0.0, most)})
    fit = bh.least_squares(model, etfe, seed=seed)
    posterior = bh.sample(fit.model, etfe, fit, ess=ess, seed=seed)
    strength = posterior.draws[:, model.names.index(own)]
    there = strength > least
    weight = there / np.where(there, strength, 1.0)  # from flat to flat in the logarithm
    at_zero = np.mean(strength < least) / least
    chosen = systematic(weight, 4000, np.random.default_rng(seed))
    return Found(
        float(np.log(weight.mean() / np.log(most / least) / at_zero)),
        float(np.quantile(strength[chosen], 0.95)) / seen,
        db(log_limits(model, posterior.draws[chosen])),
        float(posterior.rhat.max()) - 1,
    )


def db(log_limit: np.ndarray) -> tuple[float, float]:
    low, middle = 20 / np.log(10) * np.quantile(log_limit, [0.05, 0.5])
    return float(low), float(middle)


def compared(case: str, seed: int, ess: float) -> Iterator[str]:
    """A line an effect, of a clean recording and of one with a lag."""
    device, held = CASES[case]
    clean = Bench.from_device(device, held=held)
    share = 0.0
    for name in ("clean", "with a lag"):
        bench = clean.with_effect(LAG, time_constant_s=share) if share else clean
        etfe = bh.estimate_etfe(recorded(bench, SECONDS, seed))
        model = bh.grasped(device=device) if held else bh.free(device=device)
        fit = bh.least_squares(model, etfe, seed=seed)
        posterior = bh.sample(fit.model, etfe, fit, ess=2000, seed=seed)
        known = around(posterior, 400, np.random.default_rng(seed))
        for suspect in linear_suspects(posterior.model, etfe):
            if len(suspect.extension.parameters) > 1:
                continue
            later = replace(suspect, unseen=replace(suspect.unseen, lowest=0.0))
            seen = min(float(seen_of(later, known)[0]), later.unseen.largest / MOST)
            if suspect.name == LAG:
                share = 0.5 * seen
            ways = (
                of_average(later, known, seen),
                of_long_run(later, etfe, seen, ess, seed),
            )
            yield line(f"{case}, {name}", suspect.name, db(known.log_limit), *ways)


def line(case: str, name: str, declared: tuple[float, float], average: Found, long: Found) -> str:
    points = "   ".join(
        f"{one.limit_db[0] - declared[0]:+7.4f} {one.limit_db[1] - declared[1]:+7.4f}"
        for one in (average, long)
    )
    return (
        f"{case:24s} {name:20s} {average.log_evidence:+6.2f} {long.log_evidence:+6.2f}   "
        f"{average.strength:5.2f} {long.strength:5.2f}   {points}   "
        f"{average.doubt:5.2f} {long.doubt:.3f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--ess", type=float, default=4000, help="effective draws of a long run")
    parser.add_argument("--cases", nargs="+", default=list(CASES))
    asked = parser.parse_args()
    print(
        "recording, effect: log evidence, 95 % of the strength over what is seen, and the 5 and "
        "50 % points of K_CR where it is there beside the declared ones, dB; of the average and of "
        "the long run; Pareto k of the one, R-hat less one of the other"
    )
    for case in asked.cases:
        for text in compared(case, asked.seed, asked.ess):
            print(text, flush=True)


if __name__ == "__main__":
    main()
