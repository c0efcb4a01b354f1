"""Parameters after a force was taken off: wider by what its law leaves open.

The posterior takes the fitted force as exact.  It is not: its strength has an error, and its law is
an approximation.  Both act as a little more, or less, of the force would: they move the parameters
along the way that they went when it was taken off.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayeshaptic.diagnosis.state import Accepted
from bayeshaptic.diagnosis.traced import Traced, share_left
from bayeshaptic.diagnosis.widening.forces_left import forces_left
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.types import Floats


def with_law_error(
    posterior: Posterior, base: Fit, traced: Traced, seed: int = 0
) -> Posterior | None:
    """The posterior with the errors of the accepted laws; None where no force was taken off.

    Parameters
    ----------
    posterior : Posterior
        Given the fitted forces.
    base : Fit
        Of the model as declared: where nothing is known of the way to the accepted effects.
    traced : Traced
        With the fit of the model with what was found.
    seed : int
    """
    laws = [effect for effect in traced.state.accepted if effect.family == "nonlinear"]
    if not laws:
        return None
    fit, rng = traced.state.fit, np.random.default_rng([seed, 13])
    shape = posterior.chains.shape[:-1]
    sd = np.sqrt(sum(_relative_sd(law) ** 2 for law in laws))
    strength, rest = sd * rng.standard_normal(shape), rng.uniform(-1.0, 1.0, shape)
    bare = traced.without_forces or base
    known = dict(zip(bare.model.names, bare.theta, strict=True))
    moved = np.array(
        [
            value - known.get(name, value)
            for name, value in zip(fit.model.names, fit.theta, strict=True)
        ]
    )
    # What tests still see: in a loop each says it, elsewhere as a share of what they saw.
    if traced.state.etfe.direct:
        left = forces_left(fit, traced.after).parameters
    else:
        left = share_left(traced, "nonlinear") * moved
    lowest = np.array([posterior.model.prior(name).support[0] for name in posterior.names])
    far = strength[..., None] * moved + rest[..., None] * left
    chains = _by(posterior.chains, far, lowest)
    return replace(posterior, chains=chains)


def _by(chains: Floats, far: Floats, lowest: Floats) -> Floats:
    """The draws moved so far, ever less towards a bound: no device has a mass of zero."""
    above = chains - lowest
    with np.errstate(divide="ignore", invalid="ignore"):
        down = lowest + above * np.exp(np.minimum(far, 0.0) / above)
    bounded = np.isfinite(lowest) & (far < 0) & (above > 0)
    return np.where(bounded, down, np.maximum(chains + far, lowest))


def _relative_sd(law: Accepted) -> float:
    """The relative standard deviation of a force's strength, the first of its numbers."""
    strength = next(iter(law.estimates.values()))
    return strength.sd / abs(strength.mean) if strength.mean else 0.0
