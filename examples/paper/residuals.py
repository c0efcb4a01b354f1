"""The paper's three open residuals: what its own numbers say about them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import logsumexp

from bayeshaptic.models import LinearSystem
from bayeshaptic.models.response.mechanism import Link
from bayeshaptic.types import Floats

from .hypotheses import Hypothesis, Unknown, Values, Weighed, weigh
from .published import BIN_HZ, TABLES, relays, values
from .relay_data import PERIOD_S, RelayData

LHIFAM = ("lhifam", "grasped")
PHANTOM = ("phantom", "free")
USERS = ("phantom", "grasped")
HAND = ("bs", "ks", "mh", "bh", "kh")
GRIP = (*HAND, "b1", "m2")  # these, too, are others in Table I with a hand than without
SPREAD = 0.15
GAIN_SD_DB = 0.2
TRIAL_SD_DB = 0.3  # PHANToM free: one trial's error


def data(case: tuple[str, str], gain_sd_db: float = GAIN_SD_DB, sampled: bool = True) -> RelayData:
    """Table IV's row of a device."""
    gain, frequency = relays(*case)
    return RelayData(gain, frequency, BIN_HZ["_".join(case)], gain_sd_db, sampled)


# The cable's mode was seen at 87 Hz without a hand; Table II puts it at 90 Hz with one.
CABLE_MODE = (88.5, 5.0)

# (a) LHIfAM held: 86.80 dB predicted at 102.86 Hz, 82.5 dB measured at 87.3 Hz.


def _second_mode(on: int) -> dict[str, object]:
    """A mass on a spring on mass number `on`, at the 110 Hz that the paper saw."""

    def add(system: LinearSystem, v: Values) -> LinearSystem:
        rate = 2 * np.pi * v["mode_hz"]
        damper = 2 * v["mode_damping"] * v["mode_mass"] * rate
        spring = v["mode_mass"] * rate**2
        return replace(
            system, mechanism=system.mechanism.with_mass(v["mode_mass"], on, damper, spring)
        )

    carrier = values(*LHIFAM)[("m1", "m2")[on]]
    hertz = TABLES["lhifam"]["second_mode_hz"]
    extra = (
        Unknown("mode_hz", hertz, 0.2),
        Unknown("mode_mass", 0.2 * carrier, 1.5),
        Unknown("mode_damping", 0.03, 1.0),
    )
    return {"extra": extra, "add": add, "known": _modes_seen((hertz, 3.0), CABLE_MODE)}


def _modes_seen(*modes: tuple[float, float]) -> Callable[[LinearSystem], Floats]:
    """The highest modes of the system, from the top: (frequency, sd) in Hz."""

    def known(system: LinearSystem) -> Floats:
        hertz = np.sort(np.abs(system.poles()[0].imag), axis=1)[:, ::-2] / (2 * np.pi)
        off = np.stack([(hertz[:, i] - at) / sd for i, (at, sd) in enumerate(modes)])
        return -0.5 * (off**2).sum(axis=0)

    return known


def _later(median_s: float, log_sd: float) -> dict[str, object]:
    def add(system: LinearSystem, v: Values) -> LinearSystem:
        return replace(system, delay_s=system.delay_s + v["delay_s"])

    return {"extra": (Unknown("delay_s", median_s, log_sd),), "add": add}


def lhifam_hypotheses(spread: float = SPREAD) -> list[Hypothesis]:
    """Table II with a spread, and what may be more."""

    def held(title: str, **more: object) -> Hypothesis:
        known = {"known": _modes_seen(CABLE_MODE)} | more
        return Hypothesis(title, LHIFAM, spread, **known)  # type: ignore[arg-type]

    return [
        held("Table II and nothing else"),
        held("transmission unknown (bc, kc within a factor of 1.65)", wider={"bc": 0.5, "kc": 0.5}),
        held("hand unknown (a factor of 2)", wider=dict.fromkeys(HAND, 0.7)),
        held("second mode at 110 Hz on the motor", **_second_mode(0)),
        held("second mode at 110 Hz on the body", **_second_mode(1)),
        held("more delay (0.3 ms, a factor of 2.7)", **_later(0.3e-3, 1.0)),
    ]


def lhifam_held(spread: float = SPREAD, sampled: bool = True) -> list[Weighed]:
    """Residual (a)."""
    return weigh(lhifam_hypotheses(spread), data(LHIFAM, sampled=sampled))


def separation(
    first: Weighed, second: Weighed, frequency_hz: Floats, draws: int = 800
) -> tuple[Floats, Floats, Floats]:
    """Responses' gains (dB) under two hypotheses, and how far apart they are.

    Returns
    -------
    gains : two arrays of shape (3, L)
        Quantiles 5, 50, 95 %.
    distance : ndarray, shape (L,)
        Of the medians, over the root of the summed variances.
    """
    bands, middles, variances = [], [], []
    for weighed in (first, second):
        system = weighed.hypothesis.system(weighed.evidence.draws[:draws])
        gain = 20 * np.log10(np.abs(system.sampled_response(frequency_hz, PERIOD_S)))
        bands.append(np.quantile(gain, [0.05, 0.5, 0.95], axis=0))
        middles.append(np.median(gain, axis=0))
        variances.append(gain.var(axis=0))
    distance = np.abs(middles[0] - middles[1]) / np.sqrt(sum(variances))
    return bands[0], bands[1], distance


# (b) PHANToM free: 22.41 dB predicted at 17.67 Hz; 18.5, 16.3, 15.2 dB measured at 16.6 to 14.2 Hz.


def _spring() -> dict[str, object]:
    def add(system: LinearSystem, v: Values) -> LinearSystem:
        link = Link(0, None, np.zeros_like(v["spring"]), v["spring"])
        return replace(system, mechanism=system.mechanism.with_link(link))

    return {"extra": (Unknown("spring", 1.0, 1.5),), "add": add}


def _lighter() -> dict[str, object]:
    def add(system: LinearSystem, v: Values) -> LinearSystem:
        masses = tuple(mass * v["inertia"] for mass in system.mechanism.masses)
        return replace(system, mechanism=replace(system.mechanism, masses=masses))

    return {"extra": (Unknown("inertia", 1.0, 0.3),), "add": add}


def _friction() -> dict[str, object]:
    def add(system: LinearSystem, v: Values) -> LinearSystem:
        link = Link(0, None, v["damper"], np.zeros_like(v["damper"]))
        return replace(system, mechanism=system.mechanism.with_link(link))

    return {"extra": (Unknown("damper", values(*PHANTOM)["b1"], 1.0),), "add": add}


def _stronger() -> dict[str, object]:
    """The motor gives more than commanded: everything that resists it is smaller by that."""

    def add(system: LinearSystem, v: Values) -> LinearSystem:
        mechanism = system.mechanism
        masses = tuple(mass / v["gain"] for mass in mechanism.masses)
        links = tuple(
            replace(link, damping=link.damping / v["gain"], stiffness=link.stiffness / v["gain"])
            for link in mechanism.links
        )
        return replace(system, mechanism=replace(mechanism, masses=masses, links=links))

    return {"extra": (Unknown("gain", 1.0, 0.3),), "add": add}


def phantom_hypotheses(spread: float = 0.05) -> list[Hypothesis]:
    """Table I with a spread, and what may be more."""

    def free(title: str, **more: object) -> Hypothesis:
        return Hypothesis(title, PHANTOM, spread, **more)  # type: ignore[arg-type]

    return [
        free("Table I and nothing else"),
        free("more delay (0.3 ms, a factor of 2.7)", **_later(0.3e-3, 1.0)),
        free("more friction (8.5 mN m s/rad, a factor of 2.7)", **_friction()),
        free("restoring spring (1 N m/rad, a factor of 4.5)", **_spring()),
        free("another inertia (a factor of 1.35)", **_lighter()),
        free("motor stronger or weaker (a factor of 1.35)", **_stronger()),
    ]


def phantom_free(
    spread: float = 0.05, sampled: bool = True, gain_sd_db: float = TRIAL_SD_DB
) -> list[Weighed]:
    """Residual (b)."""
    return weigh(phantom_hypotheses(spread), data(PHANTOM, gain_sd_db, sampled))


# (c) PHANToM held: six users, 38.0 to 42.6 dB.


@dataclass(frozen=True)
class HandSpread:
    """The posterior of the log standard deviation of the hand's parameters between people.

    Attributes
    ----------
    spread : ndarray, shape (n,)
        Grid of log standard deviations.
    shift_db : ndarray, shape (m,)
        Grid of a shift of all gains, the same for everybody.
    density : ndarray, shape (m, n)
        Posterior mass of the cells, for a prior that is flat over both.
    predicted_db : ndarray, shape (n,)
        Standard deviation of K_CR between people with that spread.
    """

    spread: Floats = field(repr=False)
    shift_db: Floats = field(repr=False)
    density: Floats = field(repr=False)
    predicted_db: Floats = field(repr=False)

    def quantile(self, p: float) -> float:
        """Of the spread."""
        return _quantile(self.spread, self.density.sum(axis=0), p)

    def shift_quantile(self, p: float) -> float:
        return _quantile(self.shift_db, self.density.sum(axis=1), p)

    def predicted_quantile(self, p: float) -> float:
        """Of the standard deviation of K_CR between people, in dB."""
        order = np.argsort(self.predicted_db)
        return _quantile(self.predicted_db[order], self.density.sum(axis=0)[order], p)


def _quantile(grid: Floats, mass: Floats, p: float) -> float:
    below = np.cumsum(mass) - 0.5 * mass
    return float(np.interp(p, below / mass.sum(), grid))


def hand_spread(
    names: tuple[str, ...] = HAND,
    shift_db: Floats | None = None,
    sampled: bool = True,
    draws: int = 4000,
    seed: int = 0,
) -> HandSpread:
    """Residual (c): a nested grid; for each spread, each user's likelihood averaged over hands.

    The device is Table I's, known to 2 %; the named parameters vary from user to user, all by the
    same log standard deviation, around Table I's.  `shift_db` is the grid of a common shift of
    all gains (default: -1 to 4 dB); [0] for none.
    """
    users, rng = data(USERS, sampled=sampled), np.random.default_rng(seed)
    shift = np.linspace(-1.0, 4.0, 26) if shift_db is None else np.asarray(shift_db, float)
    z = rng.standard_normal((draws, len(values(*USERS))))
    grid = np.geomspace(0.03, 1.5, 24)
    log_density, predicted = np.empty((len(shift), len(grid))), np.empty(len(grid))
    for i, spread in enumerate(grid):
        hypothesis = Hypothesis("hands", USERS, 0.02, dict.fromkeys(names, float(spread)))
        with np.errstate(all="ignore"):
            each = users.log_likelihood(hypothesis.system(z), shift)
        log_density[:, i] = (logsumexp(each, axis=1) - np.log(draws)).sum(axis=1)
        predicted[i] = np.std(hypothesis.limits(z[:800])[0])
    # Flat over the spread itself: a geometric grid has cells as wide as its values.
    density = np.exp(log_density - log_density.max()) * grid
    return HandSpread(grid, shift, density / density.sum(), predicted)


def at_own_frequency(case: tuple[str, str]) -> Floats:
    """Measured minus predicted gain in dB, both at the frequency of each relay oscillation."""
    gain, frequency = relays(*case)
    nothing = np.zeros((1, len(values(*case))))
    system = Hypothesis("as published", case, 0.0).system(nothing)
    return gain + 20 * np.log10(np.abs(system.sampled_response(frequency, PERIOD_S)[0]))


def sensitivities() -> dict[str, float]:
    """dB of K_CR of the held PHANToM for an e-fold of each parameter, the others as published."""
    published = list(values(*USERS))
    step = 0.02
    hypothesis = Hypothesis("one", USERS, step)
    z = np.zeros((2 * len(published), len(published)))
    for i, name in enumerate(published):
        z[2 * i, published.index(name)] = 1.0
        z[2 * i + 1, published.index(name)] = -1.0
    gain = hypothesis.limits(z)[0].reshape(-1, 2)
    return dict(zip(published, ((gain[:, 0] - gain[:, 1]) / (2 * step)).tolist(), strict=True))
