"""`index.html`: one line for each report of a study."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bayeshaptic.report.quantities import interval, quantity

if TYPE_CHECKING:
    from bayeshaptic.report.headline import Headline

HERE = Path(__file__).parent
HEADS = ("recording", "held by", "configuration", "model", "median limit", "90 % interval",
         "what to do")  # fmt: skip


@dataclass(frozen=True)
class Reported:
    """What became of one recording.

    Attributes
    ----------
    name : str
        The recording's name.
    page : Path or None
        Its report; None where it failed.
    headline : Headline or None
        The stiffness to act on, or why there is none.
    remark : str
        What closing the loop found, in a sentence; empty without it.
    summary : mapping
        The content of its ``summary.json``; empty where it failed.
    warnings : tuple of str
    error : str or None
        One line saying why it failed.
    """

    name: str
    page: Path | None = None
    headline: Headline | None = None
    remark: str = ""
    summary: Mapping[str, Any] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    error: str | None = None


def write_index(title: str, done: Sequence[Reported], folder: Path) -> Path:
    """Write the page that lists the reports of a study, and what failed.

    Parameters
    ----------
    title : str
        The study's name.
    done : sequence of Reported
    folder : Path
        Where the page goes; the reports are linked relative to it.

    Returns
    -------
    Path
        Of index.html.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(HERE, encoding="utf-8"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    page = environment.get_template("index.jinja").render(
        title=title,
        style=(HERE / "report.css").read_text(encoding="utf-8"),
        heads=HEADS,
        reported=[(_link(one, folder), one, _cells(one)) for one in done if one.headline],
        failed=[one for one in done if not one.headline],
    )
    target = folder / "index.html"
    draft = folder / f".index-{os.getpid()}.html"
    draft.write_text(page, encoding="utf-8", newline="\n")
    draft.replace(target)
    return target


def _link(one: Reported, folder: Path) -> str:
    assert one.page is not None
    return Path(os.path.relpath(one.page, folder)).as_posix()


def _cells(one: Reported) -> tuple[str, ...]:
    """What stands beside the recording's name."""
    assert one.headline is not None
    recording, limit = one.summary["recording"], one.summary["critical_stiffness"]
    low, high, unit = limit["q05"], limit["q95"], limit["unit"]
    sd = None if low is None or high is None else (high - low) / 3.29 or None
    configuration = recording["configuration"]
    return (
        recording["user"] or "nobody",
        "" if configuration is None else str(configuration),
        one.summary["model"]["name"],
        quantity(limit["q50"], unit, sd),
        interval(low, high, unit, sd),
        one.headline.sentence,
    )
