"""Posteriors in ArviZ's data format, in versions 0.x and 1.x.

ArviZ 0.x keeps an InferenceData and takes groups as keywords; 1.x keeps an xarray DataTree and
takes a dictionary of groups.  Given the other's form, 0.x fails silently.
"""

from __future__ import annotations

import errno
import json
import os
import shutil
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from bayeshaptic.inference.archive import model_to_dict
from bayeshaptic.inference.arviz_statistics import arviz
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.models import Model, draw
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Floats

_PREDICTIVE_DRAWS = 4  # a walker: the response at every frequency is large
_LIKELIHOOD_DRAWS = 20  # a walker
_PRIOR_DRAWS = 2000
MARK = "bayeshaptic"


class Sampled(Protocol):
    """The part of a `Posterior` that is written; its attributes are described there."""

    @property
    def model(self) -> Model: ...
    @property
    def chains(self) -> Floats: ...
    @property
    def log_likelihood(self) -> Floats: ...
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
    """The posterior as ArviZ keeps it, each walker a chain.

    Groups: ``posterior`` (a variable a parameter, its unit in ``attrs["units"]``),
    ``sample_stats`` (log likelihood), ``prior``, and, where the measurement is at hand,
    ``log_likelihood`` (a window each), ``observed_data`` and ``posterior_predictive`` (real and
    imaginary part of the response, noise included).

    Returns
    -------
    arviz.InferenceData (0.x) or xarray.DataTree (1.x)
    """
    return _joined(_groups(posterior))


def _joined(groups: dict[str, Any]) -> Any:
    az = arviz()
    if int(az.__version__.split(".")[0]) < 1:  # 1.x has the old name too, but not the old thing
        return az.InferenceData(**groups)
    import xarray

    return xarray.DataTree.from_dict(groups)


def save_posterior(posterior: Sampled, path: Path) -> Path:
    """Write `posterior` as netCDF, first beside `path` and then in its place."""
    groups = _groups(posterior)
    # The HDF5 library does not survive a disk that fills up while it writes.
    needed = sum(group.nbytes for group in groups.values()) + (1 << 20)
    if shutil.disk_usage(path.absolute().parent).free < needed:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        _joined(groups).to_netcdf(str(temporary), engine="h5netcdf")
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
    return path


def _by_walker(values: Floats) -> Floats:
    """(ensembles, steps, walkers, ...) to (chain, draw, ...) with each walker a chain."""
    moved = np.moveaxis(values, 2, 1)
    return moved.reshape(-1, *moved.shape[2:])


def _groups(posterior: Sampled) -> dict[str, Any]:
    """The groups as xarray datasets, for both versions alike."""
    import xarray

    model = posterior.model
    by_walker = _by_walker(posterior.chains)
    chain = {"chain": np.arange(by_walker.shape[0])}
    draws = chain | {"draw": np.arange(by_walker.shape[1])}

    def dataset(values: Floats, coords: dict[str, Any]) -> Any:
        variables = {
            name: (("chain", "draw"), values[..., i], _attributes(posterior, name))
            for i, name in enumerate(model.names)
        }
        return xarray.Dataset(variables, coords)

    main = dataset(by_walker, draws)
    main.attrs |= _about(posterior)
    rng = np.random.default_rng(posterior.seed)
    prior = np.stack([draw(model.prior(n), rng, _PRIOR_DRAWS) for n in model.names], axis=-1)
    groups = {
        "posterior": main,
        "sample_stats": xarray.Dataset(
            {"log_likelihood": (("chain", "draw"), _by_walker(posterior.log_likelihood))}, draws
        ),
        "prior": dataset(prior[None], {"chain": [0], "draw": np.arange(_PRIOR_DRAWS)}),
    }
    if posterior.windows is not None:
        groups["log_likelihood"] = _pointwise(posterior, by_walker, chain)
    if posterior.etfe is not None:
        groups |= _predictive(posterior, by_walker, chain, rng)
    return groups


def _attributes(posterior: Sampled, name: str) -> dict[str, str]:
    parameter = posterior.model.parameter(name)
    return {"units": posterior.model.unit(name), "long_name": parameter.title}


def _about(posterior: Sampled) -> dict[str, Any]:
    about = {
        "model": model_to_dict(posterior.model),
        "ensembles": posterior.chains.shape[0],
        "converged": posterior.converged,
        "message": posterior.message,
        "seconds": posterior.seconds,
        "seed": posterior.seed,
    }
    return {MARK: json.dumps(about), "inference_library": "emcee"}


def _thinned(by_walker: Floats, count: int) -> Floats:
    step = max(1, by_walker.shape[1] // count)
    return by_walker[:, step - 1 :: step][:, :count]


def _pointwise(posterior: Sampled, by_walker: Floats, chain: dict[str, Any]) -> Any:
    import xarray

    assert posterior.windows is not None
    some = _thinned(by_walker, _LIKELIHOOD_DRAWS)
    values = Likelihood(posterior.model, posterior.windows).pointwise(
        some.reshape(-1, some.shape[2])
    )
    values = values.reshape(*some.shape[:2], -1)
    coords = chain | {
        "draw": np.arange(some.shape[1]),
        "window": np.arange(values.shape[2]),
        "frequency_hz": ("window", posterior.windows.frequency_hz.mean(axis=1)),
    }
    return xarray.Dataset({"response": (("chain", "draw", "window"), values)}, coords)


def _predictive(
    posterior: Sampled, by_walker: Floats, chain: dict[str, Any], rng: np.random.Generator
) -> dict[str, Any]:
    """The measured response, and what the posterior predicts of it with its noise."""
    import xarray

    etfe = posterior.etfe
    assert etfe is not None
    some = _thinned(by_walker, _PREDICTIVE_DRAWS)
    response = posterior.model.response(some.reshape(-1, some.shape[2]), etfe.frequency_hz)
    noise = rng.standard_normal((2, *response.shape)) * np.sqrt(etfe.variance / 2)
    shape = (*some.shape[:2], -1)
    unit = {"units": f"{etfe.position_unit}/{etfe.force_unit}"}
    dims = ("chain", "draw", "frequency")
    where = {"frequency": etfe.frequency_hz}
    predicted = {
        "response_real": (dims, (response.real + noise[0]).reshape(shape), unit),
        "response_imag": (dims, (response.imag + noise[1]).reshape(shape), unit),
    }
    observed = {
        "response_real": (("frequency",), etfe.value.real, unit),
        "response_imag": (("frequency",), etfe.value.imag, unit),
        "sd": (("frequency",), np.sqrt(etfe.variance), unit),
    }
    draws = chain | {"draw": np.arange(some.shape[1])}
    return {
        "posterior_predictive": xarray.Dataset(predicted, draws | where),
        "observed_data": xarray.Dataset(observed, where),
    }
