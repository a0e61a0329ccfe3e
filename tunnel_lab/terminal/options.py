"""Parts of the command line that several commands share."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

PlanArgument = Annotated[
    Path | None,
    typer.Argument(help="Plan of a campaign (TOML). Default: the rig with its default spring at 10 m/s."),
]
RunOption = Annotated[
    str | None, typer.Option("--run", metavar="ID", help="Run of the plan. Default: its first.")
]
SpringOption = Annotated[int | None, typer.Option("--spring", help="Number of the spring in Table II.")]
WindOption = Annotated[float | None, typer.Option("--wind", help="Wind speed, m/s.")]
AngleOption = Annotated[float | None, typer.Option("--angle", help="Release angle, degrees.")]
EffectOption = Annotated[
    list[str] | None,
    typer.Option(
        "--effect",
        metavar="NAME:PARAMETER=VALUE",
        help="Add an effect to the nominal model. May be repeated; tunnel effects lists them.",
    ),
]


def _know_effects(context: typer.Context, path: Path | None) -> Path | None:
    """Make the effects of a file known until the command ends."""
    if path is not None:
        from tunnel_sim.effects.effects_file import read_effects
        from tunnel_sim.effects.registry import answering_with

        context.with_resource(answering_with(read_effects(path)))
    return path


EffectsFileOption = Annotated[
    Path | None,
    typer.Option(
        "--effects-file",
        metavar="FILE.toml",
        help="Add the effects that this file states as expressions to the vocabulary.",
        callback=_know_effects,
    ),
]


def split_names(words: Sequence[str] | None) -> tuple[str, ...]:
    """Names from repeated options, from lists with commas, or from both."""
    return tuple(name.strip() for word in words or () for name in word.split(",") if name.strip())


def known_estimator(name: str) -> None:
    """Refuse an unknown estimator.

    Raises:
        TunnelError: when there is no such estimator; it suggests the closest name.
    """
    from identification.estimators import ALL_ESTIMATORS
    from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean

    if name not in ALL_ESTIMATORS:
        raise TunnelError(
            f"there is no estimator {name!r}", where="--estimator", remedy=did_you_mean(name, ALL_ESTIMATORS)
        )


def refuse_unwritable_files(*paths: Path | None) -> None:
    """Refuse files that cannot be written before the work is done; None is left out.

    Raises:
        TunnelError: for the first of them.
    """
    from tunnel_sim.files.writing import refuse_unwritable

    for path in filter(None, paths):
        refuse_unwritable(path)
