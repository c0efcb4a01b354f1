"""Does the device change while the force repeats itself?  The lines between the excited ones tell.

In the DFT of M whole periods a steady device answers in every M-th line alone.  Between them lie
noise, what is left of how the motion began, and what a change makes: parameters that go with a
shape over time add their slope of the response times the transform of shape(t) u(t), coherent over
all of these lines.  Noise is not, and leakage is smooth or that of a free motion of the device
(R. Pintelon and J. Schoukens, "System Identification", 2nd ed., Wiley, 2012, section 6.3).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.residuals.drift import SHAPES
from bayeshaptic.diagnosis.residuals.residual import Test, chi_square_score, hats
from bayeshaptic.inference.coordinates import coordinates
from bayeshaptic.inference.fit import Fit
from bayeshaptic.numerics.gauss_newton import jacobian, lengths
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.local_polynomial import (
    leakage_terms,
    project_out,
    window_edges,
)
from bayeshaptic.recordings.response.spectra import PeriodicSpectra
from bayeshaptic.recordings.signals.excitation import find_repetition
from bayeshaptic.recordings.signals.raw_signals import count_of
from bayeshaptic.recordings.signals.rounding import hidden_rounding
from bayeshaptic.types import Bools, Complexes, Floats, Ints

CHANGES = {f"{name} between the periods": shape for name, shape in SHAPES.items()}
_LINES = 20  # of a window at least: five of them are leakage
_ROUNDS = 4  # of weights and of what they leave
_WILD = 15.0  # power over the noise's: by chance in one line of three million
_SAME = 1e-3  # columns as nearly alike as this are one


def change_tests(fit: Fit, etfe: Etfe) -> tuple[Test, ...]:
    """One test for each course that a change may take; none unless the excitation is periodic.

    From two periods on.  Of 174 recordings without a change (two to ten periods, free and held,
    with friction, gaps and faults) one is flagged, with cogs under a hand that moves on over
    them.  Of a device that changes by 6 % and more, mass, grip or damping, all that are free are,
    and those held but for dampers that a hand hides.

    Parameters
    ----------
    fit : Fit
    etfe : Etfe
    """
    found = _between(etfe)
    if found is None or len(found.frequency_hz) < _LINES:
        return ()
    slopes = _slopes(fit, found.frequency_hz)
    begun = _free_motions(fit, found.frequency_hz, etfe.period_s)
    # What the force does not repeat is answered, or noise of its sensor, or each in part.
    besides = (fit.response(found.frequency_hz) * found.driven(np.ones_like))[:, None]
    begun = found.without_leakage(np.concatenate([begun, besides, 1j * besides], axis=1))
    tests = []
    for name, shape in CHANGES.items():
        columns = found.without_leakage(slopes * found.driven(shape)[:, None])
        score, where = _score(found, _unit(begun), _unit(columns))
        text = f"the device changes while the force repeats itself: {name} ({score:.1f} standard "
        text += "deviations)"
        tests.append(Test(name, "time-varying", score, thresholds.normal(), where, text))
    return tuple(tests)


@dataclass(frozen=True)
class _Between:
    """The lines between the excited ones, in windows.

    Attributes
    ----------
    number : ndarray of int, shape (L,)
        Of each line in the DFT of all periods.
    frequency_hz : ndarray, shape (L,)
    position : complex ndarray, shape (L,)
        Leakage removed.
    rounding : ndarray, shape (L,)
        Density of the rounding that settled periods repeat: where they do in every count, only
        the first ones make noise, and theirs is not alike from line to line.
    force : ndarray, shape (N,)
        Of all periods.
    windows : tuple of (slice, ndarray)
        Lines, and an orthonormal basis of what leakage may be there, (w, 5).
    """

    number: Ints
    frequency_hz: Floats
    position: Complexes
    rounding: Floats
    force: Floats
    windows: tuple[tuple[slice, Complexes], ...]

    def driven(self, shape: Callable[[Floats], Floats]) -> Complexes:
        """Transform of the force times a shape over time, -1 to 1, shape (L,)."""
        time = np.linspace(-1, 1, len(self.force))
        return _transform(self.force * shape(time))[self.number]

    def without_leakage(self, columns: Complexes) -> Complexes:
        """Columns, shape (L, C), less what leakage may make of them."""
        return np.concatenate([project_out(basis, columns[own]) for own, basis in self.windows])

    @property
    def leverage(self) -> Floats:
        """Share of each line that goes with the leakage, shape (L,)."""
        return np.concatenate([np.sum(np.abs(basis) ** 2, axis=1) for _, basis in self.windows])


def _between(etfe: Etfe) -> _Between | None:
    recording = etfe.unbroken
    if recording is None or not isinstance(etfe.spectra, PeriodicSpectra):
        return None
    repetition = find_repetition(recording.force)
    if repetition is None:
        return None
    # The position of a sample answers the forces before it: it may go on for one sample more.
    stop = min(repetition.stop + 1, recording.samples)
    periods = (stop - repetition.start) // repetition.period
    samples = periods * repetition.period
    whole = recording.part(stop - samples, stop)
    frequency = np.arange(samples // 2) / (samples * recording.period_s)
    low, high = 0.5 * etfe.band_hz[0], etfe.band_hz[1]
    number = np.flatnonzero((frequency >= low) & (frequency <= high))
    number = number[number % periods != 0]
    frequency = frequency[number]
    edges = window_edges(frequency, _LINES)
    if len(edges) < 2:
        return None
    windows = tuple(
        (slice(a, b), _leakage(number[a:b])) for a, b in zip(edges[:-1], edges[1:], strict=True)
    )
    position = _transform(whole.position)[number]
    force = whole.force - whole.force.mean()
    settled = whole.position[samples - etfe.spectra.periods * repetition.period :]
    settled = settled.reshape(-1, repetition.period)
    rounding = hidden_rounding(settled, number // periods, count_of(recording))
    found = _Between(number, frequency, position, rounding / len(settled), force, windows)
    return replace(found, position=found.without_leakage(position[:, None])[:, 0])


def _transform(signal: Floats) -> Complexes:
    return np.fft.rfft(signal - signal.mean()) / np.sqrt(len(signal))


def _leakage(number: Ints) -> Complexes:
    """What leakage may be in a window of lines; with a constant and a slope, smooth."""
    line = number.astype(float)
    middle = 0.5 * (line[0] + line[-1])
    terms = leakage_terms((line - middle) / (line[-1] - middle), line, np.array([middle]))
    return np.linalg.qr(terms.astype(complex))[0]


def _slopes(fit: Fit, frequency_hz: Floats) -> Complexes:
    """Slopes of the response along the parameters' coordinates, shape (L, P)."""
    here = coordinates(fit.model)

    def response(phi: Floats) -> Floats:
        found = fit.model.response(here.natural(phi), frequency_hz, measured=True)
        return np.concatenate([found.real, found.imag], axis=1)

    both = jacobian(response, here.coordinate(fit.theta[None]))[0]
    count = len(frequency_hz)
    return np.asarray(both[:count] + 1j * both[count:])


def _free_motions(fit: Fit, frequency_hz: Floats, period_s: float) -> Complexes:
    """How the device moves by itself, and with poles a little elsewhere, shape (L, 2 S)."""
    poles = np.linalg.eigvals(fit.model.system(fit.theta).mechanism.state_matrix()[0])
    later = np.exp(-2j * np.pi * frequency_hz * period_s)[:, None]
    free = np.prod(1 - np.exp(poles * period_s) * later, axis=1)[:, None]
    powers = (1 - later) ** np.arange(len(poles))
    return np.concatenate([powers / free, powers / free**2], axis=1)


def _unit(columns: Complexes) -> Complexes:
    size = np.linalg.norm(columns, axis=0)
    return columns[:, size > 0] / size[size > 0]


def _score(found: _Between, begun: Complexes, columns: Complexes) -> tuple[float, float]:
    """Normal score of a change along the columns, and the line where it is most, Hz.

    Weighted least squares; each line's weight is the noise that the change, too, leaves there.
    """
    both = np.concatenate([begun, columns], axis=1)
    kept = np.ones(len(found.position), bool)
    left, taken = found.position, found.leverage
    for _ in range(_ROUNDS):
        free = np.clip(1 - taken, 0.01, 1)
        power = np.abs(left) ** 2 / free
        noise = np.maximum(_smooth(found.frequency_hz, power, free, kept), found.rounding)
        kept = power < _WILD * noise
        weight = kept * np.sqrt(2 / noise)
        basis = _basis(_real(weight[:, None] * both))
        seen = _real(weight * found.position)
        along = basis @ (basis.T @ seen)
        left = found.position - _complex(along) / np.where(kept, weight, np.inf)
        taken = found.leverage + 0.5 * _lines(np.sum(basis**2, axis=1))
    nothing = _basis(_real(weight[:, None] * begun))
    change = _real(weight[:, None] * columns)
    change = _basis(change - nothing @ (nothing.T @ change))
    there = change.T @ seen
    each = _lines((change @ there) ** 2)
    score = chi_square_score(float(there @ there), change.shape[1])
    return score, float(found.frequency_hz[np.argmax(each)])


def _basis(columns: Floats) -> Floats:
    """An orthonormal basis of columns of whatever sizes, shape (N, at most C)."""
    basis, sizes, _ = np.linalg.svd(columns / lengths(columns), full_matrices=False)
    return np.asarray(basis[:, sizes > _SAME * sizes[0]])


def _real(values: Complexes) -> Floats:
    return np.concatenate([values.real, values.imag])


def _complex(both: Floats) -> Complexes:
    real, imaginary = np.split(both, 2)
    return np.asarray(real + 1j * imaginary)


def _lines(both: Floats) -> Floats:
    """Of a line's real and its imaginary part, the sum."""
    return np.add(*np.split(both, 2))


def _smooth(frequency_hz: Floats, power: Floats, weight: Floats, kept: Bools) -> Floats:
    """Density of noise, a power of the frequency between knots, by Whittle's likelihood, (L,).

    A generalised linear model of exponential variables (P. McCullagh and J. A. Nelder, "Generalized
    Linear Models", 1989, chapter 8), by its usual reweighted steps.
    """
    log_f = np.log10(frequency_hz)
    straight = hats(log_f, np.array(list(_knots(log_f[kept]))))
    own, seen = np.sqrt(weight[kept]), np.maximum(power[kept], np.finfo(float).tiny)
    design = straight[kept] * own[:, None]
    mean_of_log = -np.euler_gamma  # of an exponential variable of mean one
    level = np.linalg.lstsq(design, own * (np.log(seen) - mean_of_log), rcond=None)[0]
    most, steps = 1.0, 12
    for _ in range(steps):
        over = seen / np.exp(straight[kept] @ level) - 1
        level += np.clip(np.linalg.lstsq(design, own * over, rcond=None)[0], -most, most)
    return np.asarray(np.exp(straight @ level))


def _knots(log_f: Floats) -> Iterable[float]:
    """The first, then one every 0.15 decades that holds 12 lines more, the last."""
    decades, lines, first = 0.15, 12, 0
    while first + lines < len(log_f) - lines // 2:
        yield float(log_f[first])
        first = max(first + lines, int(np.searchsorted(log_f, log_f[first] + decades)))
    yield float(log_f[-1])
