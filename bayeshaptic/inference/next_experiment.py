r"""What to measure next: how far a further recording would narrow a prediction.

Of a prediction with the gradient g in the sampled coordinates the posterior leaves, to first
order, the variance :math:`g^T (F + \Lambda)^{-1} g`, F the Fisher information of the recording's
likelihood and :math:`\Lambda` the precision of the priors.  A further recording adds its own
information, which is known before it is made: that of the windows of this one, multiplied and added
up anew.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.arguments import at_the_door
from bayeshaptic.errors import InputError
from bayeshaptic.inference.coordinates import Coordinates, coordinates
from bayeshaptic.inference.fit import Fit, weighted_residuals
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.models.model import Model
from bayeshaptic.models.structures import HAND, chain
from bayeshaptic.numerics.gauss_newton import jacobian
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class Experiment:
    """One further recording, as long as the one at hand.

    Attributes
    ----------
    name : {"again", "louder", "band", "another user", "no user"}
    title : str
        In words, for example "the same again (twice as long)".
    log_sd : float
        Predicted standard deviation of the prediction (of ln K_CR) with both recordings.
    ratio : float
        That over the present one: 0.7 is three tenths narrower.
    """

    name: str
    title: str
    log_sd: float
    ratio: float


@dataclass(frozen=True)
class Information:
    """What one recording says about the coordinates of its model.

    Attributes
    ----------
    model : Model
    here : Coordinates
    theta : ndarray, shape (P,)
    slopes : ndarray, shape (W, N, P)
        Derivative of the normalised residuals of each window.
    lines : ndarray, shape (W,)
        DFT lines of each window.
    frequency_hz : ndarray, shape (W,)
    noise_scale : float
        Factor on the noise variance.
    """

    model: Model
    here: Coordinates
    theta: Floats
    slopes: Floats
    lines: Floats
    frequency_hz: Floats
    noise_scale: float = 1.0

    def fisher(self, weights: Floats | float = 1.0) -> Floats:
        """Fisher information with each window's power times `weights`, shape (P, P)."""
        weighted = self.slopes * np.broadcast_to(weights, len(self.slopes))[:, None, None]
        return np.einsum("wnp,wnq->pq", weighted, self.slopes) / self.noise_scale

    def prior_precision(self) -> Floats:
        """Of normal priors with the spread of the true ones, shape (P, P)."""
        priors = [self.model.prior(name) for name in self.model.names]
        ends = np.array([[float(p.quantile(q)) for p in priors] for q in (0.16, 0.84)])
        low, high = self.here.coordinate(ends)
        return np.diag((0.5 * (high - low)) ** -2.0)

    def gradient(self, slopes: Mapping[str, float]) -> Floats:
        """From d ln K / d p by name to the coordinates, shape (P,)."""
        slope = np.array([slopes.get(name, 0.0) for name in self.model.names])
        return slope * np.where(self.here.log, self.theta, self.here.scale)


def information(fit: Fit, noise_scale: float = 1.0) -> Information:
    """What the recording of a fit says, at its parameters.

    Parameters
    ----------
    fit : Fit
    noise_scale : float
        Factor on the noise variance, where the model misfits.
    """
    return _information(fit.model, fit, fit.theta, noise_scale)


@at_the_door
def next_experiment(
    fit: Fit,
    slopes: Sequence[tuple[Mapping[str, float], float]],
    crossing_hz: float | None = None,
    noise_scale: float = 1.0,
) -> tuple[Experiment, ...]:
    """Further recordings by how far they would narrow the critical stiffness, the best first.

    Parameters
    ----------
    fit : Fit
    slopes : sequence of (mapping, float)
        d ln K_CR / d p by name at each crossing that may bind, and the crossing's probability: see
        `bayeshaptic.elasticities`.
    crossing_hz : float, optional
        Frequency of the most probable crossing: the force may be concentrated around it.
    noise_scale : float
        Factor on the noise variance, where the model misfits.

    Returns
    -------
    tuple of Experiment
        What is said is to first order around the fit, with noise that the excitation does not
        change, and of the model: nothing that the model lacks is narrowed by more data.

    References
    ----------
    L. Pronzato, "Optimal experimental design and some related control problems", Automatica 44(2),
    2008: c-optimality.
    """
    known = information(fit, noise_scale)
    fisher, prior = known.fisher(), known.prior_precision()
    if not slopes:
        raise InputError("slopes is empty; give at least one pair of slopes and their share")
    gradients = [(known.gradient(slope), share) for slope, share in slopes]

    def spread(total: Floats) -> float:
        covariance = np.linalg.inv(total + prior)
        return float(np.sqrt(sum(share * g @ covariance @ g for g, share in gradients)))

    now = spread(fisher)
    if not now > 0:
        raise InputError(
            f"slopes are of none of the fit's parameters, {', '.join(fit.model.names)}"
        )
    found = []
    for name, title, added in _experiments(known, fit, fisher, prior, crossing_hz):
        after = spread(fisher + added)
        found.append(Experiment(name, title, after, after / now))
    return tuple(sorted(found, key=lambda experiment: experiment.ratio))


def _experiments(
    known: Information, fit: Fit, fisher: Floats, prior: Floats, crossing_hz: float | None
) -> list[tuple[str, str, Floats]]:
    """Name, title and added information of every further recording that can be judged."""
    found = [
        ("again", "the same again (twice as long)", fisher),
        ("louder", "one more with twice the force", 4 * fisher),
    ]
    if crossing_hz:
        octave = 2**0.5  # half an octave to either side of a crossing
        low, high = crossing_hz / octave, crossing_hz * octave
        inside = (known.frequency_hz >= low) & (known.frequency_hz <= high)
        fewest = 6  # windows in that band
        if inside.sum() >= fewest and not inside.all():
            louder = known.lines.sum() / known.lines[inside].sum()
            title = f"one more with all of its power from {low:.3g} to {high:.3g} Hz"
            found.append(("band", title, known.fisher(np.where(inside, louder, 0.0))))
    if known.model.held:
        device = np.array([name not in HAND for name in known.model.names])
        found.append(
            ("another user", "one more with another user", _without_hand(fisher, prior, device))
        )
        free = _free_information(known, fit)
        if free is not None:
            title = "one more with nobody holding the device"
            found.append(("no user", title, free))
    return found


def _without_hand(fisher: Floats, prior: Floats, device: NDArray[np.bool_]) -> Floats:
    """What a like recording says of the device when its hand is a stranger's, (P, P)."""
    hand = ~device
    inner = (fisher + prior)[np.ix_(hand, hand)]
    across = fisher[np.ix_(device, hand)]
    added = np.zeros_like(fisher)
    part = fisher[np.ix_(device, device)] - across @ np.linalg.solve(inner, across.T)
    added[np.ix_(device, device)] = part
    return added


def _free_information(known: Information, fit: Fit) -> Floats | None:
    """The same force on the device with nobody holding it; None with effects inside the model."""
    model = known.model
    if model.effects:
        return None
    kept = np.array([name not in HAND for name in model.names])
    parameters = tuple(p for p, keep in zip(model.parameters, kept, strict=True) if keep)
    free = replace(model, structure=chain(model.structure.modes), parameters=parameters)
    said = _information(free, fit, known.theta[kept], known.noise_scale)
    added = np.zeros((model.size, model.size))
    added[np.ix_(kept, kept)] = said.fisher()
    return added


def _information(model: Model, fit: Fit, theta: Floats, noise_scale: float) -> Information:
    here = coordinates(model)
    likelihood = Likelihood(model, fit.windows)
    residuals: Callable[[Floats], Floats] = weighted_residuals(likelihood, here)
    slopes = jacobian(residuals, here.coordinate(theta[None]))[0]
    count, nodes = fit.windows.target.shape
    return Information(
        model,
        here,
        theta,
        slopes.reshape(count, 2 * nodes, model.size),
        fit.windows.lines,
        fit.windows.frequency_hz.mean(axis=1),
        noise_scale,
    )
