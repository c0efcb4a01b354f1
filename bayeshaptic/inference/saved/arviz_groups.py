"""Posteriors in ArviZ's data format, in versions 0.x and 1.x.

ArviZ 0.x keeps an InferenceData and takes groups as keywords; 1.x keeps an xarray DataTree and
takes a dictionary of groups.  Given the other's form, 0.x fails silently.
"""

from __future__ import annotations

import importlib
import json
import os
import warnings
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Protocol

import numpy as np

from bayeshaptic.errors import refuse_place
from bayeshaptic.inference.diagnostics import Diagnostics
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.inference.saved.archive import model_to_dict
from bayeshaptic.inference.saved.netcdf import Group, Variable, dataset, write
from bayeshaptic.models import Model, draw
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Floats

_CACHE = "XDG_CACHE_HOME"  # below it programs write what they may lose, on Linux
MARK = "bayeshaptic"
TOTAL = "total_log_likelihood"
"""In `sample_stats`: of the whole measurement, where ArviZ expects one for each observation."""


class Sampled(Protocol):
    """The part of a `Posterior` that is written; its attributes are described there."""

    @property
    def model(self) -> Model: ...
    @property
    def chains(self) -> Floats: ...
    @property
    def log_likelihood(self) -> Floats: ...
    @property
    def diagnostics(self) -> Diagnostics: ...
    @property
    def converged(self) -> bool: ...
    @property
    def message(self) -> str: ...
    @property
    def seconds(self) -> float: ...
    @property
    def seed(self) -> int: ...
    @property
    def windows(self) -> Windows | None: ...
    @property
    def etfe(self) -> Etfe | None: ...


def to_arviz(posterior: Sampled) -> Any:
    """The posterior as ArviZ keeps it.

    Each ensemble is a chain, and its walkers follow each other in it, each in the order of time:
    ArviZ's R-hat then compares what began apart, as ours does, and its effective draws see what
    each walker repeats.  Those of the report stand in the attributes ``rhat`` and
    ``effective_draws`` of each variable.

    Groups: ``posterior`` (a variable a parameter, its unit in ``attrs["units"]``),
    ``sample_stats`` (total log likelihood), ``prior``, and, where the measurement is at hand,
    ``log_likelihood`` (a window each), ``observed_data``, ``posterior_predictive`` and
    ``prior_predictive`` (real and imaginary part of the response, noise included), and
    ``constant_data`` (the noise's sd).

    Parameters
    ----------
    posterior : Posterior

    Returns
    -------
    arviz.InferenceData (0.x) or xarray.DataTree (1.x)
    """
    az = import_arviz()
    groups = {name: dataset(group) for name, group in _groups(posterior).items()}
    if int(az.__version__.split(".")[0]) < 1:  # 1.x has the old name too, but not the old thing
        return az.InferenceData(**groups)
    import xarray

    return xarray.DataTree.from_dict(groups)


def import_arviz() -> Any:
    """The arviz module, without its once-a-day advertisement of the next version.

    It writes down when it was advertised, and fails to be imported where another process does so at
    the same moment, or where nobody may write: then once more, with a place of its own for that.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)
        try:
            return importlib.import_module("arviz")
        except OSError:
            before = os.environ.get(_CACHE)
        with TemporaryDirectory() as own:
            os.environ[_CACHE] = own
            try:
                return importlib.import_module("arviz")
            finally:
                del os.environ[_CACHE]
                if before is not None:
                    os.environ[_CACHE] = before


def save_posterior(posterior: Sampled, path: Path) -> Path:
    """Write `posterior` as netCDF; an InputError where it cannot be written there."""
    refuse_place(path, "posterior.nc")
    write(_groups(posterior), path)
    return path


def as_chains(values: Floats) -> Floats:
    """(ensembles, steps, walkers, ...) to (chain, draw, ...), walker by walker."""
    moved = np.moveaxis(values, 2, 1)
    return moved.reshape(len(moved), -1, *moved.shape[3:])


def from_chains(values: Floats, walkers: int) -> Floats:
    """What `as_chains` was given."""
    return np.moveaxis(values.reshape(len(values), walkers, -1, *values.shape[2:]), 1, 2)


def _groups(posterior: Sampled) -> dict[str, Group]:
    """The groups, alike for the file and for both versions."""
    model = posterior.model
    chains = as_chains(posterior.chains)
    draws = _numbered(chains)
    rng = np.random.default_rng(posterior.seed)
    prior_draws = 2000
    prior = np.stack([draw(model.prior(n), rng, prior_draws) for n in model.names], axis=-1)[None]
    level = Variable(("chain", "draw"), as_chains(posterior.log_likelihood))
    groups = {
        "posterior": Group(_sampled(posterior, chains), draws, _about(posterior)),
        "sample_stats": Group({TOTAL: level}, draws),
        "prior": Group(_parameters(posterior, prior), _numbered(prior)),
    }
    if posterior.windows is not None:
        groups["log_likelihood"] = _pointwise(posterior)
    if posterior.etfe is not None:
        groups |= _predictive(posterior, prior, rng)
    return groups


def _numbered(values: Floats) -> dict[str, Variable]:
    """Numbers of the chains and draws of values of shape (chain, draw, ...)."""
    return {
        name: Variable((name,), np.arange(size))
        for name, size in zip(("chain", "draw"), values.shape[:2], strict=True)
    }


def _parameters(posterior: Sampled, values: Floats) -> dict[str, Variable]:
    """A variable a parameter, of values of shape (chain, draw, P)."""
    model = posterior.model
    return {
        name: Variable(
            ("chain", "draw"),
            values[..., i],
            {"units": model.unit(name), "long_name": model.parameter(name).title},
        )
        for i, name in enumerate(model.names)
    }


def _sampled(posterior: Sampled, values: Floats) -> dict[str, Variable]:
    """The same with R-hat and effective draws as the report has them."""
    found = _parameters(posterior, values)
    known = posterior.diagnostics
    least = np.minimum(known.ess_bulk, known.ess_tail)
    return {
        name: replace(
            variable,
            attributes={
                **variable.attributes,
                "rhat": float(known.rhat[i]),
                "effective_draws": float(least[i]),
            },
        )
        for i, (name, variable) in enumerate(found.items())
    }


def _about(posterior: Sampled) -> dict[str, Any]:
    about = {
        "model": model_to_dict(posterior.model),
        "walkers": posterior.chains.shape[2],
        "converged": posterior.converged,
        "message": posterior.message,
        "seconds": posterior.seconds,
        "seed": posterior.seed,
    }
    return {MARK: json.dumps(about), "inference_library": "emcee"}


def _thinned(posterior: Sampled) -> Floats:
    """The draws of which there is a likelihood and a prediction, shape (chain, draw, P).

    The same of both: ArviZ weighs the one by the other (``plot_loo_pit``).
    """
    count = 8  # of each walker: each is a whole response
    step = max(1, posterior.chains.shape[1] // count)
    return as_chains(posterior.chains[:, step - 1 :: step][:, :count])


def _pointwise(posterior: Sampled) -> Group:
    windows = posterior.windows
    assert windows is not None
    some = _thinned(posterior)
    values = Likelihood(posterior.model, windows).pointwise(some.reshape(-1, some.shape[2]))
    values = values.reshape(*some.shape[:2], -1)
    along = {
        "window": Variable(("window",), np.arange(values.shape[2])),
        "frequency_hz": Variable(("window",), windows.frequency_hz.mean(axis=1)),
    }
    response = Variable(("chain", "draw", "window"), values)
    return Group({"response": response}, _numbered(some) | along)


def _predictive(posterior: Sampled, prior: Floats, rng: np.random.Generator) -> dict[str, Group]:
    """The measured response, and what posterior and prior predict of it with its noise."""
    etfe = posterior.etfe
    assert etfe is not None
    before = 200  # draws of the prior: each is a whole response
    unit = {"units": f"{etfe.position_unit}/{etfe.force_unit}"}
    where = {"frequency": Variable(("frequency",), etfe.frequency_hz)}

    def predicted(theta: Floats) -> Group:
        response = posterior.model.response(
            theta.reshape(-1, theta.shape[2]), etfe.frequency_hz, measured=True
        )
        noise = rng.standard_normal((2, *response.shape)) * np.sqrt(etfe.variance / 2)
        shape, dims = (*theta.shape[:2], -1), ("chain", "draw", "frequency")
        parts = {"real": response.real + noise[0], "imag": response.imag + noise[1]}
        variables = {
            f"response_{name}": Variable(dims, part.reshape(shape), unit)
            for name, part in parts.items()
        }
        return Group(variables, _numbered(theta) | where)

    observed = {
        "response_real": Variable(("frequency",), etfe.value.real, unit),
        "response_imag": Variable(("frequency",), etfe.value.imag, unit),
    }
    sd = Variable(("frequency",), np.sqrt(etfe.variance), unit)
    return {
        "posterior_predictive": predicted(_thinned(posterior)),
        "prior_predictive": predicted(prior[:, :before]),
        "observed_data": Group(observed, where),
        "constant_data": Group({"response_sd": sd}, where),
    }
