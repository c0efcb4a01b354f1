"""TDMS files, as LabVIEW writes them, through npTDMS."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.readers.reader import Arrays, Reader, refuse_size


def read_tdms(path: Path) -> Arrays:
    """The channels of a TDMS file as ``group/channel``; of a waveform ``group/channel/time``, too.

    Raises
    ------
    InputError
        For a file that is not TDMS, claims more than can be read, or where npTDMS is missing.
    """
    try:
        from nptdms import TdmsFile
    except ImportError:
        raise InputError(
            f"{path}: TDMS files need the formats extra: pip install 'bayeshaptic[formats]'"
        ) from None
    found: Arrays = {}
    try:
        with TdmsFile.open(path) as file:
            for group in file.groups():
                for channel in group.channels():
                    found.update(_signals(channel, f"{group.name}/{channel.name}", path))
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{path}: not a readable TDMS file ({error})") from None
    return found


def _signals(channel: Any, name: str, path: Path) -> Arrays:
    refuse_size((len(channel),), f"{path}: '{name}'")
    values = np.asarray(channel[:]) if len(channel) else np.empty(0)
    if values.ndim != 1 or not len(values) or values.dtype.kind not in "iufb":
        return {}
    unit = str(channel.properties.get("unit_string", "")).strip()
    found = {f"{name} ({unit})" if unit else name: values}
    step = channel.properties.get("wf_increment")
    if isinstance(step, float | int) and step > 0:
        offset = float(channel.properties.get("wf_start_offset", 0.0))
        found[f"{name}/time"] = offset + step * np.arange(len(values))
    return found


READER = Reader("TDMS", (".tdms",), read_tdms, apart=True)
