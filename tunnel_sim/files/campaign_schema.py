"""The tables of ``campaign.toml``, and their conversion to and from `Campaign`."""

from __future__ import annotations

from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from tunnel_sim.files.plausible import plausible_values
from tunnel_sim.files.reading import check_count
from tunnel_sim.files.toml_input import (
    OneLine,
    SampleRate,
    StrictModel,
    check_version,
    load_toml,
    shown,
    validate,
)
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.campaign import (
    Campaign,
    Quantity,
    RigProperties,
    SensorProperties,
    Zero,
    needs_density,
)
from tunnel_sim.vocabulary.errors import TunnelError

CAMPAIGN_FILE = "campaign.toml"
NO_CAMPAIGN = f"name a folder that holds a {CAMPAIGN_FILE}"

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]


class CampaignTable(StrictModel):
    """``[campaign]``."""

    name: OneLine = Field(description="a short name in quotes")
    description: str = Field(default="", description="text in quotes, or leave it out")


class RigTable(StrictModel):
    """``[rig]``."""

    yaw_inertia: Positive | None = Field(default=None, description="a positive number in kg m2")
    frontal_area: Positive | None = Field(default=None, description="a positive number in m2")
    reference_length: Positive | None = Field(default=None, description="a positive number in m")
    width: Positive | None = Field(default=None, description="a positive number in m")


class SensorTable(StrictModel):
    """``[sensor]``."""

    sample_rate: SampleRate | None = Field(default=None, description="a positive number in Hz")
    resolution: NotNegative | None = Field(default=None, description="a number in rad, zero or more")
    noise_std: NotNegative | None = Field(default=None, description="a number in rad, zero or more")
    plausible: bool | None = Field(
        default=None, description="false to accept values that look like a wrong unit, or leave it out"
    )
    quantity: Quantity | None = Field(default=None, description="'angle', 'rate' or 'acceleration'")
    zero: Zero | None = Field(default=None, description="'common', 'per_run' or 'auto'")


class RunTable(StrictModel):
    """``[[runs]]``."""

    id: OneLine = Field(description="a short unique name in quotes")
    file: OneLine = Field(description="a path inside the campaign's folder, such as 'runs/r01.csv'")
    spring_stiffness: Positive | None = Field(
        default=None, description="a positive number in N m/rad, or leave it out for the normalised form"
    )
    wind_speed: NotNegative = Field(description="a number in m/s, 0 for wind-off")
    air_density: Positive | None = Field(default=None, description="a positive number in kg/m3")
    release_angle: float | None = Field(default=None, description="a number in rad")


class CampaignDocument(StrictModel):
    """The whole of ``campaign.toml``."""

    schema_version: Literal[1] = Field(description="1")
    campaign: CampaignTable = Field(description="a [campaign] table with a name")
    rig: RigTable = Field(default=RigTable(), description="a [rig] table")
    sensor: SensorTable = Field(default=SensorTable(), description="a [sensor] table")
    runs: list[RunTable] = Field(min_length=1, description="one [[runs]] table or more")


def read_document(path: Path) -> CampaignDocument:
    """Read and validate ``campaign.toml``; the run files are not opened.

    Raises:
        TunnelError: for the first fault, naming file, run and remedy.
    """
    return parse_document(load_toml(path, missing=NO_CAMPAIGN), path)


def parse_document(document: dict[str, Any], path: Path) -> CampaignDocument:
    """Validate the content of ``campaign.toml``.

    Args:
        path: the file that is read or written, for the message.

    Raises:
        TunnelError: for the first fault, naming file, run and remedy.
    """
    check_version(document, path)
    parsed = validate(CampaignDocument, document, path)
    remedy = "put the runs into several campaigns"
    check_count(len(parsed.runs), limits.CAMPAIGN_RUNS, "runs", shown(path), remedy)
    seen: set[str] = set()
    for run in parsed.runs:
        where = run_place(path, run.id)
        if run.id in seen:
            raise TunnelError(
                f"the id '{run.id}' is used twice", where=where, remedy="give every run its own id"
            )
        seen.add(run.id)
        _check_run(run, parsed.rig, where)
    if parsed.sensor.plausible is not False:
        _check_sizes(parsed, path)
    return parsed


def run_place(path: Path, run_id: str) -> str:
    """File and run for an error message.

    Args:
        path: of the run's file, or of the campaign's folder.
    """
    return f"{shown(path)}, run '{run_id}'"


def _check_sizes(document: CampaignDocument, path: Path) -> None:
    plausible_values(document.rig.model_dump(), f"{shown(path)}, [rig]")
    for run in document.runs:
        plausible_values(run.model_dump(), run_place(path, run.id))


def _check_run(run: RunTable, rig: RigTable, where: str) -> None:
    scales = run.spring_stiffness, rig.frontal_area, rig.reference_length
    if run.air_density is None and needs_density(run.wind_speed, *scales):
        raise TunnelError(
            f"wind-on (wind_speed = {run.wind_speed:g} m/s) without air_density",
            where=where,
            remedy="give air_density in kg/m3 (about 1.2 for air)",
        )
    windows, posix = PureWindowsPath(run.file), PurePosixPath(run.file)
    if windows.drive or windows.root or posix.is_absolute() or ".." in windows.parts + posix.parts:
        raise TunnelError(
            f"the path '{run.file}' may lead outside the campaign's folder",
            where=where,
            remedy="put the file inside the folder and name it without '..' or a leading '/'",
        )


def rig_properties(table: RigTable) -> RigProperties:
    """The vocabulary's form of ``[rig]``."""
    return RigProperties(**table.model_dump())


def sensor_properties(table: SensorTable) -> SensorProperties:
    """``[sensor]`` as `SensorProperties`."""
    return SensorProperties(**table.model_dump())


def campaign_document(campaign: Campaign, files: dict[str, str]) -> dict[str, Any]:
    """The tables of ``campaign.toml`` for a campaign.

    Args:
        files: the file of every run, by id, relative to the campaign's folder.

    Returns:
        The tables, in the order in which they are written, without values that are None.
    """
    head = {"name": campaign.name, "description": campaign.description or None}
    document: dict[str, Any] = {"schema_version": 1, "campaign": _stated(head)}
    for key, values in (("rig", vars(campaign.rig)), ("sensor", vars(campaign.sensor))):
        if _stated(values):
            document[key] = _stated(values)
    document["runs"] = [
        {"id": run.id, "file": files[run.id]}
        | _stated({key: value for key, value in vars(run).items() if key not in ("id", "record")})
        for run in campaign.runs
    ]
    return document


def _stated(values: dict[str, Any]) -> dict[str, Any]:
    # NumPy scalars become Python floats, which TOML can hold; -0.0 and all digits are kept.
    return {
        key: float(value) if isinstance(value, np.floating | np.integer) else value
        for key, value in values.items()
        if value is not None
    }
