"""Recordings made in closed loop: how often the intervals hold what the bench was.

    python -m benchmarks.closed_loop [COUNT] [--white SHARE] [--first SEED] [--exact SECONDS]

Rigid devices of 0.1 to 10 kg under five controllers and four kinds of references, 2 to 30 s.  In
seven of ten there is a force that depends on the position, and friction that changes along the way,
differs between the directions, and fades near standstill: none of these is a law of the model.
The same once more without such a force, and with one of white noise in its place: widths beside the
least that are possible.  With --white that alone, of this share of the command; with --exact, too,
beside what the counts themselves say of recordings up to so long, at some 4 s of CPU time for each.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from scipy.stats import t as student

from bayeshaptic.diagnosis.feedback.lacking import with_laws
from bayeshaptic.errors import InputError
from bayeshaptic.inference.time_domain.fit import fit_motion
from bayeshaptic.inference.time_domain.mass_in_loop import NAMES
from bayeshaptic.inference.time_domain.white_force import in_white_force
from bayeshaptic.inference.time_domain.widths.correlated import FREEDOM
from bayeshaptic.models import rigid
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.types import Floats
from benchmarks.bounds.one_mass import bound, spreads, with_limit
from benchmarks.bounds.one_mass_exact import of_counts
from benchmarks.recordings.one_mass import PERIOD_S, make

DRAWS = 600
FIRST = 1000  # seed of the loops under a white force
LOST = 1e-2  # of what is known of a mass, beyond its grid: more is no information


def limit_draws(truth: Floats, values: Floats, covariance: Floats, seed: int) -> Floats:
    """K_CR of the truth, then of draws from the posterior; inf alone where there are none."""
    rng = np.random.default_rng(seed)
    sd = np.sqrt(np.diag(covariance))
    root = np.linalg.cholesky(covariance / np.outer(sd, sd) + 1e-9 * np.eye(len(sd)))
    count = 10 * DRAWS
    stretch = np.sqrt(FREEDOM / rng.chisquare(FREEDOM, count))[:, None]
    drawn = values + sd * (rng.standard_normal((count, len(sd))) @ root.T) * stretch
    prior = np.exp(-0.5 * (drawn[:, 4] / (2 * PERIOD_S)) ** 2)
    kept = np.all(drawn[:, [0, 1, 2, 4]] > 0, axis=1) & (rng.uniform(size=count) < prior)
    theta = np.concatenate([truth[None], drawn[kept][:DRAWS]])[:, [0, 1, 4]]
    return critical_stiffness(rigid(period_s=PERIOD_S), theta).samples


def main(count: int) -> None:
    """Print the coverage of every parameter and of K_CR."""
    reach = student.ppf(0.95, FREEDOM)
    inside, ranks, widths, white, seconds = [], [], [], [], 0.0
    for seed in range(100, 100 + count):
        case = make(seed)
        began = time.process_time()
        try:
            found, laws, doubts = with_laws(case.recording, None)
            found = in_white_force(found, case.recording)
        except InputError as error:
            print(error)
            continue
        seconds += time.process_time() - began
        white.append(found.disturbed is not None)
        inside.append(np.abs(found.values - case.truth) < reach * found.sd)
        limits = limit_draws(case.truth, found.values, found.covariance, seed)
        if len(limits) > DRAWS // 10:
            ranks.append(float(np.mean(limits[1:] < limits[0])))
            low, high = np.quantile(limits[1:], [0.05, 0.95])
            widths.append(float(20 * np.log10(high / low)))
        named = ", ".join(law.effect.name for law in laws)
        print(f"seed {seed}: {case.what}  {named} {' '.join(doubts)}")
    print(f"{len(inside)} recordings, {seconds / len(inside):.2f} s of CPU time each")
    held, known = np.array(inside), np.array(white)
    for what, some in (("all", held), ("a white force", held[known]), ("others", held[~known])):
        shares = zip(NAMES, np.mean(some, axis=0), strict=True)
        told = ", ".join(f"{name} {100 * share:.0f} %" for name, share in shares)
        print(f"{what} ({len(some)}): 90 % intervals hold {told}")
    rank, width = np.array(ranks), np.array(widths)
    for widest in (np.inf, 6.0, 3.0):
        some = rank[width < widest]
        held = np.mean((some > 0.05) & (some < 0.95))
        print(
            f"K_CR, intervals under {widest:g} dB ({len(some)}): holds the truth in "
            f"{100 * held:.0f} %, lies above it in {100 * np.mean(some <= 0.05):.0f} %"
        )


def beside_the_bound(
    count: int, noise: float, along_too: bool = False, first: int = FIRST, exact_s: float = 0.0
) -> None:
    """Print how wide posteriors are, and errors, beside the Cramer-Rao bound."""
    widths, errors, inside, white = [], [], [], []
    exact: list[tuple[Floats, Floats]] = []
    reach = student.ppf(0.95, FREEDOM)
    for seed in range(first, first + count):
        case = make(seed, noise, along_too)
        try:
            found = in_white_force(fit_motion(case.recording), case.recording)
        except InputError as error:
            print(error)
            continue
        slopes = with_limit(case.truth)
        least, sd = spreads(bound(case), slopes), spreads(found.covariance, slopes)
        off = np.abs(slopes @ (found.values - case.truth))
        widths.append(sd / least)
        errors.append(off / least)
        inside.append(off < reach * sd)
        white.append(found.disturbed is not None)
        if case.recording.duration_s < exact_s:
            covariance, lost = of_counts(case)
            if lost < LOST:
                own = np.where(least > 0, spreads(covariance, slopes), np.nan)
                exact.append((own / least, sd / own))
    known = np.array(white)
    beside = ", and one along the way in seven of ten" if along_too else ""
    print(f"a white force of {100 * noise:g} % of the command{beside}, {len(widths)} recordings:")
    for what, some in (("all", known | True), ("told to be white", known)):
        middles = (np.nanmedian(np.array(one)[some], axis=0) for one in (widths, errors))
        held = np.mean(np.array(inside)[some], axis=0)
        print(f"{what} ({np.count_nonzero(some)}), medians of sd and |error| over the bound, held:")
        for name, width, error, share in zip((*NAMES, "ln K_CR"), *middles, held, strict=True):
            print(f"{name:8s} {width:.3g}  {error:.3g}  {100 * share:.0f} %")
    if exact:
        print(f"medians of {len(exact)}: what the counts allow over the bound, and sd over that")
        for name, *ratios in zip((*NAMES, "ln K_CR"), *np.nanmedian(exact, axis=0), strict=True):
            print(f"{name:8s} " + "  ".join(f"{ratio:.3g}" for ratio in ratios))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=200)
    parser.add_argument("--white", type=float, metavar="SHARE", help="of the command's size")
    parser.add_argument("--first", type=int, default=FIRST, metavar="SEED")
    parser.add_argument("--exact", type=float, default=0.0, metavar="SECONDS")
    asked = parser.parse_args()
    if asked.white is not None:
        beside_the_bound(asked.count, asked.white, first=asked.first, exact_s=asked.exact)
    else:
        main(asked.count)
        for share in (0.003, 0.01, 0.03):
            beside_the_bound(asked.count // 4, share)
        beside_the_bound(asked.count // 2, 0.01, along_too=True)
