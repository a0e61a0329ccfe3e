"""Helpers of the figures of a diagnosis, and the colours that change with the theme of the page."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from html import unescape
from typing import TYPE_CHECKING, Any

import numpy as np

from identification.show.style import styled
from tunnel_sim.vocabulary.freedom import ANGLE, Freedom
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure


BEFORE, AFTER, ACCENT, QUIET = "#d55e00", "#0072b2", "#009e73", "#77808a"
INK, SOFT, LINE, NOISE, MARK, PAPER = "#1b1f24", "#59636e", "#d9dee3", "#e6e9ec", "#f0e442", "#ffffff"
THEMED = {
    INK: "ink", SOFT: "soft", LINE: "line", NOISE: "noise", PAPER: "paper", QUIET: "quiet", MARK: "mark",
    BEFORE: "before", AFTER: "after", ACCENT: "accent",
}  # fmt: skip
"""Custom properties of the style sheet by colour of the figures."""
NARROW = 4.4  # inches: legible on a phone without scrolling
SIGMAS = 3.0
"""Standard deviations within which values count as noise in the figures."""
_FAINTEST = 0.12
# number of levels of a colour map: too fine to be visible; a colour bar has the same number of areas
_STEPS = 48
_NOT_HTML = (
    re.compile(r"^.*?(?=<svg)", re.DOTALL),  # the XML declaration and document type, which contain an address
    re.compile(r"<metadata>.*?</metadata>\s*", re.DOTALL),
)
_TAG = re.compile(r"<[^>]+>")  # text between tags may contain any names of runs
_NAMES = re.compile(r'\s+xmlns(:\w+)?="[^"]*"')  # HTML needs no namespace for SVG
_OPENING = re.compile(r"<svg[^>]*>")
_SIZE = re.compile(r' (width|height)="[^"]*"')
_ID = re.compile(r'\bid="([^"]+)"')
_COLOUR = re.compile("|".join(THEMED))
_REFERENCE = re.compile(r'(href="#|url\(#)([^")]+)')


def in_words(drawn: Figure, freedom: Freedom, names: Sequence[str]) -> Figure:
    """A drawing with its texts in the words of a freedom.

    Args:
        names: the user's names, which are not translated.
    """
    if freedom is ANGLE:
        return drawn
    from matplotlib.ticker import FixedLocator

    for axes in drawn.axes:
        for axis in (axes.xaxis, axes.yaxis):
            if isinstance(axis.get_major_locator(), FixedLocator):  # labels of categories
                axis.set_ticklabels([freedom.words(one.get_text(), names) for one in axis.get_ticklabels()])
    for text in drawn.findobj(lambda part: hasattr(part, "set_text") and hasattr(part, "get_text")):
        text.set_text(freedom.words(text.get_text(), names))  # type: ignore[attr-defined]
    return drawn


def array(values: Sequence[float | None]) -> Array:
    """Numbers of a JSON list, NaN for null, shape (n,)."""
    return np.array([np.nan if v is None else v for v in values], dtype=np.float64)


def faded(*colours: str) -> Colormap:
    """A colour map that fades out instead of becoming white, for light and dark pages.

    It has one colour, from faint to opaque, or two, opaque at the ends and transparent in the middle.
    """
    from matplotlib.colors import LinearSegmentedColormap, to_rgba

    strong = [to_rgba(colour) for colour in colours]
    if len(strong) == 1:
        ramp = [(0.0, (*strong[0][:3], _FAINTEST)), (1.0, strong[0])]
    else:
        low, high = strong
        ramp = [(0.0, low), (0.5, (*low[:3], 0.0)), (0.5, (*high[:3], 0.0)), (1.0, high)]
    return LinearSegmentedColormap.from_list("faded", ramp, N=_STEPS)


def colour_bar(figure: Figure, shown: ScalarMappable, axes: Axes, **given: Any) -> None:
    """A colour bar of separate areas in the colours of the page's theme; arguments of ``Figure.colorbar``."""
    bar = figure.colorbar(shown, ax=axes, **given)
    if bar.solids is not None:  # otherwise it is an image, in the colours of the light page
        bar.solids.set_rasterized(False)


@styled
def inline_svg(figure: Figure, name: str, description: str) -> str:
    """A figure as an SVG element, deterministic and without addresses outside the page.

    Args:
        figure: drawn by matplotlib; its text remains text. Colours of `THEMED` become the style sheet's.
        name: a name that is unique in the page; the prefix of every id in the element.
    """
    from matplotlib import rc_context

    # Ids are numbered: matplotlib's are hashes of positions, which the layout reproduces only up to rounding.
    ids: dict[str, str] = {}

    def own(given: str) -> str:
        return ids.setdefault(given, f"{name}-{len(ids)}")

    def in_page(tag: re.Match[str]) -> str:
        drawn = tag[0].replace('<g id="QuadMesh', '<g shape-rendering="crispEdges" id="QuadMesh')  # no seams
        text = _ID.sub(lambda match: f'id="{own(match[1])}"', _NAMES.sub("", drawn))
        text = _REFERENCE.sub(lambda match: match[1] + own(match[2]), text)
        return _COLOUR.sub(lambda match: f"var(--{THEMED[match[0]]})", text)

    buffer = io.StringIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        figure.savefig(buffer, format="svg", metadata={"Date": None}, transparent=True)
    text = buffer.getvalue()
    for pattern in _NOT_HTML:
        text = pattern.sub("", text)
    text = _TAG.sub(in_page, text)
    text = _OPENING.sub(lambda match: _SIZE.sub("", match[0]), text, count=1)
    label = description.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
    return text.replace("<svg", f'<svg role="img" aria-label="{label}"', 1)


def shown_text(svg: str) -> str:
    """The distinct characters in elements of `inline_svg`, in order."""
    return "".join(sorted(set(unescape(_TAG.sub("", svg)))))
