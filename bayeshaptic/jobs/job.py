"""What is to be reported, how, and where to."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from bayeshaptic.errors import InputError
from bayeshaptic.numerics.spending import BUDGET_S


@dataclass(frozen=True)
class Settings:
    """How recordings are read and analysed: the options of the command ``report``.

    Attributes
    ----------
    columns : str or None
        Mapping of the file's columns.
    period_s, encoder_resolution : float or None
    model : str
        "auto", "rigid", "free" or "grasped".
    device : str or None
        Name or path of a device file; for a study, instead of the study's own.
    delay_s, delay_sd_s : float or None
    band_hz : (float, float) or None
    seed : int
    budget_s : float
        What looking for it may cost, in nominal seconds.
    held : bool or None
        Whether somebody held the device; of a study its users say so.
    close_loop : bool
        Whether to look for what the model lacks.
    allow_outside : bool
        Whether a study may read files outside its folder.
    rows, seconds : (float or None, float or None), or None
        The part of a recording that is read.
    """

    columns: str | None = None
    period_s: float | None = None
    encoder_resolution: float | None = None
    model: str = "auto"
    device: str | None = None
    delay_s: float | None = None
    delay_sd_s: float | None = None
    band_hz: tuple[float, float] | None = None
    seed: int = 0
    budget_s: float = BUDGET_S
    close_loop: bool = True
    held: bool | None = None
    allow_outside: bool = False
    rows: tuple[float | None, float | None] | None = None
    seconds: tuple[float | None, float | None] | None = None


@dataclass(frozen=True)
class Job:
    """One recording or study, the folder for its report, and the command that asked for it."""

    source: Path
    folder: Path
    settings: Settings
    command: str | None = None


def refuse_file(folder: Path) -> None:
    """Say before any work that a report cannot be written there.

    Raises
    ------
    InputError
        Where `folder`, or the nearest of its parents that exists, is not a folder to write in.
    """
    nearest = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not nearest.is_dir():
        raise InputError(f"{nearest} is a file; name a folder for the report with -o")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise InputError(f"{nearest}: no permission to write there; name another folder with -o")
