"""The deterministic fit: weighted least squares from several starts (the paper's, section III)."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from bayeshaptic.arguments import at_the_door
from bayeshaptic.inference.coordinates import coordinates
from bayeshaptic.inference.fit import Fit, refuse_unfit, search_box, summarise, weighted_residuals
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.inference.valleys import ONE_VALLEY, OTHER_VALLEYS, Optimum, refine
from bayeshaptic.models import Model
from bayeshaptic.models.chains import shorter_chain, with_a_mode_moved, with_one_more_mode
from bayeshaptic.models.start import informed, starting_points
from bayeshaptic.numerics.gauss_newton import minimise
from bayeshaptic.recordings.response.etfe import Etfe, compress
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.threads import single_threaded
from bayeshaptic.types import Floats

# Sets of starting points: where a model misfits its valleys are many.  Of 76 devices of any size
# that somebody holds six sets miss the deepest that eight found in 2.5 %; four, of which two that
# ended alike were the last, in 7 %.
SETS = 6
# In closed loop: of 70 simulated ones most settle in four, some short ones not in twenty.
_REWEIGHINGS, _SETTLED = 20, 0.02
# Sets that have to end within so much log likelihood of the likeliest. Two may end in one wrong
# valley, and now and then more do: of one held device six of seven in closed loop.  In open loop
# one set ends 10 and more in log density below the best of eight in 26 % of 34 held devices of any
# size; sets until two agree (3.1 of them) do in 9 %, until three do (4.2) in 6 %.
_AGREEING, _AGREEING_IN_OPEN_LOOP, _SAME_VALLEY = 3, 2, 1.0


@at_the_door
@single_threaded
def least_squares(
    model: Model,
    etfe: Etfe,
    seed: int = 0,
    start: Floats | None = None,
    shorter: Fit | None = None,
    most_sets: int = SETS,
) -> Fit:
    """Fit `model` to `etfe` by weighted least squares from several starts.

    The residual of every window is weighted by the noise that the window itself shows; priors only
    bound the search (at six standard deviations).  The windows are compressed anew around each
    fit, because only the ratio to a good first fit is smooth beside a resonance.  Where the model
    misfits, in closed loop and in a hand, more sets of starting points follow; where it misfits
    some of these have a mode above half the sampling rate.  Of a chain one mode after the other is
    looked for elsewhere.

    Parameters
    ----------
    model : Model
    etfe : Etfe
    seed : int
        For the starting points.
    start : ndarray, shape (P,) or (S, P), optional
        Begin here and nowhere else.
    shorter : Fit, optional
        For a chain: what its starting points grow from, where that was fitted before; with whatever
        priors, which only bound a search.
    most_sets : int
        Sets of starting points for a model that misfits, in closed loop and in a hand.

    Returns
    -------
    Fit

    Raises
    ------
    InputError
        Where the model was given another sampling period than the response has, or `start` has
        not as many parameters as the model.
    """
    refuse_unfit(model, etfe, start)
    model = informed(model, etfe)
    if start is not None:
        return replace(_fit(model, etfe, start), etfe=etfe)
    first = refine(model, compress(etfe.blurred), _starts(model, etfe, seed, shorter))
    fit = _followed(model, etfe, first)
    if shorter_chain(model) is not None:
        fit = _with_modes_moved(fit, etfe, most_sets - 1)
    elif fit.misfits and not etfe.direct:
        fit = _from_other_sets(fit, first, etfe, seed, most_sets - 1)
    elif etfe.direct or model.held:
        fit = likeliest(fit, etfe, seed, most_sets - 1)
    return replace(fit, etfe=etfe)


def continued(fit: Fit, etfe: Etfe) -> Fit:
    """The fit, followed to the optimum of other spectra of the same recording."""
    theta, windows = _sharpened(fit.model, etfe, fit.theta, _REWEIGHINGS)
    there = summarise(fit.model, windows, theta, fit.starts)
    return replace(there, elsewhere=fit.elsewhere, alike=fit.alike, etfe=etfe)


def likeliest(fit: Fit, etfe: Etfe, seed: int = 0, most: int = SETS) -> Fit:
    """The fit, or a better one that other sets of starting points lead to, where none misfits.

    What a fit leaves is its noise in closed loop, so that none says that it misfits: of 13 held
    devices five ended 4 to 92 in log likelihood short of the likeliest valley, of eight free ones
    none.  In open loop masses of a held device may swap their parts in the motion, and fit nearly
    as well.  Of those found that with the highest posterior density, as in `refine`; no more are
    looked for once the likeliest has been found several times.

    Parameters
    ----------
    fit : Fit
    etfe : Etfe
    seed : int
        For the starting points.
    most : int
        Sets of them.
    """
    found, agreeing = [fit], _AGREEING if etfe.direct else _AGREEING_IN_OPEN_LOOP
    for another in range(1, most + 1):
        nearly = max(one.log_likelihood for one in found) - _SAME_VALLEY
        if sum(one.log_likelihood > nearly for one in found) >= agreeing:
            break
        rng = np.random.default_rng([seed, another])
        found.append(_fit(fit.model, etfe, starting_points(fit.model, etfe, rng)))
    return replace(max(found, key=_log_density), etfe=etfe)


def _log_density(fit: Fit) -> float:
    """Log posterior density, in the coordinates of the search, up to a constant."""
    here = coordinates(fit.model)
    theta = fit.theta[None]
    prior = fit.model.log_prior(theta) + here.log_jacobian(here.coordinate(theta))
    return fit.log_likelihood + float(prior[0])


def _from_other_sets(fit: Fit, first: Optimum, etfe: Etfe, seed: int, most: int) -> Fit:
    """The fit, or that of the deepest valley that other sets of starting points find.

    No more of them are taken once one has reached the noise.
    """
    # Of a position that is early an image takes up the lead that no delay leaves over.
    images = "delay_s" not in fit.impossible
    windows, found = compress(etfe.blurred), [first]
    for another in range(1, most + 1):
        rng = np.random.default_rng([seed, another])
        starts = starting_points(fit.model, etfe, rng, with_images=images)
        found.append(refine(fit.model, windows, starts))
        if found[-1].explains:
            break
    deepest = min(found, key=lambda one: one.reduced_chi_square)
    if not first.as_deep_as(deepest):
        other = _followed(fit.model, etfe, deepest)
        if other.reduced_chi_square < fit.reduced_chi_square:
            fit = other
        else:
            deepest = first
    # What lies beside it: as its own set saw it, and where other sets ended.
    beside, last = [], deepest
    for one in sorted(found, key=lambda one: one.reduced_chi_square):
        if not one.as_deep_as(last):
            beside.append(one.theta)
            last = one
    elsewhere = np.concatenate([fit.elsewhere, np.reshape(beside, (-1, fit.model.size))])
    return replace(fit, elsewhere=elsewhere[:OTHER_VALLEYS])


def _followed(model: Model, etfe: Etfe, found: Optimum) -> Fit:
    """The fit that a valley leads to, with the windows compressed anew around it."""
    blurred = etfe.blurred
    theta = found.theta
    rewindowings = 2
    for _ in range(rewindowings):
        windows = compress(blurred, partial(model.response, theta, measured=True))
        theta = polish(model, windows, theta)
    if blurred is not etfe:
        theta, windows = _sharpened(model, etfe, polish(model, compress(etfe), theta), rewindowings)
    if etfe.direct:
        ways = [_sharpened(model, etfe, way, _REWEIGHINGS) for way in (theta, *found.elsewhere)]
        theta, windows = max(ways, key=lambda way: Likelihood(model, way[1])(way[0][None])[0])
    fit = summarise(model, windows, theta, found.agreeing)
    return replace(fit, elsewhere=found.elsewhere, alike=found.alike)


def _sharpened(
    model: Model, etfe: Etfe, theta: Floats, rewindowings: int
) -> tuple[Floats, Windows]:
    """The fit continued together with the windows around it, where that is needed.

    It is needed beside sharp modes, and where feedback hides the noise.  Valleys of sharp modes are
    narrower than starting points are dense, so that a fit begins without them; then the windows
    themselves tell a pole better than the fit does.  Around a fit that is off by a hundredth of a
    line the windows are many times louder, so that not every step leads to a better fit.  In closed
    loop the noise is what the last fit left.
    """
    tried: list[tuple[float, Floats, Windows]] = []
    for step in range(rewindowings + 1):
        windows = compress(etfe, partial(model.response, theta, measured=True))
        tried.append((float(Likelihood(model, windows)(theta[None])[0]), theta, windows))
        if step > 2 and abs(tried[-1][0] - tried[-2][0]) < _SETTLED:
            break
        if step < rewindowings:
            theta = polish(model, windows, theta)
    _, theta, windows = max(tried, key=lambda one: one[0])
    return theta, windows


def _fit(model: Model, etfe: Etfe, start: Floats) -> Fit:
    """The best fit from one set of starting points, shape (P,) or (S, P)."""
    return _followed(model, etfe, refine(model, compress(etfe.blurred), start))


def _starts(model: Model, etfe: Etfe, seed: int, known: Fit | None) -> Floats:
    """Where to begin; a chain grows from the fit of the one with a mode less, if it can."""
    shorter, grown = shorter_chain(model), np.empty((0, model.size))
    if shorter is not None:
        if known is None or known.model.names != shorter.names:
            known = least_squares(shorter, etfe, seed=seed)
        grown = with_one_more_mode(shorter, known.theta, model, etfe)
    return grown if len(grown) else starting_points(model, etfe, np.random.default_rng(seed))


def _with_modes_moved(fit: Fit, etfe: Etfe, rounds: int) -> Fit:
    """A chain's fit, or a better one that it leads to with one mode after the other elsewhere."""
    idle, modes = 0, fit.model.structure.modes
    for step in range(rounds * modes):
        if not fit.misfits or idle == modes:
            break
        start = with_a_mode_moved(fit.model, fit.theta, 1 + step % modes, etfe)
        other = _fit(fit.model, etfe, start) if len(start) else fit
        better = other.reduced_chi_square < (1 - ONE_VALLEY) * fit.reduced_chi_square
        fit, idle = (other, 0) if better else (fit, idle + 1)
    return fit


def polish(model: Model, windows: Windows, theta: Floats) -> Floats:
    """The optimum nearest to one vector, shape (P,)."""
    here, low, high = search_box(model)
    residuals = weighted_residuals(Likelihood(model, windows), here)
    phi, _ = minimise(residuals, here.coordinate(theta[None]), low, high, 60, 1e-8)
    return np.asarray(here.natural(phi)[0])
