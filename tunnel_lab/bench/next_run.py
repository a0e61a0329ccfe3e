"""The stage Next run: which run would distinguish two answers, how long, and by how much."""

from __future__ import annotations

from math import degrees
from typing import Any

from nicegui import ui

from tunnel_lab.bench import work
from tunnel_lab.bench.parts import Fault, Frame, button, show_parts
from tunnel_lab.bench.workspace import Session, read_result
from tunnel_sim.vocabulary.errors import TunnelError

_NO_SPRING = "no run can be planned without a stated spring"


def build(session: Session, frame: Frame) -> None:
    """Build the page."""
    from diagnosis.printing import rival_lines
    from tunnel_lab.report.view import next_steps

    document = read_result(session.diagnosis)
    assert document is not None  # else the stage is closed
    ui.html("What to do next", sanitize=False, tag="h2")
    with ui.element("ol"):
        for step in next_steps(document):
            with ui.element("li"):
                ui.label(step)
    show_parts(rival_lines(document))
    if document["next_run"] is not None:
        show_run(document["next_run"])
    _Rivals(session, document)
    with ui.element("p").classes("buttons"):
        frame.way_on()


class _Rivals:
    """Two answers to choose, and the run that would distinguish them."""

    def __init__(self, session: Session, document: dict[str, Any]) -> None:
        from tunnel_sim.effects import known_effects

        self._session = session
        fitted = {kind.name: kind.name.replace("_", " ") for kind in known_effects() if kind.fitted}
        answers = [
            [name for name in one["effect"].split(" + ") if name in fitted] for one in document["candidates"]
        ]
        answers = [answer for answer in answers if answer] or [[next(iter(fitted))]]
        ui.html("Which run would distinguish two answers?", sanitize=False, tag="h2")
        with ui.element("div").classes("fields"):
            self._first, self._second = (
                ui.select(fitted, label=label, value=answer, multiple=True).props("dense use-chips")
                for label, answer in (
                    ("This answer", answers[0]),
                    ("or that one", answers[min(1, len(answers) - 1)]),
                )
            )
        self._fault = Fault()
        with ui.element("p").classes("buttons"):
            button("Find the run", self._find)
        self._place = ui.element("div").props("role=status aria-live=polite")

    async def _find(self) -> None:
        self._place.clear()
        with self._fault.around():
            first, second = sorted(self._first.value), sorted(self._second.value)
            if first == second:
                raise TunnelError("both answers are the same", remedy="choose different causes")
            with self._place:
                ui.label("Simulating runs …").classes("soft")
            try:
                found = await work.next_run(self._session.campaign, self._session.state(), first, second)
            finally:
                if not self._place.is_deleted:
                    self._place.clear()
            if self._place.is_deleted:  # the page was left
                return
            if found is None:
                raise TunnelError(_NO_SPRING, remedy="state spring_stiffness on the page Conditions")
            with self._place:
                show_run(found)


def show_run(run: dict[str, float]) -> None:
    """A run to make.

    Args:
        run: spring stiffness (N m/rad), wind speed (m/s), release angle (rad), duration (s) and separation.
    """
    wind = "off" if run["wind_speed"] == 0.0 else f"{run['wind_speed']:g} m/s"
    with ui.element("div").classes("facts"):
        for value, label in (
            (f"{run['spring_stiffness']:.4g} N m/rad", "spring"),
            (wind, "wind"),
            (f"{run['release_angle']:.2g} rad ({degrees(run['release_angle']):.0f}°)", "release"),
            (f"{run['duration']:.3g} s", "length of the record"),
            (f"{run['separation']:.0f} standard deviations", "expected difference, in the noise's"),
        ):
            with ui.element("div"):
                ui.label(value).classes("value")
                ui.label(label).classes("soft")
