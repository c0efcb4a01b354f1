"""How the site is built: `sphinx-build -W docs site` after `pip install -e ".[docs]"`."""

import re

from docutils.nodes import SkipNode
from latex2mathml.converter import convert

from bayeshaptic.version import __version__

project = "bayeshaptic"
author = "the bayeshaptic contributors"
copyright = author
version = release = __version__

extensions = [
    "myst_nb",  # Markdown, and notebooks that are run while the site is built
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
]
html_theme = "furo"
html_title = f"bayeshaptic {__version__}"
exclude_patterns = ["README.md", "study", "gallery"]

myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_merge_streams = True

html_math_renderer = "mathml"

napoleon_numpy_docstring = True
napoleon_google_docstring = False
napoleon_use_rtype = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"
suppress_warnings = ["config.cache"]


def setup(app):
    app.connect("source-read", _bring_files_along)
    inline, block = (_in_line, None), (_displayed, None)
    app.add_html_math_renderer("mathml", inline, block)


def _bring_files_along(app, name, source):
    """A link to a page outside this folder, as in ../CONTRIBUTING.md, becomes one to the file."""
    depth = name.count("/") + 1

    def as_download(found):
        leads_out = found[2].count("../") >= depth
        return f"{{download}}`{found[1]} <{found[2]}>`" if leads_out else found[0]

    source[0] = re.sub(r"\[([^\]]+)\]\(([^)#\s]+\.md)(?:#[^)]*)?\)", as_download, source[0])


def _in_line(writer, node):
    """An equation as MathML, which browsers draw by themselves: no script, no network."""
    writer.body.append(convert(node.astext()))
    raise SkipNode


def _displayed(writer, node):
    equation = convert(node.astext(), display="block")
    writer.body.append(f'<div class="math">{equation}</div>\n')
    raise SkipNode
