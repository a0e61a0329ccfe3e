"""``tunnel simulate`` and ``tunnel plan``: a campaign from a plan, and a plan with the most informative drive."""

from __future__ import annotations

from dataclasses import replace
from math import floor, inf, pi, sqrt
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from typer import Argument, Option

from identification.show.blocks import TextTable
from tunnel_lab.terminal.arguments import (
    EffectsFileOption,
    ending,
    output_file,
    parse_effect,
    refuse_unwritable_files,
)
from tunnel_lab.terminal.outputs import say, say_written, show
from tunnel_lab.terminal.progress import bar
from tunnel_sim.vocabulary.errors import TunnelError, counted, shown

if TYPE_CHECKING:
    from identification.uncertainty.cramer_rao import CampaignBound
    from tunnel_sim.files.plan_file import PlanDocument

_COEFFICIENTS = ("cn_beta", "cn_r")


def simulate(
    plan: Annotated[Path, Argument(help="Plan of the campaign, a TOML file.")],
    out: Annotated[Path, Option("--out", "-o", metavar="FOLDER", help="Where the campaign goes.")],
    format: Annotated[
        Literal["parquet", "csv"], Option("--file-format", help="Format of the run files.")
    ] = "parquet",
    seed: Annotated[
        int | None, Option("--seed", min=0, help="Seed of the noise; overrides the plan's.")
    ] = None,
    effects: Annotated[
        tuple[str, ...],
        Option(
            "--effect",
            metavar="NAME:PARAMETER=VALUE",
            help="Add an effect to the nominal model; separate further parameters by commas. May be repeated; "
            "tunnel effects lists the effects.",
        ),
    ] = (),
    overwrite: Annotated[
        bool, Option("--overwrite", help="Replace a campaign that is already in the folder.")
    ] = False,
    picture: Annotated[
        Path | None,
        output_file(
            "--picture",
            ".png",
            help="Draw the runs, input and response; more than twelve go on further pages, FILE-2.png and so on.",
        ),
    ] = None,
    effects_file: EffectsFileOption = None,
) -> None:
    r"""Simulate a campaign: springs × wind speeds × release angles × repeats.

    Writes campaign.toml, a file for each run (time in s, yaw angle in rad), and
    truth.json with the injected values. The same plan and seed give bit-identical
    campaigns.

    A [drive] in the plan adds driven runs, which start at rest: springs × wind
    speeds × amplitudes × repeats. Their files also have an input column. Kinds
    are sine, stepped_sine, chirp, multisine, random, square and file.

    A [scatter] makes the runs differ by chance, as real runs do: the true wind
    speed, spring and mechanical damping (relative standard deviations) and the
    sensor's zero (rad). campaign.toml has the stated values, truth.json the true
    values of every run.

    [bold]A plan[/bold]
      name = "two-speeds"
      seed = 1
      springs = [5, 8]             # of the paper's Table II
      wind_speeds = [0.0, 10.0]    # m/s; 0 is wind-off
      release_angles_deg = [20.0]
      repeats = 1
      duration = 20.0              # s
      truth.cn_beta = 0.495        # 1/rad
      truth.cn_r = -0.114          # 1/rad

    [bold]Scatter between runs[/bold]
      scatter.wind_speed = 0.003
      scatter.spring_stiffness = 0.0005
      scatter.mechanical_damping = 0.01

    [bold]A drive[/bold]
      drive.kind = "multisine"
      drive.from_hz = 0.5
      drive.to_hz = 5.0
      drive.amplitudes_nm = [0.2]  # N m on the body; _rad: the spring's root; _rad_s2: the base

    [bold]Examples[/bold]
      tunnel simulate plan.toml --out my-campaign
      tunnel simulate plan.toml --out again --file-format csv --seed 7
      tunnel simulate plan.toml --out dry \
        --effect coulomb_friction:friction_moment=0.004

    [bold]Exit status[/bold]
      0 written, 2 bad input; nothing is written then.
    """
    from identification.show.style import save
    from tunnel_lab.plotting.runs import trace_pages
    from tunnel_sim.engine.virtual_campaign import plan_effects, simulate_campaign, truth_document
    from tunnel_sim.files.campaign_folder import write_campaign
    from tunnel_sim.files.plan_file import load_plan

    del effects_file  # its effects are known already
    added = tuple(parse_effect(text) for text in effects)
    loaded = load_plan(plan)
    if seed is not None:
        loaded = replace(loaded, seed=seed)
    loaded = replace(loaded, effects=loaded.effects + added)
    plan_effects(loaded)  # refuses invalid effects before anything is simulated
    refuse_occupied(out, overwrite=overwrite)
    if picture is not None:
        refuse_unwritable_files(picture)
    with bar("simulating runs", len(loaded.conditions)) as progress:
        campaign = simulate_campaign(loaded, progress=progress)
    folder = write_campaign(
        campaign, out, run_format=format, truth=truth_document(loaded), overwrite=overwrite
    )
    say(f"Written: {folder} ({counted(len(campaign.runs), 'run')})")
    if picture is not None:
        written = []
        for i, page in enumerate(trace_pages(campaign), 1):
            path = picture if i == 1 else picture.with_stem(f"{picture.stem}-{i}")
            written.append(save(page, path))
        say_written(*written)


def refuse_occupied(folder: Path, *, overwrite: bool) -> None:
    """Refuse a file, or a folder that may not be replaced, before the work is done."""
    from tunnel_sim.files.writing import clear_leftovers

    clear_leftovers(folder.resolve().parent)  # restore files that a killed command had set aside
    if folder.exists() and not folder.is_dir():
        raise TunnelError("is a file, not a folder", where=str(folder), remedy="name another --out")
    if folder.exists() and not overwrite:
        raise TunnelError("exists already", where=str(folder), remedy="name another --out or add --overwrite")


def plan_drive(
    plan: Annotated[Path, Argument(help="Plan of free decays, a TOML file.")],
    moment: Annotated[
        float, Option("--moment", metavar="N_M", help="Largest moment of the drive, N m, peak.")
    ],
    amplitude: Annotated[
        float, Option("--amplitude", metavar="RAD", help="Largest angle of the response, rad, peak.")
    ],
    out: Annotated[
        Path,
        Option(
            "--out", "-o", callback=ending(".toml"), metavar="FILE.toml", help="Where the driven plan goes."
        ),
    ],
    drive: Annotated[bool, Option("--drive", help="Plan driven runs; the only kind so far.")] = False,
    goal: Annotated[
        Literal["d", "cn_r"],
        Option("--goal", help="d: both coefficients, by the determinant; cn_r: Cnr alone."),
    ] = "d",
    minutes: Annotated[
        float | None, Option("--minutes", help="Rig time, minutes. Default: as for the free decays.")
    ] = None,
    buffeting: Annotated[
        float | None,
        Option(
            "--buffeting",
            metavar="S",
            help="Intensity of the effect buffeting, dimensionless; overrides the plan's.",
        ),
    ] = None,
) -> None:
    r"""Plan the drive that tells most about Cnβ and Cnr.

    A plan of free decays becomes a plan of driven runs with the same springs,
    speeds, sensor and rig time: one run of each spring and speed replaces several
    releases, so that less time is lost in pauses. The truth of the plan is the
    prior guess of the coefficients. The drive is the multisine, chirp, sine or
    stepped sine with the lowest Cramér–Rao bound, as large as both limits allow.
    The response stays within its limit if the prior guess is right: leave a margin.

    Rig time is the records' duration, plus 60 s for each record, 300 s for each change
    of spring and 60 s for each change of speed. With buffeting, the bound includes
    the random moment; identify the runs with filter_error. Other effects of the
    plan are ignored.

    [bold]Examples[/bold]
      tunnel plan free.toml --drive --moment 0.5 --amplitude 0.3 --out driven.toml
      tunnel plan free.toml --drive --moment 0.5 --amplitude 0.3 --goal cn_r \
        --minutes 60 --buffeting 0.02 --out driven.toml

    [bold]Exit status[/bold]
      0 written, 2 bad input; nothing is written then.
    """
    import tomli_w

    from identification.uncertainty.drive_design import Limits, peak_response, plan_bound, propose_drive
    from tunnel_lab.envs.menu import Costs
    from tunnel_sim.effects import ALL_EFFECTS
    from tunnel_sim.effects.random_moments import RandomMoment
    from tunnel_sim.engine.virtual_campaign import plan_effects
    from tunnel_sim.files.plan_file import EffectTable, check_size, plan_from, read_plan, run_count
    from tunnel_sim.files.rig_file import load_rig
    from tunnel_sim.files.writing import write_whole

    if not drive:
        raise TunnelError("nothing to plan", where="tunnel plan", remedy="add --drive")
    for name, value, unit, most in (
        ("--moment", moment, "N m", 1e6),
        ("--amplitude", amplitude, "rad, at most π", pi),
        ("--minutes", minutes, "minutes", inf),
    ):
        if value is not None and not (1e-9 <= value <= most and value < inf):
            raise TunnelError(
                f"{value:g} is out of range", where=name, remedy=f"give a number above 0 in {unit}"
            )
    if out.resolve() == plan.resolve():
        raise TunnelError("is the plan itself", where=f"--out {out}", remedy="name another file")
    refuse_unwritable_files(out)
    document, rig, where = read_plan(plan), load_rig(), shown(plan)
    if buffeting is not None:  # with the bandwidth stated in the plan
        of_stream = (
            one for one in ALL_EFFECTS if issubclass(one, RandomMoment) and one.condition == "wind_on"
        )
        kind = next(of_stream)
        stated = next((effect.parameters for effect in document.effects if effect.name == kind.name), {})
        kept = [effect for effect in document.effects if effect.name != kind.name]
        if buffeting:
            parameters = {**stated, kind.parameters()[0].name: buffeting}
            kept.append(EffectTable(name=kind.name, parameters=parameters))
        document = document.model_copy(update={"effects": kept})
    if document.drive is not None:
        raise TunnelError("has a [drive] already", where=where, remedy="give a plan of free decays alone")
    loaded = plan_from(document, rig, where)
    plan_effects(loaded)  # refuses invalid effects
    spent = rig_time(document)
    changes, setup = _changes(document), Costs().setup
    cells = len(document.wind_speeds) * (len(document.springs) + len(document.spring_stiffness))
    left = ((spent if minutes is None else 60.0 * minutes) - changes) / cells - setup
    if left < 1.0:
        least = (changes + cells * (setup + 1.0)) / 60.0
        what = f"leaves no time for records: starts and changes take {least:.3g} min"
        raise TunnelError(what, where="--minutes", remedy="give more, or fewer springs and wind_speeds")
    duration = floor(10.0 * left + 1e-6) / 10.0
    check_size(cells, duration, document.sample_rate, where)
    free = plan_bound(loaded, rig)
    with bar("comparing inputs") as progress:
        tried = iter(range(1, 10**9))
        best = propose_drive(
            document,
            rig,
            Limits(moment, amplitude),
            goal=goal,
            duration=duration,
            progress=lambda: progress(next(tried), None),
        )
    proposed = plan_from(best, rig, where)
    driven = plan_bound(proposed, rig)
    write_whole(out, tomli_w.dumps(best.model_dump(exclude_none=True, exclude_defaults=True)).encode())
    bounds = _bounds(
        (rig_time(best) - changes) / (spent - changes),
        ("free decays", run_count(document), document.duration, spent, free),
        ("planned drive", cells, duration, rig_time(best), driven),
    )
    show([bounds])
    if minutes is not None:
        say("The last row is for free decays repeated to the same rig time.")
    chosen = best.drive
    assert chosen is not None
    rates = chosen.frequencies_hz or [f for f in (chosen.frequency_hz, chosen.from_hz, chosen.to_hz) if f]
    between = " to " if chosen.from_hz else ", "
    hertz = between.join(f"{rate:g}" for rate in rates)
    words = f"Drive: {chosen.kind.replace('_', ' ')}, {hertz} Hz, {chosen.amplitudes_nm[0]:g} N m peak"
    say(f"{words}; response up to {peak_response(proposed, rig):.3g} rad")
    say_written(out)


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


def _bounds(longer: float, *rows: tuple[str, int, float, float, CampaignBound]) -> TextTable:
    """The bounds of both plans, and their ratio with the first repeated ``longer`` times, for equal rig time."""
    from identification.estimate import UNITS
    from identification.printing import SYMBOLS
    from identification.show.numbers import significant, unit

    names = tuple(f"std {SYMBOLS[name]}\n{unit(UNITS[name])}" for name in _COEFFICIENTS)
    heads = ("runs", "record\n[s]", "rig time\n[min]", *names)
    cells = [
        (
            *(name, f"{runs}", f"{record:g}", f"{spent / 60.0:.1f}"),
            *(significant(bound.std(each), 3) for each in _COEFFICIENTS),
        )
        for name, runs, record, spent, bound in rows
    ]
    ratios = (rows[0][-1].std(each) / rows[1][-1].std(each) / sqrt(longer) for each in _COEFFICIENTS)
    cells.append(("free over planned", "", "", "", *(f"{ratio:.2f}" for ratio in ratios)))
    title = "Cramér–Rao bounds: the smallest standard deviations"
    return TextTable(title, ("plan", *heads), tuple(cells), right=heads)
