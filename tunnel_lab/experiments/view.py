"""The view of an experiment: blocks for a terminal, files of figures and data, and a page of them."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from identification.show.blocks import Block, Figure, as_html
from identification.show.style import save_both
from tunnel_lab.report.page import page_of
from tunnel_lab.terminal.outputs import show
from tunnel_sim.files.writing import output_folder, write_whole

if TYPE_CHECKING:
    from matplotlib import figure


@dataclass(frozen=True)
class ExperimentView:
    """The results of an experiment.

    Args:
        figures: figures by the names of their files, without suffix; drawn when they are written.
        data: contents of further files, by name.
    """

    title: str
    blocks: Sequence[Block]
    figures: Mapping[str, Callable[[], figure.Figure | None]] = field(default_factory=dict)
    data: Mapping[str, bytes] = field(default_factory=dict)

    def write(self, folder: Path) -> str:
        """Write data, figures (PNG and PDF) and the page ``index.html`` to a folder; a line that names them."""
        output_folder(folder)
        written = [write_whole(folder / name, content) for name, content in self.data.items()]
        images = {}
        for name, draw in self.figures.items():
            drawn = draw()
            if drawn is not None:
                written += save_both(drawn, folder / f"{name}.png")
                content = b64encode(written[-2].read_bytes()).decode()
                images[name] = f'<img alt="{escape(name)}" src="data:image/png;base64,{content}">'
        captioned = [Figure(name, name.replace("-", " ")) for name in images]
        page = page_of(self.title, as_html([*self.blocks, *captioned], images))
        written.append(write_whole(folder / "index.html", page.encode()))
        return f"Written to {folder}: {', '.join(path.name for path in written)}"

    def show(self) -> None:
        """Print the blocks."""
        show(self.blocks)
