"""The view of an experiment: tables and lines for a terminal, files of figures and data, and a page of them."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from identification.blocks import Block, Paragraph, Table, as_html
from tunnel_lab.plotting.style import save_both
from tunnel_lab.report.page import page_of
from tunnel_lab.terminal.outputs import say, show_tables, text_table
from tunnel_sim.files.writing import output_folder, write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table as RichTable


@dataclass(frozen=True)
class View:
    """What an experiment has found.

    Args:
        parts: tables and lines, in their order.
        figures: by name of their files, without suffix; drawn when they are written.
        data: contents of further files, by name.
    """

    title: str
    parts: Sequence[Table | RichTable | str]
    figures: Mapping[str, Callable[[], Figure | None]] = field(default_factory=dict)
    data: Mapping[str, bytes] = field(default_factory=dict)

    def write(self, folder: Path) -> str:
        """Write data, figures (PNG and PDF) and the page ``index.html`` to a folder; a line that names them."""
        output_folder(folder)
        written = [write_whole(folder / name, content) for name, content in self.data.items()]
        pictures = []
        for name, draw in self.figures.items():
            drawn = draw()
            if drawn is not None:
                written += save_both(drawn, folder / f"{name}.png")
                pictures.append(written[-2])
        written.append(write_whole(folder / "index.html", self._page(pictures).encode()))
        return f"Written to {folder}: {', '.join(path.name for path in written)}"

    def show(self) -> None:
        """Print tables and lines."""
        for part in self.parts:
            say(part) if isinstance(part, str) else show_tables(part)

    def _page(self, pictures: Sequence[Path]) -> str:
        parts = [as_html(map(_block, self.parts))]
        for path in pictures:
            name = escape(path.stem.replace("-", " "))
            content = b64encode(path.read_bytes()).decode()
            parts.append(f'<figure><img alt="{name}" src="data:image/png;base64,{content}"></figure>')
        return page_of(self.title, "\n".join(parts))


def _block(part: Table | RichTable | str) -> Block:
    if isinstance(part, str):
        return Paragraph(part.strip())
    return part if isinstance(part, Table) else text_table(part)
