import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tunnel_sim.files import campaign_folder
from tunnel_sim.files.campaign_folder import read_campaign, write_campaign
from tunnel_sim.files.run_files import read_table, table_bytes
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.campaign import (
    Campaign,
    Quantity,
    Repeatability,
    RigProperties,
    Run,
    SensorProperties,
)
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.freedom import Freedom
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.record import Record


def decay(
    frequency: float = 2.0,
    *,
    zeta: float = 0.01,
    amplitude: float = 0.35,
    duration: float = 5.0,
    rate: float = 200.0,
    noise: float = 0.0005,
    seed: int = 0,
) -> Record:
    time = np.arange(round(duration * rate)) / rate
    omega = 2.0 * np.pi * frequency
    clean = amplitude * np.exp(-zeta * omega * time) * np.cos(omega * np.sqrt(1.0 - zeta**2) * time)
    return Record(time, clean + noise * np.random.default_rng(seed).standard_normal(time.size))


def campaign() -> Campaign:
    return Campaign(
        name="two runs",
        description='of "one" rig – with a\nsecond line',
        rig=RigProperties(yaw_inertia=0.11, frontal_area=0.036, reference_length=0.625),
        sensor=SensorProperties(sample_rate=200.0, resolution=0.0005113269292952137),
        runs=(
            Run("off", decay(), 0.0, spring_stiffness=16.12, release_angle=0.3490658503988659),
            Run("on", decay(1.9, seed=1), 10.0, spring_stiffness=16.12, air_density=1.204),
        ),
    )


def assert_same(one: Campaign, other: Campaign) -> None:
    assert replace(one, runs=()) == replace(other, runs=())
    assert len(one.runs) == len(other.runs)
    for a, b in zip(one.runs, other.runs, strict=True):
        assert {k: v for k, v in vars(a).items() if k != "record"} == {
            k: v for k, v in vars(b).items() if k != "record"
        }
        np.testing.assert_array_equal(a.record.time_s, b.record.time_s)
        np.testing.assert_array_equal(a.record.yaw_rad, b.record.yaw_rad)


@pytest.mark.parametrize("run_format", ["parquet", "csv"])
def test_what_is_written_reads_back_as_the_same_numbers(tmp_path: Path, run_format: str) -> None:
    folder = write_campaign(campaign(), tmp_path / "new" / "c", run_format=run_format)
    assert_same(read_campaign(folder), campaign())
    assert {p.suffix for p in (folder / "runs").iterdir()} == {f".{run_format}"}


@pytest.mark.parametrize(
    "stated",
    [
        Repeatability(0.003, 0.0005, 0.01),
        Repeatability(spring_stiffness=0.0),
        Repeatability(mechanical_damping=0.02, wind_speed=np.float64(0.1)),
    ],
)
def test_a_stated_repeatability_is_read_back(tmp_path: Path, stated: Repeatability) -> None:
    given = replace(campaign(), repeatability=stated)
    folder = write_campaign(given, tmp_path / "c")
    assert_same(read_campaign(folder), given)
    assert "[repeatability]" in (folder / "campaign.toml").read_text()


def test_an_empty_repeatability_states_nothing(tmp_path: Path) -> None:
    folder = write_campaign(replace(campaign(), repeatability=Repeatability()), tmp_path / "c")
    assert "repeatability" not in (folder / "campaign.toml").read_text()
    path = folder / "campaign.toml"
    path.write_text(path.read_text().replace("[[runs]]", "[repeatability]\n\n[[runs]]", 1))
    assert read_campaign(folder).repeatability is None


@pytest.mark.parametrize("value", [-0.001, 1.0, np.nan, np.inf, True, "0.1", 10**400])
def test_a_repeatability_that_is_not_a_standard_deviation_is_refused(value: Any) -> None:
    with pytest.raises(
        TunnelError, match=r"repeatability: spring_stiffness = .* give a number from 0 to below 1"
    ):
        Repeatability(spring_stiffness=value)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=20)
@given(
    values=st.lists(st.floats(-limits.LARGEST_NUMBER, limits.LARGEST_NUMBER), min_size=2, max_size=20),
    suffix=st.sampled_from([".csv", ".parquet"]),
)
def test_any_float_survives_a_run_file(tmp_path: Path, values: list[float], suffix: str) -> None:
    path = tmp_path / f"run{suffix}"
    record = Record(np.arange(len(values)) / 3.0, np.array(values))
    path.write_bytes(table_bytes(record, path))
    held = read_table(path, "here")
    time_s, yaw, column = held.time_s, held.reading, held.column
    assert column == "yaw_rad"
    assert time_s is not None
    assert time_s.tobytes() == record.time_s.tobytes()
    assert yaw.tobytes() == record.yaw_rad.tobytes()


text = st.text(st.characters(codec="utf-8", exclude_categories=["C", "Z"]), min_size=1, max_size=12)
positive = st.floats(min_value=limits.SMALLEST_NUMBER, max_value=limits.LARGEST_NUMBER)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=40)
@given(
    name=text,
    description=st.text(st.characters(codec="utf-8"), max_size=20).filter(lambda s: "\r" not in s),
    ids=st.lists(text, min_size=1, max_size=3, unique=True),
    rig=st.builds(RigProperties, *[st.none() | positive] * 4),
    stiffness=st.none() | positive,
    speed=st.just(0.0) | positive,
    density=positive,
    angle=st.none() | st.floats(min_value=0.1, max_value=3.0),
    noise=st.none() | st.just(0.0) | positive,
)
def test_any_statement_survives_the_campaign_file(
    tmp_path: Path, name, description, ids, rig, stiffness, speed, density, angle, noise
) -> None:
    runs = tuple(Run(i, decay(), speed, stiffness, density, angle) for i in ids)
    one = Campaign(name, rig, SensorProperties(noise_std=noise, plausible=False), runs, description)
    assert_same(read_campaign(write_campaign(one, tmp_path / "c", run_format="csv", overwrite=True)), one)


def written(folder: Path, header: str, rows: list[str], sensor: str = "") -> Path:
    (folder / "runs").mkdir(parents=True)
    (folder / "runs" / "r.csv").write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    (folder / "campaign.toml").write_text(
        f'schema_version = 1\n[campaign]\nname = "c"\n{sensor}\n'
        '[[runs]]\nid = "r"\nfile = "runs/r.csv"\nwind_speed = 0\n',
        encoding="utf-8",
    )
    return folder


def test_degrees_become_radians(tmp_path: Path) -> None:
    record = decay()
    degrees = np.rad2deg(record.yaw_rad)
    rows = [f"{t!r},{y!r}" for t, y in zip(record.time_s.tolist(), degrees.tolist(), strict=True)]
    read = read_campaign(written(tmp_path, "time_s,yaw_deg", rows))
    np.testing.assert_array_equal(read.runs[0].record.yaw_rad, np.deg2rad(degrees))


def test_without_times_the_sample_rate_gives_them(tmp_path: Path) -> None:
    record = decay(rate=100.0)
    rows = [repr(y) for y in record.yaw_rad.tolist()]
    read = read_campaign(written(tmp_path, "yaw_rad", rows, "[sensor]\nsample_rate = 100"))
    np.testing.assert_array_equal(read.runs[0].record.time_s, record.time_s)


def test_csv_from_other_hands_is_read(tmp_path: Path) -> None:
    # Byte-order mark, Windows line ends, quoted and padded cells, another column, blank lines at the end.
    record = decay()
    folder = written(tmp_path, "", [])
    rows = [
        f'{t!r}, "{y!r}",20.1' for t, y in zip(record.time_s.tolist(), record.yaw_rad.tolist(), strict=True)
    ]
    content = "\r\n".join(['time_s, "yaw_rad",temperature', *rows, "", ""])
    (folder / "runs" / "r.csv").write_bytes(b"\xef\xbb\xbf" + content.encode())
    np.testing.assert_array_equal(read_campaign(folder).runs[0].record.yaw_rad, record.yaw_rad)


@pytest.mark.parametrize("dtype", [pl.Float32, pl.Int32])
def test_other_number_types_of_parquet_are_read(tmp_path: Path, dtype: type[pl.DataType]) -> None:
    folder = written(tmp_path, "", [], "[sensor]\nsample_rate = 200")
    toml = folder / "campaign.toml"
    toml.write_text(toml.read_text().replace("r.csv", "r.parquet"))
    degrees = np.round(np.rad2deg(decay().yaw_rad))
    pl.DataFrame({"yaw_deg": pl.Series(degrees, dtype=dtype)}).write_parquet(folder / "runs" / "r.parquet")
    np.testing.assert_array_equal(read_campaign(folder).runs[0].record.yaw_rad, np.deg2rad(degrees))


@pytest.mark.parametrize("run_format", ["parquet", "csv"])
@pytest.mark.parametrize("kind", ["rounded", "uneven", "missing"])
def test_times_are_kept_as_they_were_recorded(tmp_path: Path, kind: str, run_format: str) -> None:
    record = decay(rate=193.0)
    time, kept = record.time_s, np.ones(record.time_s.size, bool)
    if kind == "rounded":
        time = np.round(time, 3)
    elif kind == "uneven":
        time = time + 0.4 / 193.0 * np.sin(np.arange(time.size) ** 2)
    else:
        kept[300:340] = False
    one = replace(
        campaign(), sensor=SensorProperties(), runs=(Run("r", Record(time[kept], record.yaw_rad[kept]), 0.0),)
    )
    assert_same(read_campaign(write_campaign(one, tmp_path / "c", run_format=run_format)), one)


@pytest.mark.parametrize("run_format", ["parquet", "csv"])
@pytest.mark.parametrize(
    ("quantity", "column"), [("rate", "yaw_rate_rad_s"), ("acceleration", "yaw_acceleration_rad_s2")]
)
def test_rates_and_accelerations_have_columns_of_their_own(
    tmp_path: Path, quantity: Quantity, column: str, run_format: str
) -> None:
    """A rate of 60 rad/s is no slip of units."""
    sensor = SensorProperties(200.0, quantity=quantity, zero="per_run")
    one = replace(campaign(), sensor=sensor, runs=(Run("r", decay(amplitude=60.0, rate=200.0), 0.0),))
    folder = write_campaign(one, tmp_path / "c", run_format=run_format)
    assert_same(read_campaign(folder), one)
    (path,) = (folder / "runs").iterdir()
    table = pl.read_csv(path) if run_format == "csv" else pl.read_parquet(path)
    assert table.columns == ["time_s", column]


def test_a_rate_may_be_in_degrees_per_second(tmp_path: Path) -> None:
    record = decay(rate=200.0)
    rows = [repr(y) for y in np.rad2deg(record.yaw_rad).tolist()]
    sensor = '[sensor]\nquantity = "rate"\nsample_rate = 200.0'
    folder = written(tmp_path / "c", "yaw_rate_deg_s", rows, sensor)
    np.testing.assert_allclose(read_campaign(folder).runs[0].record.yaw_rad, record.yaw_rad, rtol=1e-15)


@pytest.mark.parametrize("centre", [np.pi, -2.0 * np.pi])
def test_the_angle_may_rest_anywhere(tmp_path: Path, centre: float) -> None:
    still = decay(amplitude=4.0)
    one = replace(campaign(), runs=(Run("r", Record(still.time_s, still.yaw_rad + centre), 0.0),))
    assert_same(read_campaign(write_campaign(one, tmp_path / "c")), one)


def test_times_may_start_anywhere(tmp_path: Path) -> None:
    record = decay(rate=1000.0)
    shifted = Record(record.time_s + 1.7e9, record.yaw_rad)  # seconds since 1970
    one = replace(campaign(), sensor=SensorProperties(), runs=(Run("r", shifted, 0.0),))
    assert_same(read_campaign(write_campaign(one, tmp_path / "c")), one)


def test_a_wide_swing_of_a_pendulum_is_no_unit_slip(tmp_path: Path) -> None:
    one = replace(campaign(), runs=(Run("r", decay(amplitude=2.6), 0.0, release_angle=2.4),))
    assert_same(read_campaign(write_campaign(one, tmp_path / "c")), one)


def test_the_truth_is_written_and_never_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = write_campaign(campaign(), tmp_path / "c", truth={"cn_beta": 0.4719})
    assert json.loads((folder / "truth.json").read_text()) == {"cn_beta": 0.4719}
    opened: list[str] = []
    original = os.open

    def spy(path: Any, *flags: Any, **more: Any) -> int:
        opened.append(Path(path).name)
        return original(path, *flags, **more)

    monkeypatch.setattr(os, "open", spy)
    (folder / "truth.json").write_text("not JSON")
    assert_same(read_campaign(folder), campaign())
    assert sorted(opened) == ["campaign.toml", "off.parquet", "on.parquet"]


def test_ids_that_are_no_file_names_are_kept(tmp_path: Path) -> None:
    runs = tuple(replace(campaign().runs[0], id=i) for i in ("../up", "a/b", "A", "a", "β = 20°"))
    one = replace(campaign(), runs=runs)
    folder = write_campaign(one, tmp_path / "c")
    assert_same(read_campaign(folder), one)
    assert sorted(p.name for p in tmp_path.rglob("*.parquet")) == [
        f"run-{n:04d}.parquet" for n in range(1, 6)
    ]


def test_an_existing_folder_is_only_replaced_when_asked_for(tmp_path: Path) -> None:
    folder = write_campaign(campaign(), tmp_path / "c", truth={})
    shorter = replace(campaign(), runs=campaign().runs[:1])
    with pytest.raises(TunnelError, match="exists"):
        write_campaign(shorter, folder)
    assert_same(read_campaign(folder), campaign())
    write_campaign(shorter, folder, overwrite=True)
    assert_same(read_campaign(folder), shorter)
    assert sorted(p.name for p in folder.rglob("*")) == ["campaign.toml", "off.parquet", "runs"]
    assert list(tmp_path.iterdir()) == [folder]


@pytest.mark.parametrize("stranger", ["notes.txt", "c/notes.txt", "c/runs/notes.txt", "c/runs/old/r.csv"])
def test_what_is_not_a_campaign_is_never_deleted(tmp_path: Path, stranger: str) -> None:
    folder = tmp_path / "c"
    if stranger == "notes.txt":
        folder.mkdir()
        (folder / stranger).write_text("mine")
    else:
        write_campaign(campaign(), folder)
        (tmp_path / stranger).parent.mkdir(exist_ok=True)
        (tmp_path / stranger).write_text("mine")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(TunnelError, match=r"does not contain a campaign|contains more than a campaign"):
        write_campaign(campaign(), folder, overwrite=True)
    assert sorted(tmp_path.rglob("*")) == before


def test_an_empty_folder_may_be_filled_and_a_file_not(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    assert_same(read_campaign(write_campaign(campaign(), tmp_path / "empty", overwrite=True)), campaign())
    (tmp_path / "file").write_text("mine")
    with pytest.raises(TunnelError, match="not a folder"):
        write_campaign(campaign(), tmp_path / "file", overwrite=True)
    assert (tmp_path / "file").read_text() == "mine"


def test_a_disk_that_fails_leaves_the_old_campaign_and_no_litter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write_campaign(campaign(), tmp_path / "c")

    def full(record: Record, path: Path, quantity: Quantity, drive: Input | None, freedom: Freedom) -> bytes:
        if path.stem == "on":
            raise OSError(28, "No space left on device")
        return table_bytes(record, path, quantity, drive, freedom)

    monkeypatch.setattr(campaign_folder, "table_bytes", full)
    for target in (folder, tmp_path / "other"):
        with pytest.raises(TunnelError, match="no space left on device"):
            write_campaign(campaign(), target, overwrite=True)
    assert list(tmp_path.iterdir()) == [folder]
    assert_same(read_campaign(folder), campaign())


def test_a_campaign_written_meanwhile_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    other = replace(campaign(), name="the other")

    def overtaken(
        record: Record, path: Path, quantity: Quantity, drive: Input | None, freedom: Freedom
    ) -> bytes:
        monkeypatch.setattr(campaign_folder, "table_bytes", table_bytes)
        write_campaign(other, tmp_path / "c")
        return table_bytes(record, path, quantity, drive, freedom)

    monkeypatch.setattr(campaign_folder, "table_bytes", overtaken)
    with pytest.raises(TunnelError, match="c: the folder exists"):
        write_campaign(campaign(), tmp_path / "c")
    assert read_campaign(tmp_path / "c").name == "the other"
    assert list(tmp_path.iterdir()) == [tmp_path / "c"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"runs": ()}, "'runs' is empty"),
        ({"runs": (campaign().runs[0],) * 2}, "used twice"),
        ({"runs": (replace(campaign().runs[1], air_density=None),)}, "without air_density"),
        ({"runs": (replace(campaign().runs[0], record=decay(duration=1.0)),)}, "fewer than three"),
        ({"name": ""}, "blank"),
        ({"sensor": SensorProperties(sample_rate=0.2)}, "sample_rate"),
    ],
)
def test_what_could_not_be_read_is_not_written(
    tmp_path: Path, change: dict[str, object], message: str
) -> None:
    with pytest.raises(TunnelError, match=message):
        write_campaign(replace(campaign(), **change), tmp_path / "c")
    assert not list(tmp_path.iterdir())


def test_an_unknown_format_is_named(tmp_path: Path) -> None:
    with pytest.raises(TunnelError, match="did you mean 'parquet'"):
        write_campaign(campaign(), tmp_path / "c", run_format="parket")


def test_truth_that_json_cannot_hold_is_refused_before_writing(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="JSON"):
        write_campaign(campaign(), tmp_path / "c", truth={"cn_beta": float("nan")})
    assert not list(tmp_path.iterdir())


def test_the_toml_itself_may_be_named(tmp_path: Path) -> None:
    folder = write_campaign(campaign(), tmp_path / "c")
    assert_same(read_campaign(folder / "campaign.toml"), campaign())


def test_reading_imports_no_engine() -> None:
    code = (
        "import sys, tunnel_sim.files.campaign_folder, identification.datasets\n"
        "sys.exit(bool({'mujoco', 'torch', 'matplotlib'} & sys.modules.keys()))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
