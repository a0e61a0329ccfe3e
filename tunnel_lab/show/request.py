"""The run to be shown: a plan's, or the rig with a few options."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Option


@dataclass(frozen=True)
class Request:
    """The run, as options; None takes the value of the plan or the rig.

    Args:
        plan: path of a campaign's description.
        run: id of a run of the plan; None takes its first.
        spring: number of the spring in the rig's table.
        wind_speed: wind speed, m/s.
        release_angle_deg: release angle, degrees.
        duration: duration, s.
        effects: effects as ``NAME:PARAMETER=VALUE``, in addition to the plan's.
        seed: seed of the sensor's noise and of random effects; None takes the plan's, or 1.
    """

    plan: Annotated[
        Path | None,
        Argument(help="Plan of a campaign (TOML). Default: the rig with its default spring at 10 m/s."),
    ] = None
    run: Annotated[str | None, Option("--run", metavar="ID", help="Run of the plan. Default: its first.")] = (
        None
    )
    spring: Annotated[int | None, Option("--spring", help="Number of the spring in Table II.")] = None
    wind_speed: Annotated[float | None, Option("--wind", help="Wind speed, m/s.")] = None
    release_angle_deg: Annotated[float | None, Option("--angle", help="Release angle, degrees.")] = None
    duration: Annotated[float | None, Option("--duration", help="Duration of the run, s.")] = None
    effects: Annotated[
        tuple[str, ...],
        Option(
            "--effect",
            metavar="NAME:PARAMETER=VALUE",
            help="Add an effect to the nominal model. May be repeated; tunnel effects lists them.",
        ),
    ] = ()
    seed: Annotated[int | None, Option("--seed", min=0, help="Seed of the noise.")] = None

    @classmethod
    def from_json_dict(cls, data: Mapping[str, Any]) -> Request:
        """From the fields by name."""
        plan = None if data["plan"] is None else Path(data["plan"])
        return cls(**{**data, "plan": plan, "effects": tuple(data["effects"])})
