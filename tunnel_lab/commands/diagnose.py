"""``tunnel diagnose``: where the nominal model does not fit, and which effect explains it."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tunnel_lab.terminal.inputs import HELP as CAMPAIGN_HELP
from tunnel_lab.terminal.options import EffectsFileOption

if TYPE_CHECKING:
    from diagnosis.result import Diagnosis
    from tunnel_sim.effects import Effect
    from tunnel_sim.engine.joint_model import JointModel
    from tunnel_sim.vocabulary.campaign import Campaign

NAME = "diagnose"
OUTPUT, CAUSES, MODEL = "Output", "Effects", "A model of your own"


def run(
    campaign: Annotated[Path, typer.Argument(help=CAMPAIGN_HELP)],
    json: Annotated[
        Path | None,
        typer.Option(
            "--json",
            metavar="FILE",
            rich_help_panel=OUTPUT,
            help="Write the answer as JSON; - for standard output.",
        ),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(
            "--report", metavar="FILE.html", rich_help_panel=OUTPUT, help="Write a report, one HTML page."
        ),
    ] = None,
    summary: Annotated[
        Path | None,
        typer.Option(
            "--summary",
            metavar="FILE.pdf",
            rich_help_panel=OUTPUT,
            help="Write the report's summary, one printed page; needs Chromium.",
        ),
    ] = None,
    author: Annotated[
        str,
        typer.Option(
            "--author", metavar="NAME", rich_help_panel=OUTPUT, help="Who made the diagnosis, for the report."
        ),
    ] = "",
    notes: Annotated[
        str,
        typer.Option(
            "--notes", metavar="TEXT", rich_help_panel=OUTPUT, help="Notes for the head of the report."
        ),
    ] = "",
    effects: Annotated[
        list[str] | None,
        typer.Option("--effects", metavar="A,B", rich_help_panel=CAUSES, help="Consider these effects only."),
    ] = None,
    exclude: Annotated[
        list[str] | None,
        typer.Option(
            "--exclude",
            metavar="C",
            rich_help_panel=CAUSES,
            help="Leave these effects out; tunnel effects lists all.",
        ),
    ] = None,
    effects_file: EffectsFileOption = None,
    model: Annotated[
        Path | None,
        typer.Option(
            "--model",
            metavar="FILE.xml",
            rich_help_panel=MODEL,
            help="A model of your own, MJCF or URDF, as the nominal model.",
        ),
    ] = None,
    joint: Annotated[
        str | None,
        typer.Option(
            "--joint",
            metavar="NAME",
            rich_help_panel=MODEL,
            help="Joint of the model that was recorded; for --model.",
        ),
    ] = None,
    free: Annotated[
        list[str] | None,
        typer.Option(
            "--free",
            metavar="A,B",
            rich_help_panel=MODEL,
            help="Parameters of the model to fit: inertia, damping, stiffness, rest. Default: those that the "
            "runs can determine.",
        ),
    ] = None,
    asset_dir: Annotated[
        Path | None,
        typer.Option(
            "--asset-dir",
            metavar="DIR",
            rich_help_panel=MODEL,
            help="Folder of the model's includes and meshes, where they are not in or below its own.",
        ),
    ] = None,
    patch: Annotated[
        Path | None,
        typer.Option(
            "--patch",
            metavar="OUT.xml",
            rich_help_panel=MODEL,
            help="Write the model with the causes in it; for --model.",
        ),
    ] = None,
    propose: Annotated[
        Path | None,
        typer.Option(
            "--propose",
            metavar="LAW.toml",
            rich_help_panel=OUTPUT,
            help="Write the formula proposed for what no effect explains.",
        ),
    ] = None,
) -> None:
    """Find out why the nominal model does not fit the runs of a campaign.

    The nominal model is fitted to all runs, and its residuals are tested against
    the noise. Then the effects of the vocabulary, and sets of them, are fitted
    and compared. The answer is one effect or several, "none" (there is no gap) or
    "unknown" (no effect of the vocabulary explains it), each with a probability.
    Gap and coefficients are given before and after the effects are added. The gap
    is predicted for runs, or stretches of time, held out of the fit. Where
    something remains, the answer says whether it could move the coefficients, how
    much of it could be closed, by what kind of moment or error of the reading, and
    by which formula; --propose writes the formula for --effects-file.

    [bold]Examples[/bold]
      tunnel diagnose my-campaign
      tunnel diagnose my-campaign --json answer.json --report report.html --author "A. Smith"
      tunnel diagnose my-campaign --summary report.pdf
      tunnel diagnose my-campaign --exclude buffeting,mains_hum
      tunnel diagnose my-campaign --json - | jq .causes
      tunnel diagnose my-campaign --effects-file my.toml
      tunnel diagnose my-campaign --model pendulum.xml --joint hinge --patch out.xml
      tunnel diagnose my-campaign --propose law.toml

    [bold]Exit status[/bold]
      0 diagnosed, whatever the answer; 2 bad input; 130 interrupted. Files are
      written completely or not at all.
    """
    from diagnosis import read_model, vocabulary
    from tunnel_lab.terminal.inputs import file_hashes, given_campaign
    from tunnel_lab.terminal.options import refuse_unwritable_files, split_names
    from tunnel_lab.terminal.tables import say, say_written
    from tunnel_sim.files.writing import json_text, write_json
    from tunnel_sim.vocabulary.errors import TunnelError

    del effects_file  # its effects are known already
    kinds = vocabulary(split_names(effects), split_names(exclude))
    to_stdout = json is not None and str(json) == "-"
    refuse_unwritable_files(None if to_stdout else json, report, summary, patch, propose)
    if summary is not None:
        from tunnel_lab.report import find_browser

        find_browser()
    if (model is None) != (joint is None) or (model is None and (free or patch or asset_dir)):
        raise TunnelError(
            "--model and --joint belong together, and --free, --patch and --asset-dir to them",
            remedy="give both",
        )
    data = given_campaign(campaign)
    hashes = file_hashes(campaign)
    own_model = None
    if model is not None and joint is not None:
        own_model = read_model(model, joint, data, split_names(free) or None, asset_dir)
    if own_model is not None and patch is not None:
        from diagnosis.patch.patched_model import refuse_unpatchable

        refuse_unpatchable(own_model, data, patch)
    answer = diagnose_with_progress(data, kinds, own_model)
    document = answer.to_json_dict()
    document["provenance"]["sha256"] = hashes
    # Files first: the reader of a pipe may close it early.
    if json is not None and not to_stdout:
        write_json(json, document)
    if patch is not None:
        write_patch(answer, patch)
    write_pages(answer, document, (report, summary), (author, notes), patch)
    proposed = None if propose is None else write_proposal(propose, document)
    if to_stdout:
        typer.echo(json_text(document), nl=False)
        return
    show(document)
    if propose is not None and proposed is None:
        nothing = "nothing remains beyond chance, or beside a random moment, or a run is driven"
        say(f"No formula is proposed: {'none is supported' if document['closable'] else nothing}")
    say_written(json, report, summary, patch, proposed)


def write_pages(
    answer: Diagnosis,
    document: dict[str, Any],
    paths: tuple[Path | None, Path | None],
    said: tuple[str, str],
    patch: Path | None,
) -> None:
    """Write the report and its summary, where a file is given for them.

    Args:
        document: of the answer.
        paths: of the report and of the summary.
        said: author and notes for their head.
        patch: the file of the patched model, which the report names.
    """
    if not any(paths) or answer.data is None:
        return
    from tunnel_lab.report import Byline, write_report, write_summary

    today = datetime.now().astimezone().date().isoformat()
    byline = Byline(today, *said, "" if patch is None else patch.name)
    for path, write in zip(paths, (write_report, write_summary), strict=True):
        if path is not None:
            write(document, answer.data, path, byline)


def write_proposal(path: Path, document: dict[str, Any]) -> Path | None:
    """Write the formula proposed as an effects file.

    Returns:
        The file; None where no formula is proposed, and nothing is written.
    """
    import tomli_w

    from tunnel_sim.files.writing import write_whole

    law = (document["closable"] or {}).get("law")
    if law is None:
        return None
    return write_whole(path, tomli_w.dumps({"effects": [law["effect"]]}).encode())


def diagnose_with_progress(
    campaign: Campaign, kinds: tuple[type[Effect], ...], model: JointModel | None = None
) -> Diagnosis:
    """Diagnose, with step and effect on standard error where that is a terminal.

    Args:
        model: the nominal model; None: spring and damper.
    """
    from diagnosis import diagnose
    from tunnel_lab.terminal.progress import step_display

    with step_display() as show_step:
        return diagnose(campaign, kinds=kinds, progress=show_step, model=model)


def write_patch(answer: Diagnosis, path: Path) -> None:
    """Write the patched model of an answer.

    Args:
        path: of the MJCF file.

    Raises:
        TunnelError: when the answer has none, with the reason.
    """
    from diagnosis.closure import UNPATCHED
    from tunnel_sim.vocabulary.errors import TunnelError

    if answer.model is None:
        reason = next(
            (caution.rstrip(".") for caution in answer.cautions if caution.startswith(UNPATCHED)), UNPATCHED
        )
        raise TunnelError(reason, where="--patch", remedy="leave out --patch for the answer alone")
    answer.model.write(path)


def show(document: dict[str, Any]) -> None:
    """Print an answer: the verdict in words, then the figures behind it."""
    from diagnosis import printing as parts
    from diagnosis.closure import closable_table, closable_words, patch_lines, patch_table
    from tunnel_lab.terminal.tables import rich_table, say, show_tables

    say(document["verdict"])
    for line in (parts.where_line(document), *parts.rival_lines(document)):
        if line:
            say(line)
    say("")
    answers = (parts.candidates_table, parts.parameters_table)
    show_tables(*(rich_table(table(document)) for table in answers))
    if line := parts.inclusion_line(document):
        say(f"{line}\n")
    if line := closable_words(document):
        say(f"{line}\n")
    shown = (closable_table, parts.waterfall_table, parts.gap_table, parts.coefficients_table, patch_table)
    show_tables(*(rich_table(table(document)) for table in shown))
    for line in (*patch_lines(document), *parts.closing_lines(document)):
        say(line)
