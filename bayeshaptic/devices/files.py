"""Device files: TOML, some of them installed with the package."""

from __future__ import annotations

import os
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

from bayeshaptic.arguments import at_the_door
from bayeshaptic.devices.device import KINDS, STRUCTURES, Device
from bayeshaptic.devices.table import Table, read_toml
from bayeshaptic.errors import InputError, nearest

FACTS = (
    "name",
    "kind",
    "period_s",
    "delay_s",
    "delay_sd_s",
    "encoder_resolution",
    "lever_m",
    "band_hz",
    "notes",
)
DEVICE_KEYS = (*FACTS, *STRUCTURES)


def _folder() -> Path:
    return Path(str(resources.files("bayeshaptic.devices")))


def device_names() -> tuple[str, ...]:
    """Names of the devices whose files come with the package."""
    return tuple(sorted(path.stem for path in _folder().glob("*.toml")))


@at_the_door
def load_device(name_or_path: str | os.PathLike[str] | Device) -> Device:
    """A device by its name, or from a device file.

    Parameters
    ----------
    name_or_path : str, path or Device
        One of `device_names()` in any case, or the path of a TOML file. A Device is handed back.

    Returns
    -------
    Device

    Raises
    ------
    InputError
        Where there is no such device, or its file has a slip.
    """
    if isinstance(name_or_path, Device):
        return name_or_path
    text = os.fspath(name_or_path)
    if text.lower() in device_names():
        path = _folder() / f"{text.lower()}.toml"
    elif text.lower().endswith(".toml") or Path(text).is_file():
        path = Path(text)
    else:
        names = device_names()
        raise InputError(
            f"unknown device '{text}'{nearest(text, names)}; known devices: {', '.join(names)}; "
            "the path of a device file (.toml) works too"
        )
    return device_from_table(read_toml(path), str(path), default_name=path.stem)


def device_from_table(
    content: object,
    where: str,
    base: Device | None = None,
    default_name: str | None = None,
    other_keys: tuple[str, ...] = (),
) -> Device:
    """A device from the content of a TOML table.

    Parameters
    ----------
    content : object
        The table, with the keys of a device file; all but the kind may be absent.
    where : str
        File and table, for messages.
    base : Device or None
        A device whose facts hold where the table is silent.
    default_name : str or None
        The device's name where the table gives none.
    other_keys : tuple of str
        Keys that the table may have and that the caller reads itself.

    Raises
    ------
    InputError
        For unknown keys, wrong types, impossible values, and a kind that is not that of `base`.
    """
    table = Table(content, where, known=(*DEVICE_KEYS, *other_keys))
    kind = table.text("kind", choices=KINDS)
    if base is not None and kind not in (None, base.kind):
        raise InputError(f"{where}: kind = '{kind}', but the device {base.name} is {base.kind}")
    if base is None:
        if kind is None:
            raise InputError(f"{where} needs a kind: kind = 'translational' or kind = 'rotational'")
        name = table.text("name") or default_name
        if name is None:
            raise InputError(f"{where} needs a name: name = 'my device'")
        base = Device(name, kind)
    facts: dict[str, Any] = {
        "name": table.text("name"),
        "period_s": table.number("period_s", 0, above=True),
        "delay_s": table.number("delay_s", 0),
        "delay_sd_s": table.number("delay_sd_s", 0),
        "encoder_resolution": table.number("encoder_resolution", 0, above=True),
        "lever_m": table.number("lever_m", 0, above=True),
        "band_hz": _band(table),
        "parameters": {**base.parameters, **_parameters(table)},
        "notes": _notes(table),
    }
    device = replace(base, **{key: value for key, value in facts.items() if value is not None})
    if device.delay_sd_s is not None and device.delay_s is None:
        raise InputError(f"{where}: delay_sd_s without delay_s; give both, or neither")
    if device.band_hz and device.period_s and device.band_hz[1] > 0.5 / device.period_s:
        half = f"half the rate of period_s = {device.period_s:g}"
        raise InputError(f"{where}: band_hz ends above {0.5 / device.period_s:g} Hz, {half}")
    return device


def _parameters(table: Table) -> dict[str, dict[str, float]]:
    """The tables [rigid], [free] and [grasped]: masses above zero, the rest at least zero."""
    found = {}
    for structure, names in STRUCTURES.items():
        if structure in table.content:
            where = f"{table.where}, [{structure}]"
            values = Table(table.content[structure], where, known=names)
            found[structure] = {
                name: values.number(name, 0, above=name.startswith("m")) or 0.0
                for name in values.content
            }
    return found


def _band(table: Table) -> tuple[float, float] | None:
    band = table.content.get("band_hz")
    if band is None:
        return None
    if not isinstance(band, list) or len(band) != 2:
        raise table.wrong("band_hz", "two frequencies, [low, high]")
    edges = Table({"low": band[0], "high": band[1]}, f"{table.where}, band_hz")
    low, high = edges.number("low", 0), edges.number("high", 0, above=True)
    if low is None or high is None or low >= high:
        raise table.wrong("band_hz", "two frequencies, [low, high] with low < high")
    return low, high


def _notes(table: Table) -> tuple[str, ...] | None:
    notes = table.content.get("notes")
    if notes is None:
        return None
    if isinstance(notes, str):
        return (notes,)
    if not isinstance(notes, list) or not all(isinstance(note, str) for note in notes):
        raise table.wrong("notes", "text or a list of texts")
    return tuple(notes)
