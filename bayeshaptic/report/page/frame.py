"""What every page has: templates, style, script, contents, figures inside of the page."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bayeshaptic.faq import entry, without_links
from bayeshaptic.version import __version__

if TYPE_CHECKING:
    from jinja2 import Environment, Template

    from bayeshaptic.report.figures.style import Drawn

TEMPLATES = Path(__file__).parents[1] / "templates"
_UNIT = r"(?:%|dB|kg|[kMmn\N{MICRO SIGN}]?(?:N|Hz|s|m|g|A))(?:\W|$)"
# Around the sign of an error, between a number and its unit, and in a unit of several parts as in
# "8.50 mN m s/rad".
_NO_BREAK = re.compile(
    rf"(?<=\d) (?=\xb1 \d)|(?<=\xb1) (?=\d)|(?<=\d) (?={_UNIT})|(?<=N) (?=m\b)|(?<=N) (?=s\b)"
    r"|(?<=N m) (?=s\b)|(?<=g) (?=m²)"
)
_TEXT = re.compile(
    r"(<(?:style|script|svg|pre|code|title)\b.*?</(?:style|script|svg|pre|code|title)>|<[^>]*>)",
    re.DOTALL,
)
_OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*[a-z](?: LOW,HIGH| [A-Z]\b)?")
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
    readings: str = ""

    @property
    def switched(self) -> bool:
        """Whether it shows before and after, each in a layer of its own."""
        layers = ('class="before"', 'class="after"')
        return self.svg is not None and all(layer in self.svg for layer in layers)


def frame() -> dict[str, Any]:
    """What every page has: style, script and its hash, version, the moment, what words mean."""
    script = (TEMPLATES / "page.js").read_text(encoding="utf-8")
    digest = hashlib.sha256(script.encode()).digest()
    return {
        "style": style(),
        "script": script,
        "script_hash": base64.b64encode(digest).decode("ascii"),
        "version": __version__,
        "written": written(),
        "faq": entry,
        "plain": without_links,
    }


def finished(page: str, contents: Sequence[tuple[str, str]] = ()) -> str:
    """The page with links to its sections, and no line broken where none should be."""
    return with_contents(_typeset(page), contents) if contents else _typeset(page)


def _typeset(page: str) -> str:
    """Numbers stay with their units, and options of the command line are one word."""
    parts = _TEXT.split(page)
    parts[::2] = [_OPTION.sub(r"<code>\g<0></code>", unbroken(text)) for text in parts[::2]]
    return "".join(parts)


def with_contents(page: str, contents: Sequence[tuple[str, str]]) -> str:
    """The page with links to those of the sections that it has."""
    links = "".join(
        f'<a href="#{key}">{name}</a>\n' for key, name in contents if f'<section id="{key}"' in page
    )
    place = page.index("</nav>")
    return page[:place] + links + page[place:]


def unbroken(text: str) -> str:
    """A number stays on one line with its error and its unit."""
    return _NO_BREAK.sub("\N{NO-BREAK SPACE}", text)


def embedded(name: str, drawn: Drawn, words: str) -> EmbeddedPicture:
    """A figure as a part of the page, with the words that stand for it."""
    readings = json.dumps(drawn.readings, separators=(",", ":")) if drawn.readings else ""
    width, height = struct.unpack(">II", drawn.png[16:24])  # of the PNG's header
    if drawn.svg is not None:
        label = f'role="img" aria-label="{html.escape(words)}"'
        svg = drawn.svg.replace("<svg", f"<svg {label}", 1)
        return EmbeddedPicture(name, words, "", width, height, svg, readings)
    source = "data:image/png;base64," + base64.b64encode(drawn.png).decode("ascii")
    return EmbeddedPicture(name, words, source, width, height, None, readings)


def template(name: str) -> Template:
    """A template of the folder `templates`."""
    return _environment().get_template(name)


@cache
def _environment() -> Environment:
    """One for all pages: each template is compiled once."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader(TEMPLATES, encoding="utf-8"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def style() -> str:
    """The style sheet of every page."""
    return (TEMPLATES / "report.css").read_text(encoding="utf-8")


def written() -> str:
    """The moment, for a person."""
    return datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
