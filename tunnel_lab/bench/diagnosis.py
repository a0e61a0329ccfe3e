"""The stages of the diagnosis: Diagnose and Next run, with causes switched on and off by hand."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from math import degrees
from typing import TYPE_CHECKING, Any

from nicegui import ui

from diagnosis.printing import plain
from tunnel_lab.bench import work
from tunnel_lab.bench.parts import Fault, Frame, address, button, show_command, show_parts
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
_NO_SPRING = "no run can be planned without a stated spring"


def build_diagnose(session: Session, frame: Frame) -> None:
    """Build the page."""
    _Diagnose(session, frame)


class _Diagnose:
    """The page: it follows the log of the command, whoever has started it."""

    def __init__(self, session: Session, frame: Frame) -> None:
        self._session, self._frame = session, frame
        self._log = session.log(WORK)
        self._shown: object = None
        self._tried = ""
        self._before = ""
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
        state = work.work_of(self._log)
        result = self._session.diagnosis
        written = result.stat().st_mtime_ns if result.is_file() and not state.running else 0
        stages, self._tried = stages_of(state.lines)
        if not state.running and (seconds := work.seconds_taken(self._log)) is not None:
            self._before = f"; the last diagnosis took {seconds:.0f} s"
        now = (replace(state, lines=()), stages, written)
        if now == self._shown:
            self._show_clock(state)
            return
        self._shown = now
        self._show_buttons(state)
        self._show_clock(state)
        self._show_progress(state, stages)
        if state.error:
            self._fault.show(f"{state.error}{_AFTER_STOP if state.status == STOPPED else ''}")
        self._show_result(state)

    def _show_buttons(self, state: work.Work) -> None:
        self._buttons.clear()
        with self._buttons:
            if not state.running:
                button(
                    "Diagnose again" if self._session.diagnosis.is_file() else "Diagnose",
                    self._start,
                    main=True,
                )
                return
            if state.paused:
                button("Go on", lambda: work.go_on(self._log), main=True)
            else:
                button("Pause", lambda: work.pause(self._log))
            button("Stop", self._stop)

    def _show_clock(self, state: work.Work) -> None:
        tried = f", now with {self._tried}" if self._tried else ""
        since = (
            f"{_elapsed(state):.0f} s so far{self._before}{tried}. "
            "It runs in a process of its own: this page may be closed."
        )
        words = "Paused; it goes on where it was." if state.paused else since
        self._clock.set_text(f"{words} {_STOP}" if state.running else "")

    async def _start(self) -> None:
        with self._fault.around():
            await asyncio.to_thread(work.start, _words(self._session), self._log)

    async def _stop(self) -> None:
        await asyncio.to_thread(work.stop, self._log)

    def _show_progress(self, state: work.Work, stages: tuple[tuple[str, str], ...]) -> None:
        self._progress.clear()
        if not state.running:
            return
        with self._progress:
            for place, (seconds, words) in enumerate(stages):
                last = place == len(stages) - 1
                with ui.element("li").classes("now" if last else "done"):
                    ui.label(f"{words} … since {seconds} s" if last else f"{words}, from {seconds} s on")

    def _show_result(self, state: work.Work) -> None:
        self._result.clear()
        self._on.clear()
        if state.running:
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


def stages_of(lines: Sequence[str]) -> tuple[tuple[tuple[str, str], ...], str]:
    """How far a diagnosis has come, by what it has printed.

    Returns:
        The stages begun, each with the time of its begin (s, as printed) and its name; and the set of effects that
        the last one tries, in words, empty where there is none.
    """
    stages: list[tuple[str, str]] = []
    tried = ""
    for line in lines:
        seconds, _, words = line.partition(" s: ")
        stage, _, effects = words.partition(": ")
        if words in STEPS.values():
            stages.append((seconds, words))
            tried = ""
        elif stages and stage == stages[-1][1]:
            tried = plain(effects)
    return tuple(stages), tried


def _elapsed(state: work.Work) -> float:
    """Time since a command was started, s."""
    if not state.started:
        return 0.0
    return (datetime.now().astimezone() - datetime.fromisoformat(state.started)).total_seconds()


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
        if (document.get("maps") or {}).get("traces"):
            ui.html("The fit over the data", sanitize=False, tag="h2")
            source = f"{address(session, 'fit.html')}?{time.time_ns()}"
            ui.element("iframe").classes("fit-frame").props(
                f'src="{source}" title="The fit over the data" loading=lazy'
            )
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
        from diagnosis.closure import closable_table, closable_words

        show_parts([printing.where_line(document), *printing.rival_lines(document)])
        show_parts([printing.candidates_table(document), printing.parameters_table(document)])
        show_parts([printing.waterfall_table(document), printing.coefficients_table(document)])
        with ui.expansion("What remains, the runs, and caveats"):
            show_parts([document["rest"]["words"], closable_words(document), closable_table(document)])
            show_parts([printing.gap_table(document), *printing.closing_lines(document)])


def figures(document: dict[str, Any]) -> list[str]:
    """The report's figures of the summary, as elements of a page."""
    from tunnel_lab.report.drawing import inline_svg
    from tunnel_lab.report.page import DESCRIPTIONS
    from tunnel_lab.report.waterfall import waterfall_figure
    from tunnel_lab.report.where import runs_figure

    drawn = {"waterfall": waterfall_figure(document)}
    if document.get("maps"):
        drawn["where-runs"] = runs_figure(document)
    return [
        inline_svg(figure, name, DESCRIPTIONS[name]) for name, figure in drawn.items() if figure is not None
    ]


class ByHandPart:
    """Switches for the causes, and the closure with those that are on.

    Args:
        document: of its diagnosis; its causes are on at first.
    """

    def __init__(self, session: Session, document: dict[str, Any]) -> None:
        from tunnel_sim.effects import known_effects

        self._session, self._document = session, document
        self._waiting = self._converged = False
        ui.html("By hand", sanitize=False, tag="h2")
        ui.label(_ABOUT).classes("soft")
        listed = [name for candidate in document["candidates"] for name in candidate["effect"].split(" + ")]
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
            closure = await self._closure(*now)
            if self._place.is_deleted:  # the page was left
                return
            self._place.clear()
            with self._place:
                if closure is not None:
                    show_closure(closure, self._document)
        self._waiting = False
        self._place.classes(remove="waiting")

    async def _closure(self, effects: list[str], converged: bool) -> Closure | None:
        try:
            closure = await work.closure(
                self._session.campaign, self._session.state(), effects, converged=converged
            )
        except TunnelError as error:
            self._fault.show(error)
            return None
        self._fault.clear()
        return closure


def show_closure(closure: Closure, document: dict[str, Any]) -> None:
    """The closure with causes chosen by hand.

    Args:
        document: of the diagnosis, whose units it is shown in.
    """
    from tunnel_lab.report.view import estimate, misfit_shown, percent

    with ui.element("div").classes("facts"):
        for value, label in (
            (percent(closure.closed), f"share closed, {closure.held_out}"),
            (misfit_shown(document, closure.after), "left of the misfit, root mean square"),
            (misfit_shown(document, closure.before), "with the nominal model"),
        ):
            with ui.element("div"):
                ui.label(value).classes("value")
                ui.label(label).classes("soft")
    ui.linear_progress(closure.closed, show_value=False).props('aria-label="share of the gap closed"')
    with ui.element("ul").classes("notes"):
        for name, given in closure.parameters.items():
            with ui.element("li"):
                words = name.replace("_", " ").replace(".", ": ")
                ui.label(f"{words} = {estimate(given.to_json_dict())}")


def build_next_run(session: Session, frame: Frame) -> None:
    """Build the page."""
    from diagnosis.printing import rival_lines
    from tunnel_lab.report.advice import next_steps, run_to_make, unplannable

    document = read_result(session.diagnosis)
    assert document is not None  # else the stage is closed
    ui.html("What to do next", sanitize=False, tag="h2")
    with ui.element("ol"):
        for step in next_steps(document):
            with ui.element("li"):
                ui.label(step)
    lines, run = rival_lines(document), run_to_make(document)
    if run is None and document["next_run"] is not None:
        lines[-1] = _too_close(document["next_run"])
    show_parts(lines)
    if run is not None:
        show_run(run)
    if why := unplannable(document):
        ui.label(why).classes("soft")
    else:
        _Rivals(session, document)
    with ui.element("p").classes("buttons"):
        frame.way_on()


class _Rivals:
    """Two answers to choose, and the run that would distinguish them."""

    def __init__(self, session: Session, document: dict[str, Any]) -> None:
        from tunnel_lab.report.view import windy
        from tunnel_sim.effects import known_effects

        self._session = session
        blown = windy(document)  # an effect of the wind cannot be fitted where none blew
        fitted = {
            kind.name: plain(kind.name)
            for kind in known_effects()
            if kind.fitted and (blown or kind.condition == "always")
        }
        answers = [
            [name for name in candidate["effect"].split(" + ") if name in fitted]
            for candidate in document["candidates"]
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
        from tunnel_lab.report.advice import LEAST_SEPARATION

        self._place.clear()
        with self._fault.around():
            first, second = sorted(self._first.value), sorted(self._second.value)
            if first == second:
                raise TunnelError("both answers are the same", remedy="choose different causes")
            with self._place:
                ui.label("Simulating runs …").classes("soft")
            try:
                run = await work.next_run(self._session.campaign, self._session.state(), first, second)
            finally:
                if not self._place.is_deleted:
                    self._place.clear()
            if self._place.is_deleted:  # the page was left
                return
            if run is None:
                raise TunnelError(_NO_SPRING, remedy="state spring_stiffness on the page Conditions")
            with self._place:
                if run["separation"] < LEAST_SEPARATION:
                    ui.label(_too_close(run))
                else:
                    show_run(run)


def _too_close(run: Mapping[str, float]) -> str:
    """That no run distinguishes two answers, in a sentence."""
    return (
        "No run that can be set distinguishes these answers: with the best one they differ by "
        f"{run['separation']:.1f} standard deviations of the noise."
    )


def show_run(run: Mapping[str, float]) -> None:
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
    with ui.element("p").classes("buttons"):
        button("Download the plan", lambda: ui.download(run_table(run).encode(), "next-run.toml"))


def run_table(run: Mapping[str, float]) -> str:
    """A run to make, as the table that ``campaign.toml`` takes once its record is there."""
    import tomli_w

    stated = {name: run[name] for name in ("wind_speed", "spring_stiffness", "release_angle")}
    head = f"# Record {run['duration']:g} s from the release; state air_density where the wind is on.\n"
    return head + tomli_w.dumps({"runs": [{"id": "next", "file": "runs/next.csv", **stated}]})
