"""The vocabulary of effects as tables, as JSON and as the reference page, all from the registry."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from identification.printing.numbers import unit_mark

if TYPE_CHECKING:
    from rich.table import Table

    from tunnel_sim.effects import Effect, ParameterInfo

SCHEMA_VERSION = 1
ABOUT_DIRECTIONS = (
    "Moments stand on the right-hand side of Izz β̈ + Cr β̇ + Kr β = Ka β + Ca β̇, with Ka = ½ρV²Al Cnβ and "
    "Ca = ½ρVAl² Cnr; y is the reading."
)
"""The sign convention of the equations."""

_PAGE_HEAD = """# Effects

<!-- Written by `tunnel effects --markdown docs/reference/effects.md`: change the registry, not this page. -->

The effects that the nominal model leaves out. `tunnel simulate` injects them and `tunnel diagnose` reports them
by these names. The condition `always` means with the wind on or off, `wind_on` only with the wind on.

{directions}

The first parameter of an effect is its severity. At zero severity the record is bit-identical to one without the
effect. Numbers in a plan or on the command line are in the units given here:

```toml
[[effects]]
name = "coulomb_friction"
parameters = {{ friction_moment = 0.004 }}   # N m
```

```
tunnel simulate plan.toml --out c --effect coulomb_friction:friction_moment=0.004
```

Real effects never have exactly these forms: each name stands for a family. For what free decays cannot reveal
about them see [what no free decay can show](../theory/what-no-free-decay-can-show.md).

"""


def summary(kind: type[Effect]) -> str:
    """What an effect is, in one sentence: the first line of its docstring."""
    return inspect.cleandoc(kind.__doc__ or "").splitlines()[0]


def document(kinds: Sequence[type[Effect]]) -> dict[str, Any]:
    """The full description of effects, in JSON's types.

    Returns:
        ``{"schema_version", "effects": [...]}`` in the order given.
    """
    return {
        "schema_version": SCHEMA_VERSION,
        "effects": [
            {
                "name": kind.name,
                "channel": kind.channel,
                "condition": kind.condition,
                "stochastic": kind.random == "broad_band",
                "summary": summary(kind),
                "equation": kind.equation,
                "signature": kind.signature,
                "references": list(kind.references),
                "parameters": [dataclasses.asdict(info) for info in kind.parameters()],
            }
            for kind in kinds
        ],
    }


def listing(kinds: Sequence[type[Effect]]) -> Table:
    """Effects with equation and parameters, one row each."""
    from rich.text import Text

    from tunnel_lab.terminal.tables import table

    last = "equation, then parameters [unit]"
    result = table("Effects beyond the nominal model", "effect", "channel", "condition", last)
    for column in result.columns[:3]:  # names are to be copied, so never folded
        column.no_wrap = True
    for kind in kinds:
        parameters = [f"{info.name} {info.symbol} [{unit_mark(info.unit)}]" for info in kind.parameters()]
        cells = (kind.name, kind.channel, kind.condition, "\n".join([kind.equation, *parameters]))
        result.add_row(*map(Text, cells), end_section=True)
    return result


def parameter_table(kind: type[Effect]) -> Table:
    """The parameters of one effect."""
    from rich.text import Text

    from tunnel_lab.terminal.tables import table

    right = ("typical", "from", "to", "default")
    result = table("Parameters", "name", "symbol", "unit", "meaning", *right, right=right)
    for info in kind.parameters():
        numbers = (f"{value:g}" for value in (info.scale, info.lower, info.upper, info.default))
        result.add_row(*map(Text, (info.name, info.symbol, unit_mark(info.unit), info.meaning, *numbers)))
    return result


def lines(kind: type[Effect]) -> list[str]:
    """The description of one effect without its parameters."""
    drawn = ["drawn:      a random moment, different in every run"] if kind.random == "broad_band" else []
    return [
        f"{kind.name}: {summary(kind)}",
        "",
        f"channel:    {kind.channel}",
        f"condition:  {kind.condition}",
        f"equation:   {kind.equation}",
        f"signature:  {kind.signature}",
        *drawn,
        *(f"reference:  {reference}" for reference in kind.references),
        "",
    ]


def example(kind: type[Effect]) -> str:
    """The option of ``tunnel simulate`` that injects an effect of typical size."""
    values = ",".join(f"{info.name}={_typical(info):g}" for info in kind.parameters())
    return f"--effect {kind.name}:{values}"


def _typical(info: ParameterInfo) -> float:
    """A suitable value: the default where it is not zero, else the typical size."""
    return info.default or info.scale


def markdown(kinds: Sequence[type[Effect]]) -> str:
    """The reference page."""
    overview = ["| effect | channel | condition | equation |", "|---|---|---|---|"]
    overview += [
        f"| [`{kind.name}`](#{kind.name}) | {kind.channel} | {kind.condition} | {_cell(kind.equation)} |"
        for kind in kinds
    ]
    sections = [_section(kind) for kind in kinds]
    return _PAGE_HEAD.format(directions=ABOUT_DIRECTIONS) + "\n".join(overview) + "\n\n" + "\n".join(sections)


def _section(kind: type[Effect]) -> str:
    rows = [
        f"| `{info.name}` | {info.symbol} | {unit_mark(info.unit)} | {_cell(info.meaning)} | {info.scale:g} "
        f"| {info.lower:g} | {info.upper:g} | {info.default:g} |"
        for info in kind.parameters()
    ]
    return "\n".join(
        [
            f"## {kind.name}",
            "",
            summary(kind),
            "",
            f"- Channel `{kind.channel}`, condition `{kind.condition}`.",
            f"- Equation: {_cell(kind.equation)}",
            f"- Signature in a record: {kind.signature}",
            *(f"- Reference: {reference}" for reference in kind.references),
            "",
            "| parameter | symbol | unit | meaning | typical | from | to | default |",
            "|---|---|---|---|---|---|---|---|",
            *rows,
            "",
        ]
    )


def _cell(text: str) -> str:
    """Text with escaped bars for a cell of a Markdown table."""
    return text.replace("|", "\\|")
