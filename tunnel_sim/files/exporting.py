"""A campaign as one file for other programs: MAT, HDF5, Excel or a flat CSV table."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, BinaryIO, cast

import numpy as np
import polars as pl

from tunnel_sim.files.importing.condition_names import OF_REPEATABILITY, RIG_KEYS, RUN_KEYS
from tunnel_sim.files.kept_process import check_polars
from tunnel_sim.files.toml_input import shown
from tunnel_sim.files.writing import write_encoded
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean, library
from tunnel_sim.vocabulary.inputs import INPUT_KEYS
from tunnel_sim.vocabulary.text_cells import as_text_cell

_SHEET_ROWS = 1_048_576


def export_campaign(campaign: Campaign, path: Path, kind: str) -> Path:
    """Write a campaign as one ``mat``, ``csv``, ``xlsx`` or ``hdf5`` file, completely or not at all."""
    if kind not in WRITERS:
        raise TunnelError(f"unknown format '{kind}'", where=shown(path), remedy=did_you_mean(kind, WRITERS))
    return write_encoded(path, lambda stream: WRITERS[kind](campaign, stream, shown(path)))


def _column(campaign: Campaign) -> str:
    return next(iter(campaign.sensor.freedom.columns[campaign.sensor.quantity or "angle"]))


def _stated(values: object, keys: tuple[str, ...]) -> dict[str, float]:
    return {key: value for key in keys if (value := getattr(values, key)) is not None}


def _of_campaign(campaign: Campaign) -> dict[str, float]:
    """The stated sizes of the rig, and the stated scatter between runs."""
    spread = {} if campaign.repeatability is None else campaign.repeatability.stated
    return campaign.sensor.freedom.as_own(_stated(campaign.rig, RIG_KEYS)) | {
        f"{OF_REPEATABILITY}{name}": value for name, value in spread.items()
    }


def _as_csv(campaign: Campaign, stream: BinaryIO, _where: str) -> None:
    """One row for each sample, with the run's id and conditions and the rig's sizes."""
    check_polars()
    frames = [
        pl.DataFrame(_record(campaign, run)).select(
            pl.lit(as_text_cell(run.id)).alias("run"),
            *(
                pl.lit(value, dtype=pl.String if key == "drive_hold" else pl.Float64).alias(key)
                for key, value in _cells(campaign, run).items()
            ),
            pl.all(),
        )
        for run in campaign.runs
    ]
    # free decays have no value of an input
    pl.concat(frames, how="diagonal" if _input_columns(campaign) else "vertical").write_csv(stream)


def _as_mat(campaign: Campaign, stream: BinaryIO, _where: str) -> None:
    """A structure array ``runs``, and a structure ``rig``."""
    from scipy.io import savemat

    keys = ("id", *_condition_keys(campaign), "time_s", _column(campaign), *_input_columns(campaign))
    runs = np.zeros(len(campaign.runs), dtype=[(key, object) for key in keys])
    for place, run in enumerate(campaign.runs):
        known = {"id": run.id, **_conditions(campaign, run), **_record(campaign, run)}
        runs[place] = tuple(known.get(key, np.empty((0, 0))) for key in keys)
    rig: Mapping[str, Any] = {"name": campaign.name, **_of_campaign(campaign)}
    savemat(
        cast(Any, stream),
        {"runs": runs, "rig": rig},
        do_compression=True,
        oned_as="column",
        long_field_names=True,
    )


def _condition_keys(campaign: Campaign) -> tuple[str, ...]:
    keys = tuple(campaign.sensor.freedom.as_own(dict.fromkeys(RUN_KEYS)))
    return (*keys, *INPUT_KEYS) if _input_columns(campaign) else keys


def _cells(campaign: Campaign, run: Run) -> dict[str, float | str | None]:
    """The conditions of a run, None if they are not stated, and the stated sizes and scatter."""
    stated = _conditions(campaign, run)
    return {key: stated.get(key) for key in _condition_keys(campaign)} | _of_campaign(campaign)


def _record(campaign: Campaign, run: Run) -> dict[str, Any]:
    own = campaign.sensor.freedom.own_input
    given: dict[str, Any] = {} if run.drive is None else {own(run.drive.column): run.drive.values}
    return {"time_s": run.record.time_s, _column(campaign): run.record.yaw_rad, **given}


def _conditions(campaign: Campaign, run: Run) -> dict[str, float | str]:
    """The stated conditions of a run by key; for a driven run also those of its input."""
    stated: dict[str, float | str | None] = campaign.sensor.freedom.as_own(
        {key: getattr(run, key) for key in RUN_KEYS}
    )
    if run.drive is not None:
        stated |= run.drive.stated
    return {key: value for key, value in stated.items() if value is not None}


def _input_columns(campaign: Campaign) -> tuple[str, ...]:
    """The input columns of any run, in the order of the format."""
    found = {drive.column for drive in campaign.inputs}
    return tuple(name for name, kind in campaign.sensor.freedom.inputs.items() if kind in found)


def _as_hdf5(campaign: Campaign, stream: BinaryIO, where: str) -> None:
    """A group for each run, with its id and conditions as attributes; an id may contain any character."""
    h5py = library("h5py", "HDF5", "import", where)
    with h5py.File(stream, "w") as file:
        file.attrs.update({"name": campaign.name, **_of_campaign(campaign)})
        width = len(str(len(campaign.runs)))  # programs sort groups by name
        for number, run in enumerate(campaign.runs, 1):
            group = file.create_group(f"run-{number:0{width}d}")
            group.attrs.update({"id": run.id, **_conditions(campaign, run)})
            for name, values in _record(campaign, run).items():
                group.create_dataset(name, data=values, compression="gzip", shuffle=True)


def _as_xlsx(campaign: Campaign, stream: BinaryIO, where: str) -> None:
    """A sheet of conditions and sizes, and one for each run."""
    xlsxwriter = library("xlsxwriter", "Excel", "import", where)
    for run in campaign.runs:
        if run.record.time_s.size >= _SHEET_ROWS:
            raise TunnelError(
                f"run '{run.id}' has {run.record.time_s.size:,} samples, more than a sheet's {_SHEET_ROWS - 1:,}",
                where=where,
                remedy="choose --file-format hdf5 or mat",
            )
    # Texts that look like formulas or links remain texts.
    options = {"in_memory": True, "strings_to_formulas": False, "strings_to_urls": False}
    with xlsxwriter.Workbook(stream, options) as book:
        names = [f"run {place}" for place in range(1, len(campaign.runs) + 1)]
        sheet = book.add_worksheet("conditions")
        sheet.write_row(0, 0, ["sheet", "run", *_condition_keys(campaign), *_of_campaign(campaign)])
        for row, (name, run) in enumerate(zip(names, campaign.runs, strict=True), 1):
            sheet.write_row(row, 0, [name, run.id, *_cells(campaign, run).values()])
        for name, run in zip(names, campaign.runs, strict=True):
            sheet = book.add_worksheet(name)
            for place, (heading, values) in enumerate(_record(campaign, run).items()):
                sheet.write(0, place, heading)
                sheet.write_column(1, place, values.tolist())


WRITERS: Mapping[str, Callable[[Campaign, BinaryIO, str], None]] = {
    "mat": _as_mat,
    "csv": _as_csv,
    "xlsx": _as_xlsx,
    "hdf5": _as_hdf5,
}
"""Writers by format."""
