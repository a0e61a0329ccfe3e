"""Inputs of commands: a campaign or an effect, and options that several commands share."""

from __future__ import annotations

import hashlib
import shlex
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer import Option

from tunnel_sim.vocabulary.errors import (
    TunnelError,
    did_you_mean,
    one_line,
    own_traceback,
    raised_line,
    shown,
)

if TYPE_CHECKING:
    from tunnel_sim.vocabulary.campaign import Campaign
    from tunnel_sim.vocabulary.plan import EffectSetting


NO_EFFECT = "none"
"""The name of the nominal model in place of an effect."""
HELP = (
    "Folder of the campaign: campaign.toml and its runs. Or one file of a data logger, as for tunnel import."
)
_FORM = "write NAME:PARAMETER=VALUE, with a comma before each further PARAMETER=VALUE; see tunnel effects"


def given_campaign(path: Path) -> Campaign:
    """Read a campaign's folder, its ``campaign.toml``, or a file of any format that ``tunnel import`` reads.

    A summary of an imported file of a data logger is printed on standard error.
    """
    from tunnel_lab.terminal.outputs import say
    from tunnel_lab.terminal.progress import bar
    from tunnel_sim.files.as_campaign import refuse_records
    from tunnel_sim.files.campaign_folder import CAMPAIGN_FILE, read_campaign

    refuse_records(path)
    if not path.is_file() or path.name == CAMPAIGN_FILE:
        with bar("reading runs") as progress:
            return read_campaign(path, progress)
    if path.suffix.lower() == ".toml":
        remedy = f"if it is a plan: tunnel simulate {shlex.quote(str(path))} --out FOLDER"
        raise TunnelError(f"is neither a record nor a {CAMPAIGN_FILE}", where=shown(path), remedy=remedy)
    # imported here because a campaign does not need it
    from tunnel_sim.files.importing.records import read_records
    from tunnel_sim.vocabulary.turning_points import HoldsTurningPoints

    try:
        imported = read_records([path])
    except HoldsTurningPoints:
        raise
    except TunnelError as error:
        remedy = f"tunnel import takes options: {error.remedy}"
        raise TunnelError(error.what, where=error.where, remedy=remedy) from None
    for line in imported.remarks():
        say(f"Note: {line}", stderr=True)
    return imported.campaign


def file_hashes(path: Path) -> dict[str, str]:
    """SHA-256 of the files from which `given_campaign` read a campaign.

    Returns:
        Hexadecimal digests by name in the campaign's folder: ``campaign.toml`` and the runs, or the one file.
    """
    from tunnel_sim.files.campaign_folder import CAMPAIGN_FILE, read_document

    if path.is_file() and path.name != CAMPAIGN_FILE:
        paths = {one_line(path.name): path}
    else:
        folder = path.parent if path.is_file() else path
        files = [CAMPAIGN_FILE, *(run.file for run in read_document(folder / CAMPAIGN_FILE).runs)]
        paths = {name: folder / name for name in files}
    digests = {}
    for name, file in paths.items():
        with file.open("rb") as stream:
            digests[name] = hashlib.file_digest(stream, "sha256").hexdigest()
    return digests


def parse_effect(text: str) -> EffectSetting:
    """Read the value of ``--effect``, such as ``coulomb_friction:friction_moment=0.004``.

    Returns:
        Name and parameters; the registry checks whether they exist and are in range.
    """
    from tunnel_sim.vocabulary.plan import EffectSetting

    where = f"--effect {text}"
    name, _, rest = text.partition(":")
    values: dict[str, float] = {}
    for part in rest.split(",") if rest else []:
        parameter, equals, value = (piece.strip() for piece in part.partition("="))
        if not (parameter and equals and value):
            raise TunnelError(f"{part!r} is not PARAMETER=VALUE", where=where, remedy=_FORM)
        if parameter in values:
            raise TunnelError(f"{parameter} is given twice", where=where, remedy="give it once")
        try:
            values[parameter] = float(value)
        except ValueError:
            raise TunnelError(f"{value!r} is not a number", where=where, remedy=_FORM) from None
    if not name.strip():
        raise TunnelError("no effect is named", where=where, remedy=_FORM)
    return EffectSetting(name.strip(), values)


def _know_effects(context: typer.Context, path: Path | None) -> Path | None:
    """Make the effects of a file known until the command ends."""
    if path is not None:
        from tunnel_sim.effects.expression_effect import read_effects
        from tunnel_sim.effects.registry import answering_with

        context.with_resource(answering_with(read_effects(path)))
    return path


EffectsFileOption = Annotated[
    Path | None,
    Option(
        "--effects-file",
        metavar="FILE.toml",
        rich_help_panel="Effects",
        help="Also try the effects that this file states as expressions.",
        callback=_know_effects,
    ),
]


SchedulerOption = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        metavar="ADDRESS",
        help="Use the Dask cluster of this scheduler (tcp://host:8786), or start one here: local.",
    ),
]


def estimator_option(what: str, more: str = "") -> Any:
    """The option ``--estimator`` of a command, which takes a name or a class.

    Args:
        what: the use of the estimator in the command, for the help.
        more: further sentences.
    """
    text = f"{what}: a name, or module:Class of your own.{more and ' '}{more}"
    return Option("--estimator", "-e", metavar="NAME", help=text)


def split_names(words: Sequence[str] | None) -> tuple[str, ...]:
    """Names from repeated options, from lists with commas, or from both."""
    return tuple(name.strip() for word in words or () for name in word.split(",") if name.strip())


LeaveOutOption = Annotated[
    tuple[str, ...],
    Option(
        "--leave-out",
        metavar="RUN",
        help="Leave out the run of this id. May be repeated.",
        callback=split_names,
    ),
]


def chosen_estimator(word: str) -> str:
    """The name of an estimator from the value of ``--estimator``: its name, or ``module:Class`` of the user's.

    The module is also looked for in the current folder, and its class is registered.

    Raises:
        TunnelError: for an unknown name, suggesting the closest one, and for a class that cannot be used.
    """
    from identification.estimators import known_estimators, register_from

    if ":" in word:
        if not {"", str(Path.cwd())} & set(sys.path):
            sys.path.insert(0, str(Path.cwd()))  # worker processes inherit it
        return register_from(word)
    known = known_estimators()
    if word not in known:
        remedy = f"{did_you_mean(word, known).removesuffix('?')}, or give module:Class of your own"
        raise TunnelError(f"there is no estimator {word!r}", where="--estimator", remedy=remedy)
    return word


def chosen_estimators(words: Sequence[str]) -> tuple[str, ...]:
    """The names of estimators from repeated options, each perhaps a list with commas."""
    return tuple(dict.fromkeys(map(chosen_estimator, split_names(words))))


@contextmanager
def own_code(estimators: Sequence[str]) -> Iterator[None]:
    """End the command with status 1 if an estimator raises an exception or returns no valid estimate.

    The traceback of an exception in the user's code is printed.
    """
    from identification.returned import WrongReturn
    from tunnel_lab.terminal.outputs import say

    try:
        yield
    except WrongReturn as error:
        say(f"tunnel: {error}", stderr=True)
        raise typer.Exit(1) from None
    except TunnelError:
        raise
    except (Exception, SystemExit) as error:
        from identification.estimators import SUMMARIES

        own = [name for name in estimators if name not in SUMMARIES]
        if not own:
            raise
        say(own_traceback(error), stderr=True)
        remedy = "identification.check_estimator checks a class"
        say(f"tunnel: {', '.join(own)} raised an exception: {raised_line(error)}; {remedy}", stderr=True)
        raise typer.Exit(1) from None


def refuse_unwritable_files(*paths: Path | None) -> None:
    """Before the work is done, refuse the first file that cannot be written; None is left out."""
    from tunnel_sim.files.writing import refuse_unwritable

    for path in filter(None, paths):
        refuse_unwritable(path)


def ending(*known: str) -> Callable[[Path | None], Path | None]:
    """A callback of an option that takes a file; it accepts only these endings, such as ``.html``.

    The output has one format, so another ending would be wrong. ``-`` and devices are accepted.
    """

    def checked(path: Path | None) -> Path | None:
        if (
            path is None or str(path) == "-" or path.resolve().suffix.lower() in known
        ):  # the target's ending for a link
            return path
        if path.exists() and not path.is_file():  # a folder is refused when it is written
            return path
        remedy = f"name a file that ends in {' or '.join(known)}, the format that is written"
        raise TunnelError(f"does not end in {' or '.join(known)}", where=shown(path), remedy=remedy)

    return checked


def output_file(flag: str, *endings: str, help: str, panel: str | None = None) -> Any:
    """An option for a file to write, with one of these endings, such as ``.html``."""
    path = f"FILE{endings[0]}"
    return Option(flag, callback=ending(*endings), metavar=path, help=help, rich_help_panel=panel)
