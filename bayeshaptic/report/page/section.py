"""A section of a page that is rendered by itself: its HTML and its pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from bayeshaptic.report.figures.style import Drawn, drawn
from bayeshaptic.report.page.frame import embedded, template

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Section:
    """A part of a page.

    Attributes
    ----------
    html : str
        A ``<section>`` with its pictures inside.
    pictures : mapping of str to Drawn
        The same pictures, by name.
    """

    html: str = field(repr=False)
    pictures: Mapping[str, Drawn] = field(repr=False)


def section(name: str, figures: Mapping[str, tuple[Figure, str]], **values: Any) -> Section:
    """Render the template `name`, which shows its figures by `macros.jinja`.

    Parameters
    ----------
    name : str
        File name.
    figures : mapping
        Name to the figure and what it shows in words.
    **values
        What else the template reads.
    """
    files = {key: drawn(figure, key) for key, (figure, _) in figures.items()}
    pictures = {key: embedded(key, files[key], words) for key, (_, words) in figures.items()}
    return Section(template(name).render(pictures=pictures, **values), files)
