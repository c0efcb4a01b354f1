"""What the data alone say about an unknown device: scales, weak priors, starting values."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.models.build import delay_prior
from bayeshaptic.models.hand import KILOGRAMS, hand_priors
from bayeshaptic.models.model import Model
from bayeshaptic.models.prior import LogNormal, Prior, draw
from bayeshaptic.models.prior_of_zero import SPIKE, SPIKE_OF_MOTOR, MaybeZero
from bayeshaptic.models.structures import GROUND_DAMPERS, HAND, MOTOR_DAMPERS, ONE_IN_A_HAND
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.types import Floats

_STARTS = 400  # plausible mechanisms that a fit is begun from; a quarter as many from the priors


@dataclass(frozen=True)
class ResponseScales:
    """The asymptotes and the peaks of a measured response.

    Attributes
    ----------
    mass : float
        Median of 1/(w^2 |G|) over log frequency: between the motor's mass and the whole.
    low_hz, high_hz : float
        The band.
    peaks_hz : ndarray
        Peaks of w^2 |G|, highest first: candidates for vibration modes.
    """

    mass: float
    low_hz: float
    high_hz: float
    peaks_hz: Floats

    @property
    def middle(self) -> float:
        """Geometric middle of the band, rad/s."""
        return float(2 * np.pi * np.sqrt(self.low_hz * self.high_hz))


def scales(etfe: Etfe) -> ResponseScales:
    """Read the scales off a measured response."""
    from scipy.ndimage import median_filter
    from scipy.signal import find_peaks

    frequency = etfe.frequency_hz
    inertance = np.abs(etfe.value) * (2 * np.pi * frequency) ** 2
    low, high = float(frequency[0]), float(frequency[-1])
    grid = np.geomspace(low, high, 300)
    log_inertance = np.interp(np.log(grid), np.log(frequency), np.log(inertance))
    smooth = median_filter(log_inertance, 5, mode="nearest")
    peaks, found = find_peaks(smooth, prominence=0.3)
    order = np.argsort(-found["prominences"])
    return ResponseScales(float(np.exp(-np.median(smooth))), low, high, grid[peaks[order]][:6])


def informed(model: Model, etfe: Etfe) -> Model:
    """`model` with the period and units of the data, and weak priors where it has none.

    The weak priors use two numbers of the data, a mass and the band: log-normal with a factor e^2
    (masses) or e^3 (springs and dampers) a standard deviation; ground dampers may be zero.
    Those of a hand say what hands are like.
    """
    model = replace(
        model,
        period_s=etfe.period_s,
        force_unit=etfe.force_unit,
        position_unit=etfe.position_unit,
    )
    if model.has_priors:
        return model
    found = scales(etfe)
    missing = {p.name: p.dimension for p in model.parameters if p.prior is None}
    kilograms = (model.force_unit, model.position_unit) == ("N", "m")
    hand = hand_priors(KILOGRAMS if kilograms else found.mass)
    return model.with_prior(
        {
            name: hand[name] if name in HAND else _weak_prior(name, kind, found, etfe.period_s)
            for name, kind in missing.items()
        }
    )


def _weak_prior(name: str, dimension: str, found: ResponseScales, period_s: float) -> Prior:
    if name in GROUND_DAMPERS:
        weight = SPIKE_OF_MOTOR if name in MOTOR_DAMPERS else SPIKE
        return MaybeZero(0.5 * found.mass * found.middle, weight=weight)
    if dimension == "mass":
        return LogNormal(found.mass, 2.0)
    if dimension == "damping":
        return LogNormal(0.1 * found.mass * found.middle, 3.0)
    if dimension == "stiffness":
        return LogNormal(found.mass * found.middle**2, 3.0)
    prior = delay_prior(None, None, period_s)
    assert prior is not None
    return prior


def starting_points(
    model: Model,
    etfe: Etfe,
    rng: np.random.Generator,
    with_images: bool = False,
) -> Floats:
    """Starting vectors for a fit, natural values, shape (B, P).

    The device file's values where there are any, draws from the priors, and mechanisms with
    plausible modes: masses from the asymptotes, modes at the peaks or anywhere in the band.
    `with_images` also modes above half the sampling rate, of which the band shows the images.
    """
    found = scales(etfe)
    drawn = np.stack([draw(model.prior(name), rng, _STARTS) for name in model.names], axis=1)
    guessed = drawn.copy()
    mechanisms = _plausible(model.name, found, rng, _STARTS)
    for column, name in enumerate(model.names):
        if name in mechanisms:
            guessed[:, column] = mechanisms[name]
        elif name == "delay_s":
            guessed[:, column] = rng.uniform(0, 2, _STARTS) * etfe.period_s
    points = [drawn[: _STARTS // 4], guessed]
    if with_images and {"m1", "m2", "kc", "bc"} <= set(model.names):
        points.append(_images(model.names, guessed, etfe.period_s, rng))
    if all(name in model.reference for name in model.names):
        points.insert(0, model.values[None, :])
    return np.concatenate(points)


def _images(
    names: tuple[str, ...], guessed: Floats, period_s: float, rng: np.random.Generator
) -> Floats:
    """The same points with a smaller motor, and the mode where sampling would show it as it was."""
    images = guessed.copy()
    m1, m2, kc, bc = (names.index(name) for name in ("m1", "m2", "kc", "bc"))
    mode = np.sqrt(images[:, kc] * (1 / images[:, m1] + 1 / images[:, m2]))
    above = 2 * np.pi / period_s + rng.choice([-1.0, 1.0], len(images)) * mode
    images[:, m1] *= np.exp(rng.uniform(-3.5, 0.0, len(images)))
    images[:, kc] = above**2 / (1 / images[:, m1] + 1 / images[:, m2])
    images[:, bc] *= np.abs(above) / mode * images[:, m1] / guessed[:, m1]
    return images


def _plausible(
    name: str, found: ResponseScales, rng: np.random.Generator, count: int
) -> dict[str, Floats]:
    """Random mechanisms around the data's scales: name of the parameter to values."""

    def factor(low: float, high: float) -> Floats:
        low, high = sorted((low, high))  # in a narrow band three times its lower end lies above it
        return np.exp(rng.uniform(np.log(low), np.log(high), count))

    def rate(low_hz: float, high_hz: float) -> Floats:
        return 2 * np.pi * factor(low_hz, high_hz)

    mass = found.mass * factor(0.3, 3.0)
    ground = mass * rate(0.3 * found.low_hz, 10 * found.low_hz)
    rigid = {"m": mass, "b": ground}
    if name == "rigid":
        return rigid
    share = 1 / (1 + np.exp(rng.uniform(-3.5, 3.5, count)))
    m1, m2 = share * mass, (1 - share) * mass
    mode = rate(3 * found.low_hz, 1.2 * found.high_hz)
    if len(found.peaks_hz):
        at_peak = 2 * np.pi * rng.choice(found.peaks_hz, count)
        mode = np.where(rng.uniform(size=count) < 0.7, at_peak, mode)
    reduced = m1 * m2 / mass
    device = {
        "m1": m1,
        "m2": m2,
        "kc": reduced * mode**2,
        "bc": 2 * factor(0.005, 0.3) * reduced * mode,
        "b1": ground * rng.uniform(size=count),
        "b2": ground * rng.uniform(size=count),
    }
    in_a_hand = name == ONE_IN_A_HAND.name
    if not (in_a_hand or name.startswith("grasped")):
        return device
    mh = mass * factor(0.1, 3.0)
    grip, arm = rate(3 * found.low_hz, found.high_hz), rate(0.3 * found.low_hz, 10 * found.low_hz)
    hand = {
        "mh": mh,
        "ks": mh * grip**2,
        "bs": 2 * factor(0.03, 1.0) * mh * grip,
        "kh": mh * arm**2,
        "bh": 2 * factor(0.1, 3.0) * mh * arm,
    }
    return (rigid if in_a_hand else device) | hand
