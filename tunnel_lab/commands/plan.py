"""``tunnel plan``: the input that tells most about Cnβ and Cnr, in the rig time of a plan of free decays."""

from __future__ import annotations

from enum import StrEnum
from math import floor, sqrt
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.table import Table

    from identification.uncertainty.cramer_rao import CampaignBound
    from tunnel_sim.files.plan_file import PlanDocument

NAME = "plan"
_COEFFICIENTS = ("cn_beta", "cn_r")


class Goal(StrEnum):
    """What the input is to make small."""

    D = "d"
    CN_R = "cn_r"


def run(
    plan: Annotated[Path, typer.Argument(help="Plan of free decays, a TOML file.")],
    moment: Annotated[
        float, typer.Option("--moment", metavar="N_M", help="Largest moment of the drive, N m, peak.")
    ],
    amplitude: Annotated[
        float, typer.Option("--amplitude", metavar="RAD", help="Largest angle of the response, rad, peak.")
    ],
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="FILE.toml", help="Where the driven plan goes.")
    ],
    drive: Annotated[bool, typer.Option("--drive", help="Plan driven runs; the only kind so far.")] = False,
    goal: Annotated[
        Goal, typer.Option("--goal", help="d: both coefficients, by the determinant; cn_r: Cnr alone.")
    ] = Goal.D,
    minutes: Annotated[
        float | None, typer.Option("--minutes", help="Rig time, minutes. Default: that of the free decays.")
    ] = None,
    buffeting: Annotated[
        float | None,
        typer.Option(
            "--buffeting",
            metavar="S",
            help="Intensity of the effect buffeting, dimensionless; overrides the plan's.",
        ),
    ] = None,
) -> None:
    r"""Plan the drive that tells most about Cnβ and Cnr.

    From a plan of free decays it makes one of driven runs with the same springs,
    speeds, sensor and rig time: one run of each spring and speed instead of
    several releases, so that pauses become record. The truth of the plan is the
    prior guess of the coefficients. The drive is the multisine, chirp, sine or
    stepped sine with the lowest Cramér–Rao bound, as large as both limits allow.
    The response keeps to its limit if the prior guess is right: leave a margin.

    Rig time is the records, 60 s for each, 300 s for a spring and 60 s for a speed.
    With buffeting the bound is that in a random moment; identify the runs with
    filter_error then. Other effects of the plan do not count.

    [bold]Examples[/bold]
      tunnel plan free.toml --drive --moment 0.5 --amplitude 0.3 --out driven.toml
      tunnel plan free.toml --drive --moment 0.5 --amplitude 0.3 --goal cn_r \
        --minutes 60 --buffeting 0.02 --out driven.toml

    [bold]Exit status[/bold]
      0 written, 2 bad input; nothing is written then.
    """
    import tomli_w

    from identification.uncertainty.drive_design import Limits, peak_response, plan_bound, propose_drive
    from tunnel_lab.terminal.progress import bar
    from tunnel_lab.terminal.tables import say, say_written, show_tables
    from tunnel_sim.engine.virtual_campaign import plan_effects
    from tunnel_sim.files.plan_file import check_size, plan_from, read_plan, run_count
    from tunnel_sim.files.rig_file import load_rig
    from tunnel_sim.files.writing import refuse_unwritable, write_whole
    from tunnel_sim.vocabulary.errors import TunnelError, shown

    _check(plan, out, drive, {"--moment": moment, "--amplitude": amplitude, "--minutes": minutes})
    refuse_unwritable(out)
    document, rig, where = _with_buffeting(read_plan(plan), buffeting), load_rig(), shown(plan)
    if document.drive is not None:
        raise TunnelError("has a [drive] already", where=where, remedy="give a plan of free decays alone")
    loaded = plan_from(document, rig, where)
    plan_effects(loaded)  # refuses what cannot be simulated
    spent = rig_time(document)
    duration = _duration(document, spent if minutes is None else 60.0 * minutes)
    cells = len(document.wind_speeds) * (len(document.springs) + len(document.spring_stiffness))
    check_size(cells, duration, document.sample_rate, where)
    free = plan_bound(loaded, rig)
    with bar("comparing inputs") as progress:
        tried = iter(range(1, 10**9))
        best = propose_drive(
            document,
            rig,
            Limits(moment, amplitude),
            goal=goal.value,
            duration=duration,
            progress=lambda: progress(next(tried), None),
        )
    found = plan_from(best, rig, where)
    driven = plan_bound(found, rig)
    write_whole(out, tomli_w.dumps(best.model_dump(exclude_none=True, exclude_defaults=True)).encode())
    changes = _changes(document)
    table = _table(
        (rig_time(best) - changes) / (spent - changes),
        ("free decays", run_count(document), document.duration, spent, free),
        ("planned drive", cells, duration, rig_time(best), driven),
    )
    show_tables(table)
    if minutes is not None:
        say("The last row is for free decays repeated to the same rig time.")
    say(f"{_words(best)}; response up to {peak_response(found, rig):.3g} rad")
    say_written(out)


def _check(plan: Path, out: Path, drive: bool, numbers: dict[str, float | None]) -> None:
    """Refuse options before anything is calculated."""
    from math import inf, pi

    from tunnel_sim.vocabulary.errors import TunnelError

    if not drive:
        raise TunnelError("nothing to plan", where="tunnel plan", remedy="add --drive")
    units = {
        "--moment": ("N m", 1e6),
        "--amplitude": ("rad, at most π", pi),
        "--minutes": ("minutes", inf),
    }
    for name, value in numbers.items():
        unit, most = units[name]
        if value is not None and not (1e-9 <= value <= most and value < inf):
            raise TunnelError(
                f"{value:g} is out of range", where=name, remedy=f"give a number above 0 in {unit}"
            )
    if out.resolve() == plan.resolve():
        raise TunnelError("is the plan itself", where=f"--out {out}", remedy="name another file")


def _with_buffeting(document: PlanDocument, intensity: float | None) -> PlanDocument:
    """A plan with buffeting of this intensity, of the bandwidth that it states."""
    from tunnel_sim.effects import ALL_EFFECTS
    from tunnel_sim.files.plan_file import EffectTable

    if intensity is None:
        return document
    kind = next(kind for kind in ALL_EFFECTS if kind.random == "broad_band")
    stated = next((effect.parameters for effect in document.effects if effect.name == kind.name), {})
    others = [effect for effect in document.effects if effect.name != kind.name]
    added = EffectTable(name=kind.name, parameters={**stated, kind.parameters()[0].name: intensity})
    return document.model_copy(update={"effects": [*others, added] if intensity else others})


def rig_time(document: PlanDocument) -> float:
    """Rig time of a plan, s: records, releases or starts, and changes of spring and speed."""
    from tunnel_lab.envs.menu import Costs
    from tunnel_sim.files.plan_file import run_count

    driven = 0 if document.drive is None else len(document.drive.amplitudes)
    return run_count(document, driven) * (Costs().setup + document.duration) + _changes(document)


def _changes(document: PlanDocument) -> float:
    from tunnel_lab.envs.menu import Costs

    springs, costs = len(document.springs) + len(document.spring_stiffness), Costs()
    return springs * (costs.spring_change + len(document.wind_speeds) * costs.speed_change)


def _duration(document: PlanDocument, spent: float) -> float:
    """Length of the record of one run per spring and speed in a rig time (s), in tenths of a second."""
    from tunnel_lab.envs.menu import Costs
    from tunnel_sim.vocabulary.errors import TunnelError

    cells = len(document.wind_speeds) * (len(document.springs) + len(document.spring_stiffness))
    left = (spent - _changes(document)) / cells - Costs().setup
    if left < 1.0:
        least = (_changes(document) + cells * (Costs().setup + 1.0)) / 60.0
        raise TunnelError(
            f"leaves no time for records: starts and changes take {least:.3g} min",
            where="--minutes",
            remedy="give more, or fewer springs and wind_speeds",
        )
    return floor(10.0 * left + 1e-6) / 10.0


def _table(longer: float, *rows: tuple[str, int, float, float, CampaignBound]) -> Table:
    """The bounds of both plans, and their ratio with the first repeated ``longer`` times, to equal rig time."""
    from identification.estimate import UNITS
    from identification.printing import SYMBOLS, significant, unit
    from tunnel_lab.terminal.tables import table

    names = tuple(f"std {SYMBOLS[name]}\n{unit(UNITS[name])}" for name in _COEFFICIENTS)
    heads = ("runs", "record\n[s]", "rig time\n[min]", *names)
    result = table("Cramér–Rao bounds: the smallest standard deviations", "plan", *heads, right=heads)
    for name, runs, record, spent, bound in rows:
        deviations = (significant(bound.std(each), 3) for each in _COEFFICIENTS)
        result.add_row(name, f"{runs}", f"{record:g}", f"{spent / 60.0:.1f}", *deviations)
    found = (rows[0][-1].std(each) / rows[1][-1].std(each) / sqrt(longer) for each in _COEFFICIENTS)
    result.add_row("free over planned", "", "", "", *(f"{ratio:.2f}" for ratio in found))
    return result


def _words(document: PlanDocument) -> str:
    """The drive in a line."""
    drive = document.drive
    assert drive is not None
    rates = drive.frequencies_hz or [f for f in (drive.frequency_hz, drive.from_hz, drive.to_hz) if f]
    between = " to " if drive.from_hz else ", "
    shown = between.join(f"{rate:g}" for rate in rates)
    return f"Drive: {drive.kind.replace('_', ' ')}, {shown} Hz, {drive.amplitudes_nm[0]:g} N m peak"
