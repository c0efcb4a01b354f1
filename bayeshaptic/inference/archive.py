"""Models as plain JSON, so that a saved posterior brings its model along."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

from bayeshaptic.devices import Device
from bayeshaptic.errors import InputError
from bayeshaptic.models import HalfNormal, LogNormal, LogUniform, Model, Normal, Parameter, Uniform
from bayeshaptic.models.structures import STRUCTURES

_PRIORS: dict[str, type] = {
    kind.__name__: kind for kind in (HalfNormal, LogNormal, LogUniform, Normal, Uniform)
}


def model_to_dict(model: Model) -> dict[str, Any]:
    """Everything that defines `model`, as plain JSON types.

    Raises
    ------
    InputError
        If a prior is of the user's own class: it could not be read back.
    """
    parameters = []
    for parameter in model.parameters:
        prior = model.prior(parameter.name)
        kind = type(prior).__name__
        if kind not in _PRIORS:
            raise InputError(
                f"the prior of {parameter.name} is a {kind}; only {', '.join(sorted(_PRIORS))} "
                "can be saved."
            )
        entry = {"name": parameter.name, "dimension": parameter.dimension}
        entry |= {"title": parameter.title, "prior": {"kind": kind, **asdict(prior)}}  # type: ignore
        parameters.append(entry)
    return {
        "structure": model.name,
        "parameters": parameters,
        "fixed": dict(model.fixed),
        "period_s": model.period_s,
        "reference": dict(model.reference),
        "force_unit": model.force_unit,
        "position_unit": model.position_unit,
        "device": asdict(model.device) if model.device else None,
        "effects": [effect.name for effect in model.effects],
    }


def model_from_dict(data: dict[str, Any]) -> Model:
    """The model that `model_to_dict` described."""
    parameters = []
    for entry in data["parameters"]:
        prior = dict(entry["prior"])
        kind = _PRIORS[prior.pop("kind")]
        parameters.append(
            Parameter(entry["name"], entry["dimension"], entry["title"], kind(**prior))
        )
    device = data["device"]
    model = Model(
        STRUCTURES[data["structure"]],
        tuple(parameters),
        data["fixed"],
        data["period_s"],
        data["reference"],
        data["force_unit"],
        data["position_unit"],
        device=Device(**device) if device else None,
    )
    return replace(model, effects=tuple(_effect(name) for name in data["effects"]))


def _effect(name: str) -> Any:
    raise InputError(f"the posterior was made with the effect {name!r}, which is not installed.")
