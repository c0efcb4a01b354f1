"""Several short recordings of one device as one: how often the intervals hold what the bench was.

    python -m benchmarks.coverage.pooled [COUNT] [FIRST]

Steps of a rigid device with dry friction under a PD controller, four recordings of 0.5 to 3 s;
and white noise on free devices in open loop, eight recordings of 1 to 5 s.  In every other series
of steps the friction differs between the four recordings, by a tenth (sd).
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence

import numpy as np

from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.inference.sampler import sample
from bayeshaptic.inference.time_domain.fit import fit_motion
from bayeshaptic.inference.time_domain.mass_in_loop import NAMES
from bayeshaptic.inference.time_domain.white_force import in_white_force
from bayeshaptic.inference.time_domain.widths.correlated import FREEDOM
from bayeshaptic.models import build_model
from bayeshaptic.recordings import join_recordings, recording_from_arrays
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.rig import Bench, WhiteNoise, run_loop, simulate
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.types import Floats
from benchmarks.closed_loop import DRAWS, limit_draws
from benchmarks.recordings.one_mass import PERIOD_S, gains

DAY_TO_DAY = 0.1  # of the friction, standard deviation


def steps(seed: int) -> tuple[Recording, Floats]:
    """Four recordings of position steps as one, and the truth in the order of `NAMES`."""
    rng = np.random.default_rng((5, seed))
    mass = float(np.exp(rng.uniform(np.log(0.1), np.log(10))))
    stroke = rng.uniform(0.02, 0.1)
    damping, spring, derivative, _, _ = gains("PD", mass, rng)
    size = 0.3 * spring * stroke
    friction = rng.uniform(0.03, 0.2) * size
    days = friction * (1 + DAY_TO_DAY * (seed % 2) * rng.standard_normal(4))
    offset = rng.uniform(-0.03, 0.03) * size
    delay_s = rng.uniform(0, 2) * PERIOD_S
    resolution = 10 ** rng.uniform(-6.3, -5)
    found = []
    for number, today in enumerate(days):
        bench = Bench(
            "rigid", {"m": mass, "b": damping}, delay_s=delay_s, encoder_resolution=resolution
        ).with_effect("coulomb_friction", force=float(today))
        seconds = rng.uniform(0.5, 3)
        goals, hold = stroke * rng.uniform(-1, 1, 10), round(rng.uniform(0.3, 0.6) / PERIOD_S)
        last = [0.0]

        def control(
            k: int,
            position: float,
            goals: Floats = goals,
            hold: int = hold,
            last: list[float] = last,
        ) -> float:
            rate, last[0] = (position - last[0]) / PERIOD_S if k else 0.0, position
            return float(spring * (goals[k // hold] - position) - derivative * rate)

        done = run_loop(bench, control, seconds, seed=10 * seed + number)
        # A constant force on the device is a constant in the command that nobody feels.
        found.append(recording_from_arrays(done.force + offset, done.position, PERIOD_S))
    return join_recordings(found), np.array([mass, damping, friction, offset, delay_s])


def white(seed: int) -> tuple[Recording, dict[str, float]]:
    """Eight recordings of white noise on a free device as one, and its parameters."""
    rng = np.random.default_rng((6, seed))
    bench = Bench.from_device(("phantom", "lhifam")[seed % 2], False, "free")
    values = {name: v * float(np.exp(rng.normal(0, 0.3))) for name, v in bench.values.items()}
    delay_s = rng.uniform(0, 2) * bench.period_s
    found = []
    for number in range(8):
        own = Bench(
            "free",
            values,
            delay_s=delay_s,
            encoder_resolution=bench.encoder_resolution,
            period_s=bench.period_s,
        )
        noise = WhiteNoise(bench.force_rms, 400.0, 0.5, float(rng.uniform(1, 5)))
        made = simulate(own, noise, seed=10 * seed + number)
        found.append(recording_from_arrays(**made.signals))
    return join_recordings(found), values | {"delay_s": delay_s}


def of_steps(count: int, first: int) -> None:
    """Coverage of every parameter and of K_CR."""
    from scipy.stats import t as student

    reach = student.ppf(0.95, FREEDOM)
    inside, held, widths, white, seconds = [], [], [], 0, 0.0
    for seed in range(first, first + count):
        recording, truth = steps(seed)
        began = time.process_time()
        found = in_white_force(fit_motion(recording), recording)
        white += found.disturbed is not None
        seconds += time.process_time() - began
        inside.append(np.abs(found.values - truth) < reach * found.sd)
        limits = limit_draws(truth, found.values, found.covariance, seed)
        low, high = np.quantile(limits[1:], [0.05, 0.95])
        held.append(low < limits[0] < high)
        widths.append(20 * np.log10(high / low))
    print(f"{count} series of four steps, {seconds / count:.2f} s of CPU time each, {white} white")
    for name, share in zip(NAMES, np.mean(inside, axis=0), strict=True):
        print(f"{name:8s} 90 % interval holds the truth in {100 * share:.0f} %")
    print(f"K_CR     {100 * np.mean(held):.0f} %, median width {np.median(widths):.2g} dB")
    for name, half in (("same", 0), ("differs", 1)):
        share = 100 * np.mean(np.array(inside)[(half - first) % 2 :: 2], axis=0)
        print(f"friction {name}: " + ", ".join(f"{s:.0f}" for s in share))


def of_white(count: int, first: int) -> None:
    """Coverage of the parameters, joined, and of K_CR; K_CR's width beside one piece's."""
    inside, held, narrower = [], [], []
    for seed in range(first, first + count):
        recording, truth = white(seed)
        widths = []
        for one in (recording, max(recording.pieces, key=lambda piece: piece.samples)):
            etfe = estimate_etfe(one)
            fit = least_squares(build_model("free", period_s=one.period_s), etfe)
            posterior = sample(fit.model, etfe, start=fit, ess=400)
            draws = posterior.draws[:: max(len(posterior.draws) // DRAWS, 1)]
            limits = critical_stiffness(fit.model, draws).samples
            low, high = np.quantile(limits, [0.05, 0.95])
            widths.append(np.log(high / low))
            if one is recording:
                own = np.array([[truth[name] for name in fit.model.names]])
                held.append(low < critical_stiffness(fit.model, own).samples[0] < high)
                ends = posterior.quantile(np.array([0.05, 0.95]))
                inside += [
                    a < truth[name] < b
                    for name, a, b in zip(fit.model.names, *ends, strict=True)
                    if truth[name] > 0
                ]
        narrower.append(widths[0] / widths[1])
    shown: Sequence[object] = (count, np.mean(inside), np.mean(held), np.median(narrower))
    print(
        "{} series of white noise: parameters in {:.0%}, K_CR in {:.0%}; its interval is {:.2f} "
        "times as wide as that of the longest piece alone".format(*shown)
    )


def main(count: int, first: int = 0) -> None:
    """Both kinds, of the seeds from `first` on."""
    of_steps(count, first)
    of_white(max(count // 2, 1), first)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=60)
    parser.add_argument("first", nargs="?", type=int, default=0, help="first seed")
    main(**vars(parser.parse_args()))
