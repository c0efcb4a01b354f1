"""What the loop knows at one moment, and what trying an effect gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.inference.least_squares import Fit
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.models import Model
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Floats

# Windows are dealt out in turn: half of them to fit, a quarter to choose, a quarter to report on.
FIT, CHOOSE, REPORT = (0, 2), (1,), (3,)


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
    told_apart_by : str
        The measurement that would.
    limit_log_sd : float
        What the uncertainty of the effect adds to log K_CR, as a standard deviation.
    limit_log_fall : float
        How much lower still log K_CR is if a drift goes on as it does between the parts.
    """

    name: str
    title: str
    family: str
    evidence: str
    estimates: Mapping[str, Estimate] = field(default_factory=dict)
    parameters: tuple[str, ...] = ()
    ties: tuple[str, ...] = ()
    told_apart_by: str = ""
    limit_log_sd: float = 0.0
    limit_log_fall: float = 0.0


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
    """

    accepted: Accepted
    state: State
    gain_fit: float
    gain_choose: float
    size: int

    @property
    def name(self) -> str:
        return self.accepted.name

    @property
    def score(self) -> float:
        """What candidates are ranked by: held-out gain less two a parameter."""
        return self.gain_choose - 2.0 * self.size

    @property
    def convincing(self) -> bool:
        """Does it predict what it was not fitted to?

        The windows to choose by are half as many as those to fit, so that half of the gain is
        what a true effect brings; an overfit one brings next to nothing.
        """
        return self.gain_choose > 8.0 and self.gain_choose > 0.15 * self.gain_fit


def share(windows: Windows, parts: tuple[int, ...]) -> NDArray[np.bool_]:
    """Which windows belong to the given parts of every four."""
    return np.isin(np.arange(len(windows.scatter)) % 4, parts)


def log_likelihoods(model: Model, windows: Windows, theta: Floats) -> tuple[float, float]:
    """Log likelihood of one vector on the windows to fit and on those to choose by."""
    pointwise = Likelihood(model, windows).pointwise(theta[None])[0]
    return (
        float(pointwise[share(windows, FIT)].sum()),
        float(pointwise[share(windows, CHOOSE)].sum()),
    )


def describe_gain(gain: float, extra: Any = "") -> str:
    """The held-out gain in words."""
    return f"raises the log likelihood of windows it was not fitted to by {gain:.0f}{extra}"
