"""`report.html`: one file that needs no network."""

from __future__ import annotations

import base64
import hashlib
import html
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.report import tables, words
from bayeshaptic.report.assumptions import assumptions, priors
from bayeshaptic.report.figures import FORCE_PICTURES, LOOP_PICTURES, PICTURES
from bayeshaptic.report.figures.style import Drawn
from bayeshaptic.report.headline import headline
from bayeshaptic.report.loop import force_words
from bayeshaptic.report.loop import tables as loop_tables
from bayeshaptic.report.loop import words as loop_words
from bayeshaptic.report.page import answer, methods
from bayeshaptic.report.page.lights import lights
from bayeshaptic.report.page.next_step import next_step
from bayeshaptic.report.page.reproduce import reproduce
from bayeshaptic.report.trust import doubtful_parameters
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
    """A figure inside of the page: as SVG, or as PNG where that is smaller."""

    name: str
    alternative: str
    source: str
    width: int
    height: int
    svg: str | None = None


FILES = (
    ("summary.json", "the numbers of this page"),
    ("limits.json", "stable walls, for a rendering program"),
    ("limits.csv", "the same as a table"),
    ("posterior.nc", "the draws, for ArviZ"),
)
_CONTENTS = (
    ("summary", "Summary"),
    ("limit", "Limit"),
    ("walls", "Walls"),
    ("response", "Response"),
    ("lacked", "What the model lacked"),
    ("force", "Force"),
    ("parameters", "Parameters"),
    ("guidance", "What next"),
    ("diagnostics", "Diagnostics"),
    ("assumptions", "Assumptions"),
    ("methods", "Methods"),
    ("reproduce", "Reproduce"),
)


def render(result: Result, pictures: Mapping[str, Drawn], sections: Sequence[str] = ()) -> str:
    """The page of an analysis (or of what closing the loop returns) with its figures.

    `sections` are ready as HTML: stable walls, and what to do next.
    """
    analysis, closed = result.analysis, result.closed
    head = headline(result)
    page = template("report.jinja").render(
        **frame(),
        title=title(analysis),
        contents=(),
        result=result,
        analysis=analysis,
        closed=closed,
        measured=result.measured,
        headline=head,
        label=LABELS[head.status],
        lights=lights(result),
        answer=answer,
        next_step=next_step(head, result),
        doubtful=words.doubtful(result),
        untrusted=doubtful_parameters(result),
        notices=unique(analysis.notices),
        pictures={name: embedded(name, drawn) for name, drawn in pictures.items()},
        words=words,
        tables=tables,
        loop_words=loop_words,
        force_words=force_words,
        loop_tables=loop_tables,
        assumptions=assumptions(analysis, closed),
        priors=priors(analysis),
        methods=methods.methods(result),
        bibtex=methods.bibtex(result),
        reproduce=reproduce(result),
        files=FILES,
        sections=sections,
    )
    return with_contents(page, _CONTENTS)


def frame() -> dict[str, Any]:
    """What every page has: style, script and its hash, version, the moment."""
    script = (TEMPLATES / "page.js").read_text(encoding="utf-8")
    digest = hashlib.sha256(script.encode()).digest()
    return {
        "style": style(),
        "script": script,
        "script_hash": base64.b64encode(digest).decode("ascii"),
        "version": __version__,
        "written": written(),
    }


def with_contents(page: str, contents: Sequence[tuple[str, str]]) -> str:
    """The page with links to those of the sections that it has."""
    links = "".join(
        f'<a href="#{key}">{name}</a>\n' for key, name in contents if f'<section id="{key}"' in page
    )
    place = page.index("</nav>")
    return page[:place] + links + page[place:]


def title(analysis: Analysis) -> str:
    """What the report is about: the device, who held it, and the recording's name."""
    recording = analysis.recording
    device = None if analysis.device is None else analysis.device.name
    if recording is None:
        return device or "a frequency response"
    name = recording.device or device
    if name is None:
        return recording.name
    held = f", held by {recording.user}" if recording.user else ""
    return f"{name}{held}: {recording.name}"


def unique(notices: tuple[Notice, ...]) -> tuple[Notice, ...]:
    """Warnings first, without repetitions."""
    once = tuple(dict.fromkeys(notices))
    return tuple(sorted(once, key=lambda notice: notice.level != "warning"))


def embedded(name: str, drawn: Drawn, alternative: str = "") -> EmbeddedPicture:
    """A figure as a part of the page, with the words that stand for it."""
    width, height = struct.unpack(">II", drawn.png[16:24])  # of the PNG's header
    pictures = (*PICTURES, *LOOP_PICTURES, *FORCE_PICTURES)
    words = alternative or next((p.alternative for p in pictures if p.name == name), name)
    if drawn.svg is not None:
        label = f'role="img" aria-label="{html.escape(words)}"'
        svg = drawn.svg.replace("<svg", f"<svg {label}", 1)
        return EmbeddedPicture(name, words, "", width, height, svg)
    source = "data:image/png;base64," + base64.b64encode(drawn.png).decode("ascii")
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
