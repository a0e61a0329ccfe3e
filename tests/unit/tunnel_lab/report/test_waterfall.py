"""The waterfall draws what its document says, and no text of it lies on a mark, an axis or another text.

Truth: a document written by hand.
"""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pytest
from matplotlib.transforms import Bbox

from tests.marks import slow
from tests.support.diagnosis_document import CAUSE, RIVAL, findings_of, rms
from tests.support.rendered import waterfall_figure
from tests.support.shown_numbers import assert_shows

Document = dict[str, Any]


def axes_of(given: Document) -> Any:
    fig = waterfall_figure(findings_of(given))
    assert fig is not None
    (axes,) = fig.axes
    return axes


def dots(axes: Any) -> list[tuple[float, float]]:
    """Places of all dots: of the nominal model, of the rest, and of what is left without each cause."""
    drawn = [line.get_xydata() for line in axes.lines if line.get_marker() == "o"]
    return [(float(x), float(y)) for line in drawn for x, y in line if np.isfinite(x)]


def test_bars_dots_and_texts(given: Document) -> None:
    axes = axes_of(given)
    *bars, shade = axes.patches
    ends = [(bar.get_x(), bar.get_x() + bar.get_width()) for bar in bars]
    box = shade.get_extents().transformed(axes.transData.inverted())
    noise = 3.0 * np.sqrt(np.mean(np.square([0.021, 0.019, 0.017])) / 3.0)
    assert (box.x0, box.x1) == pytest.approx((0.0, rms(noise)))
    assert np.array(ends) == pytest.approx(rms([(2.75, 28.45), (0.1345, 2.75)]))
    assert [bar.get_y() + 0.5 * bar.get_height() for bar in bars] == pytest.approx([1.0, 2.0])
    nominal, leaves, last, rest = (text.get_text() for text in axes.texts)
    for text, value in zip((nominal, leaves, rest), rms([28.45, 2.75, 0.1345]), strict=True):
        assert_shows(text, [value])
        assert "°" in text
    assert last == ""  # what the last cause leaves is the rest
    assert rest.endswith("°, immaterial")
    labels = [label.get_text() for label in axes.get_yticklabels()]
    assert labels == ["without the causes", "+ quadratic damping", "+ coulomb friction", "the rest"]
    assert np.array(dots(axes)) == pytest.approx(
        np.array([(rms(28.45), 0), (rms(0.1345), 3), (rms(21.85), 1), (rms(2.85), 2)])
    )
    assert axes.get_xscale() == "linear"
    assert axes.get_xlabel() == "root mean square misfit [°]"


def test_below_the_noise_it_ends_at_zero_and_says_so(given: Document) -> None:
    given["waterfall"][-1]["excess"] = -0.002
    given["maps"], given["rest"] = None, given["rest"] | {"significant": False}
    axes = axes_of(given)
    assert dots(axes)[1] == (0.0, 3.0)
    assert axes.texts[-1].get_text() == "within the noise"
    assert waterfall_figure(findings_of(given | {"waterfall": given["waterfall"][:1]})) is None


def key(axes: Any) -> set[str]:
    return {text.get_text() for text in axes.legend_.get_texts()} if axes.legend_ else set()


def test_the_key_names_only_what_is_seen(given: Document) -> None:
    assert key(axes_of(given)) == {"noise (3σ)", "without this cause alone"}
    given["without"] = {}
    assert key(axes_of(given)) == {"noise (3σ)"}
    for step in given["waterfall"]:
        step["excess"] *= 1e6
    assert key(axes_of(given)) == set()


def test_the_caption_explains_the_circles_where_there_are_any(given: Document) -> None:
    circles = "Open circles: all causes but this one."
    assert circles in findings_of(given).pictures["waterfall"].caption
    given["without"] = dict(list(given["without"].items())[:1])
    assert circles not in findings_of(given).pictures["waterfall"].caption


def boxes(axes: Any) -> tuple[list[Bbox], list[Bbox]]:
    """What is drawn of the texts and of the dots, in pixels."""
    axes.figure.draw_without_rendering()
    texts = [text.get_window_extent() for text in axes.texts if text.get_text()]
    half = 0.5 * 5.0 / 72.0 * axes.figure.dpi
    centres = axes.transData.transform(dots(axes))
    return texts, [Bbox([centre - half, centre + half]) for centre in centres]


WITHOUT = [(28.45, 2.75), (28.7, 2.9), (36.0, 5.0), (60.0, 26.0), (21.85, 2.85)]


@pytest.mark.parametrize("without", WITHOUT)
@pytest.mark.parametrize("rest", [0.1345, -0.002])
@pytest.mark.parametrize("unit", ["rad", slow("rad/s2")])
def test_nothing_lies_on_anything_else(
    given: Document, without: tuple[float, float], rest: float, unit: str
) -> None:
    given["gap"]["misfit"]["unit"] = unit
    given["without"] = dict(zip((CAUSE, RIVAL), without, strict=True))
    given["waterfall"][-1]["excess"] = rest
    given["rest"] |= {"significant": rest > 0.0}
    axes = axes_of(given)
    texts, marks = boxes(axes)
    plot, page = axes.get_window_extent(), axes.figure.bbox
    for one, other in combinations(texts, 2):
        assert not one.overlaps(other)
    for text in texts:
        assert not any(text.overlaps(mark) for mark in marks)
        assert text.y0 > plot.y0
        assert plot.x0 < text.x0
        assert text.x1 <= page.x1
    for mark in marks:
        assert plot.x0 < mark.x0
        assert plot.y0 < mark.y0
    labels = [label.get_window_extent() for label in axes.get_yticklabels()]
    assert all(label.x1 < min(mark.x0 for mark in marks) for label in labels)
    assert all(label.y0 > plot.y0 for label in labels)
    frame = axes.legend_.get_window_extent()
    assert frame.y0 >= plot.y1
    assert frame.y0 - plot.y1 < 12.0
    assert frame.x0 == pytest.approx(plot.x0, abs=6.0)
