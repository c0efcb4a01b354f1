"""What the blind benchmark records: which effects, on which device, with which seeds."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from bayeshaptic.recordings import Recording, recording_from_arrays
from bayeshaptic.rig import Bench, Effect, WhiteNoise, simulate
from benchmarks.recordings import foreign

CASES = {
    "LHIfAM free": ("lhifam", False),
    "LHIfAM held": ("lhifam", True),
    "PHANToM free": ("phantom", False),
    "PHANToM held": ("phantom", True),
}
UNKNOWN = "unexplained"
# Effect on the bench: its class, and the names that are right.
SINGLE: dict[str, tuple[str, set[str]]] = {
    "second_mode": ("linear", {"second_mode"}),
    "extra_delay": ("linear", {"extra_delay"}),
    "actuator_lag": ("linear", {"actuator_lag"}),
    "position_filter": ("linear", {"position_filter"}),
    "reflex": ("linear", {"reflex"}),
    "centring_stiffness": ("linear", {"centring_stiffness"}),
    "structural_damping": ("linear", {"structural_damping"}),
    "coulomb_friction": ("nonlinear", {"coulomb_friction"}),
    "hardening_spring": ("nonlinear", {"hardening_spring"}),
    "hardening_connection": ("nonlinear", {"hardening_spring", "hardening_connection"}),
    "backlash": ("nonlinear", {"backlash"}),
    "grip_drift": ("time-varying", {"grip_drift"}),
    "quantisation": ("measurement", {"quantisation"}),
    "mains_tone": ("measurement", {"mains_tone"}),
    "held_samples": ("measurement", {"held_samples"}),
    # Outside the list of the library's promises.
    "base_compliance": ("linear", {"base_compliance"}),
    "stribeck_friction": ("nonlinear", {"stribeck_friction"}),
    "dahl_friction": ("nonlinear", {"dahl_friction"}),
    "drag": ("nonlinear", {"drag"}),
    "actuator_saturation": ("nonlinear", {"actuator_saturation"}),
    "gain_drift": ("time-varying", {"gain_drift"}),
    "force_ripple": ("nonlinear", {"cogging"}),
    "position_clipping": ("measurement", {"position_clipping"}),
    # Outside the bench's own effects as well: see foreign.py. UNKNOWN: there is no law for it.
    "tanh_saturation": ("nonlinear", {"soft_saturation"}),
    "velocity_cubed": ("nonlinear", {"cubic_damping"}),
    "load_friction": ("nonlinear", {"coulomb_friction"}),
    "lopsided_friction": ("nonlinear", {"coulomb_friction", UNKNOWN}),
    "asymmetric_gain": ("nonlinear", {"uneven_actuator"}),
    "coarse_command": ("nonlinear", {UNKNOWN}),
    "eccentric_encoder": ("nonlinear", {UNKNOWN}),
    "end_stops": ("nonlinear", {UNKNOWN}),
    "tighter_away": ("nonlinear", {"damping_along_the_way"}),
    "bump": ("measurement", {"outside_force"}),
    "lost_command": ("measurement", {"outside_force"}),
}
LISTED = 15  # the first of them are those that the library promises
PAIRS = (
    ("extra_delay", "coulomb_friction"),
    ("second_mode", "coulomb_friction"),
    ("second_mode", "extra_delay"),
    ("actuator_lag", "second_mode"),
    ("centring_stiffness", "extra_delay"),
    ("hardening_spring", "extra_delay"),
    ("coulomb_friction", "mains_tone"),
    ("second_mode", "held_samples"),
    ("coulomb_friction", "centring_stiffness"),
    ("backlash", "extra_delay"),
)
NEEDS_A_HAND = {"reflex", "grip_drift"}
PAIR = "pair: "
HIDDEN_BY_A_HAND = {"centring_stiffness"}  # the hand's own spring takes it up
# What the effect's size is called on the bench and in the library.
SIZES = {
    "coulomb_friction": ("force", "friction_force"),
    "load_friction": ("force", "friction_force"),
    "second_mode": ("frequency_hz", "mode_hz"),
    "backlash": ("gap", "half_gap"),
    "drag": ("coefficient", "drag_coefficient"),
}


@dataclass(frozen=True)
class Job:
    """One recording: which device, which effects, which seed.

    `drawn`: not the table's device, its typical effects and 30 s, but a device, sizes and a length
    drawn at random: see `SCATTER`, `SIZE`, `SECONDS`.
    """

    case: str
    effects: tuple[str, ...]
    seed: int
    drawn: bool = False


SCATTER = 0.3  # log sd of a drawn device's parameters around the table's
SIZE = 2.0  # sizes of an effect are multiplied by up to this, or divided, evenly in the logarithm
SECONDS = (10.0, 60.0)  # evenly in the logarithm


def jobs_for(effects: tuple[str, ...], count: int, seed: int) -> list[Job]:
    """`count` recordings dealt out over the devices on which the effects make sense."""
    cases = cases_for(*effects)
    return [Job(cases[i % len(cases)], effects, seed + i) for i in range(count)]


def cases_for(*effects: str) -> list[str]:
    """The devices, held or free, on which all the effects make sense."""
    return [
        case
        for case, (_, held) in CASES.items()
        if not (HIDDEN_BY_A_HAND if held else NEEDS_A_HAND) & set(effects)
    ]


def recorded(bench: Bench, seconds: float, seed: int) -> Recording:
    """A recording of white noise at the bench's usual level, in its usual band."""
    low, high = bench.band_hz
    made = simulate(bench, WhiteNoise(bench.force_rms, high, low, seconds), seed=seed)
    return recording_from_arrays(**made.signals, encoder_resolution=bench.encoder_resolution)


def bench_of(job: Job) -> Bench:
    """The bench with the job's effects, at their typical strengths or drawn ones."""
    device, held = CASES[job.case]
    bench = Bench.from_device(device, held=held)
    rng = np.random.default_rng(job.seed)
    if job.drawn:
        drawn = {k: v * np.exp(SCATTER * rng.normal()) for k, v in bench.values.items()}
        bench = replace(bench, values=drawn)
    for effect in job.effects:
        unheard_of = foreign.EFFECTS.get(effect)
        bench = bench.with_effect(unheard_of.typical(bench.scales()) if unheard_of else effect)
        if job.drawn:
            last = resized(bench.effects[-1], rng)
            bench = replace(bench, effects=(*bench.effects[:-1], last))
    return bench


def resized(effect: Effect, rng: np.random.Generator) -> Effect:
    """The effect with every size of its own multiplied by a random factor."""
    sizes = {f.name: getattr(effect, f.name) for f in fields(effect)}
    return replace(
        effect,
        **{
            name: value * SIZE ** rng.uniform(-1, 1)
            for name, value in sizes.items()
            if isinstance(value, float)
        },
    )


def seconds_of(job: Job) -> float:
    """How long its recording is: 30 s, or drawn."""
    if not job.drawn:
        return 30.0
    return float(np.exp(np.random.default_rng(job.seed + 1).uniform(*np.log(SECONDS))))


def single_jobs(effect: str, each: int, others: int, seed: int) -> list[Job]:
    """Recordings of one effect: `each` of those that the library promises, `others` else."""
    number = list(SINGLE).index(effect) + 1
    return jobs_for((effect,), each if number <= LISTED else others, seed + 1000 * number)


def pair_jobs(count: int, seed: int) -> dict[str, list[Job]]:
    """Recordings of `count` pairs, by the name of the pair; each next one on another device."""
    groups: dict[str, list[Job]] = {}
    for i in range(count):
        pair = PAIRS[i % len(PAIRS)]
        jobs = jobs_for(pair, 4, seed + 50_000 + 10 * i)
        turn = (i + i // len(PAIRS)) % len(jobs)
        groups.setdefault(PAIR + " + ".join(pair), []).append(jobs[turn])
    return groups
