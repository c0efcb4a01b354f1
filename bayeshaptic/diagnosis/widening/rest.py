"""Parameters where something stays unexplained: wider by what it may do to the response.

What is left may bend the response that the parameters are read from, smoothly over the frequency:
a relative deviation delta of the response, a Gaussian process over its logarithm, moves the
parameters that fit best, and they are uncertain by that much more (M. C. Kennedy and A. O'Hagan,
"Bayesian calibration of computer models", J. R. Statist. Soc. B 63, 2001).  A linear remainder
shows its size in the residual.  Any other acts as noise, and bends the response by a share of it:
what a force that is not linear adds to the best linear response is of the order of what it
scatters (R. Pintelon and J. Schoukens, "System Identification", 2nd ed., Wiley, 2012, ch. 3).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from bayeshaptic.diagnosis.traced import UNEXPLAINED, Traced
from bayeshaptic.diagnosis.widening.deviation import deviation, evidence, matern, modelled
from bayeshaptic.inference.coordinates import Coordinates, believed, coordinates, reach
from bayeshaptic.inference.fit import REACH_SDS, Fit, weighted_residuals
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.numerics.gauss_newton import jacobian
from bayeshaptic.types import Complexes, Floats

BENDS = 0.2
"""How far what acts as noise bends the response, over what it scatters in a line."""
_SMOOTH = 0.4  # decades
_NEGLIGIBLE = 1e-6  # probability of a size and a length


def with_rest(
    posterior: Posterior, fit: Fit, traced: Traced, louder: float = 1.0, seed: int = 0
) -> Posterior | None:
    """The posterior with what is unexplained; None where nothing is.

    Parameters
    ----------
    posterior : Posterior
    fit : Fit
        With what was found.
    traced : Traced
    louder : float
        Factor on the noise variance that the posterior has already.
    seed : int
    """
    left = {test.family for test in traced.after if test.flagged}
    if traced.verdict != UNEXPLAINED or not left:
        return None
    # A damper that is next to nothing is known to so much, not to a factor.
    dampers = [n for n in fit.model.names if fit.model.parameter(n).dimension == "damping"]
    here = coordinates(fit.model, dampers)
    low, high = (here.coordinate(end) for end in reach(fit.model, REACH_SDS))
    slopes, spread = _slopes(fit, here), believed(fit.model, here)
    white = modelled(fit) / np.sqrt(fit.likelihood.noise_variance)[:, None]
    pull = np.einsum("wr,wrp->wp", white.conj(), slopes)
    size = np.sum(np.abs(white) ** 2, axis=1)[:, None]
    bent = _bends(fit, left, spread * pull / size)
    real = np.sqrt(2) * np.concatenate([slopes.real, slopes.imag]).reshape(-1, len(spread))
    # Of the slopes, not of their square: that has lost what is known worst to rounding.
    prior = np.diag(1 / spread)
    root = np.asarray(np.linalg.qr(np.concatenate([real, prior]), mode="r")).T
    # In coordinates where the noise alone makes a unit: louder noise has made more of it already.
    follow = np.linalg.solve(root, 2 * pull.conj().T)
    power, axes = np.linalg.eigh(0.5 * np.real(follow @ bent @ follow.conj().T))
    sd = np.sqrt(np.maximum(power - (louder - 1.0), 0.0))
    rng = np.random.default_rng([seed, 17])
    moved = rng.standard_normal(posterior.chains.shape) @ (np.linalg.solve(root.T, axes) * sd).T
    chains = here.natural(np.clip(here.coordinate(posterior.chains) + moved, low, high))
    return replace(posterior, chains=chains)


def _bends(fit: Fit, left: Collection[str], taken_up: Complexes) -> Floats:
    """Covariance of the deviation between the windows, (W, W); `taken_up` is what a fit hides."""
    found = deviation(fit)
    between = found.log_f[:, None] - found.log_f[None, :]
    bent = np.zeros_like(between)
    if "linear" in left:
        smooth = replace(found, variance=found.variance + found.jumps)
        for (size, length), weight in zip(*evidence(smooth, taken_up), strict=True):
            if weight > _NEGLIGIBLE:
                bent += weight * size**2 * matern(between, length)
    if set(left) - {"linear"}:
        share = BENDS * np.minimum(_scatter(fit), 1.0)
        bent += share[:, None] * share * matern(between, _SMOOTH)
    return bent


def _scatter(fit: Fit) -> Floats:
    """Noise of a line over what the model makes of it, what is left over included, shape (W,)."""
    windows = fit.windows
    size = np.mean(np.abs(modelled(fit)) ** 2, axis=1)
    noise = fit.likelihood.noise_variance * max(fit.reduced_chi_square, 1.0)
    # A window of random excitation has the power of its lines in as many numbers as nodes.
    of_a_line = windows.lines / windows.target.shape[1] if windows.target.shape[1] > 1 else 1.0
    return np.asarray(np.sqrt(noise * of_a_line / size))


def _slopes(fit: Fit, here: Coordinates) -> Complexes:
    """Of the normalised deviations over the coordinates, shape (W, r, P)."""
    slope = jacobian(weighted_residuals(fit.likelihood, here), here.coordinate(fit.theta[None]))[0]
    parts = slope.reshape(*fit.windows.target.shape, 2, -1) / np.sqrt(2)
    return np.asarray(parts[:, :, 0] + 1j * parts[:, :, 1])
