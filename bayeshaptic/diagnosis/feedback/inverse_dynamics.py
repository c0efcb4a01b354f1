r"""Inverse dynamics: the force explained by the motion, for recordings with feedback.

Where a controller makes the force from the position, their spectra do not give the response: noise
and friction come back through the controller.  The equation of motion holds all the same,

.. math:: u = m \ddot x + b \dot x + F_c\, \mathrm{sign}(\dot x) + \dots + \mathrm{offset},

and is linear in its coefficients: least squares of the force on columns made of the position, all
low-passed forwards and backwards so that nothing is late, and then decimated to the bandwidth that
is left, while the device moves (M. Gautier, "Dynamic identification of robots with power model",
ICRA 1997; A. Janot, M. Gautier and M. Brunot, "Data set and reference models of EMPS", 2019).
"""

from __future__ import annotations

from dataclasses import astuple, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import decimate

from bayeshaptic.diagnosis.feedback.choose_terms import (
    Addition,
    Regression,
    between_sets,
    choose_terms,
)
from bayeshaptic.diagnosis.feedback.smooth_motion import (
    SmoothMotion,
    at_rest,
    below_the_counts,
    smooth_motion,
)
from bayeshaptic.diagnosis.feedback.terms import Column, Term, terms_of
from bayeshaptic.errors import InputError
from bayeshaptic.numerics.low_pass import low_pass
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Bools, Floats

# Samples by which the force acts later than it is written down, root mean square: the hold, the
# loop's delay and the sensor's filter make anything from none to two.
_LAG = float(np.sqrt(4 / 3))
_FEWEST = 100  # samples left after decimation


@dataclass(frozen=True)
class InverseDynamics:
    """The force explained by the motion.

    Attributes
    ----------
    terms : tuple of Term
    value, sd : ndarray, shape (J,)
        Coefficients; standard deviations allow for the residual's correlation within a second, and
        for a lag between force and motion that nobody knows (of mass and damping in a clean
        recording that is nearly all), and for what the choice of terms leaves open.
    steps : tuple of Addition
        From the linear model on, each error that of one half with the coefficients of the other.
    tried : tuple of Addition
        Terms that did not earn their place, and what they would have brought.
    relative_error : float
        Norm of the residual over the norm of the force while the device moves, all of it fitted.
    time_s, force, explained : ndarray, shape (N,)
        Filtered and decimated.
    moving : ndarray of bool, shape (N,)
        Where the device moves: at rest dry friction is whatever holds it, and nothing is fitted.
    path : SmoothMotion
        At the same times.
    cutoff_hz : float
    """

    terms: tuple[Term, ...]
    value: Floats
    sd: Floats
    steps: tuple[Addition, ...]
    tried: tuple[Addition, ...]
    relative_error: float
    time_s: Floats = field(repr=False)
    force: Floats = field(repr=False)
    explained: Floats = field(repr=False)
    moving: Bools = field(repr=False)
    path: SmoothMotion = field(repr=False)
    cutoff_hz: float

    def __getitem__(self, name: str) -> tuple[float, float]:
        """Value and standard deviation of the coefficient called `name`."""
        index = [term.name for term in self.terms].index(name)
        return float(self.value[index]), float(self.sd[index])

    @property
    def rms(self) -> float:
        """Rms of the force that is left while the device moves, all of it fitted."""
        return float(np.sqrt(np.mean((self.force - self.explained)[self.moving] ** 2)))


def inverse_dynamics(
    recording: Recording,
    cutoff_hz: float | None = None,
    terms: tuple[str, ...] | None = None,
) -> InverseDynamics:
    """Explain the force of a recording by its motion; works with and without feedback.

    Begins with mass, damper and offset and adds dry friction, then the term that lowers the error
    most on the half that was not fitted, while both halves gain enough: see `choose_terms`.

    Parameters
    ----------
    recording : Recording
        Of a device that moves as one mass below `cutoff_hz`.
    cutoff_hz : float, optional
        Of the low-pass (Butterworth, order 4, forwards and backwards); by default a twentieth of
        the sampling rate, or as many halves of it as it takes to keep the encoder's counts out of
        the acceleration.
    terms : tuple of str, optional
        Use exactly these beside mass, damping and offset; then errors allow for no other choice.

    Returns
    -------
    InverseDynamics

    Raises
    ------
    InputError
        Where the recording is too short for the cut-off, or a term has no such name.
    """
    cutoff_hz = below_the_counts(recording) if cutoff_hz is None else cutoff_hz
    low = _LowPass(cutoff_hz, recording.period_s)
    moving = _moving(recording, low)
    path = smooth_motion(recording, cutoff_hz)
    start, library = terms_of(recording, path)
    known = {term.name: term for term in (*start, *library)}
    whole = Regression(
        {name: low.of(term, path) for name, term in known.items()},
        low.smooth(recording.force),
        [term.name for term in start],
        {term.name for term in library if term.positive},
    )
    asked = whole.where(moving)
    step_s = low.every * recording.period_s
    if terms is None:
        chosen, steps, tried = choose_terms(asked, step_s * np.count_nonzero(moving))
    else:
        chosen, steps, tried = _asked_for(asked, terms)
    block_s = 1.0  # residuals further apart are taken to be independent
    late = low.smooth(np.concatenate([recording.force[:1], recording.force[:-1]]))[moving]
    value, sd = _solve(asked.design(chosen), asked.force, late, int(block_s / step_s))
    if terms is None:
        sd = np.hypot(sd, between_sets(asked, chosen, value))
    explained = whole.design(chosen) @ value
    left = (whole.force - explained)[moving]
    return InverseDynamics(
        tuple(Term(name, known[name].title, known[name].unit) for name in chosen),
        value,
        sd,
        tuple(steps),
        tuple(tried),
        float(np.linalg.norm(left) / np.linalg.norm(asked.force)),
        low.picked(recording.period_s * np.arange(recording.samples)),
        whole.force,
        np.asarray(explained, dtype=np.float64),
        moving,
        SmoothMotion(*(low.thin(a) for a in astuple(path))),
        cutoff_hz,
    )


@dataclass(frozen=True)
class _LowPass:
    """Signals below a cut-off, decimated to what is left, without the ends."""

    cutoff_hz: float
    period_s: float

    @property
    def every(self) -> int:
        """Samples of which one is kept."""
        return max(int(0.5 / (self.cutoff_hz * self.period_s)), 1)

    @property
    def edge(self) -> int:
        """Samples at each end in which the filters have not settled."""
        return int(np.ceil(2 / (self.cutoff_hz * self.period_s)))

    def picked(self, signal: NDArray[Any]) -> NDArray[Any]:
        """The samples that are kept, as they are."""
        return signal[self.edge : -self.edge : self.every]

    def thin(self, signal: Floats) -> Floats:
        """A signal that is smooth already."""
        inner = signal[self.edge : -self.edge]
        if self.every == 1:
            return inner
        return np.asarray(decimate(inner, self.every, zero_phase=True), dtype=np.float64)

    def smooth(self, signal: Floats) -> Floats:
        return self.thin(low_pass(signal, self.cutoff_hz, self.period_s))

    def of(self, term: Column, path: SmoothMotion) -> Floats:
        """The column of a term."""
        return (self.thin if term.linear else self.smooth)(term.column(path))


def _moving(recording: Recording, low: _LowPass) -> Bools:
    """Where the device moves, of the samples that are kept; refused where that is too seldom."""
    if (recording.samples - 2 * low.edge) // low.every < _FEWEST:
        raise InputError(
            f"{recording.name}: {recording.samples} samples are too few for inverse dynamics below "
            f"{low.cutoff_hz:g} Hz; raise cutoff_hz"
        )
    moving = ~low.picked(at_rest(recording, low.cutoff_hz))
    if np.count_nonzero(moving) < _FEWEST // 2:
        raise InputError(
            f"{recording.name}: it stands still too long for inverse dynamics; record it in motion"
        )
    return moving


def _asked_for(
    asked: Regression, terms: tuple[str, ...]
) -> tuple[list[str], list[Addition], list[Addition]]:
    """Exactly the terms that were asked for, beside the linear ones."""
    unknown = sorted(set(terms) - set(asked.columns))
    if unknown:
        raise InputError(f"no term {', '.join(unknown)}; there are {', '.join(asked.columns)}")
    chosen = [*asked.start, *(name for name in terms if name not in asked.start)]
    steps = [
        Addition("linear", asked.held_out(asked.start)[0]),
        Addition(" + ".join(terms), asked.held_out(chosen)[0]),
    ]
    return chosen, steps, []


def _solve(design: Floats, force: Floats, late: Floats, block: int) -> tuple[Floats, Floats]:
    """Coefficients, and standard deviations that allow for correlation within blocks, and for lag.

    Sandwich of the scores summed over blocks (K.-Y. Liang and S. L. Zeger, Biometrika 73, 1986).
    `late` is the force of a sample before.
    """
    value = np.linalg.lstsq(design, force, rcond=None)[0]
    blocks_a_term = 5  # of a recording that has fewer seconds, shorter blocks
    block = max(min(block, len(force) // (blocks_a_term * design.shape[1])), 1)
    scores = design * (force - design @ value)[:, None]
    sums = np.add.reduceat(scores, np.arange(0, len(force), block))
    bread = np.linalg.inv(design.T @ design)
    covariance = bread @ (sums.T @ sums) @ bread
    sd = np.sqrt(np.diag(covariance) * len(sums) / max(len(sums) - design.shape[1], 1))
    # No less than without correlation.
    left = force - design @ value
    sd = np.maximum(sd, np.sqrt(np.diag(bread) * (left @ left) / (len(force) - design.shape[1])))
    sd = np.hypot(sd, _LAG * (np.linalg.lstsq(design, late, rcond=None)[0] - value))
    return np.asarray(value, dtype=np.float64), np.asarray(sd, dtype=np.float64)
