"""Driven runs on disk: what is written is read, and an input that cannot be one is refused in one line."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tunnel_lab.report.import_table import parts_table
from tunnel_sim.files.campaign_folder import read_campaign, write_campaign
from tunnel_sim.files.exporting import export_campaign
from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.inputs import chance_without_effect, correlation
from tunnel_sim.files.importing.records import read_records
from tunnel_sim.files.importing.writing import import_records
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.record import Record

TIME = np.arange(1000) * 0.01
INPUT = np.sin(9.0 * TIME) + 0.3 * np.cos(31.0 * TIME)
RESPONSE = 0.1 * np.sin(9.0 * TIME - 0.7) + 0.01 * np.cos(31.0 * TIME - 2.0)
FREE = 0.3 * np.exp(-0.1 * TIME) * np.cos(12.0 * TIME)


def campaign(drive: Input | None = None, spring: float | None = 16.0) -> Campaign:
    driven = Run(
        "driven", Record(TIME, RESPONSE), 0.0, spring, drive=drive or Input("moment_nm", INPUT, "linear")
    )
    free = Run("free", Record(TIME, FREE), 0.0, 16.0, release_angle=0.3)
    return Campaign("mixed", RigProperties(), SensorProperties(100.0), (driven, free))


@pytest.mark.parametrize("run_format", ["csv", "parquet"])
@pytest.mark.parametrize(
    "drive",
    [
        Input("moment_nm", INPUT, "zero"),
        Input("drive", INPUT, "linear", -2.5),
        Input("drive", INPUT),
        Input("base_rad", 0.1 * INPUT, "linear"),
        Input("command_rad", 0.1 * INPUT, "zero", servo_kv=0.7),
    ],
)
def test_a_mixed_campaign_is_read_as_it_was_written(tmp_path: Path, run_format: str, drive: Input) -> None:
    read = read_campaign(write_campaign(campaign(drive), tmp_path / "c", run_format=run_format))
    found = read.runs[0].drive
    assert found is not None
    assert (found.column, found.stated) == (drive.column, drive.stated)
    assert found.values.tobytes() == drive.values.tobytes()
    assert read.runs[1].drive is None
    assert "1 driven" in repr(read)


def test_a_driven_run_may_have_no_spring_and_a_free_one_may_not(tmp_path: Path) -> None:
    read = read_campaign(write_campaign(campaign(spring=0.0), tmp_path / "c"))
    assert read.runs[0].spring_stiffness == 0.0
    bad = replace(campaign(), runs=(replace(campaign().runs[1], spring_stiffness=0.0),))
    with pytest.raises(TunnelError, match="only a driven run may have no spring"):
        write_campaign(bad, tmp_path / "d")


CLIPPED = np.clip(INPUT, -0.6, 0.6)
BAD = {
    "length": (Input("moment_nm", INPUT[:-1]), "999 samples, the record 1000"),
    "constant": (Input("drive", np.full(TIME.size, 3.0)), "is constant"),
    "itself": (Input("drive", -4.0 * RESPONSE + 1.0), "is proportional to the response"),
    "saturates": (Input("moment_nm", CLIPPED), "saturates"),
}


@pytest.mark.parametrize("case", BAD)
def test_an_input_that_cannot_be_one_is_refused_in_one_line(tmp_path: Path, case: str) -> None:
    drive, said = BAD[case]
    with pytest.raises(TunnelError, match=said) as caught:
        write_campaign(campaign(drive), tmp_path / "c")
    assert "run 'driven'" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "c").exists()


LEVELS = np.repeat(np.round(INPUT[::25] / np.abs(INPUT).max() * 2.0), 25)[: TIME.size]


@pytest.mark.parametrize("values", [np.sign(INPUT), np.round(INPUT * 20.0) / 20.0, INPUT, LEVELS])
def test_square_waves_and_coarse_inputs_do_not_saturate(tmp_path: Path, values: np.ndarray) -> None:
    write_campaign(campaign(Input("moment_nm", values)), tmp_path / "c")


def test_plausible_false_keeps_an_actuator_that_saturates(tmp_path: Path) -> None:
    kept = replace(campaign(Input("moment_nm", CLIPPED)), sensor=SensorProperties(100.0, plausible=False))
    assert read_campaign(write_campaign(kept, tmp_path / "c")).runs[0].drive is not None


def edited(tmp_path: Path, old: str, new: str, file: str = "campaign.toml") -> Path:
    folder = write_campaign(campaign(), tmp_path / "c", run_format="csv")
    text = (folder / file).read_text()
    assert old in text
    (folder / file).write_text(text.replace(old, new))
    return folder


@pytest.mark.parametrize(
    ("old", "new", "file", "said"),
    [
        ('drive_hold = "linear"', 'drive_hold = "cubic"', "campaign.toml", "drive_hold"),
        (
            'drive_hold = "linear"',
            "drive_gain = 2.0",
            "campaign.toml",
            "drive_gain = 2 with the column moment_nm",
        ),
        ("release_angle", "drive_gain = 1.0\nrelease_angle", "campaign.toml", "without an input column"),
        ("moment_nm", "drive,base_rad", "runs/driven.csv", "2 input columns"),
    ],
)
def test_a_wrong_statement_is_refused(tmp_path: Path, old: str, new: str, file: str, said: str) -> None:
    with pytest.raises(TunnelError, match=said):
        read_campaign(edited(tmp_path, old, new, file))


def log(path: Path, name: str, values: np.ndarray, response: np.ndarray = RESPONSE) -> Path:
    rows = "\n".join(f"{t:.4f},{y:.8f},{u:.8f}" for t, y, u in zip(TIME, response, values, strict=True))
    path.write_text(f"time (s),angle (rad),{name}\n{rows}\n")
    return path


@pytest.mark.parametrize(
    ("name", "column"),
    [
        ("moment_nm", "moment_nm"),
        ("torque (Nm)", "moment_nm"),
        ("shaker (V)", "drive"),
        ("base_rad", "base_rad"),
        ("command_rad", "command_rad"),
    ],
)
def test_import_finds_the_input_and_says_why(tmp_path: Path, name: str, column: str) -> None:
    imported = read_records([log(tmp_path / "log.csv", name, INPUT)])
    drive = imported.campaign.runs[0].drive
    assert drive is not None
    assert drive.column == column
    assert np.max(np.abs(drive.values - INPUT)) < 1e-7
    assert any("driven by" in line and "correlation" in line for line in imported.remarks())


def test_import_takes_no_other_column_for_an_input(tmp_path: Path) -> None:
    spring_torque = log(tmp_path / "a.csv", "torque (Nm)", -16.0 * FREE, FREE)
    hum = log(tmp_path / "b.csv", "motor (V)", np.sin(300.0 * TIME), FREE)
    for path in (spring_torque, hum):
        assert read_records([path]).campaign.runs[0].drive is None
    driven = log(tmp_path / "c.csv", "torque (Nm)", INPUT)
    free = read_records([driven], ImportChoices(input="none", cut=False)).campaign.runs[0]
    assert free.drive is None
    stated = read_records([driven], ImportChoices(input="torque", input_as="drive")).campaign.runs[0].drive
    assert stated is not None
    assert stated.column == "drive"


def test_a_chirp_through_the_resonance_is_an_input(tmp_path: Path) -> None:
    chirp = np.sin(2.0 * np.pi * (0.3 + 0.5 * 0.6 * TIME) * TIME)
    pole = np.exp((-0.24 + 12.0j) * 0.01)  # exact where the input is held
    state = np.zeros(TIME.size, complex)
    for k in range(1, TIME.size):
        state[k] = pole * state[k - 1] + chirp[k - 1]
    noise = np.random.default_rng(1).standard_normal(TIME.size)
    response = 1e-3 * state.imag + 3e-4 * noise
    assert correlation(chirp, response)[0] < 0.5
    imported = read_records([log(tmp_path / "log.csv", "motor (V)", chirp, response)])
    assert imported.campaign.runs[0].drive is not None


@pytest.mark.parametrize("seed", range(3))
def test_unrelated_columns_of_a_free_decay_are_not_inputs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    white = rng.standard_normal((2, TIME.size))
    reading = FREE + 1e-3 * white[0]
    for values in (white[1], np.cumsum(white[1]), np.sin(7.0 * TIME), 1.0 * (TIME > 5.0), TIME):
        assert chance_without_effect(values, reading) > 1e-5
    assert chance_without_effect(TIME, np.zeros(TIME.size)) == 1.0
    assert chance_without_effect(TIME[:20], reading[:20]) == 1.0  # too short to tell


def test_an_input_on_another_clock_is_refused(tmp_path: Path) -> None:
    path = log(tmp_path / "log.csv", "moment_nm", INPUT)
    lines = path.read_text().splitlines()
    lines[1::2] = [line.rsplit(",", 1)[0] + "," for line in lines[1::2]]
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(TunnelError, match="has no number at 500 of 1000 samples"):
        read_records([path])


@pytest.mark.parametrize("kind", ["mat", "csv", "xlsx", "hdf5"])
@pytest.mark.parametrize(
    ("drive", "spring"),
    [
        (Input("moment_nm", INPUT, "zero"), 0.0),
        (Input("drive", INPUT, "zero", -2.5), 16.0),
        (Input("drive", INPUT, "linear"), 0.0),
        (Input("base_rad", 0.1 * INPUT, "zero"), 16.0),
        (Input("command_rad", 0.1 * INPUT, "zero", servo_kv=0.7), 16.0),
    ],
)
def test_import_is_the_inverse_of_export(tmp_path: Path, kind: str, drive: Input, spring: float) -> None:
    given = campaign(drive, spring)
    path = export_campaign(given, tmp_path / f"c.{kind}", kind)
    read = read_records([path], ImportChoices(cut=False)).campaign
    assert [run.id for run in read.runs] == ["driven", "free"]
    for before, after in zip(given.runs, read.runs, strict=True):
        assert after.spring_stiffness == before.spring_stiffness
        assert after.release_angle == before.release_angle
        assert (after.drive is None) == (before.drive is None)
    found = read.runs[0].drive
    assert found is not None
    assert (found.column, found.stated) == (drive.column, drive.stated)
    assert np.max(np.abs(found.values - drive.values)) < 1e-15 * (kind == "xlsx") + 1e-300


def logged(folder: Path) -> Path:
    """A robot's log: times, angle and torque, in headings as written."""
    rows = "\n".join(f"{t:.2f},{y:.9f},{u:.9f}" for t, y, u in zip(TIME, RESPONSE, INPUT, strict=True))
    path = folder / "joint.csv"
    path.write_text(f"t [s],q [rad],tau_1 [Nm]\n{rows}\n")
    return path


@pytest.mark.parametrize("angle", ["q [rad]", "q (rad)", "q", "Q", "2", "q_rad"])
@pytest.mark.parametrize("named", ["tau_1 [Nm]", "tau_1", "tau_1 (Nm)", "3", "none"])
def test_columns_are_named_as_written_or_by_number(tmp_path: Path, angle: str, named: str) -> None:
    choices = ImportChoices(angle=(angle,), input=named)
    (run,) = read_records([logged(tmp_path)], choices).campaign.runs
    np.testing.assert_allclose(run.record.yaw_rad, RESPONSE, atol=1e-8)
    if named == "none":
        assert run.drive is None
    else:
        assert run.drive is not None
        assert run.drive.column == "moment_nm"
        np.testing.assert_allclose(run.drive.values, INPUT, atol=1e-8)


def test_the_number_of_the_input_is_not_that_of_the_angle(tmp_path: Path) -> None:
    said = r"'2' is the column 'q.*', from which the angle is read; give --input with"
    with pytest.raises(TunnelError, match=said):
        read_records([logged(tmp_path)], ImportChoices(angle=("q",), input="2"))
    with pytest.raises(TunnelError, match=r"'1' is the column .*, from which the times are read"):
        read_records([logged(tmp_path)], ImportChoices(angle=("q",), input="1"))
    with pytest.raises(TunnelError, match="no column '9' for the input"):
        read_records([logged(tmp_path)], ImportChoices(angle=("q",), input="9"))


def test_a_letter_in_a_robots_log_is_no_wind(tmp_path: Path) -> None:
    rows = np.column_stack([TIME, RESPONSE, INPUT, 3.0 + 0.1 * np.sin(TIME)])
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header="t [s],q [rad],tau [Nm],u", comments="")
    found = read_records([tmp_path / "log.csv"])
    assert found.campaign.runs[0].wind_speed == 0.0
    said = "\n".join(found.remarks())
    assert "'u' is left out: it may be wind_speed or an input, but has no unit" in said
    assert "--set wind_speed=u uses it, --input u if it drives the body" in said


def test_the_hold_of_an_input_is_asked_for(tmp_path: Path) -> None:
    path = logged(tmp_path)
    found = read_records([path], ImportChoices(input="3"))
    assert any("not stated, linear is assumed; --input-hold zero" in line for line in found.remarks())
    found = read_records([path], ImportChoices(input="3", input_hold="zero"))
    assert found.campaign.runs[0].drive is not None
    assert found.campaign.runs[0].drive.hold == "zero"
    assert not any("--input-hold" in line for line in found.remarks())


def test_the_import_of_a_joint_speaks_of_no_wind(tmp_path: Path) -> None:
    imported = import_records([logged(tmp_path)], tmp_path / "joint", ImportChoices(input="3"))
    text = (tmp_path / "joint" / "campaign.toml").read_text()
    for word in ("Cn", "frontal_area", "reference_length", "air_density", "width"):
        assert word not in text
    assert "0 for a joint without a spring" in text
    assert "# drive_hold =" in text
    assert not any("wind" in line for line in imported.remarks())
    assert "V\n[m/s]" not in parts_table(imported).columns
    read_campaign(tmp_path / "joint")
