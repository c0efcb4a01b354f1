"""What a fit scores beside others, and how far the hand in it is from what hands are like."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bayeshaptic.inference.fit import Fit, search_box, weighted_residuals
from bayeshaptic.models.hand import from_a_hand
from bayeshaptic.numerics.gauss_newton import minimise
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.types import Floats

# Differences of BIC, or of twice the log likelihood: evidence "not worth more than a bare mention",
# and "very strong" evidence (R. E. Kass and A. E. Raftery, JASA 90, 1995).
BARE_MENTION, VERY_STRONG = 2.0, 10.0


def information_criterion(fit: Fit, noise: float, further: int = 0) -> float:
    """Bayesian information criterion of a fit; smaller is better.

    Parameters
    ----------
    fit : Fit
    noise : float
        Factor on the noise variance (a quasi-likelihood where no model reaches the noise).
    further : int
        Parameters beside those of the fit's model.
    """
    numbers = 2 * len(fit.residual)
    return deviance(fit, noise)[0] + (fit.model.size + further) * float(np.log(numbers))


def deviance(fit: Fit, noise: float) -> tuple[float, float]:
    """Squared residual of a fit, and how far its hand is from what hands are like.

    A hand counts as five more residuals, and both are those of the least sum.

    Parameters
    ----------
    fit : Fit
    noise : float
        Factor on the noise variance.

    Returns
    -------
    whole : float
        Twice the fall of the log likelihood; of what is known of hands, too.
    from_a_hand : float
        The hand's part of it, a chi-square of five numbers; zero where nobody holds the device.
    """
    at_fit = 2 * float(np.sum(np.abs(fit.residual) ** 2)) / noise
    # Where the noise is what the fit leaves the likelihood tells one fit from another.
    known = fit.windows.noise is None
    own = at_fit if known else -2 * fit.log_likelihood
    if not fit.model.held:
        return own, 0.0
    here, low, high = search_box(fit.model)
    misfit = weighted_residuals(fit.likelihood, here)
    mass = float(fit.model.prior("mh").quantile(0.5))

    def hand(phi: Floats) -> Floats:
        values = dict(zip(fit.model.names, here.natural(phi).T, strict=True))
        return from_a_hand(values, mass)

    def both(phi: Floats) -> Floats:
        return np.concatenate([misfit(phi) / np.sqrt(noise), hand(phi)], axis=1)

    start = here.coordinate(fit.theta[None])
    steps, settled = 40, 1e-3  # of the least sum of misfit and distance from a hand
    phi, half = minimise(both, start, low, high, steps, settled)
    return own + 2 * float(half[0]) - at_fit, float(np.sum(hand(phi) ** 2))


@dataclass(frozen=True)
class ScoredFit:
    """A base model that was tried.

    Attributes
    ----------
    fit : Fit
    score : float
        Bayesian information criterion, with the residual of the best candidate as the noise where
        that exceeds the noise (a quasi-likelihood); smaller is better.
    from_a_hand : float
        Squared distance of its hand from what hands are like, in standard deviations, where both
        this and the misfit are least: a chi-square of five numbers, and in the score; zero where
        there is no hand.
    etfe : Etfe or None
        What it was fitted to: of some measurements each model makes its own.
    as_one_mass : bool
        Whether it is a grasped device that scores as one mass in a hand.
    """

    fit: Fit
    score: float
    from_a_hand: float = 0.0
    etfe: Etfe | None = field(default=None, repr=False)
    as_one_mass: bool = False

    @property
    def held(self) -> bool:
        """Whether somebody holds it."""
        return self.fit.model.held
