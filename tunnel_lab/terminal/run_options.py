"""Options that ``tunnel render`` and ``tunnel view`` share: what is changed of the run that is shown."""

from __future__ import annotations

from typing import Annotated

import typer

_EFFECT_HELP = "Add an effect beyond the nominal model, as often as wanted; tunnel effects lists them."

SpringOption = Annotated[int | None, typer.Option("--spring", help="Number of the spring in Table II.")]
WindOption = Annotated[float | None, typer.Option("--wind", help="Wind speed, m/s.")]
AngleOption = Annotated[float | None, typer.Option("--angle", help="Release angle, degrees.")]
EffectOption = Annotated[
    list[str] | None, typer.Option("--effect", metavar="NAME:PARAMETER=VALUE", help=_EFFECT_HELP)
]
