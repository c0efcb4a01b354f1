"""What a lab does to a recording before it saves it: what becomes of each?

    python -m benchmarks.strangers.saved [COUNT] [FIRST] [FILE]

Devices like those of Diaz and Gil and new ones, free and held, with nothing in them, under seven
excitations for 6 to 40 s.  Then the whole record is treated, position alone or both columns alike,
by one of the ways of `TREATMENTS` in turn, its size drawn at random, and read as a file's columns
are.  Some are told their delay, some whether somebody holds them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.interpolate import LSQUnivariateSpline
from scipy.signal import butter, detrend, medfilt, resample, savgol_filter, sosfiltfilt

from bayeshaptic.recordings import recording_from_arrays
from benchmarks.strangers.__main__ import run
from benchmarks.strangers.device import Array
from benchmarks.strangers.draw import COUNT, UNITS, Case, Draw, base_of, begun, delay_of, states_of
from benchmarks.strangers.recordings import EXCITATIONS, force_of, simulated

Way = Callable[[Array], Array]
FILTERS = (
    *("low-passed both ways", "high-passed both ways", "smoothed", "moving mean"),
    *("less a moving mean", "less a polynomial", "less a spline", "detrended piecewise"),
    *("median", "clipped", "outliers put in", "digits", "half precision"),
)
RATES = ("newest row", "newest force", "lines", "Fourier")
SCALES = ("deviation of one", "up to one")
TREATMENTS = (*FILTERS, *RATES, *SCALES)


def make(seed: int) -> Case | None:
    """A treated recording, what is told of it, and its limit; none where the device runs away."""
    rng = np.random.default_rng([87, seed])
    draw, treatment = begun(rng), TREATMENTS[seed % len(TREATMENTS)]
    period_s = float(rng.choice([5e-4, 1e-3, 2e-3])) if draw.new else 1e-3
    delay_s = delay_of(draw, {}, period_s)
    device = states_of(draw, {})
    seconds, excitation = draw.between(6, 40), str(rng.choice(EXCITATIONS))
    force = force_of(draw, excitation, seconds, period_s)
    made = simulated(draw, {}, device, force, period_s, delay_s)
    if made is None:
        return None
    force, position, _ = made
    count = COUNT[draw.like] * draw.between(0.3, 3)
    position = count * np.round(position / count)
    told: dict[str, Any] = {"delay_s": delay_s} if rng.random() < 0.5 else {}
    if rng.random() < 0.5:
        told["held"] = draw.held
    if treatment in RATES:
        force, position, rows, how = _at_another_rate(draw, treatment, force, position)
    else:
        rows = 1.0
        force, position, how = _treated(draw, treatment, force, position, period_s)
    # Rows made anew are those of a loop of their own rate to whoever reads them.
    periods = {period_s} if treatment == "newest row" else {period_s, rows * period_s}
    truth = max(device.critical_stiffness(each, delay_s) for each in periods)
    recording = recording_from_arrays(
        force,
        position,
        time=rows * period_s * np.arange(len(force)),
        force_unit=UNITS[draw.like][0],
        position_unit=UNITS[draw.like][1],
        name=f"saved-{seed}",
    )
    what = f"{draw.kind}, {excitation}, {seconds:.0f} s, {treatment}{how}, told {sorted(told)}"
    return Case(recording, told, what, (treatment,), truth, *base_of(draw.values))


def _treated(
    draw: Draw, treatment: str, force: Array, position: Array, period_s: float
) -> tuple[Array, Array, str]:
    """Force and position on the same clock, and the size of what was done in words."""
    if treatment in SCALES:
        scaled = {"deviation of one": lambda x: (x - x.mean()) / x.std()}
        way = scaled.get(treatment, lambda x: x / np.abs(x).max())
        return way(force), way(position), ""
    way, how = _filter(draw, treatment, len(force), period_s)
    both = treatment != "digits" and draw.rng.random() < 0.4
    return (way(force) if both else force), way(position), f" {how}{' (both)' if both else ''}"


def _filter(draw: Draw, treatment: str, samples: int, period_s: float) -> tuple[Way, str]:
    rng, time = draw.rng, period_s * np.arange(samples)
    order, half = int(rng.choice([1, 2, 3, 5])), int(rng.choice([1, 2, 3, 5, 10]))
    corner_hz, every_s = draw.between(0.05, 5), draw.between(0.3, 6)
    share, far, digits = draw.between(0.05, 0.9), draw.between(1.5, 4), int(rng.integers(2, 6))
    odd = 2 * max(int(every_s / period_s / 2), 1) + 1
    low = butter(order, share, output="sos")
    high = butter(order, corner_hz, "high", fs=1 / period_s, output="sos")
    breaks = np.sort(rng.integers(100, samples - 100, order))

    def mean(x: Array, rows: int) -> Array:
        padded = np.pad(x, rows // 2, "edge")
        return np.convolve(padded, np.full(rows, 1 / rows), "valid")

    def without_outliers(x: Array) -> Array:
        usual = np.abs(x - x.mean()) < far * x.std()
        return np.interp(time, time[usual], x[usual])

    knots = np.arange(every_s, time[-1] - every_s / 2, every_s)
    scaled = np.linspace(-1, 1, samples)
    legendre = np.polynomial.legendre.Legendre
    ways: dict[str, tuple[Way, str]] = {
        "low-passed both ways": (lambda x: sosfiltfilt(low, x), f"{order}, {share:.2g}"),
        "high-passed both ways": (lambda x: sosfiltfilt(high, x), f"{order}, {corner_hz:.2g} Hz"),
        "smoothed": (lambda x: savgol_filter(x, 2 * half + 5, min(order, 3)), f"{2 * half + 5}"),
        "moving mean": (lambda x: mean(x, 2 * half + 1), f"{2 * half + 1}"),
        "less a moving mean": (lambda x: x - mean(x, odd), f"{odd * period_s:.2g} s"),
        "less a polynomial": (lambda x: x - legendre.fit(scaled, x, order)(scaled), f"{order}"),
        "less a spline": (
            lambda x: x - LSQUnivariateSpline(time, x, knots)(time),
            f"{every_s:.2g}",
        ),
        "detrended piecewise": (lambda x: detrend(x, bp=breaks), f"{order + 1}"),
        "median": (lambda x: medfilt(x, 2 * half + 1), f"{2 * half + 1}"),
        "clipped": (lambda x: np.clip(x, -far * x.std(), far * x.std()), f"{far:.2g} sd"),
        "outliers put in": (without_outliers, f"{far:.2g} sd"),
        "digits": (lambda x: _rounded(x, digits), f"{digits}"),
        "half precision": (lambda x: np.asarray(x.astype(np.float16), float), ""),
    }
    return ways[treatment]


def _rounded(x: Array, digits: int) -> Array:
    unit = 10.0 ** (np.floor(np.log10(np.maximum(np.abs(x), 1e-300))) - digits + 1)
    return np.asarray(unit * np.round(x / unit))


def _at_another_rate(
    draw: Draw, treatment: str, force: Array, position: Array
) -> tuple[Array, Array, float, str]:
    """Both columns at so many old rows a row: the rows' own, or made between them."""
    rows = draw.between(0.4, 1.6)
    old = np.arange(len(force))
    new = np.arange(0.0, len(force) - 1, rows)
    newest = new.astype(int)
    how = f" at {rows:.2f} rows"
    if treatment == "Fourier":
        return resample(force, len(new)), resample(position, len(new)), rows, how
    between = np.interp(new, old, position)
    if treatment == "lines":
        return np.interp(new, old, force), between, rows, how
    return force[newest], position[newest] if treatment == "newest row" else between, rows, how


if __name__ == "__main__":
    run(__doc__, make)
