"""Reading a saved posterior."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.inference.archive import model_from_dict
from bayeshaptic.inference.arviz_groups import MARK
from bayeshaptic.inference.diagnostics import diagnose
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.types import Floats


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
        about = json.loads(data.attrs[MARK])
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


def _by_ensemble(values: Floats, ensembles: int) -> Floats:
    """(chain, draw, ...) to (ensembles, steps, walkers, ...), each walker having been a chain."""
    split = values.reshape(ensembles, -1, *values.shape[1:])
    return np.moveaxis(split, 1, 2)
