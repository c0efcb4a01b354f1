"""Models as plain JSON, so that a saved posterior brings its model along."""

from __future__ import annotations

from dataclasses import asdict, fields
from typing import Any

from bayeshaptic.devices import Device
from bayeshaptic.effects.library import effect_class
from bayeshaptic.errors import InputError
from bayeshaptic.models import (
    HalfNormal,
    LogNormal,
    LogUniform,
    MaybeZero,
    Model,
    NearZero,
    Normal,
    Parameter,
    Uniform,
)
from bayeshaptic.models.structures import structure_named

_PRIORS: dict[str, type] = {
    kind.__name__: kind
    for kind in (HalfNormal, LogNormal, LogUniform, MaybeZero, NearZero, Normal, Uniform)
}


def model_to_dict(model: Model) -> dict[str, Any]:
    """Everything that defines `model`, as plain JSON types.

    Raises
    ------
    InputError
        If a prior is of the user's own class or not set yet, or an effect holds something that
        could not be read back.
    """
    return {
        "structure": model.name,
        "parameters": [_parameter_to_dict(parameter) for parameter in model.parameters],
        "fixed": dict(model.fixed),
        "period_s": model.period_s,
        "reference": dict(model.reference),
        "force_unit": model.force_unit,
        "position_unit": model.position_unit,
        "device": asdict(model.device) if model.device else None,
        "effects": [effect_to_dict(effect) for effect in model.effects],
    }


def model_from_dict(data: dict[str, Any]) -> Model:
    """The model that `model_to_dict` described."""
    device = data["device"]
    return Model(
        structure_named(data["structure"]),
        tuple(_parameter_from_dict(entry) for entry in data["parameters"]),
        data["fixed"],
        data["period_s"],
        data["reference"],
        data["force_unit"],
        data["position_unit"],
        device=_device_from_dict(device) if device else None,
        effects=tuple(effect_from_dict(entry) for entry in data["effects"]),
    )


def _device_from_dict(data: dict[str, Any]) -> Device:
    """The device; JSON knows no tuples, and one with lists is not equal to what was saved."""
    tuples = {key: tuple(value) for key, value in data.items() if isinstance(value, list)}
    return Device(**{**data, **tuples})


def effect_to_dict(effect: Any) -> dict[str, Any]:
    """An effect as plain JSON types: its name, its fields, its parameters with their priors.

    Raises
    ------
    InputError
        If a field is none of a number, a text, a truth value, None, or a tuple of such.
    """
    options = {f.name: getattr(effect, f.name) for f in fields(effect) if f.name != "parameters"}
    for name, value in options.items():
        if not _plain(value):
            raise InputError(
                f"the effect {effect.name} cannot be saved: its {name} is a {type(value).__name__}."
            )
    parameters = [_parameter_to_dict(parameter) for parameter in effect.parameters]
    return {"name": effect.name, "options": options, "parameters": parameters}


def effect_from_dict(data: dict[str, Any]) -> Any:
    """The effect that `effect_to_dict` described, through the registry.

    Raises
    ------
    InputError
        If no effect of that name is installed.
    """
    try:
        kind = effect_class(data["name"])
    except InputError:
        raise InputError(
            f"the posterior was made with the effect {data['name']!r}, which is not installed."
        ) from None
    options = {name: _as_tuple(value) for name, value in data["options"].items()}
    return kind(parameters=tuple(map(_parameter_from_dict, data["parameters"])), **options)


def _plain(value: Any) -> bool:
    if isinstance(value, tuple | list):
        return all(_plain(entry) for entry in value)
    return value is None or isinstance(value, str | int | float | bool)


def _as_tuple(value: Any) -> Any:
    return tuple(_as_tuple(entry) for entry in value) if isinstance(value, list) else value


def _parameter_to_dict(parameter: Parameter) -> dict[str, Any]:
    kind = type(parameter.prior).__name__
    if kind not in _PRIORS:
        raise InputError(
            f"the prior of {parameter.name} is a {kind}; only {', '.join(sorted(_PRIORS))} "
            "can be saved."
        )
    prior = {"kind": kind, **asdict(parameter.prior)}  # type: ignore[call-overload]
    return {
        "name": parameter.name,
        "dimension": parameter.dimension,
        "title": parameter.title,
        "prior": prior,
    }


def _parameter_from_dict(data: dict[str, Any]) -> Parameter:
    prior = dict(data["prior"])
    kind = _PRIORS[prior.pop("kind")]
    return Parameter(data["name"], data["dimension"], data["title"], kind(**prior))
