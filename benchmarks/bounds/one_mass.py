"""The least widths that one mass in a white force allows: Cramer and Rao."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayeshaptic.inference.time_domain.follower import Follower
from bayeshaptic.inference.time_domain.held_force import over_span
from bayeshaptic.inference.time_domain.mass_in_loop import NAMES, MassInLoop
from bayeshaptic.inference.time_domain.uneven import WAVES as ALONG, Way
from bayeshaptic.types import Floats
from benchmarks.recordings.one_mass import PERIOD_S, Case


def bound(case: Case) -> Floats:
    """Least covariance of `NAMES` that any unbiased estimate can have, (5, 5): Cramer and Rao.

    Of the innovations of a mass that a white force and the encoder's counts disturb: how the motion
    under the recorded command alone, whatever the controller, goes with the values, through the
    steady Kalman filter.  Zero of a friction that is none.
    """
    recording = case.recording
    alone = Follower(np.zeros(1), np.ones(1))
    loop = replace(MassInLoop.of(recording, 1.0, Way.of(recording.position)), follower=alone)
    values = loop.begun(case.truth)
    waves = np.zeros(2 * ALONG)
    columns = loop.columns(values, waves, loop.error(values, waves))[:, : loop.plain]
    known = np.ones(loop.plain, bool)
    known[2] = case.truth[2] > 0  # friction that is none has no slope on either side
    columns, size = innovations(case, columns[:, known])
    scale = np.linalg.norm(columns, axis=0)
    information = (columns / scale).T @ (columns / scale)
    least = np.zeros((loop.plain, loop.plain))
    least[np.ix_(known, known)] = np.linalg.inv(information) / np.outer(scale, scale) * size**2
    return least[: len(NAMES), : len(NAMES)]


def with_limit(truth: Floats) -> Floats:
    """Slopes of the values and of ln K_CR, Diaz and Gil (2010), equation (19), shape (6, 5)."""
    of_limit = [0.0, 1 / truth[1], 0.0, 0.0, -1 / (PERIOD_S / 2 + truth[4])]
    return np.vstack([np.eye(len(truth)), of_limit])


def spreads(covariance: Floats, slopes: Floats) -> Floats:
    """Standard deviations to first order; NaN where there is none."""
    sd = np.sqrt(np.diag(slopes @ covariance @ slopes.T))
    return np.where(sd > 0, sd, np.nan)


def innovations(case: Case, columns: Floats) -> tuple[Floats, float]:
    """What a steady Kalman filter cannot foresee of positions, shape (N, C), and its sd."""
    from scipy.linalg import solve_discrete_are

    mass, damping = case.truth[:2]
    motion, push = over_span(mass, damping, PERIOD_S)
    seen = np.array([[1.0, 0.0]])
    count = np.array([[case.resolution**2 / 12]])
    pushed = np.outer(push, push) * case.noise**2
    spread = solve_discrete_are(motion.T, seen.T, pushed, count)
    size = float((seen @ spread @ seen.T + count)[0, 0])
    gain = motion @ spread @ seen.T / size
    state, new = np.zeros((2, columns.shape[1])), np.empty_like(columns)
    for k, column in enumerate(columns):
        new[k] = column - state[0]
        state = motion @ state + gain @ new[k : k + 1]
    return new, float(np.sqrt(size))
