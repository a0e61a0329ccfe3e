"""The stage Diagnose: the command in a process of its own, its answer, and causes switched on and off by hand."""

from __future__ import annotations

import asyncio
from datetime import datetime
from typing import TYPE_CHECKING, Any

from nicegui import ui

from tunnel_lab.bench import work
from tunnel_lab.bench.parts import Fault, Frame, button, show_command, show_parts
from tunnel_lab.bench.workspace import Session, is_current, read_result
from tunnel_lab.terminal.progress import STEPS
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from diagnosis.by_hand import Closure


WORK = "diagnosis"
STOPPED = 130
_AFTER_STOP = "; a stopped diagnosis starts again from the beginning, a paused one goes on where it was"
_STOP = "Stop ends it: a stopped diagnosis starts again from the beginning."
_POLL_S = 0.5
_ABOUT = (
    "Switch causes on and off: they are fitted in their textbook form, and the gap is predicted for runs, or "
    "stretches of time, held out of the fit. The diagnosis itself does not change; it also frees the forms."
)
_CONVERGE = "Free the forms, and fit to convergence (up to a minute)"


def build(session: Session, frame: Frame) -> None:
    """Build the page."""
    _Diagnose(session, frame)


class _Diagnose:
    """The page: it follows the log of the command, whoever has started it."""

    def __init__(self, session: Session, frame: Frame) -> None:
        self._session, self._frame = session, frame
        self._log = session.log(WORK)
        self._shown: object = None
        show_command(" ".join(("tunnel", *_words(session))))
        self._fault = Fault()
        self._buttons = ui.element("p").classes("buttons")
        self._clock = ui.label().classes("soft")
        self._progress = ui.element("ol").classes("progress").props("role=status aria-live=polite")
        self._result = ui.element("div")
        self._on = ui.element("p").classes("buttons")
        self._look()
        ui.timer(_POLL_S, self._look)

    def _look(self) -> None:
        one = work.work_of(self._log)
        result = self._session.diagnosis
        written = result.stat().st_mtime_ns if result.is_file() and not one.running else 0
        if (one, written) == self._shown:
            self._show_clock(one)
            return
        self._shown = (one, written)
        self._show_buttons(one)
        self._show_clock(one)
        self._show_progress(one)
        if one.error:
            self._fault.show(f"{one.error}{_AFTER_STOP if one.status == STOPPED else ''}")
        self._show_result(one)

    def _show_buttons(self, one: work.Work) -> None:
        self._buttons.clear()
        with self._buttons:
            if not one.running:
                button(
                    "Diagnose again" if self._session.diagnosis.is_file() else "Diagnose",
                    self._start,
                    main=True,
                )
                return
            if one.paused:
                button("Go on", lambda: work.go_on(self._log), main=True)
            else:
                button("Pause", lambda: work.pause(self._log))
            button("Stop", self._stop)

    def _show_clock(self, one: work.Work) -> None:
        since = f"{_elapsed(one):.0f} s so far. It runs in a process of its own: this page may be closed."
        words = "Paused; it goes on where it was." if one.paused else since
        self._clock.set_text(f"{words} {_STOP}" if one.running else "")

    async def _start(self) -> None:
        with self._fault.around():
            await asyncio.to_thread(work.start, _words(self._session), self._log)

    async def _stop(self) -> None:
        await asyncio.to_thread(work.stop, self._log)

    def _show_progress(self, one: work.Work) -> None:
        self._progress.clear()
        if not one.running:
            return
        done = [line.partition(" s: ") for line in one.lines if line.partition(" s: ")[2] in STEPS.values()]
        with self._progress:
            for place, (seconds, _, words) in enumerate(done):
                last = place == len(done) - 1
                with ui.element("li").classes("now" if last else "done"):
                    ui.label(f"{words} … since {seconds} s" if last else f"{words}, from {seconds} s on")

    def _show_result(self, one: work.Work) -> None:
        self._result.clear()
        self._on.clear()
        if one.running:
            return
        with self._result:
            document = read_result(self._session.diagnosis)
            if document is not None and is_current(self._session, self._session.diagnosis):
                _Answer(self._session, document)
            elif document is not None:
                ui.label("The campaign has changed since it was diagnosed; diagnose it again.").classes(
                    "fault"
                )
        self._frame.refresh()
        with self._on:
            self._frame.way_on()


def _elapsed(one: work.Work) -> float:
    """Time since a command was started, s."""
    if not one.started:
        return 0.0
    return (datetime.now().astimezone() - datetime.fromisoformat(one.started)).total_seconds()


def _words(session: Session) -> list[str]:
    return ["diagnose", str(session.campaign), "--json", str(session.diagnosis)]


class _Answer:
    """The answer: in words, in figures, and by hand."""

    def __init__(self, session: Session, document: dict[str, Any]) -> None:
        from tunnel_lab.report import view

        answer, kind = view.headline(document)
        with ui.element("section").classes(f"verdict {kind}").props("aria-label=Verdict"):
            ui.label(answer).classes("answer")
            ui.label(document["verdict"])
            with ui.element("div").classes("facts"):
                for fact in view.facts(document):
                    with ui.element("div"):
                        ui.label(fact.value).classes("value")
                        ui.label(fact.label).classes("soft")
                        ui.label(fact.note).classes("soft")
        self._figures = ui.element("div").classes("figures")
        ui.timer(0.0, lambda: self._draw(document), once=True)
        self._words(document)
        if document["gap"]["detected"]:
            ByHandPart(session, document)

    async def _draw(self, document: dict[str, Any]) -> None:
        drawings = await asyncio.to_thread(figures, document)
        if self._figures.is_deleted:
            return
        with self._figures:
            for drawing in drawings:
                ui.html(drawing, sanitize=False, tag="figure")  # drawn here, its texts escaped

    def _words(self, document: dict[str, Any]) -> None:
        from diagnosis import printing
        from diagnosis.closable import closable_table, closable_words

        show_parts([printing.where_line(document), *printing.rival_lines(document)])
        show_parts([printing.candidates_table(document), printing.parameters_table(document)])
        show_parts([printing.waterfall_table(document), printing.coefficients_table(document)])
        with ui.expansion("What remains, the runs, and caveats"):
            show_parts([document["rest"]["words"], closable_words(document), closable_table(document)])
            show_parts([printing.gap_table(document), *printing.closing_lines(document)])


def figures(document: dict[str, Any]) -> list[str]:
    """The report's figures of the summary, as elements of a page."""
    from tunnel_lab.report.drawing import inline_svg
    from tunnel_lab.report.figures import waterfall_figure
    from tunnel_lab.report.page import DESCRIPTIONS
    from tunnel_lab.report.where import runs_figure

    found = {"waterfall": waterfall_figure(document)}
    if document.get("maps"):
        found["where-runs"] = runs_figure(document)
    return [inline_svg(one, name, DESCRIPTIONS[name]) for name, one in found.items() if one is not None]


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
            found = await work.closure(
                self._session.campaign, self._session.state(), effects, converged=converged
            )
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
