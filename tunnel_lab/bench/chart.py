"""A chart of readings over time, drawn by uPlot, with marks that one can drag or move with the arrow keys."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from nicegui import events, ui


class Chart(ui.element, component="static/chart.js"):
    """The chart.

    Args:
        title: what it shows, for a screen reader too.
        x: label of the abscissa, with its unit.
        y: label of the ordinate, with its unit.
        series: labels of the curves and the names of their colours (``before``, ``after``, ``soft``, …).
        data: abscissas and the ordinates of every curve; None is a gap.
        moved: called with the id of a mark and where it was moved, in the unit of its axis; may be awaitable.
    """

    def __init__(
        self,
        title: str,
        x: str,
        y: str,
        series: Sequence[tuple[str, str]],
        data: Sequence[Sequence[float | None]],
        moved: Callable[[str, float], Any] | None = None,
    ) -> None:
        super().__init__()
        self._props.update(title=title, x=x, y=y, series=[list(one) for one in series], data=data)
        self._props.update(marks=[])
        self.classes("chart")
        if moved is not None:
            self.on("moved", lambda event: moved(*_mark(event)))

    def show(self, data: Sequence[Sequence[float | None]]) -> None:
        """Show other curves of the same labels."""
        self._props["data"] = data
        self.update()

    def show_marks(self, marks: Sequence[Mapping[str, Any]]) -> None:
        """Show marks.

        Args:
            marks: ``id``, ``label``, ``kind``, ``at`` and its ``unit`` of each. A ``start`` or an ``end`` is on the
                abscissa. A ``rest`` is on the ordinate, drawn from ``from`` to ``to`` with the words ``about``.
        """
        self._props.update(marks=[dict(one) for one in marks])
        self.update()


def _mark(event: events.GenericEventArguments) -> tuple[str, float]:
    return str(event.args["id"]), float(event.args["at"])
