"""Batches against loops, determinism, null effects, and runs that are refused."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.marks import slow
from tunnel_sim.engine.model import build_model, build_spec, numerics
from tunnel_sim.engine.simulate import simulate, simulate_motion, simulate_motions
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.physics.moment_law import parameter_names
from tunnel_sim.physics.run_settings import Motion, RodTwist, RunSettings, Series
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import AeroDerivatives, SensorModel

pytestmark = pytest.mark.usefixtures("in_a_folder_of_its_own")

NOT_TERMS = {"air_density", "frontal_area", "reference_length", "width", "cn_beta", "cn_r"}
NOT_TERMS |= {"spring_stiffness", "mechanical_damping", "yaw_inertia"}
TERMS = [name for name in parameter_names() if name not in NOT_TERMS]
RIG, SENSOR = load_rig(), SensorModel(zero=0.01)
PLAIN = RunSettings(
    16.12, AeroDerivatives(0.35, -0.7), 0.1014, 0.018, wind_speed=20.0, air_density=1.204,
    release_angle=0.3, duration=1.5,
)  # fmt: skip
WIND, FORCING = Series((20.0, 22.0, 19.0), 0.6), Series((0.01, -0.02, 0.015, 0.0), 0.3)
TWIST = RodTwist(1e-3, 0.3)
MIXED = [
    PLAIN,
    replace(PLAIN, spring_stiffness=67.98, wind_speed=0.0),
    replace(PLAIN, rod_twist=TWIST),
    replace(PLAIN, series={"wind_speed": WIND}),
    replace(PLAIN, yaw_inertia=0.13, mechanical_damping=0.05, parameters={"aero_lag": 2.0}),
    replace(PLAIN, rod_twist=RodTwist(2e-3, 0.4), spring_stiffness=35.02, yaw_inertia=0.12),
    replace(PLAIN, series={"forcing": FORCING, "wind_speed": WIND}, parameters={"friction_moment": 0.02}),
    replace(PLAIN, series={"wind_speed": Series((10.0, 12.0, 14.0), 0.3)}, release_angle=-0.2),
    replace(PLAIN, duration=0.9, release_rate=0.2),
    replace(PLAIN, timestep=5e-4, parameters={"free_play": 0.01}),
    replace(PLAIN, rod_twist=TWIST, parameters={"friction_moment": 0.02, "aero_lag": -1.0}),
    replace(PLAIN, rod_twist=TWIST, parameters={"friction_moment": 0.02, "presliding": 0.003}),
    replace(
        PLAIN, parameters={"friction_moment": 0.02, "friction_exponent": 0.3, "friction_saturation": 0.1}
    ),
    replace(PLAIN, parameters={"friction_moment": 0.02, "friction_peak": 0.5, "friction_peak_rate": 0.1}),
]


@cache
def _alone(number: int) -> Motion:
    return simulate_motion(build_model(RIG, MIXED[number]), 500.0)


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_batch_equals_the_loop_to_the_bit(threads: int) -> None:
    motions = simulate_motions(RIG, MIXED, 500.0, nthread=threads)
    assert len(motions) == len(MIXED)
    for number, motion in enumerate(motions):
        alone = _alone(number)
        assert np.array_equal(motion.angle, alone.angle)
        assert np.array_equal(motion.rate, alone.rate)


def test_model_with_other_settings_equals_the_one_built_from_them() -> None:
    groups = ((MIXED[0], MIXED[4]), (MIXED[2], MIXED[5]), (MIXED[3], MIXED[7]))
    for first, second in groups:
        changed = build_model(RIG, first).with_settings(second)
        built = replace(changed, mj=build_spec(RIG, second).compile())
        assert np.array_equal(simulate_motion(changed, 1000.0).angle, simulate_motion(built, 1000.0).angle)


def test_seed_decides_the_record() -> None:
    first, again, other = (simulate(RIG, PLAIN, SENSOR, np.random.default_rng(seed)) for seed in (3, 3, 4))
    assert np.array_equal(first.yaw_rad, again.yaw_rad)
    assert not np.array_equal(first.yaw_rad, other.yaw_rad)


def test_all_terms_at_zero_are_the_nominal_model_to_the_bit() -> None:
    nominal = simulate_motion(build_model(RIG, PLAIN), 1000.0)
    own = set(numerics(RIG, PLAIN)) & {"air_density", "frontal_area", "reference_length", "cn_beta", "cn_r"}
    spec = build_model(RIG, PLAIN).spec
    for numeric in list(spec.numerics):
        if numeric.name not in own | {"wind_speed"}:
            spec.delete(numeric)
    bare = spec.compile()
    assert bare.nnumeric == len(own) + 1
    data = mujoco.MjData(bare)
    data.joint("yaw").qpos = PLAIN.release_angle
    for angle in nominal.angle[:-1]:
        assert data.qpos[0] == angle
        mujoco.mj_step(bare, data)


@pytest.mark.parametrize("name", TERMS)
def test_term_at_zero_beside_others_changes_nothing(name: str) -> None:
    busy = {"moment_cubic": 1.0, "stiffness_cubic": 1.0, "quadratic_damping": 0.01, "aero_lag": 1.0}
    without = {key: value for key, value in busy.items() if key != name}
    one, two = replace(PLAIN, parameters=without), replace(PLAIN, parameters={**without, name: 0.0})
    assert np.array_equal(
        simulate_motion(build_model(RIG, one), 1000.0).angle,
        simulate_motion(build_model(RIG, two), 1000.0).angle,
    )


def test_written_mjcf_runs_as_the_model() -> None:
    model = build_model(RIG, replace(PLAIN, rod_twist=TWIST))
    read = mujoco.MjModel.from_xml_string(model.spec.to_xml())
    assert np.array_equal(read.jnt_stiffness, model.mj.jnt_stiffness)
    assert read.body_inertia == pytest.approx(model.mj.body_inertia, rel=1e-5)
    data = mujoco.MjData(read)
    data.joint("yaw").qpos = 0.3
    mujoco.mj_step(read, data, 100)
    assert np.all(np.isfinite(data.qpos))


def test_every_element_is_named() -> None:
    model = build_model(RIG, replace(PLAIN, rod_twist=TWIST)).mj
    counts = {"BODY": model.nbody, "GEOM": model.ngeom, "JOINT": model.njnt, "SITE": model.nsite}
    counts |= {"CAMERA": model.ncam, "LIGHT": model.nlight, "MATERIAL": model.nmat, "MESH": model.nmesh}
    counts |= {"SENSOR": model.nsensor, "NUMERIC": model.nnumeric, "TEXTURE": model.ntex}
    for kind, count in counts.items():
        for i in range(count):
            assert mujoco.mj_id2name(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind}"), i), (kind, i)


def test_rig_xml_repeats_no_number_of_the_rig_description() -> None:
    text = (Path(__file__).parents[4] / "mjcf" / "rig.xml").read_text(encoding="utf-8")
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    body, section = RIG.body, RIG.working_section
    owned = {body.length, body.width, body.height, body.ground_clearance, body.mass, body.frontal_area}
    owned |= {section.width, section.height, section.length, RIG.rod.diameter, RIG.dynamics.yaw_inertia}
    owned |= {RIG.dynamics.mechanical_damping, RIG.air.density, *RIG.springs.values()}
    looks = re.compile(r"<(texture|material|light|camera|global|quality|headlight|map|rgba)\b[^>]*>")
    found = {float(number) for number in re.findall(r"[\d.]*\d", looks.sub("", text))}
    assert not found & owned


def test_a_run_of_more_steps_than_are_recorded_at_once_is_integrated_by_itself(monkeypatch) -> None:
    together = simulate_motions(RIG, MIXED[:2], 1000.0)
    monkeypatch.setattr("tunnel_sim.engine.simulate._CHUNK_STEPS", 1000)
    for one, other in zip(simulate_motions(RIG, MIXED[:2], 1000.0), together, strict=True):
        np.testing.assert_array_equal(one.angle, other.angle)


def test_progress_counts_all_runs() -> None:
    seen: list[tuple[int, int]] = []
    simulate_motions(RIG, MIXED[:4], 1000.0, progress=lambda done, total: seen.append((done, total)))
    assert seen[-1] == (4, 4)
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)


@pytest.mark.parametrize(
    "changes",
    [
        {"spring_stiffness": 0.5},
        {"parameters": {"stiffness_cubic": -200.0}},
        {"parameters": {"quadratic_damping": -5.0}},  # so fast that MuJoCo's automatic reset would hide it
    ],
)
@pytest.mark.parametrize("sample_rate", [slow(1000.0), 50.0])
def test_motion_without_bound_is_refused(changes: dict[str, object], sample_rate: float) -> None:
    wild = replace(PLAIN, duration=20.0, **changes)  # type: ignore[arg-type]
    with pytest.raises(TunnelError, match="without bound"):
        simulate_motion(build_model(RIG, wild), sample_rate)
    with pytest.raises(TunnelError, match=r"run 2: .*without bound"):
        simulate_motions(RIG, [replace(PLAIN, duration=20.0), wild], sample_rate)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"yaw_inertia": 0.0}, "yaw_inertia"),
        ({"yaw_inertia": -0.1}, "yaw_inertia"),
        ({"spring_stiffness": -1.0}, "spring_stiffness"),
        ({"air_density": -1.0}, "air_density"),
        ({"wind_speed": -1.0}, "wind_speed"),
        ({"wind_speed": float("nan")}, "wind_speed"),
        ({"mechanical_damping": float("inf")}, "mechanical_damping"),
        ({"release_angle": float("nan")}, "release_angle"),
        ({"duration": 0.0}, "duration"),
        ({"timestep": 0.0}, "timestep"),
        ({"parameters": {"cn_beta": 1.0}}, "cn_beta"),
        ({"parameters": {"aero_lagg": 1.0}}, "did you mean 'aero_lag'"),
        ({"series": {"wind_speed": Series((20.0, -1.0), 1.0)}}, "wind_speed"),
    ],
)
def test_settings_out_of_range_are_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(TunnelError, match=message):
        replace(PLAIN, **changes)  # type: ignore[arg-type]


@pytest.mark.parametrize("arguments", [(0.0, 0.3), (1e-3, 0.0), (1e-3, 1.0), (1e-3, 0.3, -0.1)])
def test_rod_out_of_range_is_refused(arguments: tuple[float, ...]) -> None:
    with pytest.raises(TunnelError, match=r"rod|body"):
        RodTwist(*arguments)


@pytest.mark.parametrize("arguments", [((), 1.0), ((1.0, float("nan")), 1.0), ((1.0,), 0.0)])
def test_series_out_of_range_is_refused(arguments: tuple[tuple[float, ...], float]) -> None:
    with pytest.raises(TunnelError, match="series"):
        Series(*arguments)


def test_parameter_out_of_range_is_refused_by_name_in_loop_and_batch() -> None:
    bad = replace(PLAIN, parameters={"friction_moment": -1.0})
    with pytest.raises(TunnelError, match="friction_moment"):
        build_model(RIG, bad)
    with pytest.raises(TunnelError, match="friction_moment"):
        simulate_motions(RIG, [PLAIN, bad], 1000.0)


def test_unknown_series_is_refused() -> None:
    with pytest.raises(TunnelError, match="did you mean 'wind_speed'"):
        build_model(RIG, replace(PLAIN, series={"windspeed": WIND}))


def test_sample_interval_must_be_whole_steps() -> None:
    with pytest.raises(TunnelError, match="whole number"):
        simulate_motion(build_model(RIG, PLAIN), 300.0)


def test_flexible_rod_is_released_in_balance() -> None:
    model = build_model(RIG, replace(PLAIN, rod_twist=TWIST, wind_speed=0.0))
    data = model.release_state()
    end, twist = data.joint("yaw").qpos[0], data.joint("rod_twist").qpos[0]
    assert end + twist == pytest.approx(PLAIN.release_angle, rel=1e-15)
    assert PLAIN.spring_stiffness * end == pytest.approx(twist / TWIST.compliance, rel=1e-12)


def test_the_timers_of_mujoco_go_on_after_a_simulation() -> None:
    model = build_model(RIG, PLAIN)
    simulate_motion(model, 100.0)
    simulate_motions(RIG, [PLAIN], 100.0)
    data = model.release_state()
    mujoco.mj_step(model.mj, data)
    assert data.timer[mujoco.mjtTimer.mjTIMER_STEP].duration > 0.0
