"""Where the time of a report goes, and how many effective draws a second the sampler gives.

    python -m benchmarks.costs.speed [--recording FILE --device NAME] [--ess 8000]
        [--stretch-steps 2000]

First the whole command, `bayeshaptic report ... --no-loop`, as a process of its own, and the same
work stage by stage; then the sampler beside emcee's plain stretch move on the same density, fit and
adaptation included.  README.md explains the columns.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import emcee  # noqa: E402
import numpy as np  # noqa: E402

import bayeshaptic as bh  # noqa: E402
from bayeshaptic.inference.coordinates import coordinates  # noqa: E402
from bayeshaptic.inference.diagnostics import diagnose  # noqa: E402
from bayeshaptic.inference.sampling.density import Density  # noqa: E402

DATA = Path(__file__).resolve().parents[2] / "data" / "recordings"
RECORDINGS = (
    ("lhifam-free", "lhifam", bh.free),
    ("lhifam-user", "lhifam", bh.grasped),
    ("phantom-free", "phantom", bh.free),
    ("phantom-user", "phantom", bh.grasped),
)
WALKERS = 64


@contextmanager
def clocked(took: list[tuple[str, float, float]], name: str) -> Iterator[None]:
    wall, cpu = time.perf_counter(), time.process_time()
    yield
    took.append((name, time.perf_counter() - wall, time.process_time() - cpu))


def command(recording: Path, device: str) -> tuple[float, float]:
    """Wall and CPU seconds of the whole command in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        line = [sys.executable, "-m", "bayeshaptic", "report", str(recording), "--device", device]
        line += ["--no-loop", "--quiet", "-o", str(Path(folder) / "out")]
        wall, before = time.perf_counter(), os.times()
        subprocess.run(line, check=True, stdout=subprocess.DEVNULL)
        after = os.times()
    children = after.children_user + after.children_system
    cpu = children - before.children_user - before.children_system
    return time.perf_counter() - wall, cpu


def stages(recording: Path, device: str) -> list[tuple[str, float, float]]:
    """Wall and CPU seconds of what the command does, one after the other, and of the analysis."""
    took: list[tuple[str, float, float]] = []
    with tempfile.TemporaryDirectory() as folder:
        with clocked(took, "read the recording"):
            measured = bh.read_recording(recording)
        with clocked(took, "analyse"):
            analysis = bh.analyse(measured, device=device)
        for name, seconds in analysis.seconds.items():
            took.append((f"  {name}", seconds, np.nan))
        with clocked(took, "draw and write"):
            bh.write_report(analysis, Path(folder) / "out")
    posterior = analysis.posterior
    print(
        f"{len(posterior.draws)} draws, {posterior.effective:.0f} effective of the parameter with "
        f"the fewest; safe at 0.1 %: {analysis.limit.safe(0.001)}"
    )
    return took


def sampler(name: str, device: str, structure, ess: float, steps: int) -> str:
    """One row: our sampler and the plain stretch move, effective draws and seconds."""
    etfe = bh.estimate_etfe(bh.read_recording(DATA / f"{name}.csv.gz"))
    began = time.process_time()
    fit = bh.least_squares(structure(device=device), etfe)
    fitted = time.process_time() - began
    posterior = bh.sample(fit.model, etfe, start=fit, ess=ess)
    ours = time.process_time() - began
    chains, stretched = stretch(fit, steps)
    plain = diagnose(chains).ess
    return (
        f"{name:14s} {fitted:5.2f} {ours:6.2f} {posterior.chains[..., 0].size:7d} "
        f"{posterior.effective:7.0f} {posterior.effective / ours:7.0f}   {fitted + stretched:6.2f} "
        f"{chains[..., 0].size:7d} {plain:7.0f} {plain / (fitted + stretched):7.0f}   "
        f"{posterior.effective / ours / (plain / (fitted + stretched)):6.0f}"
    )


def stretch(fit: bh.Fit, steps: int) -> tuple[np.ndarray, float]:
    """Chains (2, S, walkers, P) of emcee's default move, in two halves, and CPU seconds.

    The first fifth is left out.  In logarithms, started around the fit, as one would without
    knowing better.
    """
    here = coordinates(fit.model)
    density = Density(fit.likelihood, here)
    rng = np.random.default_rng(0)
    peak = here.coordinate(fit.theta)
    start = np.empty((0, fit.model.size))
    while len(start) < WALKERS:
        drawn = np.abs(peak + 1e-2 * rng.standard_normal((WALKERS, len(peak))))
        drawn = np.where(here.walls, drawn, np.where(peak < 0, -drawn, drawn))
        start = np.concatenate([start, drawn[np.isfinite(density(drawn))]])
    plain = emcee.EnsembleSampler(WALKERS, fit.model.size, density, vectorize=True)
    plain.random_state = np.random.RandomState(1).get_state()
    began = time.process_time()
    plain.run_mcmc(start[:WALKERS], steps, skip_initial_state_check=True)
    chain = here.natural(plain.get_chain(discard=steps - steps * 4 // 5 // 2 * 2))
    return chain.reshape(2, -1, *chain.shape[1:]), time.process_time() - began


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--recording", type=Path, default=DATA / "lhifam-user.csv.gz")
    parser.add_argument("--device", default="lhifam")
    parser.add_argument("--ess", type=float, default=8000)
    parser.add_argument("--stretch-steps", type=int, default=2000)
    asked = parser.parse_args()
    print(f"bayeshaptic report {asked.recording.name} --device {asked.device} --no-loop")
    wall, cpu = command(asked.recording, asked.device)
    took = stages(asked.recording, asked.device)
    print(f"\n{'':26s} wall s  CPU s")
    print(f"{'the whole command':26s} {wall:6.2f} {cpu:6.2f}")
    for name, seconds, busy in took:
        print(f"{name:26s} {seconds:6.2f} {'' if np.isnan(busy) else format(busy, '6.2f')}")
    print(
        "\nCPU seconds, fit included                 this sampler                    stretch move\n"
        "recording        fit  total   draws     eff   eff/s    total   draws     eff   eff/s"
        "    ratio"
    )
    for name, device, structure in RECORDINGS:
        print(sampler(name, device, structure, asked.ess, asked.stretch_steps), flush=True)


if __name__ == "__main__":
    main()
