"""What became of one report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bayeshaptic.report.headline import Headline


@dataclass(frozen=True)
class Reported:
    """What became of one recording, or of a whole study.

    Attributes
    ----------
    name : str
        The recording's name, or the study's.
    page : Path or None
        Its report; None where it failed.
    headline : Headline or None
        The stiffness to act on, or why there is none.
    remark : str
        What closing the loop found, in a sentence; empty without it.
    warnings : tuple of str
    error : str or None
        One line saying why it failed.
    """

    name: str
    page: Path | None = None
    headline: Headline | None = None
    remark: str = ""
    warnings: tuple[str, ...] = ()
    error: str | None = None
