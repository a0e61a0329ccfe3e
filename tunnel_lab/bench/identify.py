"""The stage Identify: estimators side by side, and the uncertainty budget, each a command in a separate process."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import tomli_w
from nicegui import background_tasks, ui

from identification.estimate import UNITS
from identification.estimators import free_decay_estimators, summary_of
from identification.printing import (
    SYMBOLS,
    Document,
    budget_blocks,
    freedom_of,
    names_in,
    notes,
    quantity_text,
)
from identification.show.blocks import Block, Paragraph, TextTable
from identification.show.numbers import unit
from tunnel_lab.bench import work
from tunnel_lab.bench.left_out import build_choice, options
from tunnel_lab.bench.parts import Fault, Frame, button, name_of, show_blocks, show_command
from tunnel_lab.bench.workspace import ESTIMATOR, Session, is_current, read_result
from tunnel_sim.files.importing.condition_names import Conditions
from tunnel_sim.files.toml_input import load_toml
from tunnel_sim.files.writing import write_whole
from tunnel_sim.vocabulary.errors import TunnelError

_FIRST = (ESTIMATOR, "conventional", "matrix_pencil")
"""Estimators chosen initially: quick ones."""
_INPUTS = ("spring_stiffness", "wind_speed", "air_density", "frontal_area", "reference_length")
"""Stated values with an uncertainty."""
_BUDGET = "budget"
_POLL_S = 0.5
_MOST_RUNS = 50


class IdentifyPage:
    """The page: it polls the files until every command has ended."""

    def __init__(self, session: Session, frame: Frame) -> None:
        self._session, self._frame = session, frame
        self._names = free_decay_estimators()
        self._shown: object = None
        with ui.element("fieldset"):
            with ui.element("legend"):
                ui.html("Estimators", sanitize=False, tag="span")
            self._chosen = {
                name: ui.checkbox(f"{name}: {summary_of(name)}", value=name in _FIRST) for name in self._names
            }
        self._fault = Fault()
        build_choice(session, self._show_command)
        with ui.element("p").classes("buttons"):
            button("Identify", self._identify, main=True)
        self._command = ui.element("div")
        self._show_command()
        self._progress = ui.element("ul").classes("progress").props("role=status aria-live=polite")
        self._result = ui.element("div")
        self._on = ui.element("p").classes("buttons")
        with ui.expansion("Uncertainty budget"):
            words = "Standard uncertainties of the stated values, in per cent; an empty field means exact."
            ui.label(words).classes("soft")
            self._percents: dict[str, float | None] = {}
            if session.uncertainties.is_file():
                common = load_toml(session.uncertainties, missing="").get("common", {})
                self._percents = {key: 100.0 * float(value) for key, value in common.items()}
            with ui.element("div").classes("fields"):
                for key in _INPUTS:
                    field = ui.number(
                        f"{name_of(Conditions, key)} [%]", value=self._percents.get(key), min=0.0
                    )
                    field.props("dense step=any").on("change", partial(self._state, key, field))
            self._budget_fault = Fault()
            with ui.element("p").classes("buttons"):
                button("Make the budget", self._make_budget)
        self._look()
        ui.timer(_POLL_S, self._look)

    def _show_command(self) -> None:
        session = self._session
        words = " ".join(("tunnel", "identify", str(session.campaign), *options(session)))
        self._command.clear()
        with self._command:
            show_command(f"{words} --estimator {ESTIMATOR} --json {session.estimate(ESTIMATOR)}")

    def _identify(self) -> None:
        names = [name for name, box in self._chosen.items() if box.value]
        with self._fault.around():
            if ESTIMATOR not in names:
                remedy = "choose it: its estimate opens the diagnosis"
                raise TunnelError(f"{ESTIMATOR} is not chosen", remedy=remedy)
            results = {name: str(self._session.estimate(name)) for name in names}
            self._run([(name, ("--estimator", name, "--json", file)) for name, file in results.items()])

    def _state(self, key: str, field: ui.number) -> None:
        self._percents[key] = field.value

    def _make_budget(self) -> None:
        with self._budget_fault.around():
            kept = {key: value / 100.0 for key, value in self._percents.items() if value}
            document = {"schema_version": 1, "common": kept}
            write_whole(self._session.uncertainties, tomli_w.dumps(document).encode())
            models = [word for name in _FIRST if name != ESTIMATOR for word in ("--model", name)]
            words = ("--uncertainties", str(self._session.uncertainties), "--json")
            self._run([(_BUDGET, (*words, str(self._session.estimate(_BUDGET)), *models))])

    def _run(self, orders: Sequence[tuple[str, tuple[str, ...]]]) -> None:
        for name, _ in orders:
            if work.work_of(self._session.log(name)).running:
                raise TunnelError(f"{name} is running already", remedy="wait for it")
        background_tasks.create(run_commands(self._session, orders), name="identify")

    def _look(self) -> None:
        session, names = self._session, (*self._names, _BUDGET)
        works = {name: work.work_of(session.log(name)) for name in names}
        estimates = [session.estimate(name) for name in names]
        state = (works, [path.stat().st_mtime_ns for path in estimates if path.is_file()])
        if state == self._shown:
            return
        self._shown = state
        self._progress.clear()
        with self._progress:
            for name, one in works.items():
                if one.running or one.error:
                    said, style = ("running …", "") if one.running else (one.error, "fault")
                    with ui.element("li"):
                        ui.label(f"{name}: {said}").classes(style)
        self._result.clear()
        with self._fault.around(), self._result:
            *results, budget_file = estimates
            documents = [read_result(path) for path in results if is_current(session, path)]
            shown = [document for document in documents if document is not None]
            if shown:
                show_blocks(side_by_side(shown))
            budget = read_result(budget_file) if is_current(session, budget_file) else None
            if budget is not None and "budget" in budget:
                show_blocks(budget_blocks(budget))
        self._frame.refresh(self._on)


async def run_commands(session: Session, orders: Sequence[tuple[str, tuple[str, ...]]]) -> None:
    """Run several ``tunnel identify`` commands, one per processor; an order is a name for the log and options."""
    free = asyncio.Semaphore(os.cpu_count() or 1)

    async def one(name: str, given: tuple[str, ...]) -> None:
        log: Path = session.log(name)
        async with free:
            words = ("identify", str(session.campaign), *options(session), *given)
            await asyncio.to_thread(work.start, words, log)
            while (await asyncio.to_thread(work.work_of, log)).running:
                await asyncio.sleep(_POLL_S)

    await asyncio.gather(*(one(*order) for order in orders))


def side_by_side(documents: Sequence[Document]) -> list[Block]:
    """Estimates of one campaign: the coefficients, ωn and ζ of the runs, and the notes of the estimators."""
    names = tuple(str(document["estimator"]) for document in documents)
    given = [name for name in UNITS if any(document[name] for document in documents)]
    freedom, ids = freedom_of(documents[0]), names_in(documents[0])
    rows = tuple(
        (f"{SYMBOLS[name]} {unit(UNITS[name])}", *(quantity_text(document[name]) for document in documents))
        for name in given
    )
    estimators: dict[str, list[str]] = {}  # estimators by their notes
    for document in documents:
        for line in notes(document):
            estimators.setdefault(line, []).append(document["estimator"])
    blocks: list[Block] = [
        TextTable("Coefficients ± one standard deviation", ("quantity", *names), rows),
        _runs("ωn [rad/s] of the runs ± one standard deviation", "omega_n", documents, names),
        _runs("ζ [1] of the runs ± one standard deviation", "zeta", documents, names),
        *(Paragraph(line, ", ".join(given)) for line, given in estimators.items()),
    ]
    return freedom.texts(blocks, ids)


def _runs(title: str, key: str, documents: Sequence[Document], names: tuple[str, ...]) -> TextTable:
    by_run = [{run["id"]: run[key] for run in document["runs"]} for document in documents]
    ids = list(dict.fromkeys(name for runs in by_run for name in runs))[:_MOST_RUNS]
    rows = tuple((name, *(quantity_text(runs.get(name)) for runs in by_run)) for name in ids)
    return TextTable(title, ("run", *names), rows)
