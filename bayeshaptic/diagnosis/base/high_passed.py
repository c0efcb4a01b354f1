"""Whether the position may have been high-passed before it was written down.

A drift is often taken off a position by a high-pass, in a logger or by hand.  One mass m under
viscous damping b is then recorded as 1/((m s + b)(s + w)), which is a mass on an overdamped spring
to the last digit, with a damping of b + m w: a hand, a second mass that hardly moves, or a spring
takes up what the filter did, and the limit, which goes with the damping, is that of a device that
nobody has.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayeshaptic.diagnosis.residuals.moved import left_of_position
from bayeshaptic.errors import Notice
from bayeshaptic.inference.choose import Choice
from bayeshaptic.inference.criterion import VERY_STRONG, information_criterion
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import LinearSystem, LogNormal, Model, Parameter
from bayeshaptic.quantities import quantity
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.types import Floats

TOPIC = "high-passed position"
_BASES = ("rigid", "free", "grasped")  # a longer chain has valleys enough without a filter
_CORNER = "high_pass_hz"
# Shares of the position, by rms: most that a filtered one leaves beside what the command does, and
# most of what the model without a filter leaves. 35 high-passed positions leave 0.003 to 0.058 of
# themselves; of five that were held, looked filtered by their response and were not, four leave
# 0.14 to 0.6 (docs/door.md).
_LITTLE, _HALF = 0.1, 0.5
_ROUNDED = 1e-3  # of a power of ten, as a logarithm
_LOG_SD = 1.5  # of the corner, around the lower end of the band: it only bounds the search


@dataclass(frozen=True)
class HighPass:
    """A Butterworth high-pass on the recorded position, which the loop does without.

    Attributes
    ----------
    parameters : tuple of Parameter
        The corner.
    order : int
        1 or 2.
    """

    parameters: tuple[Parameter, ...]
    order: int

    name: ClassVar[str] = "high_pass"

    @classmethod
    def around(cls, corner_hz: float, order: int) -> HighPass:
        """With a corner around `corner_hz`."""
        corner = Parameter(_CORNER, "frequency", "corner", LogNormal(corner_hz, _LOG_SD))
        return cls((corner,), order)

    def apply(self, system: LinearSystem, values: Mapping[str, Floats]) -> LinearSystem:
        """The system whose position is filtered; `values` holds the corner, shape (B,)."""
        lag = 1 / (2 * np.pi * values[_CORNER])
        none, one = np.zeros_like(lag), np.ones_like(lag)
        if self.order == 1:
            return system.with_filter(np.stack([none, lag]), np.stack([one, lag]))
        poles = np.stack([one, np.sqrt(2) * lag, lag**2])
        return system.with_filter(np.stack([none, none, lag**2]), poles)


def perhaps_high_passed(
    fit: Fit, etfe: Etfe, choice: Choice | None, as_recorded: Recording | None
) -> tuple[Notice, ...]:
    """A warning where a device whose position was high-passed explains more.

    A base model that is no larger than the fit's, with a high-pass on its position, leaves nothing
    but noise and has a lower limit, and the filter is worth its parameter.  Its information
    criterion is far better than that of the fit, of the same model; or it is better, or half of the
    motion that the fit leaves is gone, and next to nothing is left of the whole motion, which a
    hand would have moved slowly.  Whole counts of an encoder were not filtered, but a file may have
    rounded what was.  How often that is so: docs/door.md.

    Parameters
    ----------
    fit : Fit
        Of the model that is to be believed, with its effects.
    etfe : Etfe
        What it was fitted to.
    choice : Choice or None
        Where base models are found; None where a model was asked for.
    as_recorded : Recording or None
        Before anything was taken off its position, which are no counts after that.
    """
    recording = etfe.unbroken
    if recording is None or as_recorded is None or _are_counts(as_recorded):
        return ()
    filtered = [
        least_squares(model.with_effect(HighPass.around(etfe.band_hz[0], order)), etfe, most_sets=1)
        for model in _no_larger(fit, choice)
        for order in (1, 2)
    ]
    own = _limit(fit)
    better = [
        one
        for one in filtered
        if not one.misfits
        and _limit(one) < own
        and _explains_more(one, fit, recording)
        and _score(one) < _score(least_squares(_without_filter(one.model), etfe, most_sets=1))
    ]
    if not better:
        return ()
    found = min(better, key=_score)
    here, there = (quantity(k, fit.model.stiffness_unit) for k in (own, _limit(found)))
    text = (
        f"{found.model.name.capitalize()} explains the recording better than what was found does "
        f"if the position was high-passed, at {quantity(_corner_hz(found), 'Hz')}, before it was "
        f"written down, by a logger, or to take a drift off it. The filter looks like damping, or "
        f"like a hand; without it the limit would be {there}, for {here}."
    )
    return (Notice("warning", TOPIC, text),)


def _explains_more(filtered: Fit, fit: Fit, recording: Recording) -> bool:
    """Whether a filter beside the same device does, or one beside another that nobody holds."""
    if 2 * np.pi * _corner_hz(filtered) * recording.duration_s < 1:
        return False  # in so long a time it does nothing
    gain = _score(fit) - _score(filtered)
    if filtered.model.name == fit.model.name and gain > VERY_STRONG:
        return True
    left = left_of_position(filtered, recording)
    return left < _LITTLE and (gain > 0 or left < _HALF * left_of_position(fit, recording))


def _corner_hz(filtered: Fit) -> float:
    return float(filtered.theta[filtered.model.names.index(_CORNER)])


def _score(fit: Fit) -> float:
    return information_criterion(fit, noise=1.0)


def _are_counts(recording: Recording) -> bool:
    """Whether positions are multiples of what no file rounds to: of no power of ten, m or rad."""
    unit = increment_unit(recording.position)
    if unit is None:
        return False
    powers = np.log10([unit, np.degrees(unit)])
    return not np.any(np.abs(powers - np.round(powers)) < _ROUNDED)


def _no_larger(fit: Fit, choice: Choice | None) -> list[Model]:
    """Base models with the priors that they were fitted with, none larger than that of the fit."""
    if choice is not None:
        tried = [one.fit.model for name, one in choice.candidates.items() if name in _BASES]
        return [model for model in tried if model.size <= fit.model.size]
    asked = fit.model
    for effect in asked.effects:
        asked = asked.without_effect(effect)
    return [asked] if asked.name in _BASES else []


def _limit(fit: Fit) -> float:
    """The limit of the device without what was done to the record alone."""
    model, theta = fit.model, fit.theta
    if _CORNER in model.names:
        theta = np.delete(theta, model.names.index(_CORNER))
        model = _without_filter(model)
    return float(critical_stiffness(model, theta).value)


def _without_filter(model: Model) -> Model:
    return model.without_effect(model.effects[-1])
