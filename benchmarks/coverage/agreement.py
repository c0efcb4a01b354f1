"""Does the sampler draw from the posterior?  Against a long run of emcee's plain stretch move.

    python -m benchmarks.coverage.agreement [--steps 30000] [--cases lhifam-user phantom-free ...]

The stretch run has no adaptation that could be wrong.  Printed are the largest difference of a mean
in standard deviations, the largest difference of a standard deviation, and what the stretch run
itself is worth; then the stiffness of small risks from a report beside that from twelve times as
many effective draws.
"""

from __future__ import annotations

import argparse
import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import emcee  # noqa: E402
import numpy as np  # noqa: E402

import bayeshaptic as bh  # noqa: E402
from bayeshaptic.inference.coordinates import coordinates  # noqa: E402
from bayeshaptic.inference.diagnostics import diagnose  # noqa: E402
from bayeshaptic.inference.sampling.density import Density  # noqa: E402
from benchmarks.costs.speed import DATA, RECORDINGS  # noqa: E402

WALKERS = 96
RISKS = (0.05, 0.01, 0.001)


def moments(name: str, device: str, structure, steps: int) -> str:
    """One row: our posterior of 20,000 effective draws against the stretch run."""
    etfe = bh.estimate_etfe(bh.read_recording(DATA / f"{name}.csv.gz"))
    fit = bh.least_squares(structure(device=device), etfe)
    posterior = bh.sample(fit.model, etfe, start=fit, ess=20_000)
    here = coordinates(fit.model)
    density = Density(fit.likelihood, here)
    # From a few rough draws: the stretch run forgets them in its first fifth.
    rough = bh.sample(fit.model, etfe, start=fit, ess=100, seed=99).draws[-WALKERS:]
    plain = emcee.EnsembleSampler(WALKERS, fit.model.size, density, vectorize=True)
    plain.random_state = np.random.RandomState(1).get_state()
    plain.run_mcmc(here.coordinate(rough), steps, skip_initial_state_check=True)
    chains = here.natural(plain.get_chain(discard=steps // 5))
    theirs, ours = chains.reshape(-1, fit.model.size), posterior.draws
    sd = theirs.std(axis=0)
    mean = np.abs(ours.mean(axis=0) - theirs.mean(axis=0)) / sd
    ratio = np.abs(ours.std(axis=0) / sd - 1)
    worth = diagnose(chains.reshape(2, -1, WALKERS, fit.model.size))
    return (
        f"{name:14s} {posterior.effective:8.0f} {worth.ess_bulk.min():8.0f}   "
        f"{mean.max():6.3f} sd ({fit.model.names[int(mean.argmax())]:4s})   "
        f"{ratio.max():6.1%} ({fit.model.names[int(ratio.argmax())]})"
    )


def risks(name: str, device: str, structure) -> str:
    """One row: small quantiles of K_CR from a report, and from a much longer run."""
    recording = bh.read_recording(DATA / f"{name}.csv.gz")
    analysis = bh.analyse(recording, model=structure(device=device))
    longer = bh.sample(analysis.model, analysis.etfe, start=analysis.fit, ess=50_000, seed=7)
    limit = bh.critical_stiffness(longer, max_draws=400_000)
    sd = np.diff(limit.quantile([0.05, 0.95]))[0] / 3.29
    cells = []
    for risk in RISKS:
        here, there = analysis.limit.quantile(risk), limit.quantile(risk)
        cells.append(f"{here:10.5g} {there:10.5g} ({(here - there) / sd:+.2f} sd)")
    below = analysis.limit.effective_below(0.001), limit.effective_below(0.001)
    return f"{name:14s} {below[0]:5.0f} {below[1]:5.0f}   " + "   ".join(cells)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--steps", type=int, default=30_000, help="of the stretch run")
    parser.add_argument("--cases", nargs="+", default=[name for name, *_ in RECORDINGS])
    asked = parser.parse_args()
    chosen = [row for row in RECORDINGS if row[0] in asked.cases]
    print("recording      effective   stretch   largest difference of a mean, of a sd")
    for row in chosen:
        print(moments(*row, asked.steps), flush=True)
    print("\nrecording      below 0.1 %   K at 5 %, 1 %, 0.1 % risk: of a report, of a longer run")
    for row in chosen:
        print(risks(*row), flush=True)


if __name__ == "__main__":
    main()
