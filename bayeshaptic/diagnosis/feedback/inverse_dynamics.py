r"""Inverse dynamics: the force explained by the motion, for recordings with feedback.

Where a controller makes the force from the position, their spectra do not give the response: noise
and friction come back through the controller.  The equation of motion holds all the same,

.. math:: u = m \ddot x + b \dot x + F_c\, \mathrm{sign}(\dot x) + \dots + \mathrm{offset},

and is linear in its coefficients: least squares of the force on columns made of the position,
low-passed forwards and backwards so that nothing is late, and everything then decimated to the
bandwidth that is left (M. Gautier, "Dynamic identification of robots with power model", ICRA 1997;
A. Janot, M. Gautier and M. Brunot, "Data set and reference models of EMPS", 2019).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.signal import decimate

from bayeshaptic.diagnosis.feedback.terms import SmoothMotion, Term, smooth_motion, terms_of
from bayeshaptic.errors import InputError
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Floats

# Samples by which the force acts later than it is written down, root mean square: the hold, the
# loop's delay and the sensor's filter make anything from none to two.
_LAG = float(np.sqrt(4 / 3))


@dataclass(frozen=True)
class Addition:
    """One round: the term that was added and the held-out rms error of the force with it."""

    term: str
    held_out_rms: float


@dataclass(frozen=True)
class InverseDynamics:
    """The force explained by the motion.

    Attributes
    ----------
    terms : tuple of Term
    value, sd : ndarray, shape (J,)
        Coefficients; standard deviations allow for the residual's correlation within a second, and
        for a lag between force and motion that nobody knows: of mass and damping in a short or a
        clean recording that is nearly all.
    steps : tuple of Addition
        From the linear model on, each error that of one half with the coefficients of the other.
    tried : tuple of Addition
        Terms that did not earn their place, and what they would have brought.
    relative_error : float
        Norm of the residual over the norm of the force, all of it fitted.
    time_s, force, explained : ndarray, shape (N,)
        Filtered and decimated.
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
    path: SmoothMotion = field(repr=False)
    cutoff_hz: float

    def __getitem__(self, name: str) -> tuple[float, float]:
        """Value and standard deviation of the coefficient called `name`."""
        index = [term.name for term in self.terms].index(name)
        return float(self.value[index]), float(self.sd[index])

    @property
    def rms(self) -> float:
        """Rms of the force that is left, all of it fitted."""
        return float(np.sqrt(np.mean((self.force - self.explained) ** 2)))


def inverse_dynamics(
    recording: Recording,
    cutoff_hz: float | None = None,
    terms: tuple[str, ...] | None = None,
) -> InverseDynamics:
    """Explain the force of a recording by its motion; works with and without feedback.

    Begins with mass, damper and offset and adds the term that lowers the error most on the half
    that was not fitted, while both halves gain.

    Parameters
    ----------
    recording : Recording
        Of a device that moves as one mass below `cutoff_hz`.
    cutoff_hz : float, optional
        Of the low-pass (Butterworth, order 4, forwards and backwards); a twentieth of the
        sampling rate by default.
    terms : tuple of str, optional
        Use exactly these beside mass, damping and offset.

    Returns
    -------
    InverseDynamics

    Raises
    ------
    InputError
        Where the recording is too short for the cut-off, or a term has no such name.
    """
    band = 0.05  # of the sampling rate: the usual cut-off
    cutoff_hz = band / recording.period_s if cutoff_hz is None else cutoff_hz
    every = max(int(0.5 / (cutoff_hz * recording.period_s)), 1)
    edge = int(np.ceil(2 / (cutoff_hz * recording.period_s)))  # where the filters are not settled
    fewest = 100  # samples left after decimation
    if (recording.samples - 2 * edge) // every < fewest:
        raise InputError(
            f"{recording.name}: {recording.samples} samples are too few for inverse dynamics below "
            f"{cutoff_hz:g} Hz; raise cutoff_hz"
        )
    path = smooth_motion(recording, cutoff_hz)

    def thin(signal: Floats) -> Floats:
        inner = signal[edge:-edge]
        if every == 1:
            return inner
        return np.asarray(decimate(inner, every, zero_phase=True), dtype=np.float64)

    force, time_s = thin(recording.force), np.arange(recording.samples)[edge:-edge:every]
    start, library = terms_of(recording, path)
    known = {term.name: term for term in (*start, *library)}
    columns = {name: thin(term.column(path)) for name, term in known.items()}
    chosen = [term.name for term in start]
    steps, tried = [Addition("linear", _held_out(columns, chosen, force)[0])], []
    if terms is not None:
        unknown = sorted(set(terms) - set(known))
        if unknown:
            raise InputError(f"no term {', '.join(unknown)}; there are {', '.join(known)}")
        chosen += [name for name in terms if name not in chosen]
        steps.append(Addition(" + ".join(terms), _held_out(columns, chosen, force)[0]))
    else:
        tried = _grow(columns, chosen, force, steps)
    design = np.stack([columns[name] for name in chosen], axis=1)
    block_s = 1.0  # residuals further apart are taken to be independent
    value, sd = _solve(design, force, max(int(block_s / (every * recording.period_s)), 1))
    late = thin(np.concatenate([recording.force[:1], recording.force[:-1]]))
    sd = np.hypot(sd, _LAG * (np.linalg.lstsq(design, late, rcond=None)[0] - value))
    left = force - design @ value
    return InverseDynamics(
        tuple(Term(name, known[name].title, known[name].unit) for name in chosen),
        value,
        sd,
        tuple(steps),
        tuple(tried),
        float(np.linalg.norm(left) / np.linalg.norm(force)),
        np.asarray(time_s * recording.period_s, dtype=np.float64),
        force,
        np.asarray(design @ value, dtype=np.float64),
        SmoothMotion(
            *(thin(a) for a in (path.position, path.velocity, path.acceleration, path.jerk))
        ),
        cutoff_hz,
    )


def _grow(
    columns: dict[str, Floats], chosen: list[str], force: Floats, steps: list[Addition]
) -> list[Addition]:
    """Add terms to `chosen` while both halves gain; what is left over comes back."""
    worth = 0.02  # a term must lower the held-out error by so much, in both halves
    while True:
        _, halves = _held_out(columns, chosen, force)
        found = {
            name: _held_out(columns, [*chosen, name], force)
            for name in columns
            if name not in chosen and _says_more(columns, chosen, name)
        }
        order = sorted(found, key=lambda name: found[name][0])
        if not order or np.any(found[order[0]][1] > (1 - worth) * halves):
            return [Addition(name, found[name][0]) for name in order]
        chosen.append(order[0])
        steps.append(Addition(order[0], found[order[0]][0]))


def _says_more(columns: dict[str, Floats], chosen: list[str], name: str) -> bool:
    """Whether a column is more than a combination of those chosen."""
    design = np.stack([columns[one] for one in chosen], axis=1)
    scale = np.linalg.norm(design, axis=0) + np.finfo(float).tiny
    column = columns[name]
    left = column - design / scale @ np.linalg.lstsq(design / scale, column, rcond=None)[0]
    its_own = 1e-3  # of its power, or it is no new term: a tone's spring is a mass
    return bool(left @ left > its_own * (column @ column))


def _held_out(columns: dict[str, Floats], names: list[str], force: Floats) -> tuple[float, Floats]:
    """Rms error of each half with the other half's coefficients: together, and a half, (2,)."""
    design = np.stack([columns[name] for name in names], axis=1)
    first = np.arange(len(force)) < len(force) // 2
    squares = []
    for own in (first, ~first):
        value = np.linalg.lstsq(design[~own], force[~own], rcond=None)[0]
        squares.append(np.mean((force[own] - design[own] @ value) ** 2))
    return float(np.sqrt(np.mean(squares))), np.sqrt(np.array(squares, dtype=np.float64))


def _solve(design: Floats, force: Floats, block: int) -> tuple[Floats, Floats]:
    """Coefficients, and standard deviations that allow for correlation within blocks.

    Sandwich of the scores summed over blocks (K.-Y. Liang and S. L. Zeger, Biometrika 73, 1986).
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
    return np.asarray(value, dtype=np.float64), np.asarray(sd, dtype=np.float64)
