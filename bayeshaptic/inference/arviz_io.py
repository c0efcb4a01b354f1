"""The one place that knows ArviZ: its statistics, its data format, in versions 0.x and 1.x.

ArviZ 0.x keeps an InferenceData and takes groups as keywords; 1.x keeps an xarray DataTree and
takes a dictionary of groups.  Given the other's form, 0.x fails silently.
"""

from __future__ import annotations

import json
import os
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.inference.archive import model_from_dict, model_to_dict
from bayeshaptic.inference.diagnostics import diagnose
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.models import draw
from bayeshaptic.types import Floats

_PREDICTIVE_DRAWS = 4  # a walker: the response at every frequency is large
_LIKELIHOOD_DRAWS = 20  # a walker
_PRIOR_DRAWS = 2000
_MARK = "bayeshaptic"


def arviz() -> Any:
    """The arviz module, without its once-a-day advertisement of the next version."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)
        import arviz

    return arviz


def effective_sample_size(chains: Floats, method: str) -> float:
    """ArviZ's effective sample size, "bulk" or "tail" (5 % and 95 %), of chains (chain, draw)."""
    keywords = {"prob": (0.05, 0.95)} if method == "tail" else {}
    value = float(arviz().ess(chains, method=method, **keywords))
    return value if np.isfinite(value) else 0.0


def split_rhat(chains: Floats) -> float:
    """ArviZ's rank-normalised split R-hat of chains of shape (chain, draw)."""
    value = float(arviz().rhat(chains))
    return value if np.isfinite(value) else float("inf")


def to_arviz(posterior: Posterior) -> Any:
    """The posterior as ArviZ keeps it, each walker a chain.

    Groups: ``posterior`` (a variable a parameter, its unit in ``attrs["units"]``),
    ``sample_stats`` (log likelihood), ``prior``, and, where the measurement is at hand,
    ``log_likelihood`` (a window each), ``observed_data`` and ``posterior_predictive`` (real and
    imaginary part of the response, noise included).

    Returns
    -------
    arviz.InferenceData (0.x) or xarray.DataTree (1.x)
    """
    groups = _groups(posterior)
    az = arviz()
    if int(az.__version__.split(".")[0]) < 1:  # 1.x has the old name too, but not the old thing
        return az.InferenceData(**groups)
    import xarray

    return xarray.DataTree.from_dict(groups)


def save_posterior(posterior: Posterior, path: Path) -> Path:
    """Write `posterior` as netCDF, first beside `path` and then in its place."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        to_arviz(posterior).to_netcdf(str(temporary), engine="h5netcdf")
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)
    return path


def load_posterior(path: str | Path) -> Posterior:
    """Read a posterior that `Posterior.save` or a report wrote.

    Parameters
    ----------
    path : path
        A ``posterior.nc``.

    Returns
    -------
    Posterior
        As good as a fresh one for `critical_stiffness`; the measurement itself is not in it.

    Raises
    ------
    InputError
        If there is no such file, or it is not a posterior of this package.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such file; a report writes posterior.nc into its folder.")
    import xarray

    try:
        with xarray.open_dataset(path, group="posterior", engine="h5netcdf") as data:
            data.load()
        with xarray.open_dataset(path, group="sample_stats", engine="h5netcdf") as stats:
            stats.load()
        about = json.loads(data.attrs[_MARK])
    except (OSError, KeyError, ValueError) as problem:
        raise InputError(f"{path}: not a posterior of bayeshaptic ({problem}).") from None
    model = model_from_dict(about["model"])
    by_walker = np.stack([data[name].values for name in model.names], axis=-1)
    chains = _by_ensemble(by_walker, about["ensembles"])
    return Posterior(
        model,
        chains,
        _by_ensemble(stats["log_likelihood"].values, about["ensembles"]),
        diagnose(chains),
        about["converged"],
        about["message"],
        about["seconds"],
        about["seed"],
    )


def _by_walker(values: Floats) -> Floats:
    """(ensembles, steps, walkers, ...) to (chain, draw, ...) with each walker a chain."""
    moved = np.moveaxis(values, 2, 1)
    return moved.reshape(-1, *moved.shape[2:])


def _by_ensemble(values: Floats, ensembles: int) -> Floats:
    """The way back from `_by_walker`."""
    split = values.reshape(ensembles, -1, *values.shape[1:])
    return np.moveaxis(split, 1, 2)


def _groups(posterior: Posterior) -> dict[str, Any]:
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


def _attributes(posterior: Posterior, name: str) -> dict[str, str]:
    parameter = posterior.model.parameter(name)
    return {"units": posterior.model.unit(name), "long_name": parameter.title}


def _about(posterior: Posterior) -> dict[str, Any]:
    about = {
        "model": model_to_dict(posterior.model),
        "ensembles": posterior.chains.shape[0],
        "converged": posterior.converged,
        "message": posterior.message,
        "seconds": posterior.seconds,
        "seed": posterior.seed,
    }
    return {_MARK: json.dumps(about), "inference_library": "emcee"}


def _thinned(by_walker: Floats, count: int) -> Floats:
    step = max(1, by_walker.shape[1] // count)
    return by_walker[:, step - 1 :: step][:, :count]


def _pointwise(posterior: Posterior, by_walker: Floats, chain: dict[str, Any]) -> Any:
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
    posterior: Posterior, by_walker: Floats, chain: dict[str, Any], rng: np.random.Generator
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
