"""The stages of the diagnosis: Diagnose, with causes switched on and off by hand, Next run, and Report."""

from __future__ import annotations

import asyncio
import re
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import partial
from html import escape
from typing import TYPE_CHECKING

import tomli_w
from nicegui import ui

from diagnosis.findings.next_run import NextRun
from diagnosis.result import Diagnosis
from identification.show.blocks import Paragraph, typeset
from identification.show.numbers import plain, reading_shown
from tunnel_lab.bench import work
from tunnel_lab.bench.left_out import build_choice, left_out_of, options
from tunnel_lab.bench.parts import (
    Fault,
    Frame,
    address,
    button,
    heading,
    show_blocks,
    show_command,
    show_facts,
    show_items,
)
from tunnel_lab.bench.workspace import DIAGNOSIS, Session, is_current, read_diagnosis
from tunnel_lab.terminal.progress import STEPS
from tunnel_lab.terminal.time_left import Reached
from tunnel_sim.files.reading import read_json
from tunnel_sim.files.writing import write_json
from tunnel_sim.vocabulary.dimensions import beside
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.freedom import Freedom

if TYPE_CHECKING:
    from diagnosis.by_hand import Closure
    from identification.show.quantity import Quantity


STOPPED = 130
_FIRST = (("where",), ("which", "found"), ("coefficients-section", "uncertainty"))
"""Sections below the figures, in groups side by side; the others are folded."""
_ELSEWHERE = ("answer", "fit", "place", "closes", "next")
"""Sections that the page shows in another way, or that another page shows."""
_AFTER_STOP = "; a stopped diagnosis starts again from the beginning, a paused one continues where it was"
_BEFORE = (
    "It compares sets of effects with the runs: half a minute to several minutes, also with this page closed."
)
_STOP = "Stop ends it: a stopped diagnosis starts again from the beginning."
_POLL_S = 0.5
_PRINTED = re.compile(r"(\d+\.\d) s: ([^:]+)(?:: (.+))?")
_ABOUT = (
    "Switch causes on and off: they are fitted in their textbook form, and the gap is predicted for "
    "held-out runs, or stretches of time. The diagnosis does not change; it also frees the forms."
)
_CONVERGE = "Free the forms, and fit to convergence (up to a minute)"
_NO_SPRING = "no run can be planned without a stated spring"


class DiagnosePage:
    """The page: it follows the log of the command, wherever the command was started."""

    def __init__(self, session: Session, frame: Frame) -> None:
        self._session, self._frame = session, frame
        self._log = session.log(DIAGNOSIS)
        self._shown: object = None
        self._before = ""
        build_choice(session, self._show_command)
        self._place = ui.element("div")
        self._show_command()
        self._fault = Fault()
        self._buttons = ui.element("p").classes("buttons")
        self._clock = ui.label().classes("soft")
        self._progress = ui.element("ol").classes("progress").props("role=status aria-live=polite")
        self._result = ui.element("div")
        self._on = ui.element("p").classes("buttons")
        self._look()
        ui.timer(_POLL_S, self._look)

    @property
    def _command(self) -> tuple[str, ...]:
        session = self._session
        return "diagnose", str(session.campaign), *options(session), "--json", str(session.diagnosis)

    def _show_command(self) -> None:
        self._place.clear()
        with self._place:
            show_command(" ".join(("tunnel", *self._command)))

    def _look(self) -> None:
        state = work.work_of(self._log)
        result = self._session.diagnosis
        written = result.stat().st_mtime_ns if result.is_file() and not state.running else 0
        progress = progress_of(state.lines)
        if not state.running and (took := work.seconds_taken(self._log)) is not None:
            self._before = f"; the last diagnosis took {took:.0f} s"
        now = (replace(state, lines=(), printed=0.0), progress.stages, written)
        words = "Paused; it continues where it was."
        if state.running and not state.paused:
            begun = datetime.fromisoformat(state.started)
            elapsed = (datetime.now().astimezone() - begun).total_seconds()
            tried = f" Now with {progress.tried}." if progress.tried else ""
            left = "time left not known after a pause"
            if not state.pauses:
                left = progress.reached.words(progress.seconds + time.time() - state.printed)
                left += " (known once a gap is found)" if left.endswith("yet") else ""
            words = (
                f"{elapsed:.0f} s so far, {left}{self._before}.{tried} "
                "It runs in a separate process: this page may be closed."
            )
        self._clock.set_text(f"{words} {_STOP}" if state.running else "")
        if now == self._shown:
            return
        self._shown = now
        self._buttons.clear()
        with self._buttons:
            if not state.running:
                words = "Diagnose again" if result.is_file() else "Diagnose"
                button(words, self._start, main=True)
            elif state.paused:
                button("Continue", lambda: work.go_on(self._log), main=True)
            else:
                button("Pause", lambda: work.pause(self._log))
            if state.running:
                button("Stop", self._stop)
        self._progress.clear()
        with self._progress:
            for place, (seconds, words) in enumerate(progress.stages if state.running else (), 1):
                last = place == len(progress.stages)
                with ui.element("li").classes("now" if last else "done"):
                    ui.label(f"{words} … since {seconds} s" if last else f"{words}, from {seconds} s on")
        if state.error:
            self._fault.show(f"{state.error}{_AFTER_STOP if state.status == STOPPED else ''}")
        self._result.clear()
        self._on.clear()
        if state.running:
            return
        with self._result:
            self._show_answer()
        self._frame.refresh(self._on)
        if not result.is_file() and not state.error:
            self._clock.set_text(_BEFORE)

    def _show_answer(self) -> None:
        try:
            answer = read_diagnosis(self._session)
            if answer is not None and is_current(self._session, self._session.diagnosis):
                ShownAnswer(self._session, answer)
            elif answer is not None:
                words = "The campaign has changed since it was diagnosed; diagnose it again."
                ui.label(words).classes("fault")
        except TunnelError as error:
            self._fault.show(error)

    async def _start(self) -> None:
        self._clock.set_text("Starting: the program loads its models, which takes a few seconds …")
        with self._fault.around():
            await asyncio.to_thread(work.start, self._command, self._log)

    async def _stop(self) -> None:
        await asyncio.to_thread(work.stop, self._log)


@dataclass(frozen=True)
class DiagnosisProgress:
    """The progress of a diagnosis, from its printed lines.

    Args:
        stages: time (s since the start, as printed) and name of each stage that has begun.
        tried: the current set of effects, in words; empty for none.
        reached: the last stage.
        seconds: time of the last line, s since the start.
    """

    stages: tuple[tuple[str, str], ...] = ()
    tried: str = ""
    reached: Reached = field(default_factory=Reached)
    seconds: float = 0.0


def progress_of(lines: Sequence[str]) -> DiagnosisProgress:
    """The progress of a diagnosis, from its printed lines."""
    names = {words: name for name, words in STEPS.items()}
    found = DiagnosisProgress()
    for seconds, stage, effects in (m.groups() for m in map(_PRINTED.fullmatch, lines) if m):
        now = float(seconds)
        if effects is None and stage in names:
            found = DiagnosisProgress((*found.stages, (seconds, stage)), "", Reached(names[stage], now), now)
        elif effects is not None and found.stages and stage == found.stages[-1][1]:
            found = replace(found, tried=plain(effects), seconds=now)
    return found


class ShownAnswer:
    """The answer in words and figures, and fits with causes chosen by hand."""

    def __init__(self, session: Session, answer: Diagnosis) -> None:
        from diagnosis.findings.sections import sections
        from diagnosis.findings.verdict import headline

        parts = {section.key: section.blocks for section in sections(answer)}
        with ui.element("section").classes(f"verdict {headline(answer)[1]}").props("aria-label=Verdict"):
            show_blocks(parts.pop("head"))
            ui.label(answer.verdict)
        if answer.maps:
            heading("The fit over the data")
            source = f"{address(session, 'fit.html')}?{time.time_ns()}"
            ui.element("iframe").classes("fit-frame").props(
                f'src="{source}" title="The fit over the data" loading=lazy'
            )
        self._figures = ui.element("div").classes("figures")
        ui.timer(0.0, lambda: self._draw(answer), once=True)
        for keys in _FIRST:
            show_blocks(block for key in keys for block in parts.pop(key))
        with ui.expansion("Residual gap, runs and caveats"):
            for key in (key for key in parts if key not in _ELSEWHERE):
                show_blocks(parts[key])
        if answer.gap.detected:
            ByHandPart(session, answer)

    async def _draw(self, answer: Diagnosis) -> None:
        """The figures of the report's first page."""

        def drawings() -> list[str]:
            from identification.show.drawing import inline_svg

            chosen = ["waterfall", "repeatability", "where-runs"]
            if answer.repeated.repeats(answer):
                chosen.remove("repeatability")
            chosen += [one.name for finding in answer.findings.values() for one in finding.pictures(answer)]
            pictures = [answer.pictures[name] for name in chosen if name in answer.pictures]
            drawn = [(one, one.draw()) for one in pictures]
            return [
                f"{inline_svg(fig, one.name, one.description)}<figcaption>{escape(one.caption)}</figcaption>"
                for one, fig in drawn
                if fig is not None
            ]

        figures = await asyncio.to_thread(drawings)
        if self._figures.is_deleted:
            return
        with self._figures:
            for figure in figures:
                ui.html(figure, sanitize=False, tag="figure")  # drawn by this program, with escaped texts


class ByHandPart:
    """Switches for the causes, initially as diagnosed, and the closure with them."""

    def __init__(self, session: Session, answer: Diagnosis) -> None:
        from tunnel_sim.effects import known_effects

        self._session, self._answer = session, answer
        self._waiting = self._converged = False
        heading("By hand")
        ui.label(_ABOUT).classes("soft")
        listed = [name for candidate in answer.candidates for name in candidate.effect.split(" + ")]
        known = [kind for kind in known_effects() if kind.fitted]
        known.sort(key=lambda kind: listed.index(kind.name) if kind.name in listed else len(listed))
        self._boxes = {}
        with ui.element("fieldset").classes("switches"):
            with ui.element("legend"):
                ui.html("Causes", sanitize=False, tag="span")
            for kind in known:
                box = ui.checkbox(kind.name.replace("_", " "), value=kind.name in answer.causes)
                self._boxes[kind.name] = box.on_value_change(partial(self._fit_chosen, False))
        self._fault = Fault()
        self._wait = ui.label().classes("soft").props("role=status aria-live=polite")
        self._place = ui.element("div").props("role=status aria-live=polite").classes("by-hand")
        with ui.element("p").classes("buttons"):
            button(_CONVERGE, partial(self._fit_chosen, True))
        ui.timer(0.0, partial(self._fit_chosen, False), once=True)

    async def _fit_chosen(self, converged: bool) -> None:
        """Fit the chosen causes; changes made meanwhile are fitted together afterwards."""
        self._converged = converged
        if self._waiting:
            return
        self._waiting, shown = True, None
        self._place.classes(add="waiting")
        self._wait.set_text("Fitting the chosen causes …")
        while True:
            effects = [name for name, box in self._boxes.items() if box.value]
            if shown == (effects, self._converged):
                break
            shown = (effects, self._converged)
            runs = work.Runs(self._session.campaign, self._session.state(), left_out_of(self._answer))
            closure, fault = None, ""
            try:
                closure = await work.closure(runs, effects, converged=self._converged)
            except TunnelError as error:
                fault = str(error)
            if self._place.is_deleted:  # the page was left
                return
            self._fault.show(fault)
            self._place.clear()
            with self._place:
                if closure is not None:
                    show_closure(closure, self._answer)
        self._waiting = False
        self._place.classes(remove="waiting")
        self._wait.set_text("")


def show_closure(closure: Closure, answer: Diagnosis) -> None:
    """The closure with causes chosen by hand, in the units of the diagnosis' document."""
    from identification.show.numbers import estimated, share, unit_mark

    def size(given: Quantity) -> str:
        return typeset(estimated(given, unit_mark(beside(given.unit, ""))))

    show_facts(
        [
            (share(closure.closed), f"explained {closure.held_out}"),
            (answer.misfit.words(closure.after), "residual misfit, root mean square"),
            (answer.misfit.words(closure.before), "with the nominal model"),
        ]
    )
    ui.linear_progress(closure.closed, show_value=False).props('aria-label="share of the gap explained"')
    with ui.element("ul").classes("notes"):
        show_items(
            f"{name.replace('_', ' ').replace('.', ': ')} = {size(given)}"
            for name, given in closure.parameters.items()
        )


def build_next_run(session: Session, frame: Frame) -> None:
    """Build the page."""
    from diagnosis.findings.next_steps import next_steps, rival_lines, run_to_make, unplannable

    answer = read_diagnosis(session)
    assert answer is not None  # otherwise the stage is closed
    heading("What to do next")
    with ui.element("ol"):
        show_items(answer.freedom.texts(list(next_steps(answer)), answer.names))
    show_blocks(map(Paragraph, answer.freedom.texts(list(rival_lines(answer)), answer.names)))
    if (run := run_to_make(answer)) is not None:
        show_run(run, answer.freedom)
    if why := unplannable(answer):
        ui.label(why).classes("soft")
    else:
        _Rivals(session, answer)
    with ui.element("p").classes("buttons"):
        frame.way_on()


class _Rivals:
    """Fields for two answers, and the run that would distinguish them."""

    def __init__(self, session: Session, answer: Diagnosis) -> None:
        from tunnel_sim.effects import known_effects

        self._session, self._left_out, self._settings = session, left_out_of(answer), answer.settings
        blown = answer.windy  # an effect of the wind cannot be fitted to runs without wind
        fitted = {
            kind.name: plain(kind.name)
            for kind in known_effects()
            if kind.fitted and (blown or kind.condition == "always") and kind.possible(answer.freedom)
        }
        self._freedom = answer.freedom
        answers = [
            [name for name in candidate.effect.split(" + ") if name in fitted]
            for candidate in answer.candidates
        ]
        answers = [names for names in answers if names] or [[next(iter(fitted))]]
        heading("Which run would distinguish two answers?")
        with ui.element("div").classes("fields"):
            self._first, self._second = (
                ui.select(fitted, label=label, value=names, multiple=True).props("dense use-chips")
                for label, names in (
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
                runs = work.Runs(self._session.campaign, self._session.state(), self._left_out)
                run = await work.next_run(runs, first, second)
            finally:
                if not self._place.is_deleted:
                    self._place.clear()
            if self._place.is_deleted:  # the page was left
                return
            if run is None:
                raise TunnelError(_NO_SPRING, remedy="state spring_stiffness on the page Conditions")
            with self._place:
                if not run.distinguishes():
                    ui.label(run.too_close())
                else:
                    show_run(run, self._freedom)


def show_run(run: NextRun, freedom: Freedom) -> None:
    """A run to make: its conditions (SI units), duration and separation."""
    wind = "off" if run.wind_speed == 0.0 else f"{run.wind_speed:g} m/s"
    unit = next(iter(freedom.shown))
    show_facts(
        [
            (f"{run.spring_stiffness:g} {freedom.unit('N m/rad')}", "spring"),
            *([(wind, "wind")] if freedom.windy else []),
            (f"{run.release_angle:.2g} {unit} ({reading_shown(run.release_angle, 2, unit)})", "release"),
            (f"{run.duration:.3g} s", "length of the record"),
            (f"{run.separation:.0f} standard deviations", "expected difference, in the noise's"),
        ]
    )

    def download() -> None:
        """The table to add to ``campaign.toml`` once the record exists."""
        stated = {
            "wind_speed": run.wind_speed,
            "spring_stiffness": run.spring_stiffness,
            "release_angle": run.release_angle,
        }
        density = "; state air_density where the wind is on" if freedom.windy else ""
        head = f"# Record {run.duration:g} s from the release{density}.\n"
        table = head + tomli_w.dumps(
            {"runs": [{"id": "next", "file": "runs/next.csv", **freedom.as_own(stated)}]}
        )
        ui.download(table.encode(), "next-run.toml")

    with ui.element("p").classes("buttons"):
        button("Download the plan", download)


class ReportPage:
    """The page: the report is rewritten when author or notes change."""

    def __init__(self, session: Session, _: Frame) -> None:
        self._session = session
        stated = {"author": "", "notes": ""}
        if session.byline.is_file():
            stated |= read_json(session.byline, remedy="delete it")
        with ui.element("div").classes("fields wide"):
            self._author = ui.input("Author", value=str(stated["author"])).props("dense")
            self._notes = ui.textarea(
                "Notes, shown at the head of the report", value=str(stated["notes"])
            ).props("dense autogrow")
        self._author.on("change", self._write)
        self._notes.on("change", self._write)
        self._fault = Fault()
        with ui.element("p").classes("buttons"):
            button("Download the report", self._download, main=True)
            ui.link("Open in a tab", address(session, "report.html"), new_tab=True).classes("button")
        ui.label(f"Written: {session.report}").classes("soft")
        words = " ".join(("tunnel", "diagnose", str(session.campaign), *options(session)))
        show_command(f"{words} --report {session.report} --author NAME --notes TEXT")
        self._place = ui.element("div").classes("preview")
        ui.timer(0.0, self._write, once=True)

    async def _write(self) -> None:
        author, notes = str(self._author.value or ""), str(self._notes.value or "")
        with self._fault.around():
            write_json(self._session.byline, {"author": author, "notes": notes})
            await asyncio.to_thread(write_session_report, self._session, author, notes)
            if self._place.is_deleted:  # the page was left
                return
            self._place.clear()
            source = f"{address(self._session, 'report.html')}?{time.time_ns()}"
            with self._place:
                ui.element("iframe").props(f'src="{source}" title="Preview of the report"')

    async def _download(self) -> None:
        ui.download(self._session.report, f"{self._session.name}-report.html")


def write_session_report(session: Session, author: str, notes: str) -> None:
    """Write the report of the session's diagnosis, as ``tunnel diagnose --report`` does."""
    from diagnosis.diagnosable import diagnosable
    from tunnel_lab.report import Byline, write_report
    from tunnel_sim.files.campaign_folder import read_campaign

    answer = read_diagnosis(session)
    assert answer is not None  # otherwise the stage is closed
    made = datetime.fromtimestamp(session.diagnosis.stat().st_mtime).astimezone().date().isoformat()
    given = read_campaign(session.campaign).without(left_out_of(answer))
    campaign = diagnosable(given).campaign
    write_report(answer, campaign, session.report, Byline(made, author, notes))
