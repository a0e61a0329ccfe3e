"""``tunnel diagnose``: the misfit of the nominal model, and the effects that explain it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer import Argument, Option

from tunnel_lab.terminal.arguments import HELP as CAMPAIGN_HELP
from tunnel_lab.terminal.arguments import (
    EffectsFileOption,
    LeaveOutOption,
    file_hashes,
    given_campaign,
    output_file,
    refuse_unwritable_files,
    split_names,
)
from tunnel_lab.terminal.encoding import printable_json
from tunnel_lab.terminal.outputs import say, say_written, show
from tunnel_lab.terminal.progress import step_display
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from diagnosis.result import Diagnosis
    from tunnel_sim.effects import Effect
    from tunnel_sim.engine.joint_model import JointModel
    from tunnel_sim.vocabulary.campaign import Campaign

_output = partial(Option, rich_help_panel="Output")
_written = partial(output_file, panel="Output")
_causes = partial(Option, rich_help_panel="Effects")
_model = partial(Option, rich_help_panel="A model of your own")
_model_file = partial(output_file, panel="A model of your own")


@dataclass(frozen=True)
class AnswerFiles:
    """The files in which the answer is written; None: none."""

    json: Annotated[
        Path | None, _written("--json", ".json", help="Write the answer as JSON; - for standard output.")
    ] = None
    report: Annotated[
        Path | None, _written("--report", ".html", ".htm", help="Write a report, one HTML page.")
    ] = None
    pdf: Annotated[
        Path | None,
        _written(
            "--pdf", ".pdf", help="Write the report as two printed pages, A4 or Letter; needs Chromium."
        ),
    ] = None
    author: Annotated[
        str, _output("--author", metavar="NAME", help="Who made the diagnosis, for the report.")
    ] = ""
    notes: Annotated[str, _output("--notes", metavar="TEXT", help="Notes for the head of the report.")] = ""
    propose: Annotated[
        Path | None,
        output_file("--propose", ".toml", help="Write the formula proposed for the residual gap."),
    ] = None

    @property
    def to_stdout(self) -> bool:
        """Whether the JSON goes to standard output."""
        return self.json is not None and str(self.json) == "-"

    def refuse_unwritable(self, patch: Path | None) -> None:
        """Refuse a file that cannot be written, or a PDF without a browser, before the work is done."""
        json = None if self.to_stdout else self.json
        refuse_unwritable_files(json, self.report, self.pdf, patch, self.propose)
        if self.pdf is not None:
            from tunnel_lab.report import find_browser

            find_browser()

    def write_pages(self, answer: Diagnosis, patch: Path | None) -> None:
        """Write the report and its PDF, if requested."""
        if answer.data is None or not (self.report or self.pdf):
            return
        from tunnel_lab.report import Byline, write_pdf, write_report

        today = datetime.now().astimezone().date().isoformat()
        byline = Byline(today, self.author, self.notes, "" if patch is None else patch.name)
        if self.report is not None:
            write_report(answer, answer.data, self.report, byline)
        if self.pdf is not None:
            write_pdf(answer, answer.data, self.pdf, byline)


@dataclass(frozen=True)
class Considered:
    """The effects that are considered."""

    effects: Annotated[
        tuple[str, ...],
        _causes("--effects", metavar="A,B", help="Consider only these effects.", callback=split_names),
    ] = ()
    exclude: Annotated[
        tuple[str, ...],
        _causes(
            "--exclude",
            metavar="C",
            help="Leave these effects out; tunnel effects lists all.",
            callback=split_names,
        ),
    ] = ()
    effects_file: EffectsFileOption = None  # its effects are known when the command runs


@dataclass(frozen=True)
class OwnModel:
    """A user's model as the nominal model, and how its patch is written."""

    model: Annotated[
        Path | None,
        _model(
            "--model", metavar="FILE.xml", help="A model of your own, MJCF or URDF, as the nominal model."
        ),
    ] = None
    joint: Annotated[
        str | None,
        _model("--joint", metavar="NAME", help="Joint of the model that was recorded; for --model."),
    ] = None
    free: Annotated[
        tuple[str, ...],
        _model(
            "--free",
            metavar="A,B",
            help="Parameters of the model to fit: inertia, damping, stiffness, rest (a constant moment where "
            "nothing holds the joint), gain (the kp of a position servo). Default: what the runs can "
            "determine.",
            callback=split_names,
        ),
    ] = ()
    actuator: Annotated[
        str | None,
        _model(
            "--actuator",
            metavar="NAME",
            help="Actuator whose control the column drive is, where the joint has several.",
        ),
    ] = None
    asset_dir: Annotated[
        Path | None,
        _model(
            "--asset-dir",
            metavar="DIR",
            help="Folder of the model's includes and meshes, where they are not in or below its own.",
        ),
    ] = None
    patch: Annotated[
        Path | None,
        _model_file("--patch", ".xml", help="Write the model with the causes in it; for --model."),
    ] = None
    native: Annotated[
        bool,
        _model("--native", help="Write --patch in MuJoCo's own elements alone, as near as they come."),
    ] = False

    def refuse_partial(self) -> None:
        """Refuse options without the options that they need."""
        partly = self.model is None and (self.free or self.patch or self.asset_dir or self.actuator)
        if (self.model is None) != (self.joint is None) or partly:
            what = (
                "--model and --joint belong together, and --free, --actuator, --patch and --asset-dir to them"
            )
            raise TunnelError(what, remedy="give both")
        if self.native and self.patch is None:
            raise TunnelError(
                "--native says how --patch is written", remedy="give --patch too, or leave it out"
            )

    def read(self, data: Campaign) -> JointModel | None:
        """The model, if there is one; a patch of it must be possible."""
        from diagnosis import read_model

        if self.model is None or self.joint is None:
            return None
        found = read_model(self.model, self.joint, data, self.free or None, self.asset_dir, self.actuator)
        if self.patch is not None:
            from diagnosis.patch.patched_model import refuse_unpatchable

            refuse_unpatchable(found, data, self.patch)
        return found


def diagnose(
    campaign: Annotated[Path, Argument(help=CAMPAIGN_HELP)],
    leave_out: LeaveOutOption = (),
    *,
    files: AnswerFiles,
    considered: Considered,
    own: OwnModel,
) -> None:
    """Find out why the nominal model does not fit the runs of a campaign.

    The nominal model is fitted to all runs, and its residuals are tested against
    the noise. Then the effects that tunnel effects lists, and sets of them, are fitted
    and compared. The answer is one effect or several, "none" (there is no gap) or
    "unknown" (none of these effects explains it), each with a probability.
    The gap and the coefficients are given before and after the effects are added.
    The gap is predicted for held-out runs, or stretches of time. For a
    significant residual gap, the answer states whether it could change the
    coefficients, and which kind of moment or error of the reading, and which
    formula, could explain it; --propose writes the formula for --effects-file.

    [bold]Examples[/bold]
      tunnel diagnose my-campaign
      tunnel diagnose my-campaign --json answer.json --report report.html --author "A. Smith"
      tunnel diagnose my-campaign --pdf report.pdf
      tunnel diagnose my-campaign --leave-out r07
      tunnel diagnose my-campaign --exclude buffeting,mains_hum
      tunnel diagnose my-campaign --json - | jq .causes
      tunnel diagnose my-campaign --effects-file my.toml
      tunnel diagnose my-campaign --model pendulum.xml --joint hinge --patch out.xml
      tunnel diagnose my-robot --model arm.xml --joint elbow --actuator motor --patch out.xml
      tunnel diagnose my-campaign --propose law.toml

    [bold]Exit status[/bold]
      0 diagnosed, whatever the answer; 2 bad input; 130 interrupted. Files are
      written completely or not at all.
    """
    from diagnosis import vocabulary
    from diagnosis.findings.sections import printed
    from tunnel_sim.files.writing import json_text, write_json

    kinds = vocabulary(considered.effects, considered.exclude)
    files.refuse_unwritable(own.patch)
    own.refuse_partial()
    whole = given_campaign(campaign)
    data = whole.without(leave_out)
    hashes = file_hashes(campaign)
    answer = diagnose_with_progress(whole, kinds, own.read(data), leave_out).with_hashes(hashes)
    document = answer.to_json_dict()
    # Files first: the reader of a pipe may close it early.
    if files.json is not None and not files.to_stdout:
        write_json(files.json, document)
    if own.patch is not None:
        write_patch(answer, own.patch, native=own.native)
    files.write_pages(answer, own.patch)
    proposed = None if files.propose is None else write_proposal(files.propose, answer)
    if files.to_stdout:
        typer.echo(printable_json(json_text(document)), nl=False)
        return
    show(printed(answer))
    if files.propose is not None and proposed is None:
        nothing = "no residual gap is significant, a random moment is a cause, or the body has no spring"
        say(f"No formula is proposed: {'none is supported' if answer.closable else nothing}")
    say_written(files.json, files.report, files.pdf, own.patch, proposed)


def write_proposal(path: Path, answer: Diagnosis) -> Path | None:
    """Write the proposed formula as an effects file; None without a proposal."""
    import tomli_w

    from tunnel_sim.files.writing import as_json, write_whole

    law = None if answer.closable is None else answer.closable.law
    if law is None:
        return None
    document = {**answer.freedom.stated, "effects": [as_json(law.effect)]}
    return write_whole(path, tomli_w.dumps(document).encode())


def diagnose_with_progress(
    campaign: Campaign,
    kinds: tuple[type[Effect], ...],
    model: JointModel | None = None,
    leave_out: Sequence[str] = (),
) -> Diagnosis:
    """Diagnose, showing step and effect on standard error if that is a terminal."""
    import diagnosis

    with step_display() as show_step:
        return diagnosis.diagnose(campaign, leave_out=leave_out, kinds=kinds, progress=show_step, model=model)


def write_patch(answer: Diagnosis, path: Path, *, native: bool = False) -> None:
    """Write the patched model of an answer as MJCF; a `TunnelError` with the reason if there is none.

    Args:
        native: whether to use MuJoCo's own elements alone.
    """
    from diagnosis.findings.cautions import UNPATCHED

    if answer.model is None:
        said = zip(answer.cautions, answer.found.cautions, strict=True)
        reason = next((caution.rstrip(".") for caution, fact in said if fact.kind == "unpatched"), UNPATCHED)
        raise TunnelError(reason, where="--patch", remedy="leave out --patch for the answer alone")
    nearest = answer.model.native
    # printed before it is written, because plain MuJoCo refuses the file
    if nearest is not None and not native:
        notes = zip(answer.model.notes, answer.model.differences, strict=True)
        say(next(f"Note: {note}" for note, fact in notes if fact.kind == "by plugin"), stderr=True)
    (answer.model if nearest is None or not native else nearest).write(path)
