r"""The motion of one mass in a loop, fitted to a recording with feedback.

A mass with viscous and dry friction, a constant force and a delay is driven by the recorded command
*and* by a follower of the measured position.  Where the follower is the controller that was in the
loop, this is the closed-loop output error (A. Janot, P.-O. Vandanjon and M. Gautier, "A generic
instrumental variable approach for industrial robot identification", IEEE Transactions on Control
Systems Technology 22, 2014): what enters the model holds no noise, so that feedback biases nothing,
and no reference is needed.  Another follower costs an error of second order in the remaining force;
a second one, with a lower bandwidth, shows how large it is, and widens the result.

Errors have equal weights on purpose.  Weights by the residual's own spectrum hand friction over to
the noise where the remaining force depends on position and direction: such a force is in the model.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.inference.time_domain.days import between_pieces
from bayeshaptic.inference.time_domain.follower import Follower, bandwidth_hz
from bayeshaptic.inference.time_domain.loop import FORCES, Hum, Loop
from bayeshaptic.inference.time_domain.mass_forces import COULOMB, MassForces
from bayeshaptic.inference.time_domain.one_way import one_way
from bayeshaptic.inference.time_domain.uneven import WAVES, Ridge, Way, ridge
from bayeshaptic.inference.time_domain.widths import covariance, mean_of_uneven
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.types import Floats

NAMES = ("m", "b", "coulomb", "offset", "delay_s")
_STUCK = 0.5  # of the error's power, that a settled fit does not promise to take away


@dataclass(frozen=True)
class MotionFit:
    """One mass in a loop, fitted.

    Attributes
    ----------
    values : ndarray, shape (5,)
        `NAMES`: mass, viscous damping, dry friction, constant force (positive against a positive
        command), delay in s.  Not held above zero: where the data put a parameter below, its
        part above is what the posterior keeps.
    inside : ndarray, shape (5,)
        The best values that are possible.
    covariance : ndarray, shape (5, 5)
    bandwidth_hz : float
        Of the follower, or of the command where the feedback was declared.
    error_rms : float
        Of the position, measured less simulated.
    uneven_rms : float
        Of the force that changes along the way.
    converged : bool
    simulated : ndarray, shape (N,)
        The position in the simulated loop.
    uneven : ndarray, shape (2 WAVES,)
        The force that changes along the way: its waves forward and backward.
    way : Way
    follower : Follower
    whole : ndarray
        All values of the `Loop`: `inside`, where pieces begin, numbers of the laws.
    forces : MassForces
        Dry friction's law, and further ones.
    whole_sd : ndarray
        Of all values.
    hums : tuple of Hum
        In the first piece.
    """

    values: Floats
    inside: Floats
    covariance: Floats
    bandwidth_hz: float
    error_rms: float
    uneven_rms: float
    converged: bool
    simulated: Floats = field(repr=False)
    uneven: Floats = field(repr=False)
    way: Way
    follower: Follower
    whole: Floats = field(repr=False)
    forces: MassForces
    whole_sd: Floats
    hums: tuple[Hum, ...] = ()

    @property
    def numbers(self) -> Floats:
        """Of the laws, one for each of `forces.names`."""
        return self.whole[len(self.whole) - len(self.forces.names) :]

    @property
    def number_sd(self) -> Floats:
        """Of `numbers`."""
        return self.whole_sd[len(self.whole) - len(self.forces.names) :]

    def loop(self, recording: Recording, later_s: float = 0.0) -> Loop:
        """The loop that was followed, or that of another recording, begun so much later."""
        hums = tuple(hum.later(later_s) for hum in self.hums)
        loop = Loop.of(recording, self.bandwidth_hz, self.way, self.forces, hums)
        return replace(loop, follower=self.follower)

    @property
    def sd(self) -> Floats:
        return np.sqrt(np.diag(self.covariance))

    def error_on(self, recording: Recording, later_s: float = 0.0) -> Floats:
        """Measured less simulated position of another recording, with these values; (N,).

        Where its pieces begin, and hums, are fitted to it.  It begins `later_s` after the fitted.
        """
        loop = self.loop(recording, later_s)
        begun = loop.begun(self.inside, self.numbers)
        return loop.error(loop.with_beginnings(begun, self.uneven), self.uneven)


def fit_motion(
    recording: Recording,
    feedback: Follower | None = None,
    forces: MassForces = COULOMB,
    start: Floats | None = None,
    hums: tuple[Hum, ...] = (),
) -> MotionFit:
    """Fit one mass with friction to a recording made in closed loop.

    Parameters
    ----------
    recording : Recording
    feedback : Follower, optional
        The controller's feedback of the position, as a force for measured - simulated.  Unknown by
        default: a spring and a damper as wide as the command's spectrum stand for it.
    forces : MassForces
        Laws of forces on the mass, whose numbers are inferred; Coulomb's friction by default.
    start : ndarray, shape (5,), optional
        Values to begin with; by default those of the inverse dynamics.
    hums : tuple of Hum
        Forces on the mass whose size and phase are inferred.

    Returns
    -------
    MotionFit

    Raises
    ------
    InputError
        Where no motion of one mass can be found beside the measured one.
    """
    width = bandwidth_hz(recording.force, recording.period_s)
    way = Way.of(recording.position)
    loop = Loop.of(recording, width, way, forces, hums)
    begun = loop.begun(_inverse_dynamics(recording) if start is None else start)
    loop = loop.led(feedback, begun)
    first = _fit(loop, begun, recording.name)
    other = 0.4  # bandwidth of the second follower over that of the first
    second = _fit(loop.led(None, begun, other), first.inside, recording.name)
    apart = second.values - first.values
    whole = first.covariance + np.outer(apart, apart)
    spread = whole[: len(NAMES), : len(NAMES)].copy()
    for index in FORCES:
        spread[index, index] += 0.5 * mean_of_uneven(first.found)
    assert loop.follower is not None
    return MotionFit(
        first.values[: len(NAMES)],
        first.inside[: len(NAMES)],
        spread,
        width,
        float(np.sqrt(np.mean(first.error**2))),
        float(np.sqrt(np.mean((first.uneven.reshape(2, WAVES) @ loop.shapes) ** 2))),
        first.converged and second.converged,
        loop.position - first.error,
        first.uneven,
        way,
        loop.follower,
        first.inside,
        forces,
        np.sqrt(np.diag(whole)),
        loop.hums_at(first.inside),
    )


@dataclass(frozen=True)
class _Found:
    """A fit with one follower; shapes (V,), (V,), (2 WAVES,), (V, V), (N,)."""

    values: Floats
    inside: Floats
    uneven: Floats
    covariance: Floats
    error: Floats
    found: Ridge
    converged: bool


def _fit(loop: Loop, start: Floats, name: str) -> _Found:
    """Gauss-Newton steps, first without the uneven force, then with it."""
    values, uneven = start, np.zeros(2 * WAVES)
    plain = loop.plain
    steps = 10
    for with_waves in (False, True):
        converged = False
        for _ in range(steps):
            error, columns, solved = _linearised(loop, values, uneven, with_waves, name)
            better = _step(loop, values, uneven, error, solved)
            if better is None:
                converged = True
                break
            values, uneven, gain = better
            if gain < 1e-4:
                converged = True
                break
    error, columns, solved = _linearised(loop, values, uneven, True, name)
    left = error + columns[:, plain:] @ uneven - columns @ solved.solution
    promised = error + columns[:, plain:] @ uneven - columns @ _within(loop, values, solved)
    # Where no step is any better, but a line promises much, it is stuck.
    converged = converged and bool(promised @ promised > (1 - _STUCK) * (error @ error))
    spread = covariance(columns, left, solved, loop.independent)
    friction = np.array([NAMES.index("b"), NAMES.index("coulomb")])
    own = loop.pieces, friction, loop.beginnings
    spread = (spread + between_pieces(columns, left, solved, *own, loop.independent))[
        :plain, :plain
    ]
    # A fit that leaves less than rounding does, as where the mass rests for long, follows that.
    rounded = (increment_unit(loop.position) or 0.0) ** 2 / 12
    spread *= max(1.0, rounded * len(left) / float(left @ left))
    spread += one_way(loop, values, uneven, columns, solved, spread)
    best = values + solved.solution[:plain]
    return _Found(best, values, uneven, spread, error, solved, converged)


def _linearised(
    loop: Loop, values: Floats, uneven: Floats, with_waves: bool, name: str
) -> tuple[Floats, Floats, Ridge]:
    """The error, its slopes, and the linear problem's solution for the step and all waves."""
    plain = loop.plain
    error = loop.error(values, uneven)
    columns = loop.columns(values, uneven, error)
    if not (np.all(np.isfinite(error)) and np.all(np.isfinite(columns))):
        raise InputError(f"{name}: no motion of one mass stays near the measured one")
    if not with_waves:
        columns[:, plain:] = 0.0
    size = float(np.std(loop.force))
    target = error + columns[:, plain:] @ uneven
    return error, columns, ridge(columns, target, plain, size, loop.independent, loop.reach)


def _step(
    loop: Loop, values: Floats, uneven: Floats, error: Floats, solved: Ridge
) -> tuple[Floats, Floats, float] | None:
    """As much of the step as lowers the penalised error, and by which share; None where none."""
    plain, lowest, highest = loop.plain, loop.lowest, loop.highest
    penalty = solved.share[plain:]
    before = float(error @ error + penalty @ uneven**2)
    share, step = 1.0, _within(loop, values, solved)
    for _ in range(6):
        trial = np.clip(values + share * step[:plain], lowest, highest)
        trial[0] = np.clip(trial[0], 0.5 * values[0], 2 * values[0])
        more = uneven + share * (step[plain:] - uneven)
        left = loop.error(trial, more)
        after = float(left @ left + penalty @ more**2)
        if after < before:
            return trial, more, 1 - after / before
        share *= 0.4
    return None


def _within(loop: Loop, values: Floats, solved: Ridge) -> Floats:
    """The solution where no value leaves what is possible: the others make up for those held."""
    plain = loop.plain
    low, high = loop.lowest - values, loop.highest - values
    step, held = solved.solution, np.zeros(plain, dtype=bool)
    for _ in range(plain):
        out = ~held & ((step[:plain] < low) | (step[:plain] > high))
        if not np.any(out):
            break
        held |= out
        (at,) = np.nonzero(held)
        beyond = solved.solution[at] - np.clip(solved.solution[at], low[at], high[at])
        own = solved.inverse[np.ix_(at, at)]
        step = solved.solution - solved.inverse[:, at] @ np.linalg.solve(own, beyond)
    return step


def _inverse_dynamics(recording: Recording) -> Floats:
    """Where to begin, shape (5,): least squares of the force on the filtered motion."""
    from scipy.signal import butter, sosfiltfilt

    band = 0.025  # of the sampling rate: of the inverse dynamics that the fit begins with
    low, period_s = butter(4, 2 * band, output="sos"), recording.period_s
    speeds = [np.gradient(sosfiltfilt(low, p.position), period_s) for p in recording.pieces]
    usual = float(np.std(np.concatenate(speeds)))
    if not usual > 0:
        raise InputError(f"{recording.name}: nothing moves in it")
    columns, target = [], []
    for piece, v in zip(recording.pieces, speeds, strict=True):
        sign = sosfiltfilt(low, np.tanh(v / (0.02 * usual)))
        # At its ends the filter takes a motion that goes on for one that stops.
        edge = min(round(2 / band), len(v) // 8)
        inside = slice(edge, len(v) - edge)
        design = np.stack([np.gradient(v, period_s), v, sign, np.ones_like(v)], 1)
        columns.append(design[inside])
        target.append(sosfiltfilt(low, piece.force)[inside])
    design = np.concatenate(columns)
    mass, damping, dry, offset = np.linalg.lstsq(design, np.concatenate(target), rcond=None)[0]
    if not mass > 0:
        mass = np.std(recording.force) / np.std(design[:, 0])
    start = [mass, max(damping, 0.01 * mass), max(dry, 0.0), offset, 0.5 * period_s]
    return np.array(start, dtype=np.float64)
