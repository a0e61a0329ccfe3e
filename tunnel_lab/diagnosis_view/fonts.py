"""The font of the figures as part of the page."""

from __future__ import annotations

import base64
import io
from pathlib import Path

FAMILY = "DejaVu Sans"
"""matplotlib places the text of a figure by the widths of this font, which it ships."""


def font_face(characters: str) -> str:
    """A rule of a style sheet that holds the font, reduced to some characters.

    Args:
        characters: those that the figures show; what the font lacks is left to the browser's fonts.

    Returns:
        The rule, with the font in WOFF; always the same for the same characters.
    """
    import matplotlib
    from fontTools.subset import Options, Subsetter, load_font

    file = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
    options = Options(
        flavor="woff", layout_features=[], hinting=False, drop_tables=["FFTM", "GPOS", "GSUB", "GDEF", "kern"]
    )
    subsetter = Subsetter(options)
    subsetter.populate(text=characters)
    buffer = io.BytesIO()
    with load_font(str(file), options) as font:
        subsetter.subset(font)
        font.flavor = "woff"
        font.save(buffer)
    data = base64.b64encode(buffer.getvalue()).decode("ascii")
    return f'@font-face {{ font-family: "{FAMILY}"; src: url(data:font/woff;base64,{data}) format("woff"); }}'
