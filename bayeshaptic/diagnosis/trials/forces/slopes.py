"""What forces' motion does to the likelihood, to first order in everything that is fitted.

Around the present forces their motion is linear in the logarithms of strength and shape, and in the
linear parameters: its slopes, simulated, enter the likelihood as further inputs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis.state import Change, share, weights
from bayeshaptic.diagnosis.trials.forces.along import Along, slopes_along
from bayeshaptic.diagnosis.trials.forces.form import Form
from bayeshaptic.diagnosis.trials.forces.tryout import Point, Tryout, answered
from bayeshaptic.inference.coordinates import coordinates
from bayeshaptic.inference.fit import search_box
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.models import Model
from bayeshaptic.numerics.gauss_newton import jacobian
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Complexes, Floats

NUDGE = 0.1  # relative, of strength and shape for the slopes
_SDS, _LEAST, _FARTHEST = 5.0, 3e-3, 0.1  # the same of a linear parameter
_ALL = (0, 1, 2, 3)  # windows
Further = tuple[Floats, bool]  # a motion, and whether a force against the ground makes it
_SMOOTH = 1e-3  # share of these distances where a sticking mass's motion goes smoothly


def spread(tryout: Tryout, found: Point) -> tuple[Floats, Floats]:
    """How well fitted forces are known, and what goes with them.

    Parameters
    ----------
    tryout : Tryout
    found : Point

    Returns
    -------
    covariance : ndarray, shape (J, J)
        Of the logarithms of each force's strength and tuned shape.
    along : ndarray, shape (P, J)
        Change of the linear parameters' coordinates with each logarithm, all else
        fitted anew: friction that is a little more leaves a damper that is far less.
    """
    _, linear, forces, free = slopes_of_all(tryout, found)
    along = np.zeros((len(free), forces.shape[1]))
    # Slopes over what nobody knows to a factor of e are rounding: that goes with no force.
    linear = np.concatenate([linear, np.eye(linear.shape[1])])
    forces = np.concatenate([forces, np.zeros((linear.shape[1], forces.shape[1]))])
    along[free] = -np.linalg.lstsq(linear, forces, rcond=None)[0]
    left = forces + linear @ along[free]
    return np.asarray(np.linalg.pinv(left.T @ left, hermitian=True)), along


def slopes_of_all(
    tryout: Tryout, found: Point, further: Sequence[Further] = ()
) -> tuple[Floats, Floats, Floats, NDArray[np.bool_]]:
    """Residuals of all windows at fitted forces, and their slopes.

    Over the linear parameters that are free, over the logarithms of strengths and shapes, and last
    over `further` motions; and which of the linear parameters are free.
    """
    form = Form.of(found)
    reach = Reach(nudges_of(tryout), np.full(len(form.begun), _SMOOTH))
    residuals, start, _ = linearised(tryout, form, found, reach, _ALL, further)
    here, size = residuals(start), tryout.model.size
    slopes = jacobian(residuals, start, here)[0]
    _, low, high = search_box(tryout.model)
    free = (start[0, :size] > low) & (start[0, :size] < high)
    return here[0], slopes[:, :size][:, free], slopes[:, size:], free


def nudges_of(tryout: Tryout) -> Floats:
    """How far each linear parameter goes for the slopes of the motion, shape (P,): some sds.

    Less would see how a sticking mass jumps, not where it goes; more would leave a resonance.
    """
    fit = tryout.state.fit
    here = coordinates(tryout.model)
    relative = fit.sd / np.where(here.log, np.maximum(fit.theta, 1e-300), here.scale)
    return np.clip(np.nan_to_num(_SDS * relative, nan=np.inf), _LEAST, _FARTHEST)


@dataclass(frozen=True)
class Reach:
    """How far slopes are taken over.

    Attributes
    ----------
    linear : ndarray, shape (P,)
        Usual distances of the linear parameters' coordinates: `nudges_of`.
    near : ndarray, shape (J,)
        Share of the usual distance of each logarithm; those of the linear parameters go with the
        strengths'.
    """

    linear: Floats
    near: Floats


def linearised(
    tryout: Tryout,
    form: Form,
    found: Point,
    reach: Reach,
    parts: tuple[int, ...],
    further: Sequence[Further] = (),
    along: Along | None = None,
) -> tuple[Callable[[Floats], Floats], Floats, Along]:
    """Residuals around forces, linear in their motion, and their start.

    A motion is that of a unit of the force times its strength, and is so here: along a ridge where
    force and damper make up for each other the product of both steps is worth more than the noise.

    Parameters
    ----------
    tryout : Tryout
    form : Form
    found : Point
        Where the slopes are taken.
    reach : Reach
    parts : tuple of int
        Which of the windows are fitted.
    further : list of (ndarray, bool)
        Further motions, whose sizes are fitted, too; and whether of a force against the ground.
    along : Along, optional
        The slopes over the linear parameters that were used last.

    Returns
    -------
    residuals : callable
        Of coordinates, changes of the logarithms and sizes of the further motions.
    start : ndarray, shape (1, P + J + M)
    along : Along
        The slopes over the linear parameters that were used.
    """
    theta, forces = found.theta, form.at(form.logs(found))
    added = tryout.simulation.added(forces, theta, found.motion)
    slopes = _over_logarithms(tryout, form, found, added, reach.near)
    along = _over_linear(tryout, form, found, added, reach, along)
    changes = tryout.changes(forces, added)
    etfe = tryout.without(changes, theta)
    columns = [
        *(tryout.at_lines(slope) for slope in slopes),
        *along.slopes.reshape(-1, along.slopes.shape[-1]),
        *(tryout.at_lines(motion) for motion, _ in further),
    ]
    by_strengths = np.tile(form.grounded[along.strengths], len(along.slopes))
    grounded = np.array([*form.grounded, *by_strengths, *(own for _, own in further)], bool)
    if tryout.held and grounded.any():
        columns = _with_a_hand(tryout, changes, etfe, theta, columns, grounded)
    windows, weight = _weighed_windows(tryout, etfe, theta, columns, parts)
    phi = coordinates(tryout.model).coordinate(theta[None])[0]
    start = np.concatenate([phi, np.zeros(len(slopes) + len(further))])[None]
    moved = form.logs(found) - form.begun
    return _residuals(tryout.model, windows, weight, form.shape, moved, start, along), start, along


def _over_logarithms(
    tryout: Tryout, form: Form, found: Point, added: Floats, near: Floats
) -> list[Floats]:
    """Slopes of the motion over each logarithm of strength or shape; zero where it runs away."""
    simulation, theta, logs = tryout.simulation, found.theta, form.logs(found)

    def driven(logs: Floats) -> Floats:
        acting = form.at(logs)
        return simulation.driven(acting, theta, simulation.added_near(acting, theta, added))

    total = driven(logs)  # as near as the others, so that differences are theirs
    sides = near * np.where(np.isfinite(form.highest), -NUDGE, NUDGE)  # away from a bound
    steps = zip(sides, np.eye(len(logs)), strict=True)
    slopes = ((driven(logs + side * unit) - total) / side for side, unit in steps)
    return [slope if np.isfinite(slope[0]) else np.zeros_like(slope) for slope in slopes]


def _over_linear(
    tryout: Tryout, form: Form, found: Point, added: Floats, reach: Reach, known: Along | None
) -> Along:
    """Slopes of the motion over the linear parameters: those `known`, where they hold."""
    strengths, logs = ~form.shape, form.logs(found)
    phi = coordinates(tryout.model).coordinate(found.theta[None])[0]
    at, near = np.concatenate([phi, logs[strengths]]), reach.near[strengths].max(initial=0.0)
    if known is not None and known.holds(at, float(near)):
        return known
    forces = form.at(logs)
    moving = [one.moves_a_mass for one in forces]
    slopes = slopes_along(tryout, forces, found.theta, added, near * reach.linear)
    return Along(slopes, np.flatnonzero(strengths)[moving], at, float(near))


def _with_a_hand(
    tryout: Tryout,
    changes: tuple[Change, ...],
    etfe: Etfe,
    theta: Floats,
    slopes: list[Complexes],
    grounded: NDArray[np.bool_],
) -> list[Complexes]:
    """Slopes of the motion, with those of what a hand would do without the forces: `etfe`.

    The more they take off, the further it alone would have moved the device: see `Windows.louder`.
    As it was measured that is a slope like those of the motion.
    """
    spectra: Any = etfe.spectra
    response = tryout.model.response(theta, tryout.at_lines.frequency_hz, measured=True)
    left = spectra.position - response * spectra.force
    found = np.array(slopes)
    found[grounded] += left * tryout.answer(theta).growth(answered(changes), found[grounded])
    return list(found)


def _weighed_windows(
    tryout: Tryout, etfe: Etfe, theta: Floats, columns: list[Complexes], parts: tuple[int, ...]
) -> tuple[Windows, Floats]:
    """Windows without what forces changed, with slopes as inputs; and roots of their weights."""
    windows = tryout.windows(etfe, theta, columns)
    # The many slopes leave too little of a window to read its noise from.
    left, scattered = weights(tryout.model, tryout.windows(etfe, theta), theta)
    nodes, rows = windows.frequency_hz.shape[1], windows.target.shape[1]
    # Rows beyond the nodes' are what of the scatter the slopes can take.
    each = np.where(np.arange(rows) < nodes, left[:, None], scattered[:, None])
    chosen = share(windows, parts)
    return windows.part(chosen), np.sqrt(2 * each[chosen])


def _residuals(
    model: Model,
    windows: Windows,
    weight: Floats,
    shape: NDArray[np.bool_],
    moved: Floats,
    start: Floats,
    along: Along,
) -> Callable[[Floats], Floats]:
    """From coordinates, changes of the logarithms and sizes of further motions to what is left.

    `shape` says which logarithms are of a shape, and `moved` how far all of them have come.
    """
    here = coordinates(model)
    nodes, size = windows.frequency_hz.shape[1], model.size
    columns = windows.design[:, :, nodes:]
    own = Likelihood(model, replace(windows, design=windows.design[:, :, :nodes]))
    shape_sd = 1.0  # log; how far a shape may be from the grid's

    def residuals(phi: Floats) -> Floats:
        steps, sizes = np.split(phi[:, size:], [len(moved)], axis=1)
        far = (moved + steps)[:, shape] / shape_sd
        grown = np.where(shape, steps, np.expm1(steps))
        # A slope is that of a motion, and as many times larger as its force is.
        beside = (phi[:, :size] - start[:, :size])[:, : len(along.slopes), None]
        beside = beside * np.exp(steps[:, None, along.strengths])
        sized = np.concatenate([grown, beside.reshape(len(phi), -1), sizes], axis=1)
        left = own.deviations(here.natural(phi[:, :size]))
        left = (left - np.einsum("wrj,bj->bwr", columns, sized)) * weight
        flat = left.reshape(len(phi), -1)
        return np.concatenate([flat.real, flat.imag, far], axis=1)

    return residuals
