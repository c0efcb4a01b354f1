"""MAT files: version 5 (and 4) through SciPy, version 7.3 as the HDF5 file that it is.

MATLAB's own objects (Simulink's ``timeseries`` and ``Dataset``) need mat-io, of the extra
``formats``.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.readers.hdf5 import read_hdf5
from bayeshaptic.recordings.readers.matlab_sizes import refuse_sizes
from bayeshaptic.recordings.readers.reader import Arrays, Reader
from bayeshaptic.recordings.readers.tree import named_vectors

_HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_OBJECTS = (b"timeseries", b"Simulink.SimulationData")


def read_matlab(path: Path) -> Arrays:
    """The vectors of a MAT file of any version.

    Fields of structures are named ``structure.field``, items of arrays of structures and of cells
    ``rec.Y(2).Data``; see `tree` for signals that are found by their own names. Of a ``timeseries``
    there are ``Time`` and ``Data``. Text and empty variables are passed over.

    Raises
    ------
    InputError
        For a file that is not a MAT file; for one with nothing but objects without mat-io.
    """
    try:
        with path.open("rb") as file:
            start = file.read(520)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    is_hdf5 = _HDF5_SIGNATURE in (start[:8], start[512:520])
    if not is_hdf5:
        refuse_sizes(path)
    objects = _objects(path) if _has_objects(path) else {}
    if objects:
        return named_vectors(objects, _expand)
    if is_hdf5:
        found = read_hdf5(path, separator=".")
    else:
        found = named_vectors(_variables(path), _expand)
    if not found and _has_objects(path):
        raise InputError(
            f"{path}: holds MATLAB objects (timeseries or Dataset), which need the formats extra "
            "(pip install 'bayeshaptic[formats]'); or save plain vectors: save('x.mat', 't', 'u')"
        )
    return found


def _variables(path: Path) -> dict[str, Any]:
    """The variables of a version 5 file, one by one where an object in it defeats the reader."""
    from scipy.io import loadmat, whosmat

    def load(names: list[str] | None) -> dict[str, Any]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            content = loadmat(path, variable_names=names)
        # An object without a name comes as the key None.
        return {k: v for k, v in content.items() if isinstance(k, str) and not k.startswith("__")}

    # scipy meets damaged or exotic files with whatever exception its parser runs into.
    try:
        return load(None)
    except MemoryError:  # a second try would take as long
        raise
    except Exception as error:
        try:
            names = [name for name, *_ in whosmat(path)]
        except Exception:
            raise InputError(f"{path}: not a readable MAT file ({error})") from None
    found: dict[str, Any] = {}
    for name in names:
        try:
            found.update(load([name]))
        except MemoryError:
            raise
        except Exception:
            continue
    return found


def _has_objects(path: Path) -> bool:
    """Whether Simulink's objects are named in the file, packed or not."""
    import mmap
    import zlib

    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        if any(content.find(name) >= 0 for name in _OBJECTS):
            return True
        # The last variable of a packed version 5 file is what its objects consist of.
        place = int.from_bytes(content[116:124], "little")
        if 128 <= place < len(content) - 8:
            try:
                unpacked = zlib.decompressobj().decompress(content[place + 8 :], 1_000_000)
            except zlib.error:
                return False
            return any(name in unpacked for name in _OBJECTS)
    return False


def _objects(path: Path) -> dict[str, Any]:
    """The variables of a file with objects, as mat-io reads them; none where it cannot."""
    try:
        import matio
    except ImportError:
        return {}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return dict(matio.load_from_mat(str(path)))
    except Exception:
        return {}


def _properties(node: Any) -> Mapping[str, Any] | None:
    properties = getattr(node, "properties", None)
    return properties if isinstance(properties, Mapping) else None


def _expand(node: Any) -> Any:
    properties = _properties(node)
    if properties is not None:
        # Private properties end in an underscore.
        public = {str(name).rstrip("_"): value for name, value in properties.items()}
        return _time_series(public) if "TimeInfo" in public else public
    if not isinstance(node, np.ndarray):
        return node if isinstance(node, Mapping | list) else None
    if node.dtype.names is not None:
        if type(node) is not np.ndarray:  # an object or a function, as SciPy gives it
            return None
        items = [{name: item[name] for name in node.dtype.names} for item in node.ravel("F")]
        return items[0] if len(items) == 1 else items
    if node.dtype == object:
        return list(node.ravel("F"))
    if node.dtype.kind == "U":
        return str(node.flat[0]) if node.size == 1 else None
    return node


def _time_series(properties: dict[str, Any]) -> dict[str, Any]:
    """Name, samples and times of a ``timeseries``; even times are kept as start and step."""
    shown: dict[str, Any] = {
        name: properties[name] for name in ("Name", "Data", "Time") if name in properties
    }
    if np.size(shown.get("Time", ())) > 1:
        return shown
    info = _properties(properties["TimeInfo"]) or {}
    clock = {str(name).rstrip("_"): value for name, value in info.items()}
    try:
        start, step = (float(np.squeeze(clock[name])) for name in ("Start", "Increment"))
    except (KeyError, TypeError, ValueError):
        return shown
    sizes = np.shape(properties.get("Data", ()))
    return shown | {"Time": start + step * np.arange(max(sizes, default=0))}


READER = Reader("MAT", (".mat",), read_matlab, apart=True)
