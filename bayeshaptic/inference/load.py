"""Reading a saved posterior."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from bayeshaptic.arguments import at_the_door
from bayeshaptic.errors import InputError
from bayeshaptic.inference.diagnostics import diagnose
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.inference.saved.archive import model_from_dict
from bayeshaptic.inference.saved.arviz_groups import MARK, TOTAL, from_chains


@at_the_door
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
    import h5py

    # A netCDF file is an HDF5 file; h5netcdf prints tracebacks where one is damaged.
    try:
        with h5py.File(path, "r") as file:
            data, stats = file["posterior"], file["sample_stats"]
            return _restored(data, stats, json.loads(data.attrs[MARK]))
    except InputError:
        raise
    # The library meets damaged files with whatever exception its parser runs into.
    except Exception as problem:
        what = " ".join(str(problem).split())[:200]
        raise InputError(f"{path}: not a posterior of bayeshaptic ({what}).") from None


def _restored(data: Any, stats: Any, about: dict[str, Any]) -> Posterior:
    model = model_from_dict(about["model"])
    walkers = about["walkers"]
    values = np.stack([data[name][()] for name in model.names], axis=-1)
    chains = from_chains(values, walkers)
    if not np.isfinite(chains).all():
        raise ValueError("draws that are no numbers")
    return Posterior(
        model,
        chains,
        from_chains(stats[TOTAL][()], walkers),
        diagnose(chains),
        about["converged"],
        about["message"],
        about["seconds"],
        about["seed"],
    )
