"""Results as headings, paragraphs, tables, lists and figures, and the back ends that show these blocks.

A result is turned into blocks once, for every presentation: `as_text` serves ``print``, `as_notebook`
notebooks, `as_html` the report and the bench, `as_markdown` pages of text, and
``tunnel_lab.terminal.outputs.show`` terminals.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from itertools import zip_longest

WIDTH = 88
"""Paragraphs are wrapped to this many characters."""
_WIDE = 3  # maximum number of columns: on a narrow page each row of a wider table becomes a list
_POWER = re.compile(r"(?<=[\d)])e([+-]\d+)\b")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Heading:
    """The heading of a few blocks, and perhaps a remark beside it."""

    text: str
    beside: str = ""


@dataclass(frozen=True)
class Paragraph:
    """A paragraph.

    Args:
        label: text at the start of the paragraph, unless a section's title introduces it.
        kind: class of the paragraph on a page, such as ``small``.
    """

    text: str
    label: str = ""
    kind: str = ""


@dataclass(frozen=True)
class Listing:
    """A list.

    Args:
        title: text above the list, unless a section's title introduces it.
    """

    items: tuple[str, ...]
    title: str = ""
    numbered: bool = False


@dataclass(frozen=True)
class Pairs:
    """Labels and values."""

    rows: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Figure:
    """A figure, by its name among the drawings that a page is given."""

    name: str
    caption: str


@dataclass(frozen=True)
class TextTable:
    """A table of texts.

    Args:
        columns: headings, with their units.
        rows: one text for each column; lines of a cell are separated by line ends.
        right: headings of the right-aligned columns.
        names: headings of the columns of names such as ``coulomb_friction``, which a page shows as words.
        detail: headings of the columns that are shown only on a page.
        sections: number of first columns that name a section. In a terminal a line separates sections; if the
            terminal is too narrow, these names stand above the rows of their section.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    right: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    detail: tuple[str, ...] = ()
    sections: int = 0

    def without_detail(self) -> TextTable:
        """The table without the columns that are shown only on a page."""
        kept = [heading not in self.detail for heading in self.columns]

        def chosen(row: tuple[str, ...]) -> tuple[str, ...]:
            return tuple(cell for cell, keep in zip(row, kept, strict=True) if keep)

        return replace(self, columns=chosen(self.columns), rows=tuple(map(chosen, self.rows)), detail=())


@dataclass(frozen=True)
class Card:
    """Blocks in a frame on a page, such as the description of an effect."""

    blocks: tuple[Block, ...]
    kind: str = "effect"


@dataclass(frozen=True)
class Detail:
    """Blocks that are shown only on a page.

    Args:
        title: title of a fold that hides the blocks at first; empty: they are shown.
    """

    blocks: tuple[Block, ...]
    title: str = ""


Block = Heading | Paragraph | Listing | Pairs | Figure | TextTable | Card | Detail


@dataclass(frozen=True)
class Section:
    """Blocks on one subject.

    Args:
        key: the id of the section on a page.
        title: title on a page; other presentations show no titles.
    """

    key: str
    title: str
    blocks: tuple[Block, ...]


def brief(blocks: Iterable[Block]) -> tuple[Block, ...]:
    """Blocks without figures, details and empty blocks."""
    shown = (one.without_detail() if isinstance(one, TextTable) else one for one in blocks)
    return tuple(one for one in shown if not isinstance(one, Figure | Detail | Card) and _filled(one))


def _filled(block: Block) -> bool:
    """Whether a block has anything to show."""
    match block:
        case TextTable() | Pairs():
            return bool(block.rows)
        case Listing():
            return bool(block.items)
        case Heading() | Paragraph():
            return bool(block.text)
        case Card() | Detail():
            return any(map(_filled, block.blocks))
        case _:
            return True


# ---- text


def as_text(blocks: Iterable[Block]) -> str:
    """Blocks as plain text, with an empty line around each table."""
    return "\n".join(map(_text, brief(blocks))).strip("\n").replace("\n\n\n", "\n\n")


def lines(block: Block) -> list[str]:
    """The lines of a block that is not a table, not wrapped."""
    match block:
        case Heading():
            return [block.text]
        case Paragraph():
            return [f"{block.label}: {block.text}" if block.label else block.text]
        case Listing():
            marks = [f"{number}." if block.numbered else "-" for number in range(1, len(block.items) + 1)]
            items = [f"{mark} {item}" for mark, item in zip(marks, block.items, strict=True)]
            return [f"{block.title}:", *items] if block.title else items
        case Pairs():
            return [f"{label}: {value}" for label, value in block.rows]
        case _:
            return []


def _text(block: Block) -> str:
    if isinstance(block, TextTable):
        return f"\n{_text_table(block)}\n"
    return "\n".join(textwrap.fill(line, WIDTH) for line in lines(block))


def _text_table(table: TextTable) -> str:
    """A table in columns of a fixed width, with a rule below the headings."""
    widths = [
        max(len(line) for cell in column for line in cell.split("\n"))
        for column in zip(table.columns, *table.rows, strict=True)
    ]
    rule = "-" * (sum(widths) + 2 * (len(widths) - 1))

    def row_lines(row: Sequence[str]) -> str:
        """One row, on as many lines as its tallest cell needs."""
        return "\n".join(
            "  ".join(
                text.rjust(width) if heading in table.right else text.ljust(width)
                for text, width, heading in zip(line, widths, table.columns, strict=True)
            ).rstrip()
            for line in zip_longest(*(cell.split("\n") for cell in row), fillvalue="")
        )

    return "\n".join([table.title, row_lines(table.columns), rule, *map(row_lines, table.rows)])


# ---- Markdown


def as_markdown(blocks: Iterable[Block]) -> str:
    """Blocks as Markdown; their texts have no HTML and no links. The name of a figure is its address."""
    return "\n\n".join(filter(None, map(_markdown, blocks))) + "\n"


def _markdown(block: Block) -> str:
    match block:
        case Heading():
            return f"## {_unmarked(block.text)}"
        case Figure():
            return f"![{_unmarked(block.caption)}]({block.name})"
        case TextTable():
            ends = ["---:" if heading in block.right else "---" for heading in block.columns]
            heads, *rows = ([_cell_text(cell) for cell in row] for row in (block.columns, *block.rows))
            title = f"**{_unmarked(block.title)}**\n\n" if block.title else ""
            return title + "\n".join(f"| {' | '.join(row)} |" for row in (heads, ends, *rows))
        case _:
            return "\n".join(map(_unmarked, lines(block)))


def _unmarked(text: str) -> str:
    return escape(text.replace("\\", "\\\\"), quote=False).replace("](", "]\\(")


def _cell_text(text: str) -> str:
    return _unmarked(" ".join(text.split())).replace("|", "\\|")


# ---- HTML

_NOTEBOOK_STYLE = (
    ".vwt td, .vwt th { text-align: left; padding: 0.15em 0.8em; vertical-align: top } "
    ".vwt .n { text-align: right } .vwt caption { text-align: left }"
)


def as_notebook(blocks: Iterable[Block]) -> str:
    """Blocks as HTML for a notebook, with the style of its tables."""
    return f'<div class="vwt"><style scoped>{_NOTEBOOK_STYLE}</style>{as_html(brief(blocks))}</div>'


def as_html(blocks: Iterable[Block], drawn: Mapping[str, str] | None = None, *, titled: bool = False) -> str:
    """Blocks as HTML, to be styled by the page's style sheet.

    Args:
        drawn: HTML of the figures by name; others are left out.
        titled: whether the title of a section introduces the blocks, so that their labels are omitted.
    """
    drawn = drawn or {}
    return "".join(_html(block, drawn, titled) for block in blocks if _filled(block))


def typeset(text: str) -> str:
    """A text with minus signs and powers of ten in its numbers, and no line break in a value or a unit."""
    text = re.sub(r"(?<![\w.])-(?=\d)", "−", text)
    text = _POWER.sub(lambda found: f" × 10{str(int(found[1])).translate(_RAISED)}", text)
    text = re.sub(r" (±|×) (?=\d)", "\u00a0\\1\u00a0", text)
    return re.sub(r"\[[^]]{1,12}\]", lambda unit: unit[0].replace(" ", "\u00a0"), text)


def _words(text: str) -> str:
    return escape(typeset(text)).replace("\n", "<br>")


def _html(block: Block, drawn: Mapping[str, str], titled: bool) -> str:
    match block:
        case Heading():
            beside = f" <span>{_words(block.beside)}</span>" if block.beside else ""
            return f"<h3>{_words(block.text)}{beside}</h3>"
        case Paragraph():
            kind = f' class="{escape(block.kind)}"' if block.kind else ""
            label = f"<b>{_words(block.label)}:</b> " if block.label and not titled else ""
            return f"<p{kind}>{label}{_words(block.text)}</p>"
        case Listing():
            tag = "ol" if block.numbered else "ul"
            title = f"<p><b>{_words(block.title)}:</b></p>" if block.title and not titled else ""
            items = "".join(f"<li>{_words(item)}</li>" for item in block.items)
            return f"{title}<{tag}>{items}</{tag}>"
        case Pairs():
            rows = (f"<div><dt>{_words(one)}</dt><dd>{_words(two)}</dd></div>" for one, two in block.rows)
            return f'<dl class="pairs">{"".join(rows)}</dl>'
        case Figure():
            figure = f'<figure data-figure="{escape(block.name)}">{drawn.get(block.name)}'
            caption = f"<figcaption>{_words(block.caption)}</figcaption></figure>"
            return figure + caption if block.name in drawn else ""
        case TextTable():
            return _html_table(block)
        case Card():
            return (
                f'<aside class="{escape(block.kind)}">{as_html(block.blocks, drawn, titled=titled)}</aside>'
            )
        case Detail():
            shown = as_html(block.blocks, drawn, titled=titled)
            fold = f'<details class="fold"><summary>{_words(block.title)}</summary>{shown}</details>'
            return fold if block.title else shown


def _html_table(table: TextTable) -> str:
    """A table as HTML; each cell has its heading, for narrow pages that stack the cells of a row."""
    numeric = [' class="n"' if heading in table.right else "" for heading in table.columns]
    named = [heading in table.names for heading in table.columns]
    heads = zip(numeric, table.columns, strict=True)
    top = "".join(f'<th scope="col"{kind}>{_words(head)}</th>' for kind, head in heads)
    rows = []
    for first, *others in table.rows:
        cells = [f'<th scope="row"{numeric[0]}>{_cell(first, named[0])}</th>']
        for head, cell, kind, name in zip(table.columns[1:], others, numeric[1:], named[1:], strict=True):
            about = escape(" ".join(head.split()))
            shown = f"<span>{_cell(cell, name)}</span>" if cell else ""
            cells.append(f'<td data-head="{about}"{kind}>{shown}</td>')
        rows.append(f"<tr>{''.join(cells)}</tr>")
    wide = ' class="wide"' if len(table.columns) > _WIDE else ""
    return (
        f'<div class="scroll" role="region" aria-label="{escape(table.title)}" tabindex="0"><table{wide}>'
        f"<caption>{_words(table.title)}</caption><thead><tr>{top}</tr></thead>"
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )


def _cell(text: str, name: bool) -> str:
    return _words(text.replace("_", " ") if name else text)
