"""``tunnel effects``: the vocabulary of effects beyond the nominal model."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Argument

from identification.show.blocks import TextTable
from identification.show.numbers import unit_mark
from tunnel_lab.terminal.arguments import EffectsFileOption, output_file, refuse_unwritable_files
from tunnel_lab.terminal.outputs import say, say_written, show
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.freedom import ANGLE, FREEDOMS

if TYPE_CHECKING:
    from tunnel_sim.effects import Effect


SCHEMA_VERSION = 1
ABOUT_DIRECTIONS = (
    "Moments are on the right-hand side of Izz β̈ + Cr β̇ + Kr β = Ka β + Ca β̇, with Ka = ½ρV²Al Cnβ and "
    "Ca = ½ρVAl² Cnr; y is the reading."
)
"""The sign convention of the equations."""
_NOT_COMPARED = (
    "Not compared with other effects: it is found in the records, in their spectra or in how runs differ, not in "
    "the motion of a run."
)
_PAGE_HEAD = """# Effects

<!-- Written by `tunnel effects --markdown docs/reference/effects.md`: change the registry, not this page. -->

The effects that the nominal model leaves out. `tunnel simulate` injects them and `tunnel diagnose` reports them
by these names. The condition `always` means with the wind on or off; `wind_on` means only with the wind on.

{directions}

The first parameter of an effect is its severity. At zero severity the record is bit-identical to one without the
effect. Numbers in a plan or on the command line are in these units:

```toml
[[effects]]
name = "coulomb_friction"
parameters = {{ friction_moment = 0.004 }}   # N m
```

```
tunnel simulate plan.toml --out c --effect coulomb_friction:friction_moment=0.004
```

Real effects never have exactly these forms: each name stands for a family.
[What no free decay can show](../theory/what-no-free-decay-can-show.md) lists the limits of free decays.

"""


def run(
    name: Annotated[
        str | None,
        Argument(
            metavar="[NAME | check NAME]",
            help="An effect to show in full, or to check. Default: a list of all.",
            show_default=False,
        ),
    ] = None,
    checked: Annotated[str | None, Argument(hidden=True)] = None,
    json: Annotated[Path | None, output_file("--json", ".json", help="Write the effects as JSON.")] = None,
    markdown: Annotated[
        Path | None, output_file("--markdown", ".md", help="Write the effects as a reference page.")
    ] = None,
    effects_file: EffectsFileOption = None,
) -> None:
    """List the effects that the nominal model leaves out.

    tunnel simulate injects them by these names, and tunnel diagnose finds them.
    Each effect has a channel (stiffness, damping, forcing, sensor or
    calibration), a condition (always or wind_on), an equation, and parameters
    with units. The first parameter is the severity.

    [bold]Examples[/bold]
      tunnel effects
      tunnel effects coulomb_friction
      tunnel effects --json effects.json
      tunnel effects check detent --effects-file my.toml

    tunnel effects check NAME tests an effect of your own by the laws that every
    effect obeys, and names other effects with the same influence on the motion.

    [bold]Exit status[/bold]
      0 shown, 1 a law is violated, 2 bad input.
    """
    from tunnel_sim.effects import effect_class, known_effects
    from tunnel_sim.files.writing import write_json, write_whole

    del effects_file  # its effects are known already
    if name == "check":
        if checked is None or json is not None or markdown is not None:
            raise TunnelError(
                "name one effect to check, and no file to write", remedy="tunnel effects check NAME"
            )
        from diagnosis.identifiability import identifiability
        from tunnel_sim.engine.effect_laws import check

        own = effect_class(checked)
        laws = [(verdict.law, verdict.fault) for verdict in check(own)]
        lines = [_NOT_COMPARED]
        if own.fitted:
            seen = identifiability(own)
            laws, lines = [*laws, (seen.LAW, seen.fault)], seen.lines()
        for law, fault in laws:
            say(f"violated: {law}: {fault}." if fault else f"obeyed: {law}.")
        for line in lines:
            say(line)
        if any(fault for _, fault in laws):
            raise typer.Exit(1)
        return
    if checked is not None:
        raise TunnelError(f"one name too many: {checked!r}", remedy="name one effect")
    kinds = known_effects() if name is None else (effect_class(name),)
    if json is not None or markdown is not None:
        refuse_unwritable_files(json, markdown)
        if json is not None:
            write_json(json, document(kinds))
        if markdown is not None:
            write_whole(markdown, reference_page(kinds).encode())
        say_written(json, markdown)
        return
    if name is None:
        show([listing(kinds)])
        say(ABOUT_DIRECTIONS)
        say("Details of one effect: tunnel effects NAME")
        return
    (kind,) = kinds
    say(f"{kind.name}: {summary(kind)}\n")
    say(f"channel:    {kind.channel}")
    say(f"condition:  {kind.condition}")
    say(f"equation:   {kind.equation}")
    say(f"signature:  {kind.signature}")
    if _stochastic(kind):
        say("drawn:      a random moment, different in every run")
    for reference in kind.references:
        say(f"reference:  {reference}")
    say("")
    right = ("typical", "from", "to", "default")
    rows = tuple(
        (
            *(info.name, info.symbol, unit_mark(info.unit), info.meaning),
            *(f"{value:g}" for value in (info.scale, info.lower, info.upper, info.default)),
        )
        for info in kind.parameters()
    )
    freedom = FREEDOMS[kind.motion or ANGLE.motion]
    table = TextTable("Parameters", ("name", "symbol", "unit", "meaning", *right), rows, right)
    show(freedom.texts([table], [kind.name, *(info.name for info in kind.parameters())]))
    if freedom is not ANGLE:  # the simulator's rig turns
        say("To look for it: tunnel diagnose CAMPAIGN --effects-file FILE")
        return
    say(ABOUT_DIRECTIONS)
    say(f"To inject it: tunnel simulate plan.toml --out FOLDER {example(kind)}")


def _stochastic(kind: type[Effect]) -> bool:
    from tunnel_sim.effects.capabilities import AtRandom

    return issubclass(kind, AtRandom) and kind.random == "broad_band"


def summary(kind: type[Effect]) -> str:
    """An effect in one sentence: the first line of its docstring."""
    return inspect.cleandoc(kind.__doc__ or "").splitlines()[0]


def document(kinds: Sequence[type[Effect]]) -> dict[str, Any]:
    """The full description of effects, in JSON's types and in the order given."""
    return {
        "schema_version": SCHEMA_VERSION,
        "effects": [
            {
                "name": kind.name,
                "channel": kind.channel,
                "condition": kind.condition,
                "stochastic": _stochastic(kind),
                "summary": summary(kind),
                "equation": kind.equation,
                "signature": kind.signature,
                "references": list(kind.references),
                "parameters": [dataclasses.asdict(info) for info in kind.parameters()],
            }
            for kind in kinds
        ],
    }


def listing(kinds: Sequence[type[Effect]]) -> TextTable:
    """Effects with equation and parameters, one row each."""
    last = "equation, then parameters [unit]"
    rows = []
    for kind in kinds:
        parameters = [f"{info.name} {info.symbol} [{unit_mark(info.unit)}]" for info in kind.parameters()]
        rows.append((kind.name, kind.channel, kind.condition, "\n".join([kind.equation, *parameters])))
    names = ("effect", "channel", "condition")
    title = "Effects beyond the nominal model"
    return TextTable(title, (*names, last), tuple(rows), names=names, sections=1)


def example(kind: type[Effect]) -> str:
    """The option of ``tunnel simulate`` that injects an effect of typical size."""
    values = ",".join(f"{info.name}={info.default or info.scale:g}" for info in kind.parameters())
    return f"--effect {kind.name}:{values}"


def reference_page(kinds: Sequence[type[Effect]]) -> str:
    """The reference page."""
    page = ["| effect | channel | condition | equation |", "|---|---|---|---|"]
    page += [
        f"| [`{kind.name}`](#{kind.name}) | {kind.channel} | {kind.condition} | {_cell(kind.equation)} |"
        for kind in kinds
    ]
    for kind in kinds:
        page += [
            "",
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
        ]
        page += [
            f"| `{info.name}` | {info.symbol} | {unit_mark(info.unit)} | {_cell(info.meaning)} | {info.scale:g} "
            f"| {info.lower:g} | {info.upper:g} | {info.default:g} |"
            for info in kind.parameters()
        ]
    return _PAGE_HEAD.format(directions=ABOUT_DIRECTIONS) + "\n".join(page) + "\n"


def _cell(text: str) -> str:
    """Text with escaped bars for a cell of a Markdown table."""
    return text.replace("|", "\\|")
