"""Recordings made in closed loop: how often the intervals hold what the bench was.

    python -m benchmarks.closed_loop [COUNT]

Rigid devices of 0.1 to 10 kg under five controllers and four kinds of references, 2 to 30 s.  In
seven of ten there is a force that depends on the position, and friction that changes along the way,
differs between the directions, and fades near standstill: none of these is a law of the model.
The same once more without such a force, and with one of white noise in its place: widths beside the
least that are possible.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student

from bayeshaptic.diagnosis.feedback.lacking import with_laws
from bayeshaptic.errors import InputError
from bayeshaptic.inference.time_domain.fit import fit_motion
from bayeshaptic.inference.time_domain.follower import Follower
from bayeshaptic.inference.time_domain.mass_in_loop import NAMES, MassInLoop
from bayeshaptic.inference.time_domain.uneven import WAVES as ALONG, Way
from bayeshaptic.inference.time_domain.white_force import in_white_force
from bayeshaptic.inference.time_domain.widths.correlated import FREEDOM
from bayeshaptic.models import rigid
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.rig import Bench, run_loop
from bayeshaptic.rig.effects import Effect
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.types import Floats

PERIOD_S = 1e-3
CONTROLLERS = ("P", "PD", "PI", "PID", "PD, filtered")
REFERENCES = ("steps", "ramps", "noise", "trajectory")
WAVES = 6
DRAWS = 600


@dataclass(frozen=True)
class Track(Effect):
    """A force on the device that nobody commands: the last entry of a list that others write."""

    name = "track"
    force: tuple[list[float], ...] = ()

    def command(self, force: Floats, progress: Floats, time_s: Floats) -> Floats:
        return force + self.force[0][0]


@dataclass(frozen=True)
class Case:
    """A recording, the truth in the order of `NAMES`, and what disturbed it.

    `resolution` is the encoder's count, `noise` the sd of a white force that nobody commands.
    """

    recording: Recording
    truth: Floats
    what: str
    resolution: float
    noise: float


def reference(kind: str, count: int, stroke: float, rng: np.random.Generator) -> Floats:
    """What the controller follows, shape (count,)."""
    if kind == "noise":
        from scipy.signal import butter, sosfilt

        low = butter(2, rng.uniform(2, 8), fs=1 / PERIOD_S, output="sos")
        wander = sosfilt(low, rng.standard_normal(count + 2000))[2000:]
        return wander / wander.std() * stroke * 0.5
    pieces, last, total = [], 0.0, 0
    while total < count:
        length = int(rng.uniform(0.3, 0.9) / PERIOD_S)
        pause = int(rng.uniform(0, 0.2) / PERIOD_S) if kind == "trajectory" else 0
        goal = rng.uniform(-1, 1) * stroke
        share = np.arange(1, length + 1) / length
        shape = {
            "steps": np.ones(length),
            "ramps": share,
            "trajectory": share**3 * (10 - 15 * share + 6 * share**2),
        }[kind]
        pieces.append(np.append(last + (goal - last) * shape, np.full(pause, goal)))
        last, total = goal, total + length + pause
    return np.concatenate(pieces)[:count]


def gains(kind: str, mass: float, rng: np.random.Generator) -> tuple[float, ...]:
    """Damping of the device, and P, D, I and what the velocity's filter keeps."""
    if kind in ("P", "PI"):  # the device itself must damp the loop
        rate = rng.uniform(6, 25)
        omega = rate / (2 * rng.uniform(0.25, 0.7))
        derivative = 0.0
    else:
        rate = np.exp(rng.uniform(np.log(2), np.log(20)))
        omega = 2 * np.pi * rng.uniform(2, 12)
        derivative = max(2 * rng.uniform(0.4, 1) * mass * omega - mass * rate, 0.0)
    spring = mass * omega**2
    integral = spring * omega * rng.uniform(0.05, 0.15) if "I" in kind else 0.0
    filtered = kind in ("PID", "PD, filtered")
    keep = np.exp(-2 * np.pi * rng.uniform(60, 200) * PERIOD_S) if filtered else 0.0
    return mass * rate, spring, derivative, integral, keep


@dataclass(frozen=True)
class Along:
    """Forces along the way, each a sum of waves: 0 as such, 1 and 2 of friction, both ways."""

    number: Floats
    phase: Floats
    height: Floats

    @classmethod
    def drawn(cls, uneven: float, dry: float, stroke: float, rng: np.random.Generator) -> Along:
        """Of size `uneven`, those of friction a quarter of `dry`; waves as long as the stroke."""
        phase = rng.uniform(0, 2 * np.pi, (3, WAVES))
        height = rng.standard_normal((3, WAVES)) / np.sqrt(np.arange(1, WAVES + 1))
        height /= np.sqrt(np.sum(height**2, axis=1) / 2)[:, None]
        rubs = 0.25 * dry * bool(uneven)
        height *= np.array([uneven, rubs, rubs])[:, None]
        return cls(0.7 * np.pi * np.arange(1, WAVES + 1) / stroke, phase, height)

    def force(self, which: int, position: Floats | float) -> Floats:
        at = np.asarray(position)[..., None] * self.number + self.phase[which]
        return np.asarray(np.sum(self.height[which] * np.sin(at), axis=-1))


def make(seed: int, noise: float | None = None, along_too: bool = False) -> Case:
    """One recording; controllers and references in turn.

    With `noise` there is a white force, as a share of the command's size, and none along the way
    unless `along_too`.
    """
    rng = np.random.default_rng(seed)
    controller = CONTROLLERS[seed % 5]
    kind = REFERENCES[seed // 5 % 4]
    seconds = float(np.exp(rng.uniform(np.log(2), np.log(30))))
    mass = float(np.exp(rng.uniform(np.log(0.1), np.log(10))))
    stroke = rng.uniform(0.02, 0.1)
    damping, spring, derivative, integral, keep = gains(controller, mass, rng)
    wanted = reference(kind, round(seconds / PERIOD_S), stroke, rng)
    size = spring * stroke * (0.1 if kind == "trajectory" else 0.3)
    dry = 0.0 if rng.uniform() < 0.35 else rng.uniform(0.03, 0.3) * size
    uneven = 0.0 if rng.uniform() < 0.3 else rng.uniform(0.01, 0.06) * size
    white = np.zeros(len(wanted))
    if noise is not None:
        uneven = uneven if along_too else 0.0
        white = noise * size * np.random.default_rng([seed, 1]).standard_normal(len(wanted))
    offset = rng.uniform(-0.1, 0.1) * size
    apart = rng.uniform(-0.3, 0.3) * dry if uneven else 0.0
    delay = rng.uniform(0, 2) * PERIOD_S
    along = Along.drawn(uneven, dry, stroke, rng)
    slow = 0.02 * stroke * np.sqrt(spring / mass)
    force = [offset]
    now = dict.fromkeys(("position", "velocity", "sum", "smooth"), 0.0)

    def control(k: int, position: float) -> float:
        rate = (position - now["position"]) / PERIOD_S if k else 0.0
        now["position"] = position
        now["velocity"] = keep * now["velocity"] + (1 - keep) * rate
        now["sum"] += (wanted[k] - position) * PERIOD_S
        now["smooth"] = 0.8 * now["smooth"] + 0.2 * rate
        moving = float(np.clip(now["smooth"] / slow, -1, 1))
        friction = float(along.force(1 if moving > 0 else 2, position))
        force[0] = (
            offset + float(along.force(0, position)) - moving * friction - abs(moving) * apart
        )
        force[0] += white[k]
        follow = spring * (wanted[k] - position)
        return float(follow - derivative * now["velocity"] + integral * now["sum"])

    bench = Bench(
        "rigid",
        {"m": mass, "b": damping},
        delay_s=delay,
        encoder_resolution=10 ** rng.uniform(-6.3, -5),
    ).with_effect(Track((force,)))
    if dry:
        bench = bench.with_effect("coulomb_friction", force=dry)
    done = run_loop(bench, control, seconds, seed=seed, give_up=100 * stroke)
    way = np.linspace(done.position.min(), done.position.max(), 400)
    mean, forward, backward = (float(along.force(which, way).mean()) for which in range(3))
    truth = np.array(
        [
            mass,
            damping,
            dry + (forward + backward) / 2,
            -offset - mean + (forward - backward) / 2 + apart,
            delay,
        ]
    )
    recording = recording_from_arrays(done.force, done.position, PERIOD_S, name=f"seed {seed}")
    what = f"{controller}, {kind}, {seconds:.1f} s"
    return Case(recording, truth, what, bench.encoder_resolution, (noise or 0.0) * size)


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


def bound(case: Case) -> Floats:
    """Least covariance of `NAMES` that any unbiased estimate can have, (5, 5): Cramer and Rao.

    Of the innovations of a mass that a white force and the encoder's counts disturb: how the motion
    under the recorded command alone, whatever the controller, goes with the values, through the
    steady Kalman filter.  Zero of a friction that is none.
    """
    recording = case.recording
    alone = Follower(np.zeros(1), np.ones(1))
    loop = replace(MassInLoop.of(recording, 1.0, Way.of(recording.position)), follower=alone)
    values = loop.begun(case.truth)
    waves = np.zeros(2 * ALONG)
    columns = loop.columns(values, waves, loop.error(values, waves))[:, : loop.plain]
    known = np.ones(loop.plain, bool)
    known[2] = case.truth[2] > 0  # friction that is none has no slope on either side
    columns, size = innovations(case, columns[:, known])
    scale = np.linalg.norm(columns, axis=0)
    information = (columns / scale).T @ (columns / scale)
    least = np.zeros((loop.plain, loop.plain))
    least[np.ix_(known, known)] = np.linalg.inv(information) / np.outer(scale, scale) * size**2
    return least[: len(NAMES), : len(NAMES)]


def with_limit(truth: Floats) -> Floats:
    """Slopes of the values and of ln K_CR, Diaz and Gil (2010), equation (19), shape (6, 5)."""
    of_limit = [0.0, 1 / truth[1], 0.0, 0.0, -1 / (PERIOD_S / 2 + truth[4])]
    return np.vstack([np.eye(len(truth)), of_limit])


def spreads(covariance: Floats, slopes: Floats) -> Floats:
    """Standard deviations to first order; NaN where there is none."""
    sd = np.sqrt(np.diag(slopes @ covariance @ slopes.T))
    return np.where(sd > 0, sd, np.nan)


def innovations(case: Case, columns: Floats) -> tuple[Floats, float]:
    """What a steady Kalman filter cannot foresee of positions, shape (N, C), and its sd."""
    from scipy.linalg import solve_discrete_are

    mass, damping = case.truth[:2]
    kept = np.exp(-damping / mass * PERIOD_S)
    far = (1 - kept) * mass / damping
    motion = np.array([[1, far], [0, kept]])
    push = np.array([[PERIOD_S - far], [1 - kept]]) / damping
    seen = np.array([[1.0, 0.0]])
    count = np.array([[case.resolution**2 / 12]])
    pushed = push @ push.T * case.noise**2
    spread = solve_discrete_are(motion.T, seen.T, pushed, count)
    size = float((seen @ spread @ seen.T + count)[0, 0])
    gain = motion @ spread @ seen.T / size
    state, new = np.zeros((2, columns.shape[1])), np.empty_like(columns)
    for k, column in enumerate(columns):
        new[k] = column - state[0]
        state = motion @ state + gain @ new[k : k + 1]
    return new, float(np.sqrt(size))


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


def beside_the_bound(count: int, noise: float, along_too: bool = False) -> None:
    """Print how wide posteriors are, and errors, beside the Cramer-Rao bound."""
    widths, errors, inside, white = [], [], [], []
    reach = student.ppf(0.95, FREEDOM)
    for seed in range(1000, 1000 + count):
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
    known = np.array(white)
    beside = ", and one along the way in seven of ten" if along_too else ""
    print(f"a white force of {100 * noise:g} % of the command{beside}, {len(widths)} recordings:")
    for what, some in (("all", known | True), ("told to be white", known)):
        middles = (np.nanmedian(np.array(one)[some], axis=0) for one in (widths, errors))
        held = np.mean(np.array(inside)[some], axis=0)
        print(f"{what} ({np.count_nonzero(some)}), medians of sd and |error| over the bound, held:")
        for name, width, error, share in zip((*NAMES, "ln K_CR"), *middles, held, strict=True):
            print(f"{name:8s} {width:.3g}  {error:.3g}  {100 * share:.0f} %")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=200)
    asked = parser.parse_args().count
    main(asked)
    for share in (0.003, 0.01, 0.03):
        beside_the_bound(asked // 4, share)
    beside_the_bound(asked // 2, 0.01, along_too=True)
