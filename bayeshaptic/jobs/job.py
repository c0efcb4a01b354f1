"""What is to be reported, how, and where to."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from bayeshaptic.arguments import check_fields
from bayeshaptic.devices import Device
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.errors import InputError, refuse_no_path


@dataclass(frozen=True)
class Settings(Options):
    """How recordings are read and analysed: what the command ``report`` can be asked for.

    Besides the options of `analyse` (`bayeshaptic.diagnosis.options`):

    Attributes
    ----------
    model : str
        Mechanism to fit: one mass (rigid), two masses (free), or three with a user's hand
        (grasped); by default auto, chosen from the data, and the report says why.
    close_loop : bool
        Whether to look for what the model lacks, as by default. Without, it is quicker, and the
        limit may be far off where something is missing.
    columns : str or None
        Which columns, variables or datasets hold time, force and position, with scale factors and
        units (N, Nm, A; m, rad), where they are not called as above; for example
        time=t*1e-6,force=u[A],position=q[rad].
    period_s : float or None
        Sampling period in seconds; by default from the time stamps. Where a force is held for
        several rows, it says whether the loop runs at every row or at the changes alone.
    encoder_resolution : float or None
        One encoder count, in m or rad; by default from the device, or from the data.
    rows : (float or None, float or None), or None
        Read rows A to B only, counted from 1; either may be left out.
    seconds : (float or None, float or None), or None
        Read from A to B seconds after the first row only; either may be left out.
    allow_outside : bool
        Let a study read files outside its own folder.
    """

    model: str = "auto"
    close_loop: bool = True
    columns: str | None = None
    period_s: float | None = None
    encoder_resolution: float | None = None
    rows: tuple[float | None, float | None] | None = None
    seconds: tuple[float | None, float | None] | None = None
    allow_outside: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        check_fields(self, globals())

    def facts(self) -> dict[str, Any]:
        """All of it as plain JSON types, for manifests and reports."""
        found = {each.name: getattr(self, each.name) for each in fields(self)}
        del found["progress"], found["checkpoints"]
        found["prior"] = {name: repr(prior) for name, prior in self.prior.items()}
        if isinstance(self.device, Device):
            found["device"] = asdict(self.device)
        elif self.device is not None:
            found["device"] = str(self.device)
        return found


@dataclass(frozen=True)
class Job:
    """One recording or study, the folder for its report, and the command that asked for it."""

    source: Path
    folder: Path
    settings: Settings
    command: str | None = None


def checkpoints_of(folder: Path) -> Path:
    """Where the samplers of a report in `folder` keep their state until it is written."""
    return folder / ".checkpoints"


def refuse_file(folder: Path) -> None:
    """Say before any work that a report cannot be written there.

    Raises
    ------
    InputError
        Where `folder`, or the nearest of its parents that exists, is not a folder to write in.
    """
    refuse_no_path(folder)
    nearest = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not nearest.is_dir():
        raise InputError(f"{nearest} is a file; name a folder for the report with -o")
    try:
        # Permissions do not tell: a root user has all of them on /proc, and cannot write there.
        TemporaryFile(dir=nearest).close()
    except OSError as error:
        where = f"{nearest}: cannot write there ({error.strerror or error})"
        raise InputError(f"{where}; name another folder with -o") from None
