"""Parameters and priors, mechanisms, the sampled response, and the rigid, free, grasped models."""

from bayeshaptic.models.build import build_model, chain, free, grasped, rigid
from bayeshaptic.models.model import Extension, Model
from bayeshaptic.models.parameter import Parameter
from bayeshaptic.models.prior import HalfNormal, LogNormal, LogUniform, Normal, Prior, Uniform, draw
from bayeshaptic.models.prior_of_zero import MaybeZero, NearZero
from bayeshaptic.models.prior_table import prior_from_table
from bayeshaptic.models.response.system import LinearSystem

__all__ = [
    "HalfNormal",
    "Extension",
    "LinearSystem",
    "LogNormal",
    "LogUniform",
    "Model",
    "MaybeZero",
    "NearZero",
    "Normal",
    "Parameter",
    "Prior",
    "Uniform",
    "build_model",
    "draw",
    "chain",
    "free",
    "grasped",
    "prior_from_table",
    "rigid",
]
