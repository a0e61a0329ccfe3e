"""A campaign as a folder: ``campaign.toml`` and one CSV or Parquet file per run; ``truth.json`` is never read."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Mapping
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any, Literal

import numpy as np
import tomli_w
from pydantic import Field

from tunnel_sim.files.plausible import checked_record, plausible_values
from tunnel_sim.files.reading import CAMPAIGN_FILE as CAMPAIGN_FILE
from tunnel_sim.files.reading import check_count, nearest, nearest_campaign
from tunnel_sim.files.run_files import RUN_FORMATS, read_table, table_bytes
from tunnel_sim.files.scatter_tables import RepeatabilityTable
from tunnel_sim.files.toml_input import (
    NotNegative,
    OneLine,
    Positive,
    SampleRate,
    StrictModel,
    check_version,
    load_toml,
    optional,
    shown,
    validate,
)
from tunnel_sim.files.writing import clear_leftovers, json_text, whole_folder
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.campaign import (
    Campaign,
    Quantity,
    RigProperties,
    Run,
    SensorProperties,
    Zero,
    needs_density,
)
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean, one_line, one_of
from tunnel_sim.vocabulary.freedom import ANGLE, FREEDOMS, Freedom, Motion
from tunnel_sim.vocabulary.input_kinds import INPUTS, InputColumn
from tunnel_sim.vocabulary.inputs import INPUT_KEYS, Hold, Input, without_spring_needs_input

NO_CAMPAIGN = f"name a folder that holds a {CAMPAIGN_FILE}"


class CampaignTable(StrictModel):
    """``[campaign]``."""

    name: OneLine = Field(description="a short name in quotes")
    description: str = Field(default="", description="text in quotes, or leave it out")


class RigTable(StrictModel):
    """``[rig]``."""

    yaw_inertia: Positive | None = optional("a positive number in kg m2")
    mass: Positive | None = optional("a positive number in kg, of a displacement")
    frontal_area: Positive | None = optional("a positive number in m2")
    reference_length: Positive | None = optional("a positive number in m")
    width: Positive | None = optional("a positive number in m")


class SensorTable(StrictModel):
    """``[sensor]``."""

    sample_rate: SampleRate | None = optional("a positive number in Hz")
    motion: Motion | None = optional("'angle' or 'displacement'")
    resolution: NotNegative | None = optional("a number in rad, zero or more")
    noise_std: NotNegative | None = optional("a number in rad, zero or more")
    plausible: bool | None = optional("false to accept values that look like a wrong unit, or leave it out")
    quantity: Quantity | None = optional("'angle', 'rate' or 'acceleration'")
    zero: Zero | None = optional("'common', 'per_run' or 'auto'")


class RunTable(StrictModel):
    """``[[runs]]``."""

    id: OneLine = Field(description="a short unique name in quotes")
    file: OneLine = Field(description="a path inside the campaign's folder, such as 'runs/r01.csv'")
    spring_stiffness: NotNegative | None = optional(
        "a positive number in N m/rad, 0 for a driven body without a spring, the kp of a position servo, or leave "
        "it out for the normalised form"
    )
    wind_speed: NotNegative = Field(description="a number in m/s, 0 for wind-off")
    air_density: Positive | None = optional("a positive number in kg/m3")
    release_angle: float | None = optional("a number in rad")
    release_displacement: float | None = optional("a number in m, of a displacement")
    drive_hold: Hold | None = optional("'zero' or 'linear', between the samples of a driven run's input")
    drive_gain: float | None = optional("a number other than 0 in N m per unit of the input")
    servo_kv: NotNegative | None = optional(
        "a number in N m s/rad, zero or more, of the servo of command_rad"
    )


class CampaignDocument(StrictModel):
    """The whole of ``campaign.toml``."""

    schema_version: Literal[1] = Field(description="1")
    campaign: CampaignTable = Field(description="a [campaign] table with a name")
    rig: RigTable = Field(default=RigTable(), description="a [rig] table")
    sensor: SensorTable = Field(default=SensorTable(), description="a [sensor] table")
    repeatability: RepeatabilityTable = Field(
        default=RepeatabilityTable(), description="a [repeatability] table"
    )
    runs: list[RunTable] = Field(min_length=1, description="one [[runs]] table or more")


def read_document(path: Path) -> CampaignDocument:
    """Read and validate ``campaign.toml``; the run files are not opened."""
    return parse_document(load_toml(path, missing=NO_CAMPAIGN), path)


def parse_document(document: dict[str, Any], path: Path) -> CampaignDocument:
    """Validate the content of the ``campaign.toml`` at a path; of a displacement, under the keys of an angle."""
    check_version(document, path)
    freedom = _freedom_of(document, path)
    document = _as_angle(document, freedom, path)
    with freedom.errors():
        return _parsed(document, path)


def _freedom_of(document: Mapping[str, Any], path: Path) -> Freedom:
    """The freedom that a document states; an angle if the statement is not a text, which is refused later.

    Raises:
        TunnelError: for any text other than the name of a freedom: every key depends on it.
    """
    sensor = document.get("sensor")
    stated = sensor.get("motion") if isinstance(sensor, Mapping) else None
    if not isinstance(stated, str):
        return ANGLE
    if stated not in FREEDOMS:
        known = one_of([f"'{name}'" for name in FREEDOMS])
        raise TunnelError(
            f"motion = '{one_line(stated)}' is no motion",
            where=f"{shown(path)}, [sensor]",
            remedy=f"give {known}",
        )
    return FREEDOMS[stated]


def _as_angle(document: Mapping[str, Any], freedom: Freedom, path: Path) -> dict[str, Any]:
    """A document under the keys of an angle; values that are not tables are left to the validation."""
    found, rig, runs = dict(document), document.get("rig"), document.get("runs")
    if isinstance(rig, Mapping):
        found["rig"] = freedom.as_angle(rig, f"{shown(path)}, [rig]")
    if isinstance(runs, list):
        still = {} if freedom.windy else {"wind_speed": 0.0}
        found["runs"] = [
            still | freedom.as_angle(run, run_place(path, one_line(run.get("id"))))
            if isinstance(run, Mapping)
            else run
            for run in runs
        ]
    return found


def _parsed(document: dict[str, Any], path: Path) -> CampaignDocument:
    parsed = validate(CampaignDocument, document, path)
    remedy = "put the runs into several campaigns"
    check_count(len(parsed.runs), limits.CAMPAIGN_RUNS, "runs", shown(path), remedy)
    seen: dict[str, str] = {}
    for run in parsed.runs:
        where = run_place(path, run.id)
        normal = unicodedata.normalize("NFC", run.id)
        if normal in seen:
            how = "" if seen[normal] == run.id else ", with its accents encoded differently"
            what = f"the id '{run.id}' is used twice{how}"
            raise TunnelError(what, where=where, remedy="give every run its own id")
        seen[normal] = run.id
        scales = run.spring_stiffness, parsed.rig.frontal_area, parsed.rig.reference_length
        if run.air_density is None and needs_density(run.wind_speed, *scales):
            what = f"wind-on (wind_speed = {run.wind_speed:g} m/s) without air_density"
            raise TunnelError(what, where=where, remedy="give air_density in kg/m3 (about 1.2 for air)")
        windows, posix = PureWindowsPath(run.file), PurePosixPath(run.file)
        if windows.drive or windows.root or posix.is_absolute() or ".." in windows.parts + posix.parts:
            what = f"the path '{run.file}' may lead outside the campaign's folder"
            remedy = "put the file inside the folder and name it without '..' or a leading '/'"
            raise TunnelError(what, where=where, remedy=remedy)
    if parsed.sensor.plausible is not False:
        plausible_values(parsed.rig.model_dump(), f"{shown(path)}, [rig]")
        for run in parsed.runs:
            plausible_values(run.model_dump(), run_place(path, run.id))
    return parsed


def run_place(path: Path, run_id: str) -> str:
    """File and run for an error message."""
    return f"{shown(path)}, run '{run_id}'"


_NOT_STATED = ("id", "record", "drive", "clock_s")  # keys of a run that are not conditions


def campaign_document(campaign: Campaign, files: dict[str, str]) -> dict[str, Any]:
    """The tables of ``campaign.toml`` in their order, without values that are None; ``files`` by id of the run."""
    head = {"name": campaign.name, "description": campaign.description or None}
    document: dict[str, Any] = {"schema_version": 1, "campaign": _stated(head)}
    own = campaign.sensor.freedom.as_own
    for key in ("rig", "sensor", "repeatability"):
        values = getattr(campaign, key)
        if values is not None and _stated(vars(values)):
            document[key] = own(_stated(vars(values)))
    document["runs"] = [
        {"id": run.id, "file": files[run.id]}
        | own(_stated({key: value for key, value in vars(run).items() if key not in _NOT_STATED}))
        | ({} if run.drive is None else _stated(run.drive.stated))
        for run in campaign.runs
    ]
    return document


def _stated(values: dict[str, Any]) -> dict[str, Any]:
    # NumPy scalars become Python floats, as TOML requires; -0.0 and all digits are kept.
    return {
        key: float(value) if isinstance(value, np.floating | np.integer) else value
        for key, value in values.items()
        if value is not None
    }


TRUTH_FILE = "truth.json"
RUN_FOLDER = "runs"
IMPORT_RECIPE, IMPORT_PICTURE = "import.toml", "import.png"
"""Files that an import keeps beside the campaign."""


def read_campaign(folder: Path | str, progress: Callable[[int, int], None] | None = None) -> Campaign:
    """Read and check a campaign.

    Args:
        folder: the campaign's folder, or the ``campaign.toml`` in it.
        progress: called with the numbers of runs read and of all runs; None: nothing is reported.

    Returns:
        The campaign, angles in radians.

    Raises:
        TunnelError: for the first fault, in one line that names file, run and remedy.
    """
    folder = Path(folder)
    if folder.name == CAMPAIGN_FILE and folder.is_file():
        folder = folder.parent
    if not folder.is_dir():
        raise TunnelError("no such folder", where=shown(folder), remedy=nearest(folder) or NO_CAMPAIGN)
    if not (folder / CAMPAIGN_FILE).exists():
        remedy = nearest_campaign(folder) or nearest(folder / CAMPAIGN_FILE) or NO_CAMPAIGN
        raise TunnelError("no such file", where=shown(folder / CAMPAIGN_FILE), remedy=remedy)
    document = read_document(folder / CAMPAIGN_FILE)
    sensor = SensorProperties(**document.sensor.model_dump())
    freedom = sensor.freedom
    runs: list[Run] = []
    samples = 0
    for run in document.runs:
        if progress is not None:
            progress(len(runs), len(document.runs))
        path = folder / run.file
        where = run_place(path, run.id)
        # Refuse a run file outside the folder, also through a symbolic link.
        try:
            inside = path.resolve().is_relative_to(folder.resolve())
        except (OSError, RuntimeError, ValueError):
            raise TunnelError("the path cannot be resolved", where=where, remedy="correct 'file'") from None
        if not inside:
            what = "a symbolic link leads outside the campaign's folder"
            raise TunnelError(what, where=where, remedy="copy the file into the folder")
        timed, quantity = sensor.sample_rate is None, sensor.quantity or "angle"
        held = read_table(path, where, timed=timed, quantity=quantity, freedom=freedom)
        time_s = held.time_s
        if time_s is None:
            if sensor.sample_rate is None:
                remedy = (
                    "add a column time_s in seconds, or sample_rate in Hz under [sensor] in campaign.toml"
                )
                raise TunnelError("no column time_s and no sample_rate", where=where, remedy=remedy)
            time_s = np.arange(held.reading.size) / sensor.sample_rate
        drive = None
        if held.input is not None and held.input_column is not None:
            _check_keys(run, held.input_column, where)
            drive = Input(held.input_column, held.input, run.drive_hold, run.drive_gain, run.servo_kv)
        elif keys := [key for key in INPUT_KEYS if getattr(run, key) is not None]:
            remedy = f"add a column {one_of(tuple(freedom.inputs))} to the run file, or leave the key out"
            raise TunnelError(f"{keys[0]} without an input column", where=where, remedy=remedy)
        with freedom.errors():
            record = checked_record(
                time_s, held.reading, held.column, sensor, run.release_angle, where, drive
            )
            without_spring_needs_input(run.spring_stiffness, drive, where)
        conditions = run.spring_stiffness, run.air_density, run.release_angle
        runs.append(Run(run.id, record, run.wind_speed, *conditions, drive=drive))
        samples += record.time_s.size
        remedy = "put the runs into several campaigns"
        check_count(samples, limits.CAMPAIGN_SAMPLES, "samples in the campaign", shown(folder), remedy)
    return Campaign(
        name=document.campaign.name,
        description=document.campaign.description,
        rig=RigProperties(**document.rig.model_dump(exclude={"mass"})),
        sensor=sensor,
        runs=tuple(runs),
        repeatability=document.repeatability.value,
    )


def _check_keys(run: RunTable, column: InputColumn, where: str) -> None:
    """Refuse statements of a run on an input that its column does not take."""
    for key in ("drive_gain", "servo_kv"):
        value = getattr(run, key)
        if value is not None and key not in INPUTS[column].keys:
            having = " or ".join(name for name, kind in INPUTS.items() if key in kind.keys)
            what = f"{key} = {value:g} with the column {column}"
            raise TunnelError(what, where=where, remedy=f"give {key} only with a column {having}")
    if run.drive_gain == 0.0:
        what = f"drive_gain = 0 with the column {column}"
        raise TunnelError(what, where=where, remedy="give drive_gain in N m per unit, not zero")


def write_campaign(
    campaign: Campaign,
    folder: Path | str,
    *,
    run_format: str = "parquet",
    truth: Mapping[str, Any] | None = None,
    overwrite: bool = False,
    text: Callable[[Mapping[str, Any]], str] = tomli_w.dumps,
    beside: Mapping[str, bytes] | None = None,
    checked: bool = False,
) -> Path:
    """Write a campaign so that reading it gives the same numbers: completely, or not at all.

    Args:
        campaign: a campaign that passes every check of the reader.
        folder: the folder to create, with missing parents.
        run_format: ``parquet`` or ``csv``.
        truth: the simulated truth, written as ``truth.json``; None: no such file.
        overwrite: whether an existing folder may be replaced; it must be empty or contain only a campaign.
        text: function that makes the text of ``campaign.toml`` from its tables, for comments in it.
        beside: further files of the folder, by name.
        checked: whether every record has already passed `checked_record`, which is then skipped.

    Raises:
        TunnelError: when the folder exists or may not be replaced, the campaign would not be readable, or the
            disk reports an error.
        ValueError: when ``truth`` contains NaN or an infinity.
        TypeError: when ``truth`` contains a value that JSON cannot represent.
    """
    folder = Path(folder)
    if run_format not in RUN_FORMATS:
        remedy = did_you_mean(run_format, RUN_FORMATS)
        raise TunnelError(f"unknown run format '{run_format}'", where=shown(folder), remedy=remedy)
    clear_leftovers(folder.resolve().parent)  # restores a folder set aside by a killed command
    check_target(folder, overwrite=overwrite)
    # run files are named by id if all ids are safe file names, else by number
    ids = [run.id for run in campaign.runs]
    safe = all(re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9_.+-]{0,79}", name) for name in ids)
    named = safe and len({name.lower() for name in ids}) == len(ids)
    files = {
        name: f"{RUN_FOLDER}/{name if named else f'run-{number:04d}'}.{run_format}"
        for number, name in enumerate(ids, start=1)
    }
    document = campaign_document(campaign, files)
    parse_document(document, folder / CAMPAIGN_FILE)
    for run in () if checked else campaign.runs:
        where = run_place(folder, run.id)
        time_s, yaw = run.record.time_s, run.record.yaw_rad
        with campaign.sensor.freedom.errors():
            checked_record(time_s, yaw, "yaw_rad", campaign.sensor, run.release_angle, where, run.drive)
            without_spring_needs_input(run.spring_stiffness, run.drive, where)
    truth_text = None if truth is None else json_text(truth)
    with whole_folder(folder, replace=overwrite) as partial:
        (partial / RUN_FOLDER).mkdir()
        for run in campaign.runs:
            quantity = campaign.sensor.quantity or "angle"
            freedom = campaign.sensor.freedom
            content = table_bytes(run.record, folder / files[run.id], quantity, run.drive, freedom)
            (partial / files[run.id]).write_bytes(content)
        if truth_text is not None:
            (partial / TRUTH_FILE).write_bytes(truth_text.encode())
        for name, content in (beside or {}).items():
            (partial / name).write_bytes(content)
        (partial / CAMPAIGN_FILE).write_bytes(text(document).encode())
    return folder


def check_target(folder: Path, *, overwrite: bool) -> None:
    """Refuse a folder in which no campaign can be written; arguments as in `write_campaign`."""
    where = shown(folder)
    if not folder.is_dir():
        if folder.exists() or folder.is_symlink():
            raise TunnelError("this is not a folder", where=where, remedy="choose another name")
        return
    if not overwrite:
        remedy = "choose another one, or overwrite it (--overwrite; overwrite=True in Python)"
        raise TunnelError("the folder exists", where=where, remedy=remedy)
    entries = list(folder.iterdir())
    if entries and not (folder / CAMPAIGN_FILE).is_file():
        remedy = "choose another one, or empty it"
        raise TunnelError("the folder does not contain a campaign", where=where, remedy=remedy)
    # Files from another source belong to the user: replacing the folder would delete them.
    own = (CAMPAIGN_FILE, TRUTH_FILE, RUN_FOLDER, IMPORT_RECIPE, IMPORT_PICTURE)
    strange = [p for p in entries if p.name not in own]
    runs = folder / RUN_FOLDER
    if runs.is_dir() and not runs.is_symlink():
        strange += [p for p in runs.iterdir() if p.is_dir() or p.suffix.lower()[1:] not in RUN_FORMATS]
    if strange:
        what = f"the folder contains more than a campaign ({strange[0].name})"
        raise TunnelError(what, where=where, remedy="move that away, or choose another folder")
