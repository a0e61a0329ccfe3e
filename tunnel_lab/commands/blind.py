"""``tunnel blind``: blind tests of the diagnosis."""

from __future__ import annotations

import os
import shlex
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import typer
from typer import Argument, Option

from tunnel_lab.terminal.arguments import (
    EffectsFileOption,
    SchedulerOption,
    output_file,
    refuse_unwritable_files,
    split_names,
)
from tunnel_lab.terminal.options import with_format, with_quiet
from tunnel_lab.terminal.outputs import console, say, say_written
from tunnel_lab.terminal.progress import bar_or_lines
from tunnel_sim.vocabulary.errors import counted

HELP = """Blind tests of the diagnosis: make campaigns, diagnose them, score the answers.

Campaigns are drawn and simulated by the reference simulator, whose integrator
and forms of effects differ from the fits'. Their truth is written
to a separate key, and its salted SHA-256 is published with the data.

[bold]Order[/bold]
  tunnel blind make set --count 200 --seed 1
  tunnel blind diagnose set
  tunnel blind score set --markdown docs/blind-check.md
"""


app = typer.Typer(help=HELP, rich_markup_mode="rich", no_args_is_help=True)

Folder = Annotated[Path, Argument(help="Folder of the set.")]
Excluded = Annotated[
    tuple[str, ...],
    Option(
        "--exclude",
        metavar="EFFECT",
        help="Leave effects out of the vocabulary; their campaigns then count as unknown.",
        callback=split_names,
    ),
]
KeyFile = Annotated[
    Path | None, Option("--key", metavar="FILE", help="The key. Default: key.json in the set.")
]


_share = partial(Option, min=0, max=1)


@dataclass(frozen=True)
class MixtureOptions:
    """The options of a `Mixture`, which has fields of these names."""

    textbook: Annotated[float, _share("--textbook", help="Share of textbook forms.")] = 0.5
    rare: Annotated[float, _share("--rare", help="Share of rare forms in the rest.")] = 0.5
    variety: Annotated[
        float,
        _share(
            "--variety",
            help="Share of campaigns with another scale, and equal shares with few runs, coloured noise or uneven "
            "time stamps.",
        ),
    ] = 0.25
    small: Annotated[float, _share("--small", help="Share with an additional small effect.")] = 0.25
    departures: Annotated[
        float,
        _share(
            "--departures",
            help="Share, each, with other sample rates, durations, clocks, release sides, starts, air, springs, "
            "noise and zeros than the standard rig's.",
        ),
    ] = 0.0
    scatter: Annotated[
        float, _share("--scatter", help="Share whose runs differ by chance; 0: as earlier versions drew.")
    ] = 0.5
    level: Annotated[
        Literal["mixed", "small", "usual", "large"],
        Option("--scatter-level", help="Widths: small or large (mixed), or the usual ones throughout."),
    ] = "mixed"
    normal: Annotated[
        float,
        _share(
            "--scatter-normal",
            help="Share of these that are normal; the rest has tails, zeros of the runs, a walk or a drift.",
        ),
    ] = 0.5
    stated: Annotated[float, _share("--stated", help="Share of these that state a [repeatability].")] = 0.5
    driven: Annotated[
        bool, Option("--driven", help="Drive the runs, all or some, by known moments or other inputs.")
    ] = False


@app.command("make")
@with_quiet
def make(
    out: Annotated[Path, Argument(help="Folder to make.")],
    seed: Annotated[int, Option("--seed", min=0, help="Seed of everything drawn.")],
    count: Annotated[int, Option("--count", min=1, help="Number of campaigns.")] = 200,
    kinds: Annotated[
        str | None,
        Option(
            "--kinds",
            metavar="KIND:WEIGHT,…",
            help="single, pair, three, four, none, outside, law, with weights.",
        ),
    ] = None,
    *,
    mixture: MixtureOptions,
    key: KeyFile = None,
) -> None:
    """Make a set: campaigns without truth, the sealed key, and its published hash.

    Springs, speeds, releases, coefficients and noise of every campaign are drawn
    at random. A campaign has up to four large effects, or one outside the vocabulary,
    in the textbook form or another, each sized to 1–100 times the noise variance. No
    two of them imitate each other. Small effects need not be found.
    In half of the campaigns wind speed, springs or damping scatter between runs.
    The scatter is scored separately from the causes.
    Effects of an --effects-file are not drawn: they only have the form of the fits,
    so they would not be an independent test. Campaigns from tunnel simulate, each
    with its truth.json, can be diagnosed with them; tunnel blind score treats them
    as an open set.

    The same seed gives the same campaigns. Sizing the effects takes several minutes
    for any number of campaigns.

    [bold]Exit status[/bold]
      0 made, 2 bad input, 130 interrupted; no incomplete set is left.
    """
    from tunnel_lab.experiments.blind import DEFAULT_SHARES, Mixture, make_blind, parse_shares
    from tunnel_lab.experiments.blind.sets import SEAL
    from tunnel_sim.files.reading import read_json

    shares = DEFAULT_SHARES if kinds is None else parse_shares(kinds)
    refuse_unwritable_files(key)
    with bar_or_lines("sizing effects and writing campaigns", count) as progress:
        where = make_blind(
            out, count=count, seed=seed, shares=shares, mixture=Mixture(**vars(mixture)), key=key,
            progress=progress, show_steps=console(stderr=True).is_terminal,
        )  # fmt: skip
    say(f"Written: {out} ({counted(count, 'campaign')}), key {where}")
    say(f"Key sha256 {read_json(out / SEAL, remedy='')['key_sha256']}, in {out / SEAL}")
    folder, named = shlex.quote(str(out)), "" if key is None else f" --key {shlex.quote(str(where))}"
    if key is None:
        say(
            f"{where} is the truth: move it out of {out} before you hand the folder out, and name it with --key"
        )
    say(f"Next: tunnel blind diagnose {folder}, then tunnel blind score {folder}{named}")


@app.command("diagnose")
@with_quiet
def diagnose(
    folder: Folder,
    exclude: Excluded = (),
    jobs: Annotated[
        int | None,
        Option("--jobs", min=0, help="Number of processes. Default: 0, which uses this one."),
    ] = None,
    scheduler: SchedulerOption = None,
    effects_file: EffectsFileOption = None,
) -> None:
    """Diagnose every campaign of a set; continue where an interrupted run ended.

    The answers go to FOLDER/answers (answers-without-… with --exclude,
    answers-with-… with --effects-file), one JSON file for each campaign; their
    SHA-256 goes to the seal.json in the same folder. The key is not read. With
    --scheduler, every worker must find the set under the same path.

    [bold]Exit status[/bold]
      0 all answered, 2 bad input, 130 interrupted (finished answers are kept).
    """
    from tunnel_lab.experiments.blind import answer_set, answers_folder
    from tunnel_lab.experiments.runner import crew

    workers = crew(jobs, scheduler, usual=0)
    with bar_or_lines("diagnosing") as progress:
        sealed = answer_set(
            folder, excluded=exclude, workers=workers, progress=progress, effects_file=effects_file
        )
    say(f"Answers: {answers_folder(folder, exclude, effects_file)}")
    say(f"Answers sha256 {sealed}")


@app.command("score")
@with_format
def score(
    folder: Folder,
    exclude: Excluded = (),
    key: KeyFile = None,
    markdown: Annotated[
        Path | None, output_file("--markdown", ".md", help="Also write the score as a page.")
    ] = None,
    json: Annotated[
        Path | None, output_file("--json", ".json", help="Also write all figures and cases as JSON.")
    ] = None,
    figure: Annotated[
        Path | None,
        output_file(
            "--figure", ".png", help="Also draw the calibration, and the confusion beside it; PDF too."
        ),
    ] = None,
    effects_file: EffectsFileOption = None,
) -> None:
    """Verify all hashes, open the key and score the answers.

    The output gives exact matches by kind with Wilson intervals, causes found and
    false by number of causes and by circumstances, false alarms, calibration of
    the answer and of the probabilities of the effects, explained gap on held-out runs,
    errors of Cnβ and Cnr before and after, the answers by true cause, and what is
    found of the scatter between runs. A folder
    without seal.json but with a truth.json in every campaign is scored as an open
    set and labelled as one.

    [bold]Exit status[/bold]
      0 scored, 2 bad input: an answer is missing, or a file does not match its hash.
    """
    from diagnosis import vocabulary
    from identification.show.style import save_both
    from tunnel_lab.experiments.blind import score_page as blind
    from tunnel_lab.experiments.blind import score_set
    from tunnel_sim.files.writing import write_json, write_whole

    vocabulary(exclude=exclude)
    refuse_unwritable_files(markdown, json, figure)
    result = score_set(folder, excluded=exclude, key=key, effects_file=effects_file)
    drawn: tuple[Path, ...] = ()
    if figure is not None:
        beside = figure.with_name(f"{figure.stem}-confusion.png")
        drawn = save_both(blind.calibration_figure(result), figure)
        drawn += save_both(blind.confusion_figure(result), beside)
    if markdown is not None:
        addresses = [os.path.relpath(path, markdown.parent) for path in drawn[::2]] or ("", "")
        write_whole(markdown, blind.markdown(result, str(folder), addresses).encode())
    if json is not None:
        write_json(json, result.to_json_dict())
    blind.blind_view(result).show()
    say_written(markdown, json, *drawn)
