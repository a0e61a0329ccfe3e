"""Parts that several pages share: the frame with the stages, errors, tables and links."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from html import escape
from urllib.parse import quote

from nicegui import ui

from identification.printing.table import TextTable, as_html
from tunnel_lab.bench.stages import STAGES, closed
from tunnel_lab.bench.workspace import Session
from tunnel_sim.vocabulary.errors import TunnelError

_THEME = "bench-theme"
_HEAD = """
<link rel="stylesheet" href="/static/uplot/uPlot.min.css">
<link rel="stylesheet" href="/static/bench/bench.css">
<script src="/static/uplot/uPlot.iife.min.js"></script>
"""


def address(session: Session, stage: str) -> str:
    """Path of a stage's page."""
    return f"/{quote(session.name)}/{stage}"


class Frame:
    """The head of a page: where one is, and which stages are open.

    Args:
        title: of the page.
        session: whose pages they are; None for pages beside the stages.
        stage: the present one.
    """

    def __init__(self, title: str, session: Session | None = None, stage: str = "") -> None:
        self._session, self._stage = session, stage
        ui.add_head_html(_HEAD)
        ui.colors(primary="var(--link)")
        ui.page_title(f"{title} · {session.name}" if session else title)
        with ui.element("header").classes("top"):
            ui.link("Skip to the page", "#main").classes("skip")
            ui.link("Bench", "/").classes("brand")
            if session is not None:
                ui.label(session.name).classes("name")
            ui.element("span").classes("space")
            ui.link("Try it", "/try")
            _theme_button()
        if session is not None:
            self.steps = ui.element("nav").props('aria-label="Stages"').classes("steps")
            self.refresh()
        self.main = ui.element("main").props("id=main")
        with self.main, ui.element("h1"):
            ui.html(title, sanitize=False, tag="span")

    def refresh(self) -> None:
        """Show the stages as the files allow them now, and the way on."""
        assert self._session is not None
        self.steps.clear()
        with self.steps, ui.element("ol"):
            for number, stage in enumerate(STAGES, 1):
                _step(self._session, stage.key, f"{number} {stage.title}", here=stage.key == self._stage)

    def way_on(self) -> None:
        """A link to the next stage, where it is open."""
        assert self._session is not None
        keys = [stage.key for stage in STAGES]
        after = keys.index(self._stage) + 1
        if after < len(keys) and not _closed(self._session, keys[after]):
            ui.link(f"Continue: {STAGES[after].title}", address(self._session, keys[after])).classes(
                "button go"
            )


def _closed(session: Session, key: str) -> str:
    try:
        return closed(session, key)
    except TunnelError as error:
        return str(error)


def _step(session: Session, key: str, text: str, *, here: bool) -> None:
    why = _closed(session, key)
    with ui.element("li"):
        if here:
            ui.link(text, address(session, key)).props("aria-current=step")
        elif why:
            ui.html(text, sanitize=False, tag="span").props("aria-disabled=true").tooltip(why)
        else:
            ui.link(text, address(session, key))


def _theme_button() -> None:
    """Automatic, light, dark: kept in a cookie, so that it is the same on every page."""
    names: dict[str, bool | None] = {"automatic": None, "light": False, "dark": True}
    request = ui.context.client.request
    now = str(request.cookies.get(_THEME, "automatic"))
    dark = ui.dark_mode(names.get(now))
    button = ui.element("button").props("type=button")

    def show(name: str) -> None:
        button.clear()
        with button:
            ui.html(f"Theme: {name}", sanitize=False, tag="span")

    def turn() -> None:
        nonlocal now
        order = list(names)
        now = order[(order.index(now) + 1) % len(order)] if now in order else order[0]
        dark.value = names[now]
        ui.run_javascript(f'document.cookie = "{_THEME}={now}; path=/; SameSite=Strict; max-age=31536000"')
        show(now)

    show(now if now in names else "automatic")
    button.on("click", turn)


class Fault:
    """The line that says what is wrong, next to what caused it; nothing while all is well."""

    def __init__(self) -> None:
        self._place = ui.element("div").props("role=alert aria-live=assertive")

    def show(self, error: TunnelError | str) -> None:
        """Show the line that the terminal would print; an empty one is none."""
        self._place.clear()
        if not str(error):
            return
        with self._place:
            ui.label(f"tunnel: {error}").classes("fault")

    def clear(self) -> None:
        """Show nothing."""
        self._place.clear()

    @contextmanager
    def around(self) -> Iterator[None]:
        """Show the error of what is done inside."""
        self.clear()
        try:
            yield
        except TunnelError as error:
            self.show(error)


def show_parts(parts: Iterable[str | TextTable]) -> None:
    """Tables and paragraphs as the terminal prints them."""
    ui.html(as_html(parts), sanitize=False).classes("printed")  # its texts are escaped


def show_command(words: str) -> None:
    """The command that does the same in a terminal."""
    with ui.element("p").classes("command"):
        ui.label("In a terminal:").classes("soft")
        ui.html(tag="code", sanitize=False, content=escape(words))


def button(text: str, action: Callable[[], object], *, main: bool = False) -> ui.element:
    """A button.

    Args:
        main: whether it is the way on.
    """
    found = ui.element("button").props("type=button").classes("button go" if main else "button")
    with found:
        ui.html(escape(text), sanitize=False, tag="span")
    return found.on("click", action)
