"""The command ``tunnel``: its arguments and exit statuses.

Exit status: 0 success; 1 a check or an estimate failed; 2 bad input, with one line on standard error;
130 interrupted. Nothing heavy is imported here: every command imports its own needs when it runs.
"""

from __future__ import annotations

import os
import re
import sys
import warnings
from collections.abc import Callable, Sequence
from functools import cache
from typing import Annotated, Any, cast

import typer

from tunnel_lab.commands import (
    about,
    blind,
    compare,
    demo,
    diagnose,
    effects,
    files,
    identify,
    paper,
    score,
    show,
    simulate,
    sweep,
    train,
)
from tunnel_lab.terminal.encoding import replace_what_cannot_be_encoded
from tunnel_lab.terminal.options import with_format, with_quiet
from tunnel_sim.vocabulary.errors import TunnelError

FAILED = 1
BAD_INPUT = 2
INTERRUPTED = 130

CommandLineError = cast("type[Exception]", typer.BadParameter.__mro__[2])
"""Click's base class of all usage errors. Typer exports only a class derived from it indirectly, at changing
places."""

app = typer.Typer(
    name="tunnel",
    no_args_is_help=False,
    add_completion=True,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    """Print the installed version and stop."""
    if wanted:
        from importlib.metadata import version

        typer.echo(f"tunnel {version('virtual-wind-tunnel')}")
        raise typer.Exit


@app.callback(invoke_without_command=True)
def tunnel(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    """A virtual wind tunnel: simulate, identify and diagnose free-decay runs of a yawing model.

    A model on a vertical rod and a spring is released at a yaw angle and
    oscillates. From runs with the wind off and on, the program identifies the
    yaw-moment derivatives Cnβ and Cnr (1/rad), the inertia Izz (kg m²) and the
    rig's damping Cr (N m s/rad), each with a standard deviation.

    tunnel COMMAND --help explains a command, with examples.

    [bold]Units[/bold]
      SI and radians throughout.

    [bold]Exit status[/bold]
      0 success, 1 a check or an estimate failed, 2 bad input (one line on
      standard error says what, where and the remedy), 130 interrupted.
    """
    del version
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


GROUPS: dict[str, dict[str, Callable[..., None] | typer.Typer]] = {
    "Start here": {
        "demo": demo.demo,
        "bench": show.bench,
        "import": files.import_files,
        "diagnose": diagnose.diagnose,
        "simulate": simulate.simulate,
    },
    "Records": {"export": files.export, "plot": show.plot, "springs": paper.springs},
    "Simulation": {
        "effects": effects.run,
        "plan": simulate.plan_drive,
        "view": show.view,
        "render": show.render,
    },
    "Estimators": {
        "identify": identify.run,
        "score": score.score,
        "sweep": sweep.sweep,
        "train": train.train,
    },
    "Results": {"compare": compare.compare, "paper": paper.paper},
    "Developers": {
        "doctor": about.doctor,
        "docs": about.docs,
        "schema": about.schema,
        "blind": blind.app,
    },
}
"""Every command by its name, in the groups of the help; a command with subcommands comes last."""
COMMANDS = {
    name: command
    for group in GROUPS.values()
    for name, command in group.items()
    if not isinstance(command, typer.Typer)
}
"""Every command that is one function by its name."""
_WITHOUT_TABLES = {"simulate", "plot", "export", "view", "render", "docs", "schema", "bench"}

for _group, _members in GROUPS.items():
    for _name, _command in _members.items():
        if isinstance(_command, typer.Typer):
            app.add_typer(_command, name=_name, rich_help_panel=_group)
        else:
            _wider = with_quiet if _name in _WITHOUT_TABLES else with_format
            app.command(_name, rich_help_panel=_group)(_wider(_command))


_MARKUP = re.compile(r"\[(?=[a-z#/@])(?!/?bold\])")
"""A bracket that Rich would take for markup; the only markup in the help is its headings."""


def _with_plain_brackets(command: Any) -> None:
    """Show brackets such as ``[drive]`` unchanged in the help of a command, its options and its subcommands."""
    for text in (command, *command.params):
        for name in ("help", "short_help"):
            if said := getattr(text, name, None):
                setattr(text, name, _MARKUP.sub(r"\\[", said))
    for own in getattr(command, "commands", {}).values():
        _with_plain_brackets(own)


@cache  # built once, even if a process calls `main` repeatedly
def _whole() -> Any:
    command = typer.main.get_command(app)
    _with_plain_brackets(command)
    return command


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``tunnel`` and turn its end or exception into an exit status.

    Args:
        arguments: the words after ``tunnel``; None: the words given to the process.

    Returns:
        0 success, 1 a check or an estimate failed, 2 bad input, 130 interrupted.
    """
    replace_what_cannot_be_encoded()
    if arguments is None and not sys.warnoptions:
        # Also in child processes: an overflow at a remote trial point of a fit means nothing to a user.
        warnings.simplefilter("ignore", RuntimeWarning)
        os.environ.setdefault("PYTHONWARNINGS", "ignore::RuntimeWarning")
    try:
        status = _whole().main(args=arguments, prog_name="tunnel", standalone_mode=False)
        _flush()
    except TunnelError as error:
        return _refuse(str(error))
    except CommandLineError as error:
        return _refuse(error.format_message())  # type: ignore[attr-defined]  # click's, see CommandLineError
    except (KeyboardInterrupt, typer.Abort):
        status = INTERRUPTED
    except BrokenPipeError:
        _settle_output()
        return 0
    except SystemExit as error:
        _settle_output()
        return 0 if _by_library(error) else _left(error)
    except OSError as error:
        _settle_output()
        return _refuse(
            f"{error.filename or 'a file'}: {(error.strerror or str(error)).lower()}; check disk and path"
        )
    finally:
        # Without this module nothing has been written, and loading it would slow --help.
        if "tunnel_sim.files.writing" in sys.modules:
            from tunnel_sim.files.writing import remove_empty_folders

            remove_empty_folders()
    if status == INTERRUPTED:
        print("tunnel: interrupted; no file is left half written", file=sys.stderr)
    return status if isinstance(status, int) else 0


def _by_library(error: SystemExit) -> bool:
    """Whether Typer or Rich ended the process, as they do for closed pipes and after completing a word."""
    frame = error.__traceback__
    while frame is not None and frame.tb_next is not None:
        frame = frame.tb_next
    module = "" if frame is None else frame.tb_frame.f_globals.get("__name__", "")
    return module.partition(".")[0] in ("typer", "rich")


def _left(error: SystemExit) -> int:
    """Report that the user's code has ended the command."""
    from tunnel_sim.vocabulary.errors import raised_line

    print(f"tunnel: the command was ended by its own code ({raised_line(error)})", file=sys.stderr)
    return FAILED


def _flush() -> None:
    """Write out what was printed; a process may be started without standard output."""
    if sys.stdout is not None:
        sys.stdout.flush()


def _settle_output() -> None:
    """Discard output that cannot be printed; otherwise Python's flush at exit would fail again.

    The reader of a pipe may have gone away (``tunnel springs | head -1``), which is not an error.
    """
    try:
        _flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _refuse(reason: str) -> int:
    """Report the fault of the input, in exactly one line."""
    print(f"tunnel: {' '.join(reason.split())}", file=sys.stderr)
    return BAD_INPUT


if __name__ == "__main__":
    sys.exit(main())
