"""Figures as SVG elements of an HTML page."""

from __future__ import annotations

import io
import re
from html import unescape
from typing import TYPE_CHECKING

from tunnel_lab.diagnosis_view.figures_common import THEMED
from tunnel_lab.plotting.common import styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_NOT_HTML = (
    re.compile(r"^.*?(?=<svg)", re.DOTALL),  # the XML declaration and document type, which name an address
    re.compile(r"<metadata>.*?</metadata>\s*", re.DOTALL),
)
_TAG = re.compile(r"<[^>]+>")  # text between tags may hold any names of runs
_NAMES = re.compile(r'\s+xmlns(:\w+)?="[^"]*"')  # HTML needs no namespace for SVG
_OPENING = re.compile(r"<svg[^>]*>")
_SIZE = re.compile(r' (width|height)="[^"]*"')
_ID = re.compile(r'\bid="([^"]+)"')
_COLOUR = re.compile("|".join(THEMED))
_REFERENCE = re.compile(r'(href="#|url\(#)([^")]+)')


@styled
def inline_svg(figure: Figure, name: str, description: str) -> str:
    """A figure as an SVG element.

    Args:
        figure: drawn by matplotlib; its text stays text. Colours of `THEMED` become the style sheet's.
        name: unique in the page; every id in the element begins with it.

    Returns:
        The element; it is always the same for the same figure and has no address outside the page.
    """
    from matplotlib import rc_context

    buffer = io.StringIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        figure.savefig(buffer, format="svg", metadata={"Date": None}, transparent=True)
    text = buffer.getvalue()
    for pattern in _NOT_HTML:
        text = pattern.sub("", text)
    text = _TAG.sub(lambda found: _in_page(found[0], name), text)
    text = _OPENING.sub(lambda found: _SIZE.sub("", found[0]), text, count=1)
    label = _escaped(description)
    return text.replace("<svg", f'<svg role="img" aria-label="{label}"', 1)


def _in_page(tag: str, name: str) -> str:
    """A tag with ids that are unique in the page, and with colours of the theme."""
    tag = _ID.sub(rf'id="{name}-\1"', _NAMES.sub("", tag))
    tag = _REFERENCE.sub(rf"\1{name}-\2", tag)
    return _COLOUR.sub(lambda found: f"var(--{THEMED[found[0]]})", tag)


def shown_text(svg: str) -> str:
    """The characters that elements of `inline_svg` show, each once, in order."""
    return "".join(sorted(set(unescape(_TAG.sub("", svg)))))


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
