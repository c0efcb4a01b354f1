"""The likelihood of a recording made in closed loop, in the form that fits and samplers take."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from bayeshaptic.inference.fit import AT_BOUND, CONVERGED, Fit
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.inference.time_domain.fit import MotionFit
from bayeshaptic.inference.time_domain.mass_in_loop import NAMES, SHARED
from bayeshaptic.inference.time_domain.widths.correlated import FREEDOM, SURELY
from bayeshaptic.models import Model
from bayeshaptic.recordings.response.etfe import Etfe, compress
from bayeshaptic.types import Complexes, Floats


@dataclass(frozen=True)
class MotionLikelihood:
    """log p(recording | theta) in what the fit of the motion keeps of it.

    A Student t density around the fitted values, of as many degrees of freedom as its covariance
    was estimated with (the limited-information likelihood of J.-Y. Kim, Journal of Econometrics
    107, 2002).

    Attributes
    ----------
    model : Model
        With the parameters `NAMES`, inferred or known.
    motion : MotionFit
    """

    model: Model
    motion: MotionFit

    @cached_property
    def _whiten(self) -> Floats:
        sd = self.motion.sd
        correlation = self.motion.covariance / np.outer(sd, sd) + 1e-9 * np.eye(len(sd))
        return np.asarray(np.linalg.inv(np.linalg.cholesky(correlation) * sd[:, None]))

    def _apart(self, theta: Floats) -> Floats:
        """Independent deviations of unit scale, shape (B, 5)."""
        inferred = dict(zip(self.model.names, theta.T, strict=True))
        values = [
            inferred[name] if name in inferred else np.full(len(theta), self.model.fixed[name])
            for name in NAMES
        ]
        return (np.stack(values, axis=1) - self.motion.values) @ self._whiten.T

    def normalised(self, theta: Floats) -> Complexes:
        """Deviations in the form of windows: E|.|^2 = 1/2, all real, shape (B, 5)."""
        return self._apart(theta) / np.sqrt(2) + 0j

    def __call__(self, theta: Floats) -> Floats:
        """Log likelihood of parameter vectors of shape (B, P); shape (B,)."""
        squares = np.sum(self._apart(theta) ** 2, axis=1)
        return -0.5 * (FREEDOM + SHARED) * np.log1p(squares / FREEDOM)


@dataclass(frozen=True, eq=False)
class InLoopFit(Fit):
    """A fit of the motion in the form of a fit of the response.

    `reduced_chi_square` is the error's power on each half with the other half's values, over the
    most that standard deviations account for; `windows` and `residual` are those of the response
    beside the model's, which feedback biases.

    Attributes
    ----------
    motion : MotionFit or None
    """

    motion: MotionFit | None = None

    @property
    def impossible(self) -> tuple[str, ...]:
        """Masses, and the delay, that end at a bound and that the motion puts beyond it.

        A delay that is known to a period or two ends below zero as easily as above it.
        """
        if self.motion is None:
            return super().impossible
        far = self.motion.values + SURELY * self.motion.sd < self.motion.inside
        beyond = {name for name, clear in zip(NAMES, far, strict=True) if clear}
        return tuple(name for name in super().impossible if name in beyond)

    @property
    def likelihood(self) -> MotionLikelihood:  # type: ignore[override]
        assert self.motion is not None
        return MotionLikelihood(self.model, self.motion)

    def at(self, theta: Floats) -> InLoopFit:
        return replace(self, theta=theta)


def in_loop_fit(model: Model, etfe: Etfe, motion: MotionFit, misfit: float) -> InLoopFit:
    """The fit of `model` whose `reduced_chi_square` is `misfit`."""
    kept = [NAMES.index(name) for name in model.names]
    theta = motion.inside[kept]
    support = np.array([model.prior(name).support for name in model.names])
    theta = np.clip(theta, support[:, 0], support[:, 1])
    windows = compress(etfe, partial(model.response, theta, measured=True))
    low = (motion.values[kept] < motion.inside[kept]) & (theta <= support[:, 0])
    outcome = {n: AT_BOUND if b else CONVERGED for n, b in zip(model.names, low, strict=True)}
    return InLoopFit(
        model,
        theta,
        motion.covariance[np.ix_(kept, kept)],
        outcome,
        misfit,
        float(MotionLikelihood(model, motion)(theta[None])[0]),
        windows,
        windows.frequency_hz.ravel(),
        Likelihood(model, windows).normalised(theta[None])[0].ravel(),
        1,
        motion,
    )
