"""Valid inputs, made once in each process: what is mutated starts from these."""

from __future__ import annotations

import io
import json
import tempfile
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from hypothesis import strategies as st

from diagnosis.findings.candidates import Candidate
from diagnosis.findings.closure import Confirmation, GapSummary, NoiseSummary, RunGap
from diagnosis.findings.coefficients import Coefficients
from diagnosis.findings.misfit import Misfit
from diagnosis.where.described import Where
from tests.fuzz.campaigns import free_decays
from tests.fuzz.tables import parquet
from tests.fuzz.values import odd_words
from tests.support.robot_logs import JOINT_STATE, START_NS, Mdf, joint_state, write_db3, write_mcap
from tests.support.small_sweep import SMALL

_TESTS = Path(__file__).parents[1]
PLAN = b"""
name = "seed"
seed = 1
springs = [5, 8]
spring_stiffness = [20.0]
wind_speeds = [0.0, 15.0]
release_angles_deg = [20.0]
repeats = 2
duration = 5.0
air_density = 1.2
truth = { cn_beta = 0.495, cn_r = -0.114, yaw_inertia = 0.1, mechanical_damping = 0.01 }
sensor = { sample_rate = 500.0, noise_std = 0.001, resolution = 0.0, zero = 0.01 }
scatter = { wind_speed = 0.003, mechanical_damping = 0.01, zero = 0.002, spring_stiffness_drift = -0.002 }
repeatability = { wind_speed = 0.003, spring_stiffness = 0.0005 }
drive = { kind = "multisine", from_hz = 0.5, to_hz = 5.0, amplitudes_nm = [0.1], hold = "zero", seed = 2 }

[[effects]]
name = "coulomb_friction"
parameters = { friction_moment = 0.002 }

[[effects]]
name = "mains_hum"
parameters = { amplitude = 1e-4 }
"""
UNCERTAINTIES = b"""
schema_version = 1
common = { spring_stiffness = 0.005, wind_speed = 0.01, air_density = 0.003, clock = 0.001 }
individual = { spring_stiffness = 0.002, wind_speed = 0.005 }
correlations = [{ between = ["wind_speed", "air_density"], coefficient = -0.5 }]
"""
MODEL_FILES: dict[str, bytes] = {
    "model.xml": b"""<mujoco model="pendulum">
  <compiler angle="radian" meshdir="parts"/>
  <option timestep="0.002" gravity="0 0 -9.81" integrator="RK4"/>
  <size memory="1M"/>
  <include file="more.xml"/>
  <default><geom contype="0" conaffinity="0"/></default>
  <asset><mesh name="arm" file="arm.obj" scale="1 1 1"/><hfield name="h" nrow="3" ncol="3" size="1 1 0.1 0.1"/>
    <texture name="t" type="2d" builtin="checker" width="8" height="8"/></asset>
  <worldbody>
    <replicate count="2" offset="1 0 0"><geom size="0.1" mass="1"/></replicate>
    <body name="b" pos="0 0 1">
      <joint name="hinge" axis="0 1 0" stiffness="2 0 0.1" springref="0.1" damping="0.01" frictionloss="0.002"/>
      <geom type="mesh" mesh="arm" mass="0.2"/>
      <geom name="bob" type="sphere" size="0.02" mass="0.4" pos="0 0 -0.3"/>
    </body>
  </worldbody>
  <sensor><jointpos name="s" joint="hinge" noise="0.001"/></sensor>
  <keyframe><key name="k" qpos="0.1"/></keyframe>
</mujoco>""",
    "more.xml": b"<mujocoinclude><custom><numeric name='n' data='1 2'/></custom></mujocoinclude>",
    "parts/arm.obj": b"v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 -0.5\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n",
}
URDF = b"""<robot name="r"><link name="base"/><link name="arm"><inertial><origin xyz="0 0 -0.3"/><mass value="0.4"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hinge" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<dynamics damping="0.1" friction="0.01"/></joint></robot>"""
FORMULAS = (
    "-k*b*exp(-(b/w)^2)",
    "-k*b^3*V^0",
    "-abs(-k)*min(b, w)*tanh(b/w)",
    "-k*sign(r)*abs(b)",
    "--k*w*sin(b/w)",
)
tokens = st.sampled_from((*"+-*/^(),bkwVrt#e", "**", "pi", "lambda:", "0/0", "b^0.5", "(b)")) | odd_words
"""What a token of a formula is exchanged for."""
EFFECT = "rod_flexibility:compliance=1e-4,inertia_share=0.3"
KINDS = "single:2.0,pair:1.0,none:0.5,outside:0.5"


def effects_document(formula: str = FORMULAS[0]) -> dict[str, Any]:
    """The tables of an effects file, of which the first effect has this formula."""
    stiffness = {"unit": "N m/rad", "scale": 0.1, "lower": 0.0, "upper": 50.0}
    width = {"unit": "rad", "scale": 0.05, "lower": 0.01, "upper": 0.3, "default": 0.06}
    share = {"unit": "1/rad", "scale": 0.1, "lower": -1.0, "upper": 1.0}
    first = {
        "name": "detent",
        "channel": "stiffness",
        "moment": formula,
        "parameters": {"k": stiffness, "w": width},
    }
    return {
        "effects": [
            first,
            {"name": "curved", "channel": "sensor", "reading": "y+k*y^2", "parameters": {"k": share}},
        ]
    }


@cache
def campaign_document() -> dict[str, Any]:
    """The tables of a campaign of two runs, one CSV and one Parquet."""
    common = {"spring_stiffness": 16.12, "air_density": 1.2, "release_angle": 0.35}
    return {
        "schema_version": 1,
        "campaign": {"name": "seed", "description": "two runs"},
        "rig": {"yaw_inertia": 0.1, "frontal_area": 0.036, "reference_length": 0.625, "width": 0.225},
        "sensor": {"sample_rate": 50.0, "resolution": 0.0005, "noise_std": 0.0005},
        "repeatability": {"wind_speed": 0.003, "mechanical_damping": 0.01},
        "runs": [
            {"id": "r1", "file": "r1.csv", "wind_speed": 0.0, **common},
            {"id": "r2", "file": "r2.parquet", "wind_speed": 15.0, **common},
        ],
    }


@cache
def run_frame() -> pl.DataFrame:
    """Times and angles of a run."""
    record = free_decays(np.random.default_rng(1)).runs[0].record
    return pl.DataFrame({"time_s": record.time_s, "yaw_rad": record.yaw_rad})


def packaged(name: str) -> bytes:
    """The bytes of a file under ``tunnel_sim/data``."""
    return (resources.files("tunnel_sim") / "data" / name).read_bytes()


def regression(name: str) -> Path:
    """A file of the quick suite's score."""
    return _TESTS / "regression" / name


@cache
def springs_csv() -> bytes:
    """The paper's springs as a table a user would write."""
    from tunnel_lab.commands.paper import paper_table

    table = paper_table()
    rows = zip(table.names, table.stiffness, table.frequency_hz, strict=True)
    return "\n".join(
        ["spring,stiffness_N_m_per_rad,frequency_Hz", *(f"{n},{k},{f}" for n, k, f in rows)]
    ).encode()


@cache
def sweep_folder() -> dict[str, bytes]:
    """The files of a sweep of which three shards of twelve are finished."""
    from tunnel_lab.experiments.experiment import begin
    from tunnel_lab.experiments.sweep import read_sweep, sweep_of
    from tunnel_lab.experiments.sweep_work import run_shard

    with tempfile.TemporaryDirectory() as name:
        file = Path(name) / "sweep.toml"
        file.write_text(SMALL.replace("records = true", "records = false"), encoding="utf-8")
        sweep = read_sweep(file)
        store = begin(sweep_of(sweep), Path(name) / "out")
        for index in range(3):
            store.keep(sweep_of(sweep).name(index), run_shard(sweep, index))
        return {
            str(path.relative_to(store.folder)): path.read_bytes()
            for path in sorted(store.folder.rglob("*"))
            if path.is_file()
        }


@cache
def estimate_document() -> dict[str, Any]:
    """The estimate of a small campaign, as JSON's types."""
    from identification import identify

    found: dict[str, Any] = identify(free_decays(np.random.default_rng(1)), "output_error").to_json_dict()
    return json.loads(json.dumps(found, default=bool))


@cache
def weights() -> tuple[bytes, dict[str, Any]]:
    """The networks that ship: their file and its record."""
    folder = resources.files("identification") / "neural" / "weights"
    return (folder / "paper.safetensors").read_bytes(), json.loads((folder / "paper.json").read_text("utf-8"))


@cache
def checkpoint() -> tuple[Any, bytes]:
    """A training of a few steps, and the checkpoint it had after half of them."""
    from identification.neural.networks import DataSpec
    from identification.neural.train import TrainingSpec, train

    data = DataSpec(zeta_count=8, grid=(3, 4), test_count=4)
    spec = TrainingSpec(seed=5, data=data, starts=1, damping_steps=2, frequency_steps=2)
    kept: list[bytes] = []
    train(spec, keep=lambda state: kept.append(state.to_bytes(spec.to_json_dict())))
    return spec, kept[2]


@cache
def answer_document() -> dict[str, Any]:
    """A diagnosis of one cause, as JSON's types."""

    from diagnosis import Diagnosis, Settings
    from diagnosis.answer.held_out import ON_RUNS
    from diagnosis.findings.decision import decision
    from identification.show.quantity import Quantity

    values = {
        "cn_beta": Quantity(0.45, 0.01, "1/rad"),
        "cn_r": Quantity(-0.1, 0.01, "1/rad"),
    }
    friction = {"friction_moment": Quantity(0.004, 1e-5, "N m")}
    runs, misfit = (RunGap("r1", 2.0, 0.1),), Misfit(5e-4, 0.1, "rad")
    gap = GapSummary(True, 2.0, 0.1, 0.99, ON_RUNS, runs, 1e-3, 1e-9, {"lag": 1e-9}, misfit)
    return Diagnosis(
        "c1", ("coulomb_friction",), gap,
        Where("damping", "always", ("r1",), (0.0, 1.0), (0.0, 0.1)),
        (Candidate("coulomb_friction", 0.9, 0.1, 0.99, friction), Candidate("none", 0.1, 2.0, 0.0)),
        ("quadratic_damping",), None, Coefficients(values, values),
        Confirmation(True, 0.0, "r1", 0.0, 1e-5),
        NoiseSummary(5e-4, None, "estimated", ""),
        decision([("coulomb_friction", 0.9), ("none", 0.1)], Settings().answer),
    ).to_json_dict() | {"wall_s": 3.0}  # fmt: skip


TRUTH: dict[str, Any] = {"effects": ["coulomb_friction"], "severity": 3.0, "cn_beta": 0.45, "cn_r": -0.1}
MADE_WITH: dict[str, Any] = {"count": 1, "seed": 1, "kinds": {"single": 1.0}, "textbook": 0.5, "rare": 0.5}


@cache
def baseline_frame() -> pl.DataFrame:
    """The quick suite's score baseline."""
    return pl.read_parquet(regression("score-baseline.parquet"))


def frame_of(content: bytes) -> pl.DataFrame:
    """A Parquet file's table."""
    return pl.read_parquet(io.BytesIO(content))


def run_file(name: str) -> bytes:
    """The seed run as a file of the kind its name says."""
    return run_frame().write_csv().encode() if name.endswith(".csv") else parquet(run_frame())


CHOICES: tuple[dict[str, Any], ...] = (
    {}, {}, {}, {"time": "1"}, {"time": "2"}, {"angle": ("1",)}, {"angle": ("2",)},
    {"angle": ("4",), "unit": "deg"}, {"rate": 50.0}, {"counts_per_turn": 1024.0}, {"calibration": "0.1 + 2*V"},
    {"start": 0.5, "end": 3.0}, {"rest": 0.01}, {"time_unit": "ms"}, {"cut": False},
)  # fmt: skip
"""What a user may state about a log."""


LOGGER_HEAD = """Logger 7; 12.3.2026
Sample rate: 50 Hz
fs = 50, Ts = 0.02 s
Wind speed: 54 km/h
Kr = 16.12 N m/rad
rho;1.2;kg/m3
frontal_area = 0.036
Gain: 3 V
time [s];yaw (rad);V [m/s];run;Kr
"""
"""The head of a log: numbers, names and a row of units."""
_HEADINGS = (
    "time", "t", "Zeit", "yaw", "angle", "run", "Lauf", "fs", "dt", "Ts", "wind_speed", "V", "Kr", "rho", "width",
    "frontal_area", "release_angle", "s", "ms", "h", "rad", "deg", "m/s", "km/h", "counts", "Inkr.", "mV", "rad/s",
    "N m/rad", "kg/m3", "Hz", "kHz", "#1", "Run #2", "(rad)", "[m/s]", "1e999", "-1e999", "1e-320", "0", "-0.0",
    "1e18",
)  # fmt: skip
headings = st.sampled_from(_HEADINGS) | odd_words


def logger_rows(*, named: bool, timed: bool) -> bytes:
    """The rows of a log under `LOGGER_HEAD`: two runs with names or numbers, with a column of times or without."""
    rows = list(run_frame().iter_rows())
    half = len(rows) // 2
    names = ("a", "b") if named else (1, 2)
    head = [f"{t};" if timed else "" for t, _ in rows]
    return "".join(
        f"{head[i]}{y};{15.0 * (i < half)};{names[i >= half]};16.12\n" for i, (_, y) in enumerate(rows)
    ).encode()


@cache
def nested_hdf5(name: str) -> bytes:
    """The seed run in HDF5 or, by its name, MAT 7.3, with attributes of many kinds, tables, texts and links."""
    import h5py

    frame = run_frame()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        block = 512 if name.endswith(".mat") else 0
        with h5py.File(path, "w", userblock_size=block) as file:
            for number in (1, 2):
                group = file.create_group(f"run-{number}")
                group.attrs.update(
                    {"id": f"r{number}", "wind_speed": 0.0, "text": "long" * 20, "many": np.arange(40)}
                )
                group.create_dataset(
                    "time_s", data=frame["time_s"].to_numpy(), compression="gzip", chunks=(64,)
                )
                group["yaw_rad"] = frame["yaw_rad"].to_numpy()[None]
                group["yaw_rad"].attrs["MATLAB_class"] = np.bytes_("double")
                group["yaw_rad"].attrs["unit"] = "rad"
            file.attrs["name"] = "seed"
            file["note"] = np.array([[72], [105]], np.uint16)
            file["note"].attrs["MATLAB_class"] = np.bytes_("char")
            file["texts"] = np.array(["a", "bc"], dtype=h5py.string_dtype())
            file["link"] = h5py.SoftLink("/run-1")
            file["again"] = file["run-2"]
            file["table"] = np.array([(1.0, 2)] * 8, dtype=[("a", "f8"), ("b", "i4")])
            file["table"].attrs["point"] = file["run-1"].ref
        content = path.read_bytes()
    return b"MATLAB 7.3 MAT-file".ljust(block) + content[block:] if block else content


@cache
def logger_file(name: str) -> bytes:
    """The seed run as a file of an instrument, of the kind its name says."""
    from nptdms import ChannelObject, TdmsWriter

    from tunnel_sim.files.exporting import export_campaign

    kinds = {".mat": "mat", ".h5": "hdf5", ".xlsx": "xlsx"}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        if path.suffix in kinds:
            export_campaign(free_decays(np.random.default_rng(1)), path, kinds[path.suffix])
        elif path.suffix == ".tdms":
            with TdmsWriter(path) as file:
                columns = [ChannelObject("run", column.name, column.to_numpy()) for column in run_frame()]
                file.write_segment(columns)
        elif path.suffix in (".mcap", ".db3", ".mf4"):
            _write_log(path)
        else:
            path.write_bytes(run_file(name))
        return path.read_bytes()


def _write_log(path: Path) -> None:
    """The seed run as joint states, or as a channel group."""
    time, angle = (run_frame()[name].to_numpy() for name in ("time_s", "yaw_rad"))
    stamps = [START_NS + round(1e9 * t) for t in time]
    messages = [
        ("/joint_states", JOINT_STATE, stamp, joint_state(stamp, ["elbow"], [y]))
        for stamp, y in zip(stamps, angle, strict=True)
    ]
    if path.suffix == ".mf4":
        made = Mdf()
        made.group("joint", time, angle=("rad", angle, None))
        path.write_bytes(made.data)
    elif path.suffix == ".db3":
        write_db3(path, messages)
    else:
        write_mcap(path, messages)
