"""Parts that several pages share: the frame with the stages, errors, tables, links and charts.

Messages of commands are shown in the words of the page: fields instead of options.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from html import escape
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from nicegui import ui

from identification.show.blocks import Block, as_html, brief
from tunnel_lab.bench.workspace import STAGES, Session, closed
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from pydantic import BaseModel

_OPTION = re.compile(r"--([a-z-]+)(?: (?:[A-Z]+\b|\"([^\"]*)\"))?")

_HEAD = """
<link rel="stylesheet" href="/static/uplot/uPlot.min.css">
<link rel="stylesheet" href="/static/bench/bench.css">
<script src="/static/uplot/uPlot.iife.min.js"></script>
"""


def page_words(text: str) -> str:
    """A line of a command in the words of the page: fields replace options, and the command's name is omitted."""
    plain = text.removeprefix("tunnel: ").replace("with --no-cut", "by switching off --no-cut")
    return _OPTION.sub(_field, plain)


def asked_in(text: str) -> list[str]:
    """The fields of `ImportChoices` for which a line of a command asks, by name."""
    keys = _choices()
    return list(dict.fromkeys(keys[option] for option, _ in _OPTION.findall(text) if option in keys))


def label_of(model: type[BaseModel], key: str) -> str:
    """The label of a field of a model, with its unit."""
    return model.model_fields[key].title or key.replace("_", " ")


def name_of(model: type[BaseModel], key: str) -> str:
    """The label of a field of a model, without its unit."""
    return label_of(model, key).partition(" [")[0]


def _field(found: re.Match[str]) -> str:
    """An option as its field, with the value to type there; an option without a field is unchanged."""
    from tunnel_sim.files.importing.choices import ImportChoices

    key = _choices().get(found[1])
    if key is None:
        return found[0]
    words = f"“{name_of(ImportChoices, key)}”"
    return f"{words} {found[2]}" if found[2] else words


@cache
def _choices() -> dict[str, str]:
    """The fields of `ImportChoices` by the option of ``tunnel import`` that fills each field."""
    from tunnel_sim.files.importing.choices import ImportChoices

    options = {key: key.replace("_", "-") for key in ImportChoices.model_fields}
    return {option: key for key, option in (options | {"conditions": "set", "cut": "no-cut"}).items()}


def address(session: Session, stage: str) -> str:
    """Path of a stage's page."""
    return f"/{quote(session.name)}/{stage}"


class Frame:
    """The head of a page: the current stage, and the open stages of the session; neither without a session."""

    def __init__(self, title: str, session: Session | None = None, stage: str = "") -> None:
        self._session, self._stage = session, stage
        ui.add_head_html(_HEAD)
        ui.colors(primary="var(--link)")
        ui.dark_mode(None)  # follow the browser's theme
        ui.page_title(f"{title} · {session.name}" if session else title)
        with ui.element("header").classes("top"):
            ui.link("Skip to the page", "#main").classes("skip")
            ui.link("Bench", "/").classes("brand")
            if session is not None:
                ui.label(session.name).classes("name")
            ui.element("span").classes("space")
            ui.link("Try it", "/try")
        if session is not None:
            self.steps = ui.element("nav").props('aria-label="Stages"').classes("steps")
            self.refresh()
        self.main = ui.element("main").props("id=main")
        with self.main, ui.element("h1"):
            ui.html(title, sanitize=False, tag="span")

    def refresh(self, on: ui.element | None = None) -> None:
        """Show the stages that the files now allow, and the links to other stages."""
        assert self._session is not None
        self.steps.clear()
        with self.steps, ui.element("ol"):
            for number, stage in enumerate(STAGES, 1):
                text, path = f"{number} {stage.title}", address(self._session, stage.key)
                with ui.element("li"):
                    if stage.key == self._stage:
                        ui.link(text, path).props("aria-current=step")
                    elif why := self._why_closed(stage.key):
                        ui.html(text, sanitize=False, tag="span").props("aria-disabled=true").tooltip(why)
                    else:
                        ui.link(text, path)
        if on is not None:
            on.clear()
            with on:
                self.way_on()

    def way_on(self) -> None:
        """Links to the next and the final stage if they are open, or the reason why the next stage is closed."""
        assert self._session is not None
        keys = [stage.key for stage in STAGES]
        after = keys.index(self._stage) + 1
        if after < len(keys) and (why := self._why_closed(keys[after])):
            ui.label(f"{STAGES[after].title} waits: {why[0].lower()}{why[1:]}").classes("waits")
        elif after < len(keys):
            path = address(self._session, keys[after])
            ui.link(f"Continue: {STAGES[after].title}", path).classes("button go")
        if after < len(keys) - 1 and not self._why_closed(keys[-1]):
            ui.link("To the report", address(self._session, keys[-1])).classes("button")

    def _why_closed(self, key: str) -> str:
        assert self._session is not None
        try:
            return closed(self._session, key)
        except TunnelError as error:
            return str(error)


class Fault:
    """The line that states an error, next to its cause; empty without an error."""

    def __init__(self) -> None:
        self._place = ui.element("div").props("role=alert aria-live=assertive")

    def show(self, error: TunnelError | str) -> None:
        """Show the line that the terminal would print, in the page's words; an empty line clears it."""
        self._place.clear()
        if str(error):
            with self._place:
                ui.label(page_words(str(error))).classes("fault")

    @contextmanager
    def around(self) -> Iterator[None]:
        """Show an error raised inside the context."""
        self.show("")
        try:
            yield
        except TunnelError as error:
            self.show(error)


def show_blocks(blocks: Iterable[Block]) -> None:
    """Blocks without figures and details."""
    ui.html(f"<div>{as_html(brief(blocks))}</div>", sanitize=False).classes(
        "printed"
    )  # the texts are escaped


def show_facts(facts: Iterable[tuple[str, ...]]) -> None:
    """Values, each with its label and perhaps a note below it."""
    with ui.element("div").classes("facts"):
        for value, *words in facts:
            with ui.element("div"):
                ui.label(value).classes("value")
                for text in words:
                    ui.label(text).classes("soft")


def show_items(lines: Iterable[str]) -> None:
    """Items of the enclosing list."""
    for line in lines:
        with ui.element("li"):
            ui.label(line)


def text_of(value: float) -> str:
    """A number as a user types it: without the rounding error of a conversion of units."""
    return f"{value:.15g}"


def heading(text: str) -> None:
    """The heading of a part of a page."""
    ui.html(text, sanitize=False, tag="h2")


def show_command(words: str) -> None:
    """The equivalent command for a terminal."""
    with ui.element("p").classes("command"):
        ui.label("In a terminal:").classes("soft")
        ui.html(tag="code", sanitize=False, content=escape(words))


def button(text: str, action: Callable[[], object], *, main: bool = False) -> ui.element:
    """A button; the main one continues to the next step."""
    element = ui.element("button").props("type=button").classes("button go" if main else "button")
    with element:
        ui.html(escape(text), sanitize=False, tag="span")
    return element.on("click", action)


class Chart(ui.element, component="static/chart.js"):
    """The chart.

    Args:
        title: title of the chart, also for a screen reader.
        series: labels of the curves and the names of their colours (``before``, ``after``, ``soft``, …).
        data: abscissas and the ordinates of every curve; None is a gap.
        moved: function called with the id of a mark and its new position, in the unit of its axis; may be
            awaitable.
        added: function called with the abscissa of a release to add, the middle of the visible part; None: no
            button.
        removed: function called with the id of a mark on which Delete is pressed.
    """

    def __init__(
        self,
        title: str,
        x: str,
        y: str,
        series: Sequence[tuple[str, str]],
        data: Sequence[Sequence[float | None]],
        moved: Callable[[str, float], Any] | None = None,
        added: Callable[[float], Any] | None = None,
        removed: Callable[[str], Any] | None = None,
    ) -> None:
        super().__init__()
        curves = [list(curve) for curve in series]
        self._props.update(
            title=title, x=x, y=y, series=curves, data=data, marks=[], focus="", adds=added is not None
        )
        self.classes("chart")
        if moved is not None:
            self.on("moved", lambda event: moved(str(event.args["id"]), float(event.args["at"])))
        if added is not None:
            self.on("added", lambda event: added(float(event.args["at"])))
        if removed is not None:
            self.on("removed", lambda event: removed(str(event.args["id"])))

    def show(self, data: Sequence[Sequence[float | None]]) -> None:
        """Show other curves with the same labels."""
        self._props["data"] = data
        self.update()

    def show_marks(self, marks: Sequence[Mapping[str, Any]], focus: str = "") -> None:
        """Show marks.

        Args:
            focus: id of the mark that takes the focus; empty: none.
            marks: ``id``, ``label``, ``kind``, ``at`` and its ``unit`` for each mark. A ``start`` or an ``end``
                is on the abscissa. A ``rest`` is on the ordinate, drawn from ``from`` to ``to`` with the text
                ``about``.
        """
        self._props.update(marks=[dict(mark) for mark in marks], focus=focus)
        self.update()
