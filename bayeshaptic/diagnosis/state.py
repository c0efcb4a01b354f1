"""What the loop knows at one moment, and what trying an effect gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.effects.nonlinear.protocol import Acting
from bayeshaptic.inference.fit import Fit, summarise
from bayeshaptic.inference.least_squares import polish
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.models import Model
from bayeshaptic.models.model import Extension
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Complexes, Floats

# Windows are dealt out in turn: half of them to fit, a quarter to choose, a quarter to report on.
FIT, CHOOSE, REPORT = (0, 2), (1,), (3,)
# Under feedback nothing can be held out: a window by itself is biased, only the sum over all of
# them is not. This share of a gain on all windows then counts as that on the quarter to choose by.
_HELD_OUT = 0.25


@dataclass(frozen=True)
class Estimate:
    """A number that belongs to an effect.

    Attributes
    ----------
    mean, sd : float
    unit : str
    """

    mean: float
    sd: float
    unit: str


@dataclass(frozen=True)
class Change:
    """What an accepted effect changed, so that it can be taken out again.

    Attributes
    ----------
    effect : Extension or None
        What it added to the model.
    acting : Acting or None
        The force that was simulated.
    force, position : complex ndarray, shape (L,)
        What it took off the spectra.
    command, motion : ndarray, shape (N,)
        What it took off the recording.
    """

    effect: Extension | None = None
    acting: Acting | None = None
    force: Complexes | float = 0.0
    position: Complexes | float = 0.0
    command: Floats | float = 0.0
    motion: Floats | float = 0.0


@dataclass(frozen=True)
class Accepted:
    """An effect that became part of the explanation.

    Attributes
    ----------
    name, title, family : str
    evidence : str
        Why it was accepted, in words and numbers.
    estimates : mapping
        Parameters that are not in the model's posterior (of nonlinear, time-varying and
        measurement effects): name to estimate.
    parameters : tuple of str
        Names of its parameters in the model, for linear effects.
    ties : tuple of str
        Effects that this recording cannot tell from it.
    probabilities : mapping
        Of itself and of its rivals, by name, where the limit is averaged over them.
    told_apart_by : str
        The measurement that would.
    limit_log_sd : float
        What the uncertainty of the effect adds to log K_CR, as a standard deviation.
    limit_log_fall : float
        How much lower still log K_CR is if a drift goes on as it does between the parts.
    limit_log_further : float
        How much lower it may go after the recording, where the device was still changing.
    change : Change or None
        None where it cannot be taken out by itself.
    """

    name: str
    title: str
    family: str
    evidence: str
    estimates: Mapping[str, Estimate] = field(default_factory=dict)
    parameters: tuple[str, ...] = ()
    ties: tuple[str, ...] = ()
    probabilities: Mapping[str, float] = field(default_factory=dict)
    told_apart_by: str = ""
    limit_log_sd: float = 0.0
    limit_log_fall: float = 0.0
    limit_log_further: float = 0.0
    change: Change | None = field(default=None, repr=False, compare=False)

    @property
    def acts(self) -> bool:
        """Is it a force, whose motion is simulated?"""
        return self.change is not None and self.change.acting is not None


@dataclass(frozen=True)
class State:
    """Measurement, model and fit as the loop has them now.

    Attributes
    ----------
    etfe : Etfe
        With what nonlinear and measurement effects add taken off.
    fit : Fit
        To all windows.
    accepted : tuple of Accepted
    """

    etfe: Etfe
    fit: Fit
    accepted: tuple[Accepted, ...] = ()

    @property
    def model(self) -> Model:
        return self.fit.model

    @cached_property
    def errors(self) -> Floats:
        """Weighted rms on windows that took no part in the fit, and on all, shape (2,)."""
        return np.array([held_out_rms(self.fit, CHOOSE), np.sqrt(self.fit.reduced_chi_square)])


@dataclass(frozen=True)
class Trial:
    """A candidate effect, fitted on one part of the windows and judged on another.

    Attributes
    ----------
    accepted : Accepted
        What it would be.
    state : State
        What the loop would know with it.
    gain_fit, gain_choose : float
        Gain in log likelihood on the windows that it was fitted to, and on those it was not.
    size : int
        Number of its parameters.
    all_along : bool
        Whether it explains what was seen in all of the recording: of another drift than it is, the
        worst part alone may leave nothing.
    """

    accepted: Accepted
    state: State
    gain_fit: float
    gain_choose: float
    size: int
    all_along: bool = True

    @property
    def name(self) -> str:
        return self.accepted.name

    @property
    def score(self) -> float:
        """What candidates are ranked by: held-out gain less what a parameter must bring."""
        return self.gain_choose - thresholds.A_PARAMETER * self.size

    @property
    def convincing(self) -> bool:
        """Does it predict what it was not fitted to?"""
        return thresholds.convincing(self.gain_fit, self.gain_choose, self.size)


def worth(fit: Fit) -> float:
    """Log likelihood on all windows, less half the log of their number for each effect parameter.

    G. Schwarz, "Estimating the dimension of a model", Annals of Statistics 6, 1978.
    """
    value = Likelihood(fit.model, fit.windows)(fit.theta[None])[0]
    return float(value) - cost(fit)


def cost(fit: Fit) -> float:
    """What `worth` takes off for the parameters of effects."""
    own = sum(len(effect.parameters) for effect in fit.model.effects)
    return 0.5 * float(np.log(len(fit.windows.scatter))) * own


def share(windows: Windows, parts: tuple[int, ...]) -> NDArray[np.bool_]:
    """Which windows, (W,), are in the given parts of every four; all by the direct method."""
    if windows.noise is not None:
        return np.ones(len(windows.scatter), bool)
    return np.isin(np.arange(len(windows.scatter)) % 4, parts)


def fit_part(model: Model, windows: Windows, theta: Floats) -> Floats:
    """The vector, shape (P,), that fits the windows to fit best, near `theta`."""
    return polish(model, windows.part(share(windows, FIT)), theta)


def log_likelihoods(model: Model, windows: Windows, theta: Floats) -> Floats:
    r"""Log likelihood of one vector on the windows to fit and on those to choose by, shape (2,).

    Where a model is far off, what is left acts as noise of that size, and a gain that is small
    beside it says nothing.  With c >= 1 the factor on the noise variance that suits the windows to
    fit best, those to choose by are judged with the same c:

    .. math:: \log p = -\sum (n-1) \log(s_0 + |z - R g|^2 / c) + k \log c

    in the terms of `Likelihood`, k the nodes of a window; at c = 1 that is `Likelihood` itself.
    Where feedback hides the noise, on all windows, and a quarter of that.
    """
    if windows.noise is not None:
        likelihood = Likelihood(model, windows)(theta[None])[0]
        return np.array([1.0, _HELD_OUT]) * likelihood
    power, freedom, c = _noise_with(model, windows, theta)
    nodes = windows.target.shape[1]
    pointwise = -freedom * np.log(windows.scatter + power / c) - nodes * np.log(c)
    pointwise += windows.offset
    return np.array([pointwise[share(windows, part)].sum() for part in (FIT, CHOOSE)])


def weights(model: Model, windows: Windows, theta: Floats) -> tuple[Floats, Floats]:
    """What a squared deviation and what scatter count in `log_likelihoods` near a vector, (W,).

    Their sum with these weights touches that likelihood from below: who makes it less raises that
    (K. Lange, D. Hunter and I. Yang, Journal of Computational and Graphical Statistics 9, 2000).
    """
    if windows.noise is not None:
        return np.asarray(1 / windows.noise), np.asarray(1 / windows.noise)
    power, freedom, c = _noise_with(model, windows, theta)
    weight = np.asarray(freedom / (c * windows.scatter + power))
    return weight, c * weight


def _noise_with(model: Model, windows: Windows, theta: Floats) -> tuple[Floats, Floats, float]:
    """|z - R g|^2 and degrees of freedom of each window, and the factor on its noise variance."""
    left = Likelihood(model, windows).deviations(theta[None])[0]
    power = np.sum(np.abs(left) ** 2, axis=1)
    fitted, freedom = share(windows, FIT), windows.lines - 1
    c = _noise_factor(power[fitted], windows.scatter[fitted], freedom[fitted], left.shape[1])
    return power, freedom, c


def _noise_factor(power: Floats, scatter: Floats, freedom: Floats, nodes: int) -> float:
    """The most likely factor, at least 1, on the noise variance of all windows."""

    def surplus(log_c: float) -> float:  # the likelihood's slope, which falls
        return float(np.sum(freedom * power / (np.exp(log_c) * scatter + power) - nodes))

    if not surplus(0.0) > 0:  # nor where a motion ran away, and all of this is nan
        return 1.0
    highest = float(np.log(np.max(freedom * power / scatter)))  # where every term is negative
    return float(np.exp(brentq(surplus, 0.0, max(highest, 1.0))))


def held_out_rms(fit: Fit, part: tuple[int, ...] = REPORT) -> float:
    """Weighted rms on a quarter of the windows, with the model fitted to the others; 1 is noise."""
    out = share(fit.windows, part)
    theta = polish(fit.model, fit.windows.part(~out), fit.theta)
    left = Likelihood(fit.model, fit.windows.part(out)).normalised(theta[None])[0]
    return float(np.sqrt(np.mean(np.abs(left) ** 2)))


def compared_errors(before: State, after: State) -> tuple[Floats, Floats]:
    """Weighted rms of two states on windows that took no part in the fit, and on all, (2,) each.

    On both, because a quarter of the windows may get better at the expense of the others.  A force
    that was taken off a recording was part of its noise, and so were samples that were mended:
    beside the little noise that they leave, what the model lacks may stand out further than all of
    it did before.  Both are fitted and weighed with the noise that was there before.
    """
    if after.accepted[-1].family in ("nonlinear", "measurement"):
        fit, windows = after.fit, after.fit.windows
        known, at = (w.frequency_hz.mean(axis=1) for w in (before.fit.windows, windows))
        there, own = (f.likelihood.noise_variance for f in (before.fit, fit))
        there = there if np.array_equal(known, at) else np.interp(at, known, there)
        louder = replace(windows, scatter=windows.scatter * there / own)
        fit = summarise(fit.model, louder, polish(fit.model, louder, fit.theta))
        after = replace(after, fit=fit)
    return before.errors, after.errors


def describe_gain(gain: float) -> str:
    """The held-out gain in words."""
    return f"raises the log likelihood of windows it was not fitted to by {gain:.0f}"
