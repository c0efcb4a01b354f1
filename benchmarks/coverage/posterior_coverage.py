"""Do 90 % intervals cover the truth in 90 % of recordings, and are they as narrow as they can be?

    python -m benchmarks.coverage.posterior_coverage [--recordings 25] [--ess 2000] [--processes 2]
        [--first 0] [--without-device] [--scatter 0.15] [--damper 0]

Truths are drawn from the priors of both devices, or scattered around their tables, free and
grasped; the recordings (30 s each) come from the virtual bench. README.md explains the columns.
"""

from __future__ import annotations

import argparse
import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

from benchmarks.coverage.calibration import (  # noqa: E402
    CASES,
    Outcome,
    Setting,
    calibrate,
    combined,
    pooled,
    uniform,
)


def row(name: str, outcomes: list[Outcome]) -> str:
    """One line of the table."""
    pulls = pooled(outcomes, "pull")
    widths = pooled(outcomes, "width") / pooled(outcomes, "bound")
    names = dict.fromkeys(name for o in outcomes for name in o.names)
    p = combined(np.array([uniform(r) for r in (ranks(outcomes, n) for n in names) if len(r) > 4]))
    limit_ranks = np.array([o.limit[3] for o in outcomes])
    chi = np.array([o.chi_square for o in outcomes])
    speed = np.array([o.effective / o.seconds for o in outcomes])
    return (
        f"{name:16s} {len(outcomes):4d} {len(pulls):5d}  {pooled(outcomes, 'covered').mean():6.1%}"
        f"  {np.mean([o.limit_covered for o in outcomes]):6.1%}  {p:6.3f}  "
        f"{uniform(limit_ranks):6.3f}  {np.sqrt(np.mean(pulls**2)):5.2f}  {np.median(widths):5.2f}"
        f" ({np.quantile(widths, 0.1):.2f}..{np.quantile(widths, 0.9):.2f})  "
        f"{chi.min():.2f}..{chi.max():.2f}  {np.median(speed):6.0f} ({speed.min():.0f}+)"
    )


def ranks(outcomes: list[Outcome], name: str) -> np.ndarray:
    """Ranks of one parameter's truth where it has more data than prior."""
    found = [(o, o.names.index(name)) for o in outcomes if name in o.names]
    return np.array([o.rank[i] for o, i in found if not o.dominated[i]])


def by_parameter(outcomes: list[Outcome]) -> list[str]:
    """Coverage and rank uniformity of every parameter."""
    lines = ["parameter    n   covered  ranks p  rms pull  width/bound"]
    for name in dict.fromkeys(name for o in outcomes for name in o.names):
        found = [(o, o.names.index(name)) for o in outcomes if name in o.names]
        found = [(o, i) for o, i in found if not o.dominated[i]]
        if not found:
            continue
        covered = np.mean([o.covered[i] for o, i in found])
        pull = np.sqrt(np.mean([o.pull[i] ** 2 for o, i in found]))
        width = np.median([o.width[i] / o.bound[i] for o, i in found])
        p = uniform(np.array([o.rank[i] for o, i in found]))
        lines.append(
            f"{name:9s} {len(found):4d}   {covered:6.1%}   {p:6.3f}   {pull:6.2f}   {width:6.2f}"
        )
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--recordings", type=int, default=25, help="of each of the four cases")
    parser.add_argument("--ess", type=float, default=2000)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--keep", help="file for the outcomes (pickle), to look at them closer")
    parser.add_argument("--without-device", action="store_true", help="the analysis has no file")
    parser.add_argument("--scatter", type=float, help="truths: the tables', with this log sd")
    parser.add_argument("--damper", type=float, help="b2 as a share of the tables' b1 + b2")
    asked = parser.parse_args()
    if asked.without_device and asked.scatter is None:
        parser.error("--without-device wants --scatter: there is no prior to draw truths from")
    setting = Setting(not asked.without_device, asked.scatter, asked.damper)
    outcomes = calibrate(
        asked.recordings,
        asked.ess,
        asked.processes,
        asked.first,
        progress=True,
        keep=asked.keep,
        setting=setting,
    )
    print(
        "\ncase              rec  par.  covered    K_CR  ranks p  K_CR p   pull  width/bound"
        "        chi-square   effective/s"
    )
    for case in CASES:
        print(row(case, [o for o in outcomes if o.case == case]))
    print(row("all", outcomes))
    pull = np.array([o.limit[4] for o in outcomes])
    print(f"mean pull of K_CR, in its standard deviations: {pull.mean():+.2f}")
    print()
    print("\n".join(by_parameter(outcomes)))
    dominated = np.mean(np.concatenate([o.dominated for o in outcomes]))
    print(f"\n{dominated:.1%} of the parameters have more prior than data and are left out.")
    failed = [f"{o.case} {o.seed}" for o in outcomes if not o.converged]
    print(f"not converged: {len(failed)} of {len(outcomes)} ({', '.join(failed) or 'none'})")


if __name__ == "__main__":
    main()
