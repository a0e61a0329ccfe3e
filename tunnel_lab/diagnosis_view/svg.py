"""Figures as SVG elements of an HTML page."""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING

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
_REFERENCE = re.compile(r'(href="#|url\(#)([^")]+)')


def inline_svg(figure: Figure, name: str, description: str) -> str:
    """A figure as an SVG element.

    Args:
        figure: drawn by matplotlib; its text stays text, in the page's own fonts.
        name: unique in the page; every id in the element begins with it.

    Returns:
        The element; it is always the same for the same figure and has no address outside the page.
    """
    from matplotlib import rc_context

    buffer = io.StringIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": name, "font.family": "sans-serif"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None}, transparent=True)
    text = buffer.getvalue()
    for pattern in _NOT_HTML:
        text = pattern.sub("", text)
    text = _TAG.sub(lambda found: _in_page(found[0], name), text)
    text = _OPENING.sub(lambda found: _SIZE.sub("", found[0]), text, count=1)
    label = _escaped(description)
    return text.replace("<svg", f'<svg role="img" aria-label="{label}"', 1)


def _in_page(tag: str, name: str) -> str:
    """A tag with ids that are unique in the page."""
    tag = _ID.sub(rf'id="{name}-\1"', _NAMES.sub("", tag))
    return _REFERENCE.sub(rf"\1{name}-\2", tag)


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
