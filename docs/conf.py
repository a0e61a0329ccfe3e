"""Sphinx configuration of the documentation site. ``tunnel docs`` builds and opens it."""

import os
import re
from importlib.metadata import version as _version
from pathlib import Path

from docutils import nodes
from latex2mathml.converter import convert
from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx
from sphinx.writers.html5 import HTML5Translator

_DOCS = Path(__file__).parent
_PAGES = {_DOCS.parent / "README.md": _DOCS / "overview.md", _DOCS / "README.md": _DOCS / "index.md"}
_LINK = re.compile(r"(!?\[(?:[^\]\[]|\[[^\]]*\])*\])\(([^)\s:#]+)(#[^)\s]*)?\)")

project = "Virtual wind tunnel"
author = "The developers of the virtual wind tunnel"
copyright = "the developers of the virtual wind tunnel"
version = release = _version("virtual-wind-tunnel")

root_doc = "index"
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
]
exclude_patterns = ["README.md", "_build", "studies"]
html_theme = "furo"
html_title = f"Virtual wind tunnel {version}"
html_static_path = ["_static"]
html_css_files = ["site.css"]

myst_enable_extensions = ["dollarmath"]
myst_update_mathjax = False
html_math_renderer = "mathml"  # browsers draw it themselves: the site needs no network and no script for it
myst_heading_anchors = 4
nb_execution_mode = "cache"
nb_execution_raise_on_error = True
nb_execution_timeout = 300

autodoc_typehints = "description"
autodoc_member_order = "bysource"
default_role = "py:obj"
napoleon_use_rtype = False


def _read(_: Sphinx, name: str, content: list[str]) -> None:
    """Put the README into the overview, and keep only links to what the site holds.

    The pages are also read in the source tree, where they may refer to any file of it.
    """
    text, place = content[0], (_DOCS / name).parent
    if name == "overview":
        readme = _DOCS.parent / "README.md"
        text, place = readme.read_text(encoding="utf-8"), readme.parent
    content[0] = _links(text, place, (_DOCS / name).parent)


def _links(text: str, source: Path, page: Path) -> str:
    def replaced(match: re.Match[str]) -> str:
        words, target, part = match[1], (source / match[2]).resolve(), match[3] or ""
        target = _PAGES.get(target, target)
        if not target.exists():
            return match[0]  # Sphinx warns
        if target.is_relative_to(_DOCS) and target.is_file():
            return f"{words}({os.path.relpath(target, page)}{part})"
        return words[1:-1]

    return _LINK.sub(replaced, text)


def _inline(page: HTML5Translator, node: nodes.math) -> None:
    page.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _displayed(page: HTML5Translator, node: nodes.math_block) -> None:
    page.body.append(f'<div class="math">{convert(node.astext(), display="block")}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> None:
    """Connect to Sphinx."""
    app.add_lexer("csv", TextLexer)
    app.add_html_math_renderer("mathml", (_inline, None), (_displayed, None))
    app.connect("source-read", _read)
