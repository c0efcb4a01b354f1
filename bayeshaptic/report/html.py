"""`report.html`: one file without scripts and without the network."""

from __future__ import annotations

import base64
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.report import tables, words
from bayeshaptic.report.assumptions import assumptions, priors, versions
from bayeshaptic.report.figures import FORCE_PICTURES, LOOP_PICTURES, PICTURES
from bayeshaptic.report.headline import headline
from bayeshaptic.report.loop import force_words
from bayeshaptic.report.loop import tables as loop_tables
from bayeshaptic.report.loop import words as loop_words
from bayeshaptic.version import __version__

if TYPE_CHECKING:
    from jinja2 import Template

    from bayeshaptic.diagnosis.analysis import Analysis
    from bayeshaptic.errors import Notice

TEMPLATES = Path(__file__).parent / "templates"
LABELS = {
    "safe": "Recommendation",
    "caution": "Recommendation, with caution",
    "untrusted": "No recommendation",
}


@dataclass(frozen=True)
class EmbeddedPicture:
    """A PNG inside of the page."""

    name: str
    alternative: str
    source: str
    width: int
    height: int


def render(result: Result, pictures: Mapping[str, bytes], sections: Sequence[str] = ()) -> str:
    """The page of an analysis (or of what closing the loop returns) with its PNG pictures.

    `sections` are further ones, ready as HTML, that follow the critical stiffness.
    """
    analysis, closed = result.analysis, result.closed
    head = headline(result)
    return template("report.jinja").render(
        title=title(analysis),
        style=style(),
        version=__version__,
        written=written(),
        result=result,
        analysis=analysis,
        closed=closed,
        measured=result.measured,
        headline=head,
        label=LABELS[head.status],
        notices=unique(analysis.notices),
        pictures={name: embedded(name, png) for name, png in pictures.items()},
        words=words,
        tables=tables,
        loop_words=loop_words,
        force_words=force_words,
        loop_tables=loop_tables,
        assumptions=assumptions(analysis, closed),
        priors=priors(analysis),
        versions=versions(),
        sections=sections,
    )


def title(analysis: Analysis) -> str:
    """What the report is about: the device and who held it, or the recording's name."""
    recording = analysis.recording
    device = None if analysis.device is None else analysis.device.name
    if recording is None:
        return device or "a frequency response"
    name = recording.device or device
    if name is None:
        return recording.name
    held = f", held by {recording.user}" if recording.user else ""
    return f"{name}{held}"


def unique(notices: tuple[Notice, ...]) -> tuple[Notice, ...]:
    """Warnings first, without repetitions."""
    once = tuple(dict.fromkeys(notices))
    return tuple(sorted(once, key=lambda notice: notice.level != "warning"))


def embedded(name: str, png: bytes, alternative: str = "") -> EmbeddedPicture:
    """A PNG as a part of the page, with the words that stand for it."""
    width, height = struct.unpack(">II", png[16:24])  # of the PNG's header
    pictures = (*PICTURES, *LOOP_PICTURES, *FORCE_PICTURES)
    words = alternative or next((p.alternative for p in pictures if p.name == name), name)
    source = "data:image/png;base64," + base64.b64encode(png).decode("ascii")
    return EmbeddedPicture(name, words, source, width, height)


def template(name: str) -> Template:
    """A template of the folder `templates`."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES, encoding="utf-8"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(name)


def style() -> str:
    """The style sheet of every page."""
    return (TEMPLATES / "report.css").read_text(encoding="utf-8")


def written() -> str:
    """The moment, for a person."""
    return datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
