"""The likelihoods for closed loops beside that of the response, on white noise in open loop.

    python -m benchmarks.in_open_loop [COUNT]

Of both devices, free and held: through a reference, which is the command itself, and by all lines.
Of one mass that a white force disturbs, of 0.1 to 3 kg: its motion followed in time.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.inference.time_domain.fit import fit_motion
from bayeshaptic.inference.time_domain.mass_in_loop import NAMES
from bayeshaptic.inference.time_domain.white_force import in_white_force
from bayeshaptic.models import build_model
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_by_direct_method, estimate_etfe
from bayeshaptic.rig import Bench, WhiteNoise, simulate
from bayeshaptic.types import Floats

PERIOD_S = 1e-3
SECONDS = 20.0
WHITE = 0.1  # force that nobody commands, of the command


def recorded(device: str, held: bool, seed: int) -> Recording:
    """The published device under the paper's noise."""
    bench = Bench.from_device(device, held, "grasped" if held else "free")
    made = simulate(bench, WhiteNoise(bench.force_rms, 400.0, 0.5, SECONDS), seed=seed)
    return recording_from_arrays(
        made.force,
        made.position,
        bench.period_s,
        force_unit=bench.force_unit,
        position_unit=bench.position_unit,
    )


def of_the_devices(count: int) -> None:
    """Print how far the other two likelihoods are from that of the response."""
    through: list[Floats] = []
    lines: list[Floats] = []
    for device in ("lhifam", "phantom"):
        for held in (False, True):
            name = "grasped" if held else "free"
            for seed in range(count):
                plain = recorded(device, held, seed)
                etfe = estimate_etfe(plain)
                model = build_model(name, device, period_s=plain.period_s)
                usual = least_squares(model, etfe)
                known = replace(plain, reference=plain.force)
                others = estimate_etfe(known, etfe.band_hz), estimate_by_direct_method(plain)
                for other, found in zip(others, (through, lines), strict=True):
                    fit = least_squares(model, other, start=usual.theta)
                    found.append(beside(fit.theta, fit.sd, usual.theta, usual.sd))
    tell("through the reference", through)
    tell("all lines", lines)


def of_one_mass(count: int) -> None:
    """Print how far the followed motion is from the fit to the response."""
    followed = []
    for seed in range(count):
        rng = np.random.default_rng(seed)
        mass = float(np.exp(rng.uniform(np.log(0.1), np.log(3))))
        bench = Bench(
            "rigid",
            {"m": mass, "b": mass * rng.uniform(1, 10)},
            delay_s=rng.uniform(0.2, 1.8) * PERIOD_S,
            encoder_resolution=10 ** rng.uniform(-6.3, -5),
        )
        command, white = 3 * rng.standard_normal((2, round(SECONDS / PERIOD_S)))
        made = simulate(bench, command + WHITE * white, seed=seed)
        recording = recording_from_arrays(command, made.position, PERIOD_S)
        usual = least_squares(build_model("rigid", period_s=PERIOD_S), estimate_etfe(recording))
        motion = in_white_force(fit_motion(recording), recording)
        own = [NAMES.index(name) for name in usual.model.names]
        followed.append(beside(motion.values[own], motion.sd[own], usual.theta, usual.sd))
    tell("one mass, followed in time", followed)


def beside(theta: Floats, sd: Floats, usual: Floats, usual_sd: Floats) -> Floats:
    """Differences, and widths, over standard deviations of the response's; shape (2, P)."""
    inner = np.isfinite(sd) & np.isfinite(usual_sd)
    return np.stack([np.abs(theta - usual), sd])[:, inner] / usual_sd[inner]


def tell(what: str, found: list[Floats]) -> None:
    """Print medians, and the ends of nine values in ten."""
    apart, wide = np.concatenate(found, axis=1)
    low, high = np.quantile(wide, [0.05, 0.95])
    print(
        f"{what}: {len(found)} recordings, {len(apart)} values; apart by {np.median(apart):.2f} sd "
        f"(nine in ten under {np.quantile(apart, 0.9):.2f}), {np.median(wide):.2f} times as wide "
        f"({low:.2f} to {high:.2f})"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=5)
    asked = parser.parse_args().count
    of_the_devices(asked)
    of_one_mass(2 * asked)
