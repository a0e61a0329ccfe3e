"""Excel, MAT, HDF5, TDMS and Parquet files, made by the libraries that write them.

Truth: the numbers that were written.
"""

from __future__ import annotations

import io
import sys
import zipfile
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime, timedelta
from pathlib import Path

import h5py
import nptdms
import numpy as np
import polars as pl
import pytest
import scipy.io
import xlsxwriter

from tests.marks import slow
from tests.support.import_files import RATE, decay, written
from tunnel_sim import TunnelError
from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.records import Imported, read_records
from tunnel_sim.files.readers import load_reader
from tunnel_sim.vocabulary import limits

TIME, ANGLE = decay()
Writer = Callable[[Path], ImportChoices | None]


def excel(path: Path) -> None:
    with xlsxwriter.Workbook(path) as book:
        sheet = book.add_worksheet("swing")
        sheet.write_row(0, 0, ["Rig", "No. 7"])
        sheet.write_row(2, 0, ["t", "yaw"])
        sheet.write_row(3, 0, ["ms", "deg"])
        for i, row in enumerate(zip(1e3 * TIME, np.rad2deg(ANGLE), strict=True), 4):
            sheet.write_row(i, 0, row)


def mat5(path: Path) -> ImportChoices:
    scipy.io.savemat(path, {"Ts": 1.0 / RATE, "data": np.stack([ANGLE, 0.1 * ANGLE**2])}, do_compression=True)
    return ImportChoices(angle=("data[1]",), unit="rad")


def mat5_struct(path: Path) -> None:
    scipy.io.savemat(path, {"rig": {"time": TIME[:, None], "angle_deg": np.rad2deg(ANGLE)[:, None]}})


def mat73(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        file["time"], file["yaw_rad"] = TIME[None], ANGLE[None]
        file["yaw_rad"].attrs["MATLAB_class"] = np.bytes_("double")
        file["note"] = np.array([[72], [105]], np.uint16)
        file["note"].attrs["MATLAB_class"] = np.bytes_("char")
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(512) + path.read_bytes()[512:])


def hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        group = file.create_group("run 1")
        group.attrs["sample_rate"] = RATE
        group["angle"] = np.rad2deg(ANGLE)
        group["angle"].attrs["units"] = "degrees"


def hdf5_table(path: Path) -> None:
    with h5py.File(path, "w") as file:
        kind = [("time_us", "i8"), ("yaw_rad", "f8")]
        file["log"] = np.array(list(zip(np.round(1e6 * TIME), ANGLE, strict=True)), dtype=kind)


def tdms(path: Path) -> None:
    properties = {"wf_increment": 1.0 / RATE, "unit_string": "deg"}
    channels = [
        nptdms.ChannelObject("swing", "Winkel", np.rad2deg(ANGLE), properties),
        nptdms.ChannelObject("swing", "Kraft", np.ones(TIME.size), {"unit_string": "N"}),
    ]
    with nptdms.TdmsWriter(path) as file:
        file.write_segment(channels)


def parquet(path: Path) -> None:
    stamps = pl.Series((1e6 * TIME).round().astype(np.int64)).cast(pl.Datetime("us"))
    pl.DataFrame({"stamp time": stamps, "Theta (rad)": ANGLE, "state": ["ok"] * TIME.size}).write_parquet(
        path
    )


FILES: dict[str, Writer] = {
    "excel.xlsx": excel,
    "five.mat": mat5,
    "struct.mat": mat5_struct,
    "seven.mat": mat73,
    "groups.h5": hdf5,
    "table.hdf5": hdf5_table,
    "labview.tdms": tdms,
    "frame.parquet": parquet,
}


def imported(folder: Path, name: str) -> Imported:
    choices = FILES[name](folder / name)
    return read_records([folder / name], choices or ImportChoices())


@pytest.mark.parametrize("name", FILES)
def test_a_format_is_read(name: str, tmp_path: Path) -> None:
    (run,) = imported(tmp_path, name).campaign.runs
    np.testing.assert_allclose(run.record.yaw_rad, ANGLE, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(run.record.time_s, TIME, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "module"),
    [("excel.xlsx", "fastexcel"), ("seven.mat", "h5py"), ("labview.tdms", "nptdms")],
)
def test_a_missing_library_is_said(
    name: str, module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    FILES[name](tmp_path / name)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(TunnelError, match=rf"needs the package {module}.*pip install '\.\[import\]'"):
        read_tables((tmp_path / name).read_bytes(), name)


@pytest.mark.parametrize("name", FILES)
def test_half_a_file_is_refused_in_one_line(name: str, tmp_path: Path) -> None:
    FILES[name](tmp_path / name)
    content = (tmp_path / name).read_bytes()
    for share in (0.02, 0.5, 0.95):
        path = written(tmp_path, f"half-{name}", content[: int(share * len(content))])
        # What can still be read may be read.
        with suppress(TunnelError):
            read_records([path], ImportChoices(angle=("data[1]",)) if name == "five.mat" else ImportChoices())


def read_tables(content: bytes, name: str) -> object:
    """The tables of a file, read in this process."""
    reader = load_reader(Path(name).suffix)
    assert reader is not None
    assert reader.read_tables is not None
    return reader.read_tables(content, name)


@pytest.mark.parametrize("name", FILES)
def test_a_wrong_ending_is_said(name: str, tmp_path: Path) -> None:
    FILES[name](tmp_path / name)
    path = written(tmp_path, "log.csv", (tmp_path / name).read_bytes())
    with pytest.raises(TunnelError, match="begins like"):
        read_records([path])
    other = written(tmp_path, f"text{Path(name).suffix}", b"time_s,yaw_rad\n0,1\n")
    with pytest.raises(TunnelError, match=r"is not an? "):
        read_records([other])


def archive(*names: str, size: int = 10) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as file:
        for name in names:
            file.writestr(name, b"\0" * size)
    return stream.getvalue()


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (archive("xl/workbook.xml", "xl/vbaProject.bin"), "the workbook holds macros"),
        (archive("xl/workbook.xml", "xl/externalLinks/externalLink1.xml"), "links to other files"),
        (archive("xl/workbook.xml", size=2**21), "2,097,152 bytes once unpacked, more than 1,048,576"),
        (archive("document.xml"), "is not an Excel workbook"),
    ],
    ids=["macros", "links", "bomb", "other"],
)
def test_dangerous_workbooks_are_refused(monkeypatch: pytest.MonkeyPatch, content: bytes, what: str) -> None:
    monkeypatch.setattr(limits, "DATA_BYTES", 2**20)
    with pytest.raises(TunnelError, match=what):
        read_tables(content, "book.xlsx")


def test_sizes_are_counted_before_anything_is_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with h5py.File(tmp_path / "bomb.h5", "w") as file:
        file.create_dataset("angle", shape=(2_000_000_000,), chunks=(1000,), compression="gzip", dtype="f8")
    with pytest.raises(TunnelError, match="2,000,000,000 numbers, more than"):
        read_records([tmp_path / "bomb.h5"])
    scipy.io.savemat(tmp_path / "zeros.mat", {"a": np.zeros(2**18)}, do_compression=True)
    monkeypatch.setattr(limits, "DATA_BYTES", 2**20)
    with pytest.raises(TunnelError, match="numbers, more than"):
        read_tables((tmp_path / "zeros.mat").read_bytes(), "zeros.mat")


@pytest.mark.parametrize("compressed", [False, True])
def test_the_size_of_a_mat_file_is_that_of_all_its_arrays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compressed: bool
) -> None:
    arrays = {name: np.zeros(1000) for name in ("a", "b", "c")}
    scipy.io.savemat(tmp_path / "three.mat", arrays, do_compression=compressed)
    content = (tmp_path / "three.mat").read_bytes()
    monkeypatch.setattr(limits, "DATA_BYTES", 3 * 8100)
    assert read_tables(content, "three.mat")
    monkeypatch.setattr(limits, "DATA_BYTES", 3 * 8000 - 8)
    with pytest.raises(TunnelError, match="numbers, more than"):
        read_tables(content, "three.mat")


@pytest.mark.parametrize("name", ["log.h5", slow("log.mat")])
def test_a_damaged_heap_in_which_hdf5_goes_round_for_ever_is_one_line(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stream = io.BytesIO()
    with h5py.File(stream, "w") as file:
        file.attrs["id"] = "run 1"
        file["yaw_rad"] = ANGLE
    content = bytearray(stream.getvalue())
    size = content.index(b"GCOL") + 24  # of the text in the heap: the next object is then this one
    content[size : size + 8] = (2**64 - 16).to_bytes(8, "little")
    monkeypatch.setattr(limits, "READER_SECONDS", 0.4)
    with pytest.raises(TunnelError, match=r"reading it takes more than [\d.]+ s; split it"):
        read_records([written(tmp_path, name, bytes(content))])


@pytest.mark.parametrize(
    ("form", "shown"),
    [
        ("yyyy-mm-dd hh:mm:ss.000", None),
        ("hh:mm:ss.000", None),
        ("", "%m/%d/%Y %I:%M:%S.%f %p"),
    ],
)
def test_dates_and_times_of_day_in_a_workbook_are_times(form: str, shown: str | None, tmp_path: Path) -> None:
    start = datetime(2026, 3, 12, 23, 59, 58)
    with xlsxwriter.Workbook(tmp_path / "log.xlsx") as book:
        sheet, style = book.add_worksheet(), book.add_format({"num_format": form})
        sheet.write_row(0, 0, ["stamp", "yaw_rad"])
        for row, (seconds, angle) in enumerate(zip(TIME.tolist(), ANGLE, strict=True), 1):
            stamp = start + timedelta(seconds=seconds)
            day = stamp if form.startswith("yyyy") else stamp.time()
            sheet.write(row, 0, stamp.strftime(shown) if shown else day, None if shown else style)
            sheet.write(row, 1, angle)
    (run,) = read_records([tmp_path / "log.xlsx"]).campaign.runs
    np.testing.assert_allclose(run.record.time_s, TIME, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("value", [np.int8(3), np.float32(3.0), np.array([3]), np.array([[3.0]]), 3])
def test_numbers_of_any_kind_are_attributes(value: object, tmp_path: Path) -> None:
    hdf5(tmp_path / "log.h5")
    with h5py.File(tmp_path / "log.h5", "a") as file:
        file.attrs["wind_speed"], file.attrs["air_density"] = value, 1.2
        file.attrs["rho"] = "text"
        file.attrs["empty"] = h5py.Empty("f8")
    (run,) = read_records([tmp_path / "log.h5"]).campaign.runs
    assert (run.wind_speed, run.air_density) == (3.0, 1.2)


def test_a_link_out_of_an_hdf5_file_is_not_followed(tmp_path: Path) -> None:
    hdf5(tmp_path / "secret.h5")
    with h5py.File(tmp_path / "link.h5", "w") as file:
        file["way out"] = h5py.ExternalLink("secret.h5", "/run 1")
        file.create_dataset("raw", (400,), external=[(str(tmp_path / "secret.h5"), 0, 3200)], dtype="f8")
    with pytest.raises(TunnelError, match="no column of numbers"):
        read_records([tmp_path / "link.h5"])


def test_integers_packed_as_netcdf_does_are_unpacked(tmp_path: Path) -> None:
    """Steps of 0.01 degrees are no degrees."""
    time, angle = decay(amplitude=0.06)
    path = tmp_path / "packed.h5"
    with h5py.File(path, "w") as file:
        file["time_s"] = time
        steps = np.round((np.degrees(angle) - 1.0) / 0.01).astype(np.int16)
        steps[300] = -32768
        packed = file.create_dataset("yaw", data=steps)
        packed.attrs.update({"units": "deg", "scale_factor": 0.01, "add_offset": 1.0})
        packed.attrs["_FillValue"] = np.int16(-32768)
    (run,) = read_records([path]).campaign.runs
    np.testing.assert_allclose(run.record.yaw_rad, np.delete(angle, 300), atol=1e-4)
