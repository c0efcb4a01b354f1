"""The critical stiffness read from the measured response itself, with no model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from bayeshaptic.quantities import estimate, quantity
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.shown import Shown
from bayeshaptic.stability.local_fit import LocalFit, ResponseData, local_fit, response_data
from bayeshaptic.threads import single_threaded
from bayeshaptic.types import Complexes, Floats

DRAWS = 4000
# Standard deviations from -180 degrees from which a stretch counts, in equal shares of the draws:
# the nearer it is, the more likely it is the noise that has put it on its side.
_LEVELS = (0.25, 0.7, 1.2, 1.9, 2.5)
_DOUBTFUL = 1.0  # a stretch below this is worth a word where it is not in the numbers,
_NEAR = 2.0  # and a place that is nearer than this without reaching the other side


@dataclass(frozen=True, eq=False, repr=False)
class EtfeCriticalStiffness(Shown):
    """Model-free critical stiffness of a measurement.

    Attributes
    ----------
    q05, q50, q95 : float or None
        Quantiles of K_CR over the ETFE's own noise, in `unit`; None where it cannot be read.
    frequency_hz : float or None
        Median frequency of the binding crossing.
    unit : str
    reason : str or None
        Why there is no number.
    caveat : str or None
        Where the phase may cross too, by less than its noise; this is not in the numbers.
    samples : ndarray, shape (n,)
        K_CR of each draw of the noise; inf where it has no crossing inside the band.
    phase_sd_deg : float or None
        Standard deviation of the phase at `frequency_hz`, in degrees, all windows around it taken
        together.
    db_per_degree : float or None
        How far K_CR moves where that phase is wrong by a degree, in dB: large where the phase
        runs nearly along -180 degrees.
    """

    q05: float | None
    q50: float | None
    q95: float | None
    frequency_hz: float | None
    unit: str
    reason: str | None = None
    caveat: str | None = None
    samples: Floats = field(default_factory=lambda: np.zeros(0), repr=False)
    phase_sd_deg: float | None = None
    db_per_degree: float | None = None

    def _lines(self) -> tuple[str, ...]:
        if self.q05 is None or self.q50 is None or self.q95 is None:
            return ("No critical stiffness from the response alone", self.reason or "")
        found = estimate(self.q50, self.q05, self.q95, self.unit)
        return (
            f"Critical stiffness of the response alone {found}, median and 90 % interval",
            f"crossing at {quantity(self.frequency_hz, 'Hz')}",
            *(() if self.caveat is None else (self.caveat,)),
        )


class _Run(NamedTuple):
    """Neighbouring places on one side of -180 degrees: from `start` up to but without `stop`.

    `strength` is the largest distance from -180 degrees, in standard deviations and signed.
    """

    start: int
    stop: int
    strength: float


@single_threaded
def etfe_critical_stiffness(
    etfe: Etfe,
    seed: int = 0,
    draws: int = DRAWS,
    sensor: Callable[[Floats], Complexes] | None = None,
) -> EtfeCriticalStiffness:
    """Smallest -Re(1/G) over the frequencies of the band where the measured G is real and negative.

    The response is fitted by quintics, each over a span of windows where a cubic is as good.
    The phase crosses between two stretches of the band that lie on either side of -180
    degrees.  The coefficients at the crossings are drawn from their covariance, and
    the lowest crossing of each draw is read off.  A stretch that is on its side by no more than
    noise counts with its neighbours: the weaker it is, the more often.

    Parameters
    ----------
    etfe : Etfe
    seed : int
        Of the random numbers.
    draws : int
    sensor : callable, optional
        Of frequencies (L,): what the sensor of a measured force multiplies the loop's response by
        (`Fit.sensor`).

    Returns
    -------
    EtfeCriticalStiffness
        Without numbers, and with the reason, where the phase does not reach -180 degrees inside
        the band.  Crossings outside the band (and the one at the Nyquist frequency) are not seen:
        the true limit may be lower.
    """
    data = response_data(etfe, sensor)
    fits = _local_fits(data, *etfe.band_hz)
    band = "{:.4g} and {:.4g} Hz".format(*etfe.band_hz)

    def missing(reason: str) -> EtfeCriticalStiffness:
        return EtfeCriticalStiffness(None, None, None, None, etfe.stiffness_unit, reason)

    if len(fits) < 2:
        return missing(f"the response is too noisy between {band}")
    value = np.array([fit.inverse for fit in fits])
    noise = np.array([fit.relative_sd for fit in fits]) * np.abs(value)
    side = value.imag / noise
    levels = [_runs(side, level)[0] for level in _LEVELS]
    certain = levels[-1]
    if certain[0].strength < 0 and value[certain[0].start].real < 0:
        return missing(f"the phase is beyond -180 degrees at {fits[0].centre_hz:.3g} Hz already")
    rng = np.random.default_rng(seed)
    shares = [_samples(data, fits, runs, rng, draws // len(levels)) for runs in levels]
    samples, where = np.concatenate(shares, axis=1)
    crosses = np.isfinite(samples)
    if not crosses.any():
        return missing(f"the phase does not reach -180 degrees between {band}")
    enough = 0.95  # share of draws with a crossing inside the band that an interval needs
    if crosses.mean() < enough:
        share = f"{100 * crosses.mean():.0f} % of the draws of its noise"
        return missing(f"the phase reaches -180 degrees between {band} in {share} only")
    q05, q50, q95 = (float(q) for q in np.quantile(samples[crosses], [0.05, 0.5, 0.95]))
    middle = float(np.median(where[crosses]))
    caveat = _caveat(fits, side, q05, etfe.stiffness_unit)
    return EtfeCriticalStiffness(
        q05, q50, q95, middle, etfe.stiffness_unit, None, caveat, samples, *_steepness(fits, middle)
    )


def _local_fits(data: ResponseData, low_hz: float, high_hz: float) -> list[LocalFit]:
    """The response around places all along the band, where it is not too noisy."""
    step = 0.03  # relative distance of the places where the phase is looked at
    count = max(int(np.log(high_hz / low_hz) / step), 2)
    places = np.geomspace(low_hz, high_hz, count)
    return [fit for hz in places if (fit := local_fit(data, hz))]


def _steepness(fits: list[LocalFit], frequency_hz: float) -> tuple[float, float]:
    """The phase's standard deviation at a crossing in degrees, and dB of 1/abs(G) per degree."""
    centres = np.array([fit.centre_hz for fit in fits])
    nearest = int(np.abs(np.log(centres / frequency_hz)).argmin())
    aside = 2  # places on either side of a crossing, over which its slope is read
    around = [fit.inverse for fit in fits[max(nearest - aside, 0) : nearest + aside + 1]]
    turned = np.degrees(np.abs(np.angle(around[-1] / around[0])))
    risen = 20 * np.log10(abs(around[-1]) / abs(around[0]))
    sd = float(np.degrees(fits[nearest].relative_sd))
    return sd, float(abs(risen) / max(turned, sd))


def _runs(side: Floats, threshold: float) -> tuple[list[_Run], list[_Run]]:
    """Stretches on one side of -180 degrees, and those that were too weak to count.

    `side` is the distance from -180 degrees in standard deviations.  The weakest stretch joins
    its neighbours until all that are left reach the threshold.
    """

    def run(start: int, stop: int) -> _Run:
        part = side[start:stop]
        return _Run(start, stop, float(part[np.abs(part).argmax()]))

    cuts = np.flatnonzero(np.signbit(side[1:]) != np.signbit(side[:-1])) + 1
    edges = [0, *cuts.tolist(), len(side)]
    runs = [run(start, stop) for start, stop in zip(edges[:-1], edges[1:], strict=True)]
    doubtful = []
    while len(runs) > 1:
        weakest = min(range(len(runs)), key=lambda n: abs(runs[n].strength))
        if abs(runs[weakest].strength) >= threshold:
            break
        doubtful.append(runs[weakest])
        first, last = max(weakest - 1, 0), min(weakest + 1, len(runs) - 1)
        runs[first : last + 1] = [run(runs[first].start, runs[last].stop)]
    return runs, doubtful


def _samples(
    data: ResponseData, fits: list[LocalFit], runs: list[_Run], rng: np.random.Generator, draws: int
) -> tuple[Floats, Floats]:
    """Lowest K of all crossings between the runs, and its frequency; inf and nan without one."""
    lowest, where = np.full(draws, np.inf), np.full(draws, np.nan)
    for left, right in zip(runs[:-1], runs[1:], strict=True):
        if min(fits[left.stop - 1].inverse.real, fits[right.start].inverse.real) < 0:
            stiffness, frequency = _lowest_crossing(data, fits, left, right, rng, draws)
            where = np.where(stiffness < lowest, frequency, where)
            lowest = np.minimum(stiffness, lowest)
    return lowest, where


def _lowest_crossing(
    data: ResponseData,
    fits: list[LocalFit],
    left: _Run,
    right: _Run,
    rng: np.random.Generator,
    draws: int,
) -> tuple[Floats, Floats]:
    """Lowest K between the middles of two runs, and its frequency, for each draw of the noise.

    inf and nan where a draw has no crossing there.
    """
    before, after = fits[left.stop - 1], fits[right.start]
    share = before.inverse.imag / (before.inverse - after.inverse).imag
    centre = before.centre_hz + share * (after.centre_hz - before.centre_hz)
    fit = local_fit(data, centre) or before
    low = max(fits[(left.start + left.stop) // 2].centre_hz, fit.low_hz)
    high = min(fits[(right.start + right.stop) // 2].centre_hz, fit.high_hz)
    points = 201
    frequency = np.linspace(min(low, before.centre_hz), max(high, after.centre_hz), points)
    inverse = fit.draws(rng, draws, frequency)
    early, late = inverse[:, :-1], inverse[:, 1:]
    change = np.signbit(early.imag) != np.signbit(late.imag)
    with np.errstate(divide="ignore", invalid="ignore"):
        part = np.where(change, early.imag / (early.imag - late.imag), 0.0)
    stiffness = -(early.real + part * (late.real - early.real))
    stiffness = np.where(change & (stiffness > 0), stiffness, np.inf)
    pick = stiffness.argmin(axis=1)
    each = np.arange(draws)
    lowest = stiffness[each, pick]
    where = frequency[pick] + part[each, pick] * (frequency[1] - frequency[0])
    return lowest, np.where(np.isfinite(lowest), where, np.nan)


def _caveat(fits: list[LocalFit], side: Floats, lowest: float, unit: str) -> str | None:
    """A sentence on the lowest crossing that the noise may hide or feign; None without one."""
    doubtful = [n for run in _runs(side, _DOUBTFUL)[1] for n in (run.start, run.stop - 1)]
    near = np.abs(side)
    dips = 1 + np.flatnonzero(
        (near[1:-1] <= np.minimum(near[:-2], near[2:])) & (near[1:-1] < _NEAR)
    )
    # Where all windows around were mostly noise, polynomials through others say nothing: at 400 Hz
    # those up to 309 Hz made a limit of 420 N/m of a gain of 1000 kN/m.
    beside = 0.03  # of the frequency, as the places are apart
    places = [
        (-fits[n].inverse.real, fits[n].centre_hz)
        for n in (*doubtful, *dips.tolist())
        if 0 < -fits[n].inverse.real < lowest and fits[n].covers(beside)
    ]
    if not places:
        return None
    stiffness, frequency = min(places)
    return (
        f"near {frequency:.3g} Hz the phase is nearer to \N{MINUS SIGN}180 degrees than its "
        f"noise; if it crosses there, the limit is {float(f'{stiffness:.3g}'):,g} {unit}"
    )
