"""Conditions that a file only seems to state: said with the option that uses them. Truth: what was written."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from identification import identify
from tests.support.import_files import RATE, csv, decay, written
from tunnel_sim import TunnelError
from tunnel_sim.files.importing.choices import ImportChoices, parse_setting, parse_times
from tunnel_sim.files.importing.condition_names import Conditions, condition_of, resembles
from tunnel_sim.files.importing.conditions import Unstated
from tunnel_sim.files.importing.records import read_records

TIME, ANGLE = decay()


def with_head(folder: Path, head: str, name: str = "log.csv") -> Path:
    rows = "\n".join(f"{t:.3f};{y:.8f}" for t, y in zip(TIME, ANGLE, strict=True))
    return written(folder, name, f"{head}\ntime_s;yaw_rad\n{rows}\n")


def with_column(folder: Path, heading: str, values: np.ndarray | float) -> Path:
    column = np.broadcast_to(values, TIME.shape)
    rows = "\n".join(f"{t:.3f};{y:.8f};{v:.8f}" for t, y, v in zip(TIME, ANGLE, column, strict=True))
    return written(folder, "log.csv", f"time_s;yaw_rad;{heading}\n{rows}\n")


def setting(text: str) -> ImportChoices:
    numbers, names = parse_setting(text, "--set")
    return ImportChoices(conditions=numbers, stated_by=names)


@pytest.mark.parametrize(
    ("head", "density"),
    [
        ("Luftdichte [kg/m3];1,196", 1.196),
        ('"Luftdichte [kg/m3]";"1,196"', 1.196),
        ("Luftdichte [kg/m^3] = 1.196", 1.196),
        ("Luftdichte;[kg/m3];1,196", 1.196),
        ("Luftdichte;1,196;kg/m3", 1.196),
        ("Luftdichte (g/cm3): 0.001196", 1.196),
        ("# rho kg/m3: 1.196", 1.196),
        ("Messung 3;Luftdichte;1,196", 1.196),
    ],
)
def test_a_density_above_the_table_is_read(tmp_path: Path, head: str, density: float) -> None:
    (run,) = read_records([with_head(tmp_path, f"Wind speed: 12 m/s\n{head}")]).campaign.runs
    assert (run.wind_speed, run.air_density) == (12.0, pytest.approx(density))


@pytest.mark.parametrize(
    ("head", "key", "value"),
    [
        ("theta0 [deg]; 20", "release_angle", np.deg2rad(20.0)),
        ("V0 = 54 km/h\nrho = 1.2", "wind_speed", 15.0),
        ("Federsteifigkeit (N mm/rad);16120", "spring_stiffness", 16.12),
    ],
)
def test_names_and_units_with_digits_above_the_table(
    tmp_path: Path, head: str, key: str, value: float
) -> None:
    (run,) = read_records([with_head(tmp_path, head)]).campaign.runs
    assert getattr(run, key) == pytest.approx(value)


def test_sizes_of_the_rig_have_units(tmp_path: Path) -> None:
    head = "frontal_area [cm2]; 360\nReference length: 62,5 cm\nyaw_inertia [kg m2] = 0.11\nwidth [mm]: 225"
    rig = read_records([with_head(tmp_path, head)]).campaign.rig
    assert (rig.frontal_area, rig.reference_length, rig.yaw_inertia) == pytest.approx((0.036, 0.625, 0.11))
    assert rig.width is None


@pytest.mark.parametrize(
    ("head", "said"),
    [
        ("V: 15", "'V' = 15 is left out: it may be wind_speed, but has no unit"),
        ("U = 15", "'U' = 15 is left out"),
        (
            "Geschwindigkeit: 54 km/h",
            "'Geschwindigkeit' = 15 in m/s is left out: its name is not a condition's",
        ),
        ("Wind speed: 12 furlong", "its unit is not one of m/s, km/h"),
    ],
)
def test_wind_off_is_not_assumed_beside_a_number(tmp_path: Path, head: str, said: str) -> None:
    path = with_head(tmp_path, head)
    with pytest.raises(Unstated, match="wind-off is not assumed beside it") as caught:
        read_records([path])
    assert said in caught.value.what
    assert "--set wind_speed=" in caught.value.remedy
    assert "--set wind_speed=0 states wind-off" in caught.value.remedy
    assert read_records([path], setting("wind_speed=0")).campaign.runs[0].wind_speed == 0.0


@pytest.mark.parametrize(("name", "speed"), [("V", 15.0), ("v", 15.0), ("Geschwindigkeit", 4.0)])
def test_the_option_that_is_named_uses_the_number(tmp_path: Path, name: str, speed: float) -> None:
    path = with_head(tmp_path, "V: 15\nGeschwindigkeit: 14,4 km/h")
    found = read_records([path], setting(f"wind_speed={name}"))
    assert found.campaign.runs[0].wind_speed == pytest.approx(speed)
    assert any(f"wind_speed = {speed:g} from the file" in line for line in found.remarks())


def test_a_name_that_no_file_has_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        TunnelError, match=r"no column or number 'Vv' that states wind_speed.*did you mean 'V'"
    ):
        read_records([with_head(tmp_path, "V: 15")], setting("wind_speed=Vv"))
    with pytest.raises(TunnelError, match="is not in a unit of wind_speed"):
        read_records([with_head(tmp_path, "V: 15 furlong")], setting("wind_speed=V [furlong]"))


def test_a_column_that_may_be_the_wind_is_said_and_used_on_request(tmp_path: Path) -> None:
    noise = 0.1 * np.random.default_rng(1).standard_normal(TIME.size)
    path = with_column(tmp_path, "V", 12.0 + noise)
    with pytest.raises(Unstated, match=r"'V' is left out.*--set wind_speed=V uses it"):
        read_records([path])
    (run,) = read_records([path], setting("wind_speed=V")).campaign.runs
    assert run.wind_speed == pytest.approx(12.0, abs=0.02)
    # About zero it is no wind, as an angular speed is not.
    slope = np.gradient(ANGLE, TIME)
    assert read_records([with_column(tmp_path, "speed", slope)]).campaign.runs[0].wind_speed == 0.0
    # What has another unit is another quantity.
    assert read_records([with_column(tmp_path, "V [mV]", 24.0)]).campaign.runs[0].wind_speed == 0.0


def test_a_stiffness_that_is_not_used_is_said_and_stops_nothing(tmp_path: Path) -> None:
    found = read_records([with_head(tmp_path, "K = 16.12\nKr = 3 N/m")])
    assert found.campaign.runs[0].spring_stiffness is None
    said = "\n".join(found.remarks())
    assert (
        "'K' = 16.12 is left out: it may be spring_stiffness, but has no unit; --set spring_stiffness=K"
        in said
    )
    assert "'Kr (N/m)' = 3 is left out: its unit is not one of N m/rad" in said
    (run,) = read_records([with_head(tmp_path, "K = 16.12")], setting("spring_stiffness=K")).campaign.runs
    assert run.spring_stiffness == 16.12


def test_members_of_a_mat_file(tmp_path: Path) -> None:
    arrays = {"time": TIME, "yaw_rad": ANGLE}
    path = tmp_path / "rig.mat"
    scipy.io.savemat(path, arrays | {"V": 15.0, "Kr": 16.12, "rho": 1.2})
    found = read_records([path])
    run = found.campaign.runs[0]
    assert (run.wind_speed, run.spring_stiffness, run.air_density) == (15.0, 16.12, 1.2)
    assert any("wind_speed = 15 from the file ('V' = 15, in m/s)" in line for line in found.remarks())
    scipy.io.savemat(path, arrays | {"V": 15.0, "Kr": 16.12})  # a voltage is as likely
    with pytest.raises(Unstated, match="--set wind_speed=V uses it"):
        read_records([path])
    scipy.io.savemat(path, arrays | {"meta": {"wind_speed": "54 km/h", "rho": 1.2, "Kr": 16.12}})
    run = read_records([path]).campaign.runs[0]
    assert (run.wind_speed, run.spring_stiffness, run.air_density) == (pytest.approx(15.0), 16.12, 1.2)
    scipy.io.savemat(path, arrays | {"V": [0.0, 10.0, 15.0]})
    with pytest.raises(Unstated, match=r"'V' of 3 values.*but not of which run.*--conditions RUNS.csv"):
        read_records([path])


def test_a_speed_in_a_file_name_is_proposed(tmp_path: Path) -> None:
    paths = [csv(tmp_path, f"S16_V{speed}_r{n}.csv") for n, speed in enumerate((0, 10, "12.5"), 1)]
    with pytest.raises(Unstated, match=r'--name "S\{spring\}_V\{wind_speed\}\*" uses it') as caught:
        read_records(paths)
    assert "a number in the files' names is left out: it may state wind_speed" in caught.value.what
    assert "S16_V10_r2.csv" in caught.value.where  # both files with a wind, in one refusal
    assert "S16_V12.5_r3.csv" in caught.value.where
    choices = ImportChoices(name="S{spring}_V{wind_speed}*", conditions=setting("air_density=1.2").conditions)
    runs = read_records(paths, choices).campaign.runs
    assert [(run.spring_stiffness, run.wind_speed) for run in runs] == [
        (16.0, 0.0),
        (16.0, 10.0),
        (16.0, 12.5),
    ]
    # A spring alone is said, and stops nothing.
    found = read_records(paths, setting("wind_speed=0"))
    assert any("'S16' in the file's name" in line for line in found.remarks())


@pytest.mark.parametrize(
    ("name", "speed", "use"),
    [
        ("V10.csv", 10.0, '--name "V{wind_speed}"'),
        ("rig_v=8_a.csv", 8.0, '--name "*_v={wind_speed}*"'),
        ("run3_10mps.csv", 10.0, '--name "*_{wind_speed}mps"'),
        ("u_inf-12p5.csv", 12.5, '--name "u_inf-{wind_speed}"'),
        ("V54kmh.csv", 15.0, "--set wind_speed=15"),
        ("S16V10.csv", 10.0, '--name "S{spring}V{wind_speed}"'),
    ],
)
def test_names_that_state_a_speed(tmp_path: Path, name: str, speed: float, use: str) -> None:
    path = csv(tmp_path, name)
    with pytest.raises(Unstated, match="wind-off is not assumed") as caught:
        read_records([path])
    assert caught.value.remedy.startswith(f"{use} uses it")
    option, _, text = use.partition(" ")
    dense = setting("air_density=1.2").conditions
    if option == "--name":
        choices = ImportChoices(name=text.strip('"'), conditions=dense)
    else:
        choices = setting(f"{text}, air_density=1.2")
    assert read_records([path], choices).campaign.runs[0].wind_speed == pytest.approx(speed)


@pytest.mark.parametrize(
    "name", ["v0.csv", "V_0_run2.csv", "run3.csv", "have10.csv", "10ms.csv", "Messung2.csv", "rev12.csv"]
)
def test_other_names_state_no_speed(tmp_path: Path, name: str) -> None:
    assert read_records([csv(tmp_path, name)]).campaign.runs[0].wind_speed == 0.0


def test_numbers_before_ms_that_differ_may_be_speeds(tmp_path: Path) -> None:
    paths = [csv(tmp_path, f"run{n}_{speed}ms.csv") for n, speed in enumerate((0, 12, 20), 1)]
    with pytest.raises(Unstated, match=r'--name "\*_\{wind_speed\}ms" uses it'):
        read_records(paths)
    choices = ImportChoices(name="*_{wind_speed}ms", conditions=setting("air_density=1.2").conditions)
    assert [run.wind_speed for run in read_records(paths, choices).campaign.runs] == [0.0, 12.0, 20.0]
    alike = [csv(tmp_path, f"run{n}_5ms.csv") for n in (1, 2)]  # the interval of the samples
    assert {run.wind_speed for run in read_records(alike).campaign.runs} == {0.0}


def test_a_temperature_of_the_air_is_not_a_wind() -> None:
    assert resembles("T_air", "") is None
    assert resembles("v_air", "") == "wind_speed"


@pytest.mark.parametrize("name", ["Feder", "spring", "K", "k_theta"])
def test_a_name_of_a_spring_states_its_stiffness_with_the_unit_of_one(name: str) -> None:
    assert condition_of(name, "N m/rad") == "spring_stiffness"
    assert condition_of(name, "") is None


def test_names_of_which_not_all_have_the_part_ask_for_a_table(tmp_path: Path) -> None:
    paths = [csv(tmp_path, "S16_off.csv"), csv(tmp_path, "S16_V10.csv")]
    with pytest.raises(Unstated, match=r"--conditions RUNS\.csv"):
        read_records(paths)


def test_a_table_of_conditions_has_the_names_and_units_of_files(tmp_path: Path) -> None:
    paths = [csv(tmp_path, "a.csv"), csv(tmp_path, "b.csv")]
    for head in ("Datei;V [km/h];Federsteifigkeit;Luftdichte [kg/m3]", "Lauf;V (km/h);Kr;rho"):
        text = f"{head}\na;54;16,12;1,2\nb;0;16,12;\n"
        found = read_records(paths, conditions=written(tmp_path, "runs.csv", text))
        runs = found.campaign.runs
        assert [(r.wind_speed, r.spring_stiffness, r.air_density) for r in runs] == [
            (pytest.approx(15.0), 16.12, 1.2),
            (0.0, 16.12, None),
        ]
        assert any("runs.csv: wind_speed from 'V" in line for line in found.remarks())
    text = "file;Wind speed [furlong]\na;1\nb;2\n"
    with pytest.raises(TunnelError, match=r"'Wind speed \[furlong\]' is not in a unit of wind_speed"):
        read_records(paths, conditions=written(tmp_path, "runs.csv", text))


@pytest.mark.parametrize(
    "name",
    [
        "speed",
        "fan_speed",
        "tunnel",
        "airspeed",
        "U_ref",
        "v_tunnel",
        "pitot",
        "wind_tunnel_velocity",
        "FlowSpeed",
    ],
)
def test_wind_off_is_not_assumed_beside_what_looks_like_a_speed(name: str, tmp_path: Path) -> None:
    for member in (12.0, np.full(TIME.size, 12.0) + 0.1 * np.sin(TIME)):  # a number, or a channel
        path = tmp_path / "rig.mat"
        scipy.io.savemat(path, {"time": TIME, "yaw_rad": ANGLE, name: member})
        choices = setting(f"wind_speed={name}")
        with suppress(Unstated):  # asked, or taken: never passed over
            assert read_records([path]).campaign.runs[0].wind_speed == pytest.approx(12.0, abs=0.1)
            continue
        with pytest.raises(Unstated, match=rf"'{name}'.*--set wind_speed={name} uses it"):
            read_records([path])
        assert read_records([path], choices).campaign.runs[0].wind_speed == pytest.approx(12.0, abs=0.1)


@pytest.mark.parametrize(
    "name", ["gyro", "temperature", "air_temp", "motor_speed", "angular_velocity", "serial", "fps"]
)
def test_other_members_are_listed_and_stop_nothing(name: str, tmp_path: Path) -> None:
    path = tmp_path / "rig.mat"
    scipy.io.savemat(path, {"time": TIME, "yaw_rad": ANGLE, name: 12.0})
    found = read_records([path])
    assert found.campaign.runs[0].wind_speed == 0.0
    assert f"stated in the file and not used: {name} = 12" in "\n".join(found.remarks())


def test_numbers_and_texts_that_are_not_used_are_listed(tmp_path: Path) -> None:
    info, members = (
        "stiff spring, new bearing",
        {"time": TIME, "yaw_rad": ANGLE, "spring_K": 16.0, "mass": 3.5},
    )
    path = tmp_path / "rig.mat"
    scipy.io.savemat(path, members | {"info": info, "Ts": 1.0 / RATE})
    said = "\n".join(read_records([path]).remarks())
    assert f"stated in the file and not used: mass = 3.5, info: '{info}'" in said
    assert "--set spring_stiffness=spring_K uses it" in said
    (run,) = read_records([path], setting("spring_stiffness=spring_K")).campaign.runs
    assert run.spring_stiffness == 16.0
    document = {"time": TIME.tolist(), "yaw_rad": ANGLE.tolist(), "operator": "bench", "kp": 4.0}
    said = "\n".join(read_records([written(tmp_path, "log.json", json.dumps(document))]).remarks())
    assert "stated in the file and not used: kp = 4, operator: 'bench'" in said


@pytest.mark.parametrize("text", ["run 3 at 12 m/s", "tunnel 43.2 km/h, stiff spring", "second day, wind on"])
def test_a_text_that_mentions_a_wind_is_not_passed_over(text: str, tmp_path: Path) -> None:
    mat, document = tmp_path / "rig.mat", {"time": TIME.tolist(), "yaw_rad": ANGLE.tolist(), "info": text}
    scipy.io.savemat(mat, {"time": TIME, "yaw_rad": ANGLE, "info": text})
    for path in (mat, written(tmp_path, "log.json", json.dumps(document)), with_head(tmp_path, f"# {text}")):
        with pytest.raises(Unstated, match="wind-off is not assumed beside it"):
            read_records([path])
        assert read_records([path], setting("wind_speed=12")).campaign.runs[0].wind_speed == 12.0


@pytest.mark.parametrize(
    ("text", "key", "value"),
    [
        ("frontal_area=360 cm2", "frontal_area", 0.036), ("wind_speed=54 km/h", "wind_speed", 15.0),
        ("spring_stiffness=2 N mm/rad", "spring_stiffness", 2e-3),
        ("reference_length=25cm", "reference_length", 0.25),
        ("air_density = 1.2 kg/m^3", "air_density", 1.2),
        ("release_angle=10 deg", "release_angle", np.deg2rad(10.0)),
        ("air_density=1,19", "air_density", 1.19), ("spring_stiffness=16,12 N m/rad", "spring_stiffness", 16.12),
        ("air_density=1,196,wind_speed=12,5", "air_density", 1.196),  # no air has 1196 kg/m3
        ("wind_speed=54,5 km/h, air_density=1,2", "wind_speed", 54.5 / 3.6),
        ("spring_stiffness=0,200,wind_speed=12", "spring_stiffness", 0.2),
    ],
)  # fmt: skip
def test_a_setting_may_have_a_unit_and_a_decimal_comma(text: str, key: str, value: float) -> None:
    assert getattr(parse_setting(text, "--set")[0], key) == pytest.approx(value)


def test_a_unit_that_does_not_fit_a_setting_is_named() -> None:
    with pytest.raises(TunnelError, match="'furlong' is not a unit of frontal_area; use one of m2"):
        parse_setting("frontal_area=360 furlong", "--set")
    with pytest.raises(TunnelError, match="'%' is not a unit of repeatability_wind_speed"):
        parse_setting("repeatability_wind_speed=2 %", "--set")


def test_a_comma_of_two_meanings_is_refused() -> None:
    with pytest.raises(TunnelError, match=r"^--set: '1,200' may be 1\.200 or 1200; give one of these$"):
        parse_setting("spring_stiffness=1,200", "--set")
    assert parse_times(["log=14,27"], "--start") == {"log": 14.27}
    with pytest.raises(TunnelError, match=r"^--start: '14,275' may be 14\.275 or 14275"):
        parse_times(["log=14,275"], "--start")


def test_refusals_of_one_file_come_together(tmp_path: Path) -> None:
    rows = "\n".join(f"{y:.8f};12.{i % 3}" for i, y in enumerate(ANGLE))
    path = written(tmp_path, "log.csv", f"pot (V);tunnel\n{rows}\n")
    with pytest.raises(TunnelError) as caught:
        read_records([path])
    for what in ("no column of times", "'pot' is in V", "'tunnel' is left out"):
        assert what in caught.value.what
    for remedy in ("--rate in Hz", "--calibration", "--set wind_speed=tunnel"):
        assert remedy in caught.value.remedy
    conditions = written(tmp_path, "runs.csv", "file,wind_speed\nlog.csv,12\n")
    with pytest.raises(TunnelError) as caught:
        read_records([path], conditions=conditions)
    assert "tunnel" not in caught.value.what  # the table states it
    choices = setting("wind_speed=12").model_copy(update={"rate": RATE, "calibration": "V", "unit": "rad"})
    (run,) = read_records([path], choices).campaign.runs
    np.testing.assert_allclose(run.record.yaw_rad, ANGLE, atol=1e-7)


def asked(paths: list[Path], choices: ImportChoices = ImportChoices()) -> TunnelError:  # noqa: B008 - frozen
    with pytest.raises(TunnelError) as caught:
        read_records(paths, choices)
    return caught.value


def test_the_density_is_asked_for_with_the_wind(tmp_path: Path) -> None:
    paths = [csv(tmp_path, f"V{speed}_K16p1.csv", speed + 1) for speed in (0, 12, 24)]
    fault = asked(paths)
    assert fault.options == ('--name "V{wind_speed}_K{spring}"', "--set air_density=1.2")
    assert "with --set air_density=1.2 (kg/m3, about 1.2 for air); --set wind_speed=0" in fault.remedy
    choices = setting("air_density=1.2").model_copy(update={"name": "V{wind_speed}_K{spring}"})
    assert [run.wind_speed for run in read_records(paths, choices).campaign.runs] == [0.0, 12.0, 24.0]
    for stated in ("wind_speed=0", "air_density=1.2"):
        said = str(asked(paths, setting(stated)) if "air" in stated else read_records(paths, setting(stated)))
        assert "--set air_density" not in said
    alone = csv(tmp_path, "V12.csv")  # without a stiffness or a size the run gives ωn and ζ only
    assert asked([alone]).options == ('--name "V{wind_speed}"',)


def test_columns_and_conditions_of_all_files_are_one_question(tmp_path: Path) -> None:
    """Two columns that may be the angle, in counts, beside a wind and a stiffness without a density."""
    wind = "wind speed [m/s];K [N m/rad]"
    rows = "\n".join(f"{t:.3f};{1e4 * y:.0f};{9e3 * y:.0f};12;16.1" for t, y in zip(TIME, ANGLE, strict=True))
    two = [written(tmp_path, f"{n}.csv", f"t [s];enc [counts];aux [counts];{wind}\n{rows}\n") for n in "ab"]
    rows = "\n".join(f"{t:.3f};{y:.8f};12;16.1" for t, y in zip(TIME, ANGLE, strict=True))
    read = written(tmp_path, "c.csv", f"t [s];yaw [rad];{wind}\n{rows}\n")
    fault = asked([*two, read])
    assert fault.options == ('--angle "enc"', "--counts-per-turn N", "--set air_density=1.2")
    for once in ("2 columns may be the angle", "'enc' is in counts", "without air_density"):
        assert str(fault).count(once) == 1
    choices = setting("air_density=1.2").model_copy(update={"counts_per_turn": 16384.0, "angle": ("enc",)})
    assert len(read_records(two, choices).campaign.runs) == 2


@pytest.mark.parametrize(("per_cycle", "kept"), [(9.1, True), (6.3, True), (4.6, True), (3.3, False)])
def test_few_samples_per_cycle_are_accepted_with_a_note(per_cycle: float, kept: bool, tmp_path: Path) -> None:
    time = np.arange(400) / (2.0 * per_cycle)
    angle = 0.3 * np.exp(-0.05 * time) * np.cos(4.0 * np.pi * time)
    rows = "".join(f"{t:.6f},{y:.8f}\n" for t, y in zip(time, angle, strict=True))
    path = written(tmp_path, "log.csv", "time_s,yaw_rad\n" + rows)
    if not kept:
        with pytest.raises(TunnelError, match=r"samples per cycle.*plausible = false"):
            read_records([path])
        return
    found = read_records([path])
    assert "samples per cycle: a motion above half the sample rate" in "\n".join(found.remarks())
    estimate = identify(found.campaign)
    assert estimate.runs[0].omega_n is not None
    assert estimate.runs[0].omega_n.value == pytest.approx(4.0 * np.pi, rel=1e-3)
    assert any("samples per cycle" in str(remark) for remark in estimate.remarks)


@pytest.mark.parametrize(
    "head",
    [
        "V = 0 m/s;;V = 10 m/s;",
        "Wind speed: 12 m/s\nWind speed: 10 m/s",
        "Wind speed: 12 m/s\nWindgeschwindigkeit: 10 m/s",
    ],
)
def test_a_condition_with_several_numbers_is_asked_about(head: str, tmp_path: Path) -> None:
    """Two runs side by side, each below its own speed, or a speed that was corrected: the last is not taken."""
    time, angle = decay()
    rows = "".join(f"{t:.3f};{y:.8f};{t:.3f};{y:.8f}\n" for t, y in zip(time, angle, strict=True))
    path = written(tmp_path, "log.csv", f"{head}\nt [s];yaw [rad];t [s];yaw [rad]\n{rows}")
    with pytest.raises(
        TunnelError, match="the file states several numbers; wind-off is not assumed"
    ) as fault:
        read_records([path])
    assert "--conditions RUNS.csv" in f"{fault.value}"
    still = ImportChoices(conditions=Conditions(wind_speed=0.0))
    assert [run.wind_speed for run in read_records([path], still).campaign.runs] == [0.0, 0.0]
    agreed = head.replace("12 m/s", "36 km/h").replace("V = 0", "V = 10")
    path = written(tmp_path, "log.csv", f"{agreed}\nt [s];yaw [rad];t [s];yaw [rad]\n{rows}")
    given = ImportChoices(conditions=Conditions(air_density=1.2))
    assert [run.wind_speed for run in read_records([path], given).campaign.runs] == [10.0, 10.0]


@pytest.mark.parametrize("heading", ["V [cm/s]", "speed [km/min]", "U_inf [ft/min]"])
def test_a_speed_in_an_unknown_unit_is_not_wind_off(heading: str, tmp_path: Path) -> None:
    with pytest.raises(TunnelError, match="its unit is not one of m/s, km/h") as fault:
        read_records([with_column(tmp_path, heading, 1000.0)])
    assert "wind-off is not assumed beside it" in f"{fault.value}"


@pytest.mark.parametrize("heading", ["spring [lbf·in/rad]", "k [kgf cm/deg]"])
def test_a_stiffness_in_an_unknown_unit_is_said(heading: str, tmp_path: Path) -> None:
    imported = read_records([with_column(tmp_path, heading, 142.67)])
    assert "its unit is not one of N m/rad" in "; ".join(imported.remarks())


@pytest.mark.parametrize("heading", ["q [Pa]", "vitesse du vent", "風速", "velocità del vento"])
def test_a_wind_under_other_names_is_not_wind_off(heading: str, tmp_path: Path) -> None:
    with pytest.raises(TunnelError, match="wind-off is not assumed beside it"):
        read_records([with_column(tmp_path, heading, 60.0)])


def test_a_speed_in_knots_in_a_file_name_has_the_digits_of_a_stated_one(tmp_path: Path) -> None:
    path = with_head(tmp_path, "").rename(tmp_path / "decay_15kn.csv")
    with pytest.raises(Unstated) as caught:
        read_records([path])
    stated, _ = parse_setting("wind_speed=15 kn", "--set")
    assert f"--set wind_speed={stated.wind_speed:g}" in caught.value.options
