"""The motion of one mass fitted more sharply, where a white force is all that disturbs it.

Equal weights (`bayeshaptic.inference.time_domain.fit`) are right on average whatever force remains,
and several times as far from the truth as need be where that is white.  Which of the two it is the
innovations show: a force that depends on the position or the direction does not leave them white.

It is fitted to its counts where a white force moves it enough (`counts`), and else to innovations:
of several pieces, under further laws, or where counts are all that disturb it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.inference.time_domain.counts.fit import by_counts
from bayeshaptic.inference.time_domain.descent import Descended, descend
from bayeshaptic.inference.time_domain.fit import MotionFit
from bayeshaptic.inference.time_domain.innovations.filter import (
    Disturbance,
    Innovations,
    innovations,
)
from bayeshaptic.inference.time_domain.mass_in_loop import SHARED, MassInLoop
from bayeshaptic.inference.time_domain.uneven import WAVES
from bayeshaptic.inference.time_domain.whiteness import FEWEST, LAGS, by_chance, correlated
from bayeshaptic.inference.time_domain.widths.of_values import covariance_of_shared
from bayeshaptic.numerics.gauss_newton import lengths
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.types import Floats

_SIZES = 10.0 ** np.arange(-6.0, 0.1, 0.4)  # of the command, that a white force may have
# Decades either side of the size that was found last: looks at which samples are clear, and how
# large the disturbance is in these.
_CLOSER = (0.2, 0.05, 0.012, 0.003)
_ROUNDS = 10  # fits at most, each with the filter of the last; most settle in three
# Standard deviations, that no value moves by where they have settled.  So far values may be from
# those of their own filter; with less, fits that would have settled run out of rounds, and those of
# equal weights stay.
_STILL = 0.1
# Variance over that with all other values known (variance inflation).  Of 17 series of steps in
# which it is larger one would have mass, damping and delay 13 standard deviations off.
_APART = 100.0
_MOSTLY = 0.5  # of the motion, for which the sign of friction must be clear


@dataclass(frozen=True)
class WhitenedLoop(MassInLoop):
    """A loop whose errors are innovations, over their standard deviations.

    Attributes
    ----------
    filtered : Innovations
    """

    filtered: Innovations | None = None

    @property
    def white(self) -> bool:
        """Whether errors are independent of each other."""
        return True

    @property
    def independent(self) -> float:
        """How many independent samples this is worth."""
        assert self.filtered is not None
        return float(np.count_nonzero(self.filtered.clear))

    def error(self, values: Floats, uneven: Floats, more: Floats | float = 0.0) -> Floats:
        """Innovations of the measured less the simulated position, shape (N,)."""
        assert self.filtered is not None
        return self.filtered(super().error(values, uneven, more), values)


def in_white_force(motion: MotionFit, recording: Recording) -> MotionFit:
    """The motion fitted to its counts or innovations where these are white, else as it was.

    Where it is fitted anew, values and covariances are those that these give; the errors and the
    force along the way remain those of equal weights.

    Parameters
    ----------
    motion : MotionFit
        Of the recording, with equal weights.
    recording : Recording
    """
    counted = by_counts(motion, recording)
    if counted is not None:
        return counted
    try:
        return _by_innovations(motion, recording)
    except (InputError, np.linalg.LinAlgError):  # no motion stays near, or two columns are one
        return motion


def _by_innovations(motion: MotionFit, recording: Recording) -> MotionFit:
    settled = _settled(motion.loop(recording), motion.whole)
    if settled is None:
        return motion
    found, disturbed = settled
    return replace(
        motion,
        values=found.values[:SHARED],
        covariance=covariance_of_shared(found.covariance, found.found),
        whole=found.inside,
        whole_sd=np.sqrt(np.diag(found.covariance)),
        disturbed=disturbed,
    )


def _settled(loop: MassInLoop, values: Floats) -> tuple[Descended, Disturbance] | None:
    """The fit beside its own filter; None where innovations are not white or no fit settles."""
    disturbed, tried = _usual(loop), _SIZES * float(np.std(loop.force))
    before = values
    for _ in range(_ROUNDS):
        disturbed, filtered = _disturbance(loop, values, disturbed, tried)
        whitened = WhitenedLoop(**vars(loop), filtered=filtered)
        if not _like_noise(whitened, values):
            return None
        found = descend(whitened, values)
        moved = (found.values - before)[:SHARED] / np.sqrt(np.diag(found.covariance)[:SHARED])
        if found.converged and np.max(np.abs(moved)) < _STILL:
            return found, disturbed
        tried, values = _around(disturbed.force_sd, _CLOSER[0]), found.inside
        before = found.values
    return None


def _usual(loop: MassInLoop) -> Disturbance:
    """Nothing but counts."""
    moves = float(np.std(np.diff(loop.position)))
    unit = increment_unit(loop.position) or 1e-3 * moves
    return Disturbance(0.0, unit / np.sqrt(12))


def _around(size: float, decades: float) -> Floats:
    return np.asarray(size * 10.0 ** np.linspace(-decades, decades, 5))


def _disturbance(
    loop: MassInLoop, values: Floats, disturbed: Disturbance, tried: Floats
) -> tuple[Disturbance, Innovations]:
    """The likeliest sizes beside a motion, all values fitted with them; and their filter."""
    assert loop.follower is not None
    waves = np.zeros(2 * WAVES)
    error = loop.error(values, waves)
    slopes = loop.columns(values, waves, error)[:, : loop.plain]
    simulated = loop.position - error
    velocity = [np.gradient(simulated[piece], loop.period_s) for piece in loop.pieces]
    beside = values, loop.follower, np.concatenate(velocity), loop.pieces
    clear = np.ones(len(error), dtype=bool)
    position_sd = disturbed.position_sd
    for decades in _CLOSER:
        lacks = []
        for force_sd in tried:
            sizes = Disturbance(float(force_sd), position_sd)
            filtered = innovations(*beside, sizes, loop.period_s)
            counted = clear & filtered.moving
            left = _left(filtered, values, error, slopes)[counted]
            power = float(np.mean(left**2))
            lack = np.log(power) + np.mean(np.log(filtered.variances[counted]))
            lacks.append((float(lack), float(force_sd), power, filtered))
        _, force_sd, power, filtered = min(lacks, key=lambda one: one[0])
        # A common factor of both sizes, and of what friction is beside them.
        position_sd *= np.sqrt(power)
        tried = _around(force_sd * np.sqrt(power), decades)
        clear = filtered.clear
    best = Disturbance(force_sd * float(np.sqrt(power)), float(position_sd))
    return best, innovations(*beside, best, loop.period_s)


def _left(filtered: Innovations, values: Floats, error: Floats, slopes: Floats) -> Floats:
    """Innovations that the columns do not explain, shape (N,)."""
    columns = np.stack([filtered(column, values) for column in slopes.T], axis=1)
    return _unexplained(filtered(error, values), columns)


def _unexplained(series: Floats, columns: Floats) -> Floats:
    """What is left of a series where columns are fitted to it, shape (N,)."""
    scaled = columns / lengths(columns)
    return np.asarray(series - scaled @ np.linalg.lstsq(scaled, series)[0])


def _like_noise(loop: WhitenedLoop, values: Floats) -> bool:
    """Whether innovations tell the values apart, are white, and owe nothing to the way.

    As far as a line says: where friction is clear, for half of the motion at least.
    """
    assert loop.filtered is not None
    clear, moving = loop.filtered.clear, np.count_nonzero(loop.filtered.moving)
    if np.count_nonzero(clear) < max(_MOSTLY * moving, FEWEST):
        return False
    waves = np.zeros(2 * WAVES)
    error = loop.error(values, waves)
    columns = loop.columns(values, waves, error)
    if not told_apart(columns[:, : loop.plain]):
        return False
    plain = _unexplained(error, columns[:, : loop.plain])
    with_waves = _unexplained(error, columns)
    along = moving * (plain @ plain / (with_waves @ with_waves) - 1)
    white = correlated(np.where(clear, plain, 0.0)) < by_chance(LAGS)
    return bool(white and along < by_chance(2 * WAVES))


def told_apart(columns: Floats) -> bool:
    """Whether slopes over the values (the five of all pieces first) tell these apart; (N, V).

    A controller takes a mass from rest to rest in moves that many masses, dampings and delays
    share: then what little counts differ by would decide.
    """
    scaled = columns / lengths(columns)
    inflated = np.diag(np.linalg.pinv(scaled.T @ scaled, hermitian=True))
    return bool(np.max(inflated[:SHARED]) < _APART)
