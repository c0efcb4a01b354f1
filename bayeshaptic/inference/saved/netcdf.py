"""Groups of labelled arrays, as ArviZ keeps posteriors, and how they are written to a file."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.files import whole_file


@dataclass(frozen=True)
class Variable:
    """An array with names for its axes.

    Attributes
    ----------
    dims : tuple of str
    values : ndarray
    attributes : mapping
        The unit, for instance.
    """

    dims: tuple[str, ...]
    values: NDArray[Any] = field(repr=False)
    attributes: Mapping[str, str | float] = field(default_factory=dict)


@dataclass(frozen=True)
class Group:
    """Variables over the same axes.

    Attributes
    ----------
    variables, coordinates : mapping of str to Variable
        Coordinates are what stands along the axes.
    attributes : mapping
    """

    variables: Mapping[str, Variable]
    coordinates: Mapping[str, Variable]
    attributes: Mapping[str, Any] = field(default_factory=dict)


def dataset(group: Group) -> Any:
    """`group` as an xarray.Dataset."""
    import xarray

    def parts(variables: Mapping[str, Variable]) -> dict[str, Any]:
        return {name: (v.dims, v.values, dict(v.attributes)) for name, v in variables.items()}

    return xarray.Dataset(parts(group.variables), parts(group.coordinates), dict(group.attributes))


def write(groups: Mapping[str, Group], path: Path) -> None:
    """Write a netCDF file that ArviZ reads, first beside `path` and then in its place.

    As ArviZ writes it, but without xarray, whose import takes longer than the writing.

    Raises
    ------
    OSError
        If the disk, or what of it is the user's, has no room for it.
    """
    import h5netcdf

    # In memory first: the HDF5 library does not survive a disk or a quota that is full.
    content = io.BytesIO()
    with h5netcdf.File(content, "w") as file:
        for name, group in groups.items():
            _write_group(file.create_group(name), group)
    with whole_file(path) as partial:
        partial.write_bytes(content.getbuffer())


def _write_group(into: Any, group: Group) -> None:
    every = {**group.coordinates, **group.variables}
    into.dimensions = {
        dim: size for v in every.values() for dim, size in zip(v.dims, v.values.shape, strict=True)
    }
    into.attrs.update(group.attributes)
    # Coordinates that are no axes of their own are named by the variables that they stand along.
    beside = {name: v for name, v in group.coordinates.items() if v.dims != (name,)}
    for name, variable in every.items():
        written = into.create_variable(name, variable.dims, data=variable.values)
        attributes: dict[str, Any] = dict(variable.attributes)
        along = [key for key, v in beside.items() if set(v.dims) <= set(variable.dims)]
        if along and name in group.variables:
            attributes["coordinates"] = " ".join(along)
        if variable.values.dtype.kind == "f":
            attributes["_FillValue"] = np.nan
        written.attrs.update(attributes)
