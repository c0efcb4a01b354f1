"""Truths from the priors, recordings from the virtual bench, and how the posteriors stand to them.

The recordings come from `bayeshaptic.rig`, which shares no code with the models that are fitted.
"""

from __future__ import annotations

import pickle
import time
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from scipy.stats import kstest

from bayeshaptic.inference import least_squares, sample
from bayeshaptic.models import HalfNormal, LogNormal, MaybeZero, Model, NearZero, build_model, draw
from bayeshaptic.recordings import Recording, recording_from_arrays
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.rig import Bench, WhiteNoise, simulate
from bayeshaptic.rig.noise import tremor_density, wander_density
from bayeshaptic.stability.critical import critical_stiffness

_MOST = 640_000  # evaluations: a run that has not converged by then is counted as it is
CASES = ("lhifam free", "lhifam grasped", "phantom free", "phantom grasped")


@dataclass(frozen=True)
class Outcome:
    """One recording: its truth, and the posterior against it; columns are parameters.

    Attributes
    ----------
    case, seed : str, int
    names : tuple of str
    truth, mean, sd, low, high, rank : ndarray, shape (P,)
        Ends of the central 90 % interval; rank is the share of draws below the truth.
    bound : ndarray, shape (P,)
        Standard deviation by Cramer and Rao, in the coordinate of sampling, the noise known and
        the prior counted; `width` is the posterior's in that coordinate.
    dominated : ndarray of bool, shape (P,)
        Parameters with more prior than data, and a damper of zero: no central interval holds that.
    limit : tuple
        K_CR: truth, low, high, rank, pull.
    chi_square, effective, seconds, rhat : float
        Effective draws of the parameter that has the fewest; CPU seconds of fit and sampling.
    """

    case: str
    seed: int
    names: tuple[str, ...]
    truth: np.ndarray
    mean: np.ndarray
    sd: np.ndarray
    low: np.ndarray
    high: np.ndarray
    rank: np.ndarray
    bound: np.ndarray
    width: np.ndarray
    dominated: np.ndarray
    limit: tuple[float, float, float, float, float]
    chi_square: float
    effective: float
    seconds: float
    rhat: float
    converged: bool
    stages: dict[str, float] = field(default_factory=dict)

    @property
    def covered(self) -> np.ndarray:
        return (self.low <= self.truth) & (self.truth <= self.high)

    @property
    def limit_covered(self) -> bool:
        truth, low, high, *_ = self.limit
        return low <= truth <= high

    @property
    def pull(self) -> np.ndarray:
        return (self.mean - self.truth) / self.sd


@dataclass(frozen=True)
class Setting:
    """Where truths come from, and what the analysis is told.

    Attributes
    ----------
    device_file : bool
        Whether the analysis has the device's file; else it knows the delay alone.
    scatter : float or None
        Truths are the tables' times a log-normal factor of this standard deviation; by default
        they are draws from the priors of the file.
    damper : float or None
        The damper b2 as a share of the tables' b1 + b2 (0: none); by default as the rest.
    """

    device_file: bool = True
    scatter: float | None = None
    damper: float | None = None


def truth_and_bench(
    case: str, seed: int, setting: Setting = Setting()
) -> tuple[Model, np.ndarray, Bench]:
    """A model to fit, a parameter vector, and a bench that has it."""
    device, structure = case.split()
    model = build_model(structure, device)
    rng = np.random.default_rng([CASES.index(case), seed])
    if setting.scatter is None:
        truth = np.array([draw(model.prior(name), rng, 1)[0] for name in model.names])
    else:
        truth = model.values * np.exp(setting.scatter * rng.standard_normal(model.size))
    values = dict(zip(model.names, truth.tolist(), strict=True))
    if setting.damper is not None:
        total = model.reference["b1"] + model.reference["b2"]
        truth[model.names.index("b2")] = values["b2"] = setting.damper * total
    bench = Bench.from_device(device, held=structure == "grasped", values=values)
    if not setting.device_file:
        model = build_model(structure, delay_s=bench.delay_s, period_s=bench.period_s)
    return model, truth, bench


def one_recording(
    case: str,
    seed: int,
    ess: float = 2000,
    seconds: float = 30.0,
    setting: Setting = Setting(),
) -> Outcome:
    """Draw a truth, record, fit, sample, and compare."""
    model, truth, bench = truth_and_bench(case, seed, setting)
    low_hz, high_hz = bench.band_hz
    excitation = WhiteNoise(bench.force_rms, high_hz, low_hz, seconds)
    recording = recording_from_arrays(**simulate(bench, excitation, seed=1000 + seed).signals)
    etfe = estimate_etfe(recording)
    began = time.process_time()
    fit = least_squares(model, etfe)
    model = fit.model  # with priors from the data, where there is no file
    fitted = time.process_time()
    posterior = sample(model, etfe, start=fit, ess=ess, seed=seed, most_evaluations=_MOST)
    sampled = time.process_time()
    limit = critical_stiffness(posterior, max_draws=8000)
    draws = posterior.draws
    low, high = np.quantile(draws, [0.05, 0.95], axis=0)
    true_limit = bench.true_critical_stiffness()
    log = np.array([model.prior(name).coordinate == "log" for name in model.names])
    return Outcome(
        case=case,
        seed=seed,
        names=model.names,
        truth=truth,
        mean=draws.mean(axis=0),
        sd=draws.std(axis=0),
        low=low,
        high=high,
        rank=np.mean(draws < truth, axis=0),
        bound=cramer_rao(model, truth, bench, recording, etfe.band_hz),
        width=np.where(log, np.log(np.where(log, draws, 1.0)).std(axis=0), draws.std(axis=0)),
        dominated=(truth == 0) | [posterior.prior_dominated[name] for name in model.names],
        limit=(
            true_limit,
            *limit.quantile([0.05, 0.95]).tolist(),
            float(np.mean(limit.samples < true_limit)),
            float((limit.samples.mean() - true_limit) / limit.samples.std()),
        ),
        chi_square=fit.reduced_chi_square,
        effective=posterior.effective,
        seconds=sampled - began,
        rhat=float(posterior.rhat.max()),
        converged=posterior.converged,
        stages={"least squares": fitted - began, "sampling": sampled - fitted},
    )


def cramer_rao(
    model: Model, truth: np.ndarray, bench: Bench, recording: Recording, band_hz: tuple
) -> np.ndarray:
    """The least standard deviation of each parameter, shape (P,), the noise spectrum known.

    In the logarithm of positive parameters, and as it is for dampers that may be zero; the
    priors' curvature is added to the information of the recording's lines in the band.
    """
    frequency = np.fft.rfftfreq(recording.samples, recording.period_s)
    force = np.fft.rfft(recording.force) / np.sqrt(recording.samples)
    inside = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
    frequency, force = frequency[inside], force[inside]
    noise = noise_variance(bench, recording, frequency)
    information = np.diag([_prior_information(model, name) for name in model.names])
    slopes = _slopes(model, truth, frequency) * force / np.sqrt(noise)
    information += 2 * np.real(slopes.conj() @ slopes.T)
    return np.sqrt(np.diag(np.linalg.inv(information)))


def noise_variance(bench: Bench, recording: Recording, frequency: np.ndarray) -> np.ndarray:
    """Variance of a line of the position's DFT over sqrt(N): the encoder's and the hand's share."""
    noise = np.full(len(frequency), bench.resolution**2 / 12 + bench.sensor_noise_rms**2)
    if bench.mechanism != "grasped":
        return noise
    grid = np.fft.rfftfreq(4 * recording.samples, recording.period_s)[1:-1]
    force = np.zeros(len(frequency))
    for rms, density in (
        (bench.tremor_rms, tremor_density(bench.tremor_hz)),
        (bench.wander_rms, wander_density(bench.wander_hz)),
    ):
        # Half of the variance lies at positive frequencies, N / 2 lines there: 1 a line if white.
        force += rms**2 * density(frequency) / density(grid).mean()
    s = 2j * np.pi * frequency
    v = bench.values
    q1 = v["m1"] * s**2 + v["b1"] * s
    transmission, grip = v["bc"] * s + v["kc"], v["bs"] * s + v["ks"]
    q2 = v["m2"] * s**2 + v["b2"] * s + transmission + grip
    qh = v["mh"] * s**2 + v["bh"] * s + v["kh"] + grip
    q1 = q1 + transmission
    from_hand = transmission * grip / (qh * q2 * q1 - transmission**2 * qh - grip**2 * q1)
    return noise + np.abs(from_hand) ** 2 * force


def _prior_information(model: Model, name: str) -> float:
    prior = model.prior(name)
    if isinstance(prior, LogNormal):
        return prior.log_sd**-2
    assert isinstance(prior, HalfNormal | MaybeZero | NearZero)
    return prior.scale**-2


def _slopes(model: Model, truth: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Derivatives of the response by the sampling coordinates, shape (P, L)."""
    rows = []
    for i, name in enumerate(model.names):
        prior = model.prior(name)
        scale = truth[i] if prior.coordinate == "log" else float(prior.quantile(0.5))
        ends = np.stack([truth, truth])
        ends[:, i] += 1e-4 * scale * np.array([1, -1])
        up, down = model.response(ends, frequency)
        step = 2e-4 * (1.0 if prior.coordinate == "log" else scale)
        rows.append((up - down) / step)
    return np.array(rows)


def calibrate(
    recordings: int,
    ess: float,
    processes: int = 1,
    first: int = 0,
    progress: bool = False,
    keep: str | None = None,
    setting: Setting = Setting(),
) -> list[Outcome]:
    """`recordings` of each case, from seed `first` on; written to the file `keep` as they come."""
    jobs = [(case, first + i) for i in range(recordings) for case in CASES]
    run = partial(_job, ess=ess, setting=setting)
    outcomes = []
    if processes == 1:
        results = map(run, jobs)
    else:
        from concurrent.futures import ProcessPoolExecutor

        results = ProcessPoolExecutor(processes).map(run, jobs)
    for outcome in results:
        outcomes.append(outcome)
        if keep:
            with open(keep, "wb") as file:
                pickle.dump(outcomes, file)
        if progress:
            print(
                f"{outcome.case} {outcome.seed}: chi-square {outcome.chi_square:.3f}, largest pull "
                f"{np.abs(outcome.pull).max():.1f}, {outcome.effective:.0f} effective in "
                f"{outcome.seconds:.1f} s",
                flush=True,
            )
    return outcomes


def _job(job: tuple[str, int], ess: float, setting: Setting) -> Outcome:
    return one_recording(*job, ess=ess, setting=setting)


def uniform(ranks: np.ndarray) -> float:
    """Probability that ranks of so many independent truths lie so unevenly by chance."""
    return float(kstest(ranks, "uniform").pvalue)


def pooled(outcomes: list[Outcome], field: str) -> np.ndarray:
    """A column of all parameters with more data than prior."""
    return np.concatenate([getattr(o, field)[~o.dominated] for o in outcomes])


def combined(probabilities: np.ndarray) -> float:
    """One probability of several dependent tests, by Cauchy's distribution.

    Y. Liu and J. Xie, "Cauchy combination test", Journal of the American Statistical Association
    115 (2020): the ranks of one recording's parameters are correlated.
    """
    if not len(probabilities):
        return np.nan
    statistic = np.mean(np.tan((0.5 - np.clip(probabilities, 1e-15, 1 - 1e-15)) * np.pi))
    return float(0.5 - np.arctan(statistic) / np.pi)
