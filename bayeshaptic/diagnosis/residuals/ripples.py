"""Does the force ripple along the way, as a motor's torque does over its poles?

A motor pulls towards its poles with or without a current (cogging), and gives a little more of what
is commanded at one place than at another (a gain that ripples).  A linear model knows the mean; the
rest looks like noise of the force.  What the model leaves, taken back to the force, goes with
sin N x and cos N x then, x the position, or with these times the command.  Gathered along the way
it has a line at N: a periodogram over position in the place of time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.residuals.columns import common_coefficient
from bayeshaptic.diagnosis.residuals.lines import Lines
from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.inference.fit import Fit
from bayeshaptic.quantities import percent, quantity
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.windows import remembered
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.types import Floats

# Slower ones are a spring, or a gain that changes along the way, of which the motion sees less than
# a period, and what a response that is a little off feigns: of a normal motion e^(-8) is left.
_SLOWEST = 4.0  # radians over the rms of the position
_PLACES, _FINEST = 4096, 8  # along the way; and places, or counts of the encoder, in a period
_MOST_PERIODS = 100  # along the way: a motor's poles are not so many in the reach of a hand
STEPS = 4  # rates for each that is independent of the others
_AROUND = 51  # lines whose power together is the noise of the one in their middle
_LOOKS = 3  # peaks of the periodogram that are looked at closely
_FINER = 9  # steps between two of its places


@dataclass(frozen=True)
class Wave:
    """What ripples.

    Attributes
    ----------
    test : str
        The name of the test that looks for it.
    effect, title : str
    of_the_gain : bool
        Or of a force besides the command.
    """

    test: str
    effect: str
    title: str
    of_the_gain: bool

    def on(self, force: Floats) -> Floats:
        """What its waves are multiplied by, shape (N,)."""
        return force if self.of_the_gain else np.ones(len(force))


GAIN = Wave("gain along the way", "gain_along_the_way", "a gain that ripples along the way", True)
COGGING = Wave(
    "force along the way", "cogging", "cogging: a force that ripples along the way", False
)
WAVES = (GAIN, COGGING)


@dataclass(frozen=True)
class Ripple:
    """A ripple sine sin(rate x) + cosine cos(rate x), x the position less its mean.

    Attributes
    ----------
    rate : float
        Radians a unit of the position.
    sine, cosine, sd : float
        Of a force, or shares of the mean gain; and the standard deviation of either.
    log_chance : float
        -log10 of the chance that noise looks like this anywhere.
    """

    rate: float
    sine: float
    cosine: float
    sd: float
    log_chance: float

    @property
    def size(self) -> float:
        return float(np.hypot(self.sine, self.cosine))

    def at(self, place: Floats) -> Floats:
        """The ripple at positions less their mean, shape (N,)."""
        turned = self.rate * place
        return np.asarray(self.sine * np.sin(turned) + self.cosine * np.cos(turned))


def ripple_tests(fit: Fit, etfe: Etfe) -> tuple[Test, ...]:
    """Whether a ripple stands out of the noise; none without a recording.

    Parameters
    ----------
    fit : Fit
    etfe : Etfe
        Of a recording that does not repeat.
    """
    recording = etfe.unbroken
    if recording is None:
        return ()
    more = _explained_by_more(fit, etfe, recording)
    return tuple(ripple_test(wave, find_ripple(wave, fit, etfe, more), recording) for wave in WAVES)


def ripple_test(wave: Wave, found: Ripple | None, recording: Recording) -> Test:
    """The test for a ripple, by the one that stands out most.

    Parameters
    ----------
    wave : Wave
    found : Ripple or None
    recording : Recording
    """
    text, score = f"nothing like {wave.title} stands out", 0.0
    if found is not None:
        score = found.log_chance
        size = percent(found.size)
        if not wave.of_the_gain:
            size = quantity(found.size, recording.force_unit)
        period = quantity(2 * np.pi / found.rate, recording.position_unit)
        text = (
            f"{wave.title} by {size}, once in {period} (the odds of noise like that: 1 in "
            f"10^{score:.0f})"
        )
    return Test(wave.test, "nonlinear", score, thresholds.LOG_CHANCE, None, text)


def find_ripple(wave: Wave, fit: Fit, etfe: Etfe, more: Floats | None = None) -> Ripple | None:
    """The ripple that stands out most; None where the periodogram has no line.

    A line of it is looked at again beside what any smooth response explains: a response that is a
    little off, under a sweep or tones, makes lines as well.

    Parameters
    ----------
    wave : Wave
    fit : Fit
    etfe : Etfe
    more : ndarray, shape (N,), optional
        What a unit of force more at each sample would explain, where it is known.
    """
    recording = etfe.unbroken
    if recording is None or recording.position.std() == 0:
        return None
    place = place_of_action(fit, recording)
    rates = rates_along(place, recording)
    if not len(rates):
        return None
    if more is None:
        more = _explained_by_more(fit, etfe, recording)
    product = wave.on(recording.force - recording.force.mean()) * more
    product -= product.mean()
    along = _gathered(place, product)
    power = _periodogram(along, np.ptp(place), rates) / np.sum(product**2)
    # Two degrees of freedom: the chance of a power is its exponential.
    independent = len(rates) / STEPS
    least = np.log(independent) + thresholds.LOG_CHANCE * np.log(10)
    looked = []
    for _ in range(_LOOKS):
        top = int(np.argmax(power))
        if power[top] < least:
            break
        rate = _finer(along, np.ptp(place), rates, top)
        looked.append(_looked_at(wave, fit, etfe, place, rate, independent))
        power[max(top - _FINER, 0) : top + _FINER] = 0.0
    return max(looked, key=lambda ripple: ripple.log_chance, default=None)


def place_of_action(fit: Fit, recording: Recording) -> Floats:
    """Where the motor is in the middle of a command's hold, less the mean position, shape (N,).

    Parameters
    ----------
    fit : Fit
    recording : Recording
    """
    delay_s = float(fit.model.system(fit.theta).delay_s[0])
    rows = np.arange(recording.samples)
    middle = rows + delay_s / recording.period_s + 0.5
    position = recording.position - recording.position.mean()
    return np.interp(middle, rows, position)


def _explained_by_more(fit: Fit, etfe: Etfe, recording: Recording) -> Floats:
    """What a unit of force more, at each sample, would explain of what the fit leaves."""
    force = recording.force - recording.force.mean()
    frequency = np.asarray(np.fft.rfftfreq(recording.samples, recording.period_s), float)
    inside = (frequency >= etfe.band_hz[0]) & (frequency <= etfe.band_hz[1])
    response = np.zeros(len(frequency), complex)
    response[inside] = fit.response(frequency[inside])
    position = np.fft.rfft(recording.position - recording.position.mean())
    left = np.where(inside, position - response * np.fft.rfft(force), 0.0)
    power = uniform_filter1d(np.abs(left) ** 2, _AROUND)
    seen = uniform_filter1d(inside.astype(float), _AROUND)
    weight = np.where(inside & (power > 0), seen / np.maximum(power, 1e-300), 0.0)
    return np.asarray(np.fft.irfft(weight * np.conj(response) * left, recording.samples))


def rates_along(place: Floats, recording: Recording) -> Floats:
    """Rates to look at, from what is no spring any more to what the encoder shows, `STEPS` a line.

    None of the encoder's counts, whose rounding has their period.

    Parameters
    ----------
    place : ndarray, shape (N,)
    recording : Recording
    """
    span = float(np.ptp(place))
    if span == 0:
        return np.zeros(0)
    count = increment_unit(recording.position) or 0.0
    step = 2 * np.pi / (STEPS * span)
    last = 2 * np.pi / (_FINEST * max(span / _PLACES, count)) / step
    first = np.floor(_SLOWEST / place.std() / step) + 1
    return np.asarray(step * np.arange(first, min(last, STEPS * _MOST_PERIODS)))


def _gathered(place: Floats, product: Floats) -> Floats:
    """The sums of a product at places along the way, shape (`_PLACES`,)."""
    share = (place - place.min()) / np.ptp(place)
    bins = np.minimum(share * _PLACES, _PLACES - 1).astype(int)
    return np.asarray(np.bincount(bins, weights=product, minlength=_PLACES), float)


def _periodogram(along: Floats, span: float, rates: Floats) -> Floats:
    """Power at rates along the way."""
    power = np.abs(np.fft.rfft(along, STEPS * _PLACES)) ** 2
    return np.asarray(power[np.rint(rates * STEPS * span / (2 * np.pi)).astype(int)])


def _finer(along: Floats, span: float, rates: Floats, top: int) -> float:
    """The rate of a line, between its neighbours."""
    near = np.linspace(rates[max(top - 1, 0)], rates[min(top + 1, len(rates) - 1)], 2 * _FINER + 1)
    places = np.arange(_PLACES) * span / _PLACES
    power = np.abs(np.exp(-1j * np.outer(near, places)) @ along)
    return float(near[int(np.argmax(power))])


def _looked_at(
    wave: Wave, fit: Fit, etfe: Etfe, place: Floats, rate: float, independent: float
) -> Ripple:
    """A ripple of this rate beside what a smooth response explains in each window."""
    recording = etfe.unbroken
    assert recording is not None
    force = recording.force - recording.force.mean()
    at_lines, response = Lines.of(etfe, recording), remembered(fit.response)
    answers = response(at_lines.frequency_hz)
    sizes, sds, square = [], [], 0.0
    for turn in (np.sin, np.cos):
        column = answers * at_lines(wave.on(force) * turn(rate * place))
        size, sd, _ = common_coefficient(etfe.spectra.windows(response, column[None]))
        sizes.append(size)
        sds.append(sd)
        square += (size / sd) ** 2 if sd > 0 else 0.0
    log_chance = 0.5 * square / np.log(10) - np.log10(independent)
    return Ripple(rate, sizes[0], sizes[1], max(sds), max(float(log_chance), 0.0))
