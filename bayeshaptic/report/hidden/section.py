"""The section about what could hide: effects too small to be seen, and the limit without them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bayeshaptic.report.figures import hidden as figure
from bayeshaptic.report.hidden import words
from bayeshaptic.report.page.section import Section, section

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis


def hidden_section(analysis: Analysis) -> Section | None:
    """HTML and the picture; None where the limit does not allow for anything."""
    found = analysis.hidden
    if found is None:
        return None
    return section(
        "hidden.jinja",
        {"hidden": (figure.draw(found), "How far effects that nobody sees could move the limit")},
        lead=words.lead(analysis, found),
        largest=words.largest(found),
        rows=words.rows(found),
        sensitivity=words.sensitivity(analysis, found),
    )
