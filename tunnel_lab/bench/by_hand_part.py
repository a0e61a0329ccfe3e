"""Causes switched on and off by hand, and how far the gap closes with them on what is held out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nicegui import ui

from tunnel_lab.bench import hand
from tunnel_lab.bench.parts import Fault, button
from tunnel_lab.bench.workspace import Session
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from diagnosis.by_hand import Closure

_ABOUT = (
    "Switch causes on and off: they are fitted in their textbook form, and the gap is predicted for runs, or "
    "stretches of time, held out of the fit. The diagnosis itself does not change; it also frees the forms."
)
_CONVERGE = "Free the forms, and fit to convergence (up to a minute)"


class ByHandPart:
    """Switches for the causes, and the closure with those that are on.

    Args:
        document: of its diagnosis; its causes are on at first.
    """

    def __init__(self, session: Session, document: dict[str, Any]) -> None:
        from tunnel_sim.effects import known_effects

        self._session = session
        self._waiting = self._converged = False
        ui.html("By hand", sanitize=False, tag="h2")
        ui.label(_ABOUT).classes("soft")
        listed = [name for one in document["candidates"] for name in one["effect"].split(" + ")]
        known = [kind for kind in known_effects() if kind.fitted]
        known.sort(key=lambda kind: listed.index(kind.name) if kind.name in listed else len(listed))
        self._boxes = {}
        with ui.element("fieldset").classes("switches"):
            with ui.element("legend"):
                ui.html("Causes", sanitize=False, tag="span")
            for kind in known:
                box = ui.checkbox(kind.name.replace("_", " "), value=kind.name in document["causes"])
                self._boxes[kind.name] = box.on_value_change(self._switch)
        self._fault = Fault()
        self._place = ui.element("div").props("role=status aria-live=polite").classes("by-hand")
        with ui.element("p").classes("buttons"):
            button(_CONVERGE, self._converge)
        ui.timer(0.0, self._fit_chosen, once=True)

    async def _switch(self) -> None:
        self._converged = False
        await self._fit_chosen()

    async def _converge(self) -> None:
        self._converged = True
        await self._fit_chosen()

    def _chosen(self) -> tuple[list[str], bool]:
        return [name for name, box in self._boxes.items() if box.value], self._converged

    async def _fit_chosen(self) -> None:
        """Fit what is chosen; changes made meanwhile are fitted together afterwards."""
        if self._waiting:
            return
        self._waiting, shown = True, None
        self._place.classes(add="waiting")
        while shown != (now := self._chosen()):
            shown = now
            found = await self._closure(*now)
            if self._place.is_deleted:  # the page was left
                return
            self._place.clear()
            with self._place:
                if found is not None:
                    show_closure(found)
        self._waiting = False
        self._place.classes(remove="waiting")

    async def _closure(self, effects: list[str], converged: bool) -> Closure | None:
        try:
            found = await hand.closure(self._session, effects, converged=converged)
        except TunnelError as error:
            self._fault.show(error)
            return None
        self._fault.clear()
        return found


def show_closure(found: Closure) -> None:
    """The closure with causes chosen by hand."""
    from tunnel_lab.report.view import estimate, excess, percent

    with ui.element("div").classes("facts"):
        for value, label in (
            (percent(found.closed), f"share closed, {found.held_out}"),
            (f"{excess(found.after)} noise variances", "left of the gap"),
            (f"{excess(found.before)} noise variances", "with the nominal model"),
        ):
            with ui.element("div"):
                ui.label(value).classes("value")
                ui.label(label).classes("soft")
    ui.linear_progress(found.closed, show_value=False).props('aria-label="share of the gap closed"')
    with ui.element("ul").classes("notes"):
        for name, given in found.parameters.items():
            with ui.element("li"):
                words = name.replace("_", " ").replace(".", ": ")
                ui.label(f"{words} = {estimate(given.to_json_dict())}")
