"""The stage Diagnose: the command in a process of its own, its answer, and causes switched on and off by hand."""

from __future__ import annotations

from typing import Any

from nicegui import run, ui

from tunnel_lab.bench import hand, work
from tunnel_lab.bench.parts import Fault, Frame, button, show_command, show_parts
from tunnel_lab.bench.stages import is_current, read_result
from tunnel_lab.bench.workspace import Session
from tunnel_lab.commands.diagnose import STEPS
from tunnel_sim.vocabulary.errors import TunnelError

WORK = "diagnosis"
_POLL_S = 0.5
_ABOUT_HAND = (
    "Switch causes on and off: they are fitted to the training runs, and the gap is predicted for runs, or stretches "
    "of time, held out of the fit. This does not change the diagnosis."
)


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
        self._progress = ui.element("ol").classes("progress").props("role=status aria-live=polite")
        self._result = ui.element("div")
        self._on = ui.element("p").classes("buttons")
        self._look()
        ui.timer(_POLL_S, self._look)

    def _look(self) -> None:
        one = work.work_of(self._log)
        result = self._session.diagnosis
        state = (one, result.stat().st_mtime_ns if result.is_file() else 0)
        if state == self._shown:
            return
        was_running = isinstance(self._shown, tuple) and self._shown[0].running
        changed = self._shown is None or state[1] != self._shown[1] or was_running != one.running  # type: ignore[index]
        self._shown = state
        self._show_buttons(one)
        self._show_progress(one)
        if one.error:
            self._fault.show(one.error)
        if changed:
            self._show_result()

    def _show_buttons(self, one: work.Work) -> None:
        self._buttons.clear()
        with self._buttons:
            if not one.running:
                button("Diagnose again" if self._session.diagnosis.is_file() else "Diagnose", self._start, main=True)
                return
            if one.paused:
                button("Go on", lambda: work.go_on(self._log), main=True)
            else:
                button("Pause", lambda: work.pause(self._log))
            button("Stop", self._stop)
            words = "Paused; it goes on where it was." if one.paused else "It runs in a process of its own: this page may be closed."
            ui.label(words).classes("soft")

    async def _start(self) -> None:
        with self._fault.around():
            await run.io_bound(work.start, _words(self._session), self._log)

    async def _stop(self) -> None:
        await run.io_bound(work.stop, self._log)
        self._fault.show("stopped; a diagnosis that was stopped starts again from the beginning, a paused one goes on")

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

    def _show_result(self) -> None:
        self._result.clear()
        with self._fault.around(), self._result:
            document = read_result(self._session.diagnosis)
            if document is not None and is_current(self._session, self._session.diagnosis):
                _Answer(self._session, document)
            elif document is not None:
                ui.label("The campaign has changed since it was diagnosed; diagnose it again.").classes("fault")
        self._frame.refresh()
        self._on.clear()
        with self._on:
            self._frame.way_on()


def _words(session: Session) -> list[str]:
    return ["diagnose", str(session.campaign), "--json", str(session.diagnosis)]


class _Answer:
    """The answer: in words, in figures, and by hand."""

    def __init__(self, session: Session, document: dict[str, Any]) -> None:
        from tunnel_lab.diagnosis_view import view

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
        ui.timer(0.0, lambda: self._draw(session, document), once=True)
        self._words(document)
        if document["gap"]["detected"]:
            ByHandPart(session, document)

    async def _draw(self, session: Session, document: dict[str, Any]) -> None:
        drawings = await run.io_bound(figures, session, document)
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


class ByHandPart:
    """Switches for the causes, and the closure with those that are on.

    Args:
        session: whose campaign it is.
        document: of its diagnosis; its causes are on at first.
    """

    def __init__(self, session: Session, document: dict[str, Any]) -> None:
        from tunnel_sim.effects import known_effects

        self._session, self._waiting = session, False
        ui.html("By hand", sanitize=False, tag="h2")
        ui.label(_ABOUT_HAND).classes("soft")
        listed = [name for one in document["candidates"] for name in one["effect"].split(" + ")]
        known = [kind for kind in known_effects() if kind.fitted]
        known.sort(key=lambda kind: listed.index(kind.name) if kind.name in listed else len(listed))
        self._boxes = {}
        with ui.element("fieldset").classes("switches"):
            with ui.element("legend"):
                ui.html("Causes", sanitize=False, tag="span")
            for kind in known:
                box = ui.checkbox(kind.name.replace("_", " "), value=kind.name in document["causes"])
                self._boxes[kind.name] = box.on_value_change(self._change)
        self._fault = Fault()
        self._place = ui.element("div").props("role=status aria-live=polite").classes("by-hand")
        ui.timer(0.0, self._change, once=True)

    async def _change(self) -> None:
        """Fit what is chosen; changes made meanwhile are fitted together afterwards."""
        if self._waiting:
            return
        chosen = None
        self._waiting = True
        self._place.classes(add="waiting")
        try:
            while chosen != (chosen := [name for name, box in self._boxes.items() if box.value]):
                await self._fit(chosen)
        finally:
            self._waiting = False
            self._place.classes(remove="waiting")

    async def _fit(self, chosen: list[str]) -> None:
        try:
            found = await hand.closure(self._session.campaign, chosen)
        except TunnelError as error:
            self._fault.show(error)
            return
        self._fault.clear()
        self._place.clear()
        with self._place:
            show_closure(found)


def show_closure(found: Any) -> None:
    """The closure with causes chosen by hand.

    Args:
        found: of `diagnosis.by_hand`.
    """
    from tunnel_lab.diagnosis_view.view import estimate, excess, percent

    with ui.element("div").classes("facts"):
        left = excess(found.after if found.effects else found.before)
        for value, label in (
            (percent(found.closed), f"share closed, {found.held_out}"),
            (f"{left} noise variances", "left of the gap"),
            (f"{excess(found.before)} noise variances", "with the nominal model"),
        ):
            with ui.element("div"):
                ui.label(value).classes("value")
                ui.label(label).classes("soft")
    ui.linear_progress(found.closed, show_value=False).props('aria-label="share of the gap closed"')
    with ui.element("ul").classes("notes"):
        for name, value in found.parameters.items():
            with ui.element("li"):
                ui.label(f"{name.replace('_', ' ').replace('.', ': ')} = {estimate(value.to_json_dict())}")


def figures(session: Session, document: dict[str, Any]) -> list[str]:
    """The report's figures of the summary, as elements of a page.

    Args:
        session: whose campaign it is.
        document: of its diagnosis.
    """
    from tunnel_lab.diagnosis_view.figures_waterfall import waterfall_figure
    from tunnel_lab.diagnosis_view.figures_where import runs_figure
    from tunnel_lab.diagnosis_view.page import DESCRIPTIONS
    from tunnel_lab.diagnosis_view.svg import inline_svg

    found = {"waterfall": waterfall_figure(document)}
    if document.get("maps"):
        found["where-runs"] = runs_figure(document)
    return [inline_svg(one, name, DESCRIPTIONS[name]) for name, one in found.items() if one is not None]
