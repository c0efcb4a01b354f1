"""How a device moves beside what its command does: coasting, or because something moves it."""

from __future__ import annotations

import numpy as np

from bayeshaptic.diagnosis.residuals.unforced import (
    coasting_motions,
    commanded_motions,
    commanded_position,
    parts,
)
from bayeshaptic.inference.fit import Fit
from bayeshaptic.models import LinearSystem
from bayeshaptic.numerics.low_pass import low_pass, slow_share
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.types import Floats

# Below it a hand moves the device, and the encoder sees it well.
_SLOW_HZ, _OF_THE_RATE = 20.0, 0.4
_FEWEST = 4  # lines of an octave whose median tells a sensor's noise
# Standard deviations of an octave's mean power above it.  Of 40 velocities and accelerations beside
# a force, of devices that nobody moves or somebody holds, none is doubted so.
_LOUDER = 3.0


def coasting(system: LinearSystem, besides: Floats, period_s: float) -> tuple[Floats, Floats]:
    """Position and velocity of a free device from how it began and from a constant force.

    Nobody knows either, and the spectra do not; the position besides what the command does tells.

    Parameters
    ----------
    system : LinearSystem
        A batch of one.
    besides : ndarray, shape (N,)
        The measured position less that of the command.
    period_s : float
    """
    columns = coasting_motions(system, len(besides), period_s)
    weights = parts(columns, besides)
    _, x, v = columns.T
    return columns @ weights, np.asarray(weights[1] * v + weights[2] * np.gradient(v, period_s))


def slow_velocity(position: Floats, period_s: float) -> Floats:
    """The velocity below the frequencies of hands, shape (N,)."""
    return np.gradient(low_pass(position, _edge_hz(period_s), period_s), period_s)


def left_of_position(fit: Fit, recording: Recording) -> float:
    """What neither the command nor coasting explains of the position, as a share of it (rms).

    Parameters
    ----------
    fit : Fit
    recording : Recording
    """
    besides = recording.position - commanded_position(fit, recording)
    coasted, _ = coasting(fit.model.system(fit.theta), besides, recording.period_s)
    return float(np.std(besides - coasted) / np.std(recording.position))


def moved_besides(fit: Fit, recording: Recording) -> float:
    """How fast a device that nobody holds moves beside what its command does, as a share of that.

    Root mean squares of slow velocities, the sensor's noise taken off.  Where a hand or the
    floor moves a device dry friction looks like damping, and no test can tell; or a force that no
    test saw makes the difference itself.

    Parameters
    ----------
    fit : Fit
    recording : Recording
    """
    period_s, v = recording.period_s, commanded_motions(fit, recording)[0, 1]
    besides = recording.position - commanded_position(fit, recording)
    coasted, along = coasting(fit.model.system(fit.theta), besides, period_s)
    left = besides - coasted
    if recording.sensed is not None and recording.sensed.derivatives:
        power = _beside_noise(left, recording)
    else:
        power = float(np.var(slow_velocity(left, period_s))) - _of_rounding(recording)
    return float(np.sqrt(max(power, 0.0)) / np.std(v + along))


def _edge_hz(period_s: float) -> float:
    return min(_SLOW_HZ, _OF_THE_RATE / period_s)


def _of_rounding(recording: Recording) -> float:
    """Variance of the slow velocity of an encoder's rounding, which is white."""
    count, period_s = increment_unit(recording.position) or 0.0, recording.period_s
    return count**2 / 12 * 2 * period_s * (2 * np.pi) ** 2 * _edge_hz(period_s) ** 3 / 3


def _beside_noise(left: Floats, recording: Recording) -> float:
    """Variance of the slow velocity of the octaves that are louder than the sensor's noise.

    That of a velocity or an acceleration is white, and rises towards the slow end once it is
    integrated.
    """
    assert recording.sensed is not None
    period_s, window = recording.period_s, np.hanning(len(left))
    frequency: Floats = np.fft.rfftfreq(len(left), period_s)[2:].astype(np.float64)
    power = np.abs(np.fft.rfft(left * window)[2:]) ** 2
    as_white = power * recording.sensed.noise(2 * np.pi * frequency * period_s)
    octave = np.floor(np.log2(frequency / frequency[0])).astype(int)
    edge_hz = _edge_hz(period_s)
    fast = (frequency > 2 * edge_hz) & (frequency < _OF_THE_RATE / period_s)
    levels = [
        float(np.median(as_white[fast & (octave == one)])) / np.log(2)
        for one in np.unique(octave[fast])
        if np.sum(fast & (octave == one)) >= _FEWEST
    ]
    level = min(levels, default=0.0)
    found = 0.0
    for one in np.unique(octave[frequency < 2 * edge_hz]):
        lines = octave == one
        # Neighbours share a window's main lobe.
        usual = level * (1 + _LOUDER / np.sqrt(max(lines.sum() / 1.5, 1.0)))
        if as_white[lines].mean() > usual:
            rate = 2 * np.pi * frequency[lines]
            kept = (rate * slow_share(frequency[lines], edge_hz)) ** 2
            share = 1 - level / as_white[lines].mean()
            found += share * float(np.sum(power[lines] * kept))
    return 2 * found / (len(left) * float(np.sum(window**2)))
