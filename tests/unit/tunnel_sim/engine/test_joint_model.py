"""Models of one's own: the law of a joint against closed forms, what is refused, and the law written back."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest

from diagnosis.patch.elements import Damper, DryFriction, Inertia, PluginMoment, Spring
from tunnel_sim.engine import joint_model
from tunnel_sim.engine.joint_model import JointModel, Recorded, read_joint_model
from tunnel_sim.engine.joint_patch import Element, Start, patched, patched_xml, simulate_joint
from tunnel_sim.physics.expression import parse
from tunnel_sim.sandbox import in_sandbox
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError

pytestmark = pytest.mark.usefixtures("models_in_this_process")

MASS, LENGTH, G = 0.4, 0.3, 9.81
BOB = f'<geom name="bob" type="sphere" size="0.02" mass="{MASS}" pos="0 0 {-LENGTH}"/>'
INERTIA = MASS * LENGTH**2 + 0.4 * MASS * 0.02**2
BODY = '<body name="arm"><joint name="hinge" axis="0 1 0" {}/>{}</body>'


@pytest.fixture
def with_limits(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is about the process with limits waits for it."""
    request.getfixturevalue("models_in_this_process")
    monkeypatch.setattr(joint_model, "in_sandbox", in_sandbox)


def model(
    folder: Path,
    joint: str = "",
    *,
    body: str = BODY,
    option: str = "",
    gravity: float = G,
    more: str = "",
    reach: float = 1.0,
    **rest,
) -> JointModel:
    path = folder / "model.xml"
    path.write_text(
        f'<mujoco><compiler angle="radian"/><option gravity="0 0 {-gravity}" {option}/><worldbody>'
        f"{body.format(joint, BOB)}{more}</worldbody></mujoco>"
    )
    return read_joint_model(path, "hinge", Recorded(reach), **rest)


def terms(found: JointModel) -> dict[str, float]:
    return {term.expression: term.coefficient for term in found.law.terms}


def test_a_pendulum_is_a_pendulum(tmp_path: Path) -> None:
    law = model(tmp_path, 'damping="0.01" frictionloss="0.002" armature="0.001"').law
    assert law.inertia == pytest.approx(INERTIA + 0.001, rel=1e-12)
    assert law.stiffness == pytest.approx(MASS * G * LENGTH, rel=1e-9)
    assert [(t.expression, t.unit) for t in law.terms] == [("sin(b)-b", "N m")]
    assert law.terms[0].coefficient == pytest.approx(MASS * G * LENGTH, rel=1e-9)
    assert (law.damping, law.friction, law.rest) == pytest.approx((0.01, 0.002, 0.0), abs=1e-9)
    assert law.free == ("inertia", "damping", "rest")


def test_a_tilted_axis_takes_its_share_of_gravity(tmp_path: Path) -> None:
    tilt = 0.7
    body = BODY.replace("0 1 0", f"{math.sin(tilt)} {math.cos(tilt)} 0").replace("pos=", "pos=")
    law = model(tmp_path, body=body).law  # the axis stays horizontal: the whole of gravity acts
    assert law.stiffness == pytest.approx(MASS * G * LENGTH, rel=1e-9)
    law = model(tmp_path, body=BODY.replace("0 1 0", f"0 {math.cos(tilt)} {math.sin(tilt)}")).law
    arm = LENGTH * math.cos(tilt)
    assert law.stiffness == pytest.approx(MASS * G * math.cos(tilt) * arm, rel=1e-9)


def test_springs_of_any_power_about_the_rest_position(tmp_path: Path) -> None:
    found = model(tmp_path, 'stiffness="2 0.3 0.5" springref="0.2" ref="-0.1"', gravity=0.0)
    assert found.law.rest == pytest.approx(0.2, abs=1e-12)
    assert found.law.stiffness == pytest.approx(2.0)
    assert terms(found) == pytest.approx({"b^2": 0.3, "b^3": 0.5})


def test_spring_and_gravity_balance_at_rest(tmp_path: Path) -> None:
    found = model(tmp_path, 'stiffness="2" springref="0.5" ref="0.3"')
    rest, weight = found.law.rest, MASS * G * LENGTH
    assert 2.0 * (rest - 0.5) + weight * math.sin(rest - 0.3) == pytest.approx(0.0, abs=1e-10)
    assert found.law.stiffness == pytest.approx(2.0 + weight * math.cos(rest - 0.3))
    assert found.law.free == ("inertia", "damping", "stiffness", "rest")


def test_a_slide_on_a_spring_hangs_lower(tmp_path: Path) -> None:
    body = '<body><joint name="hinge" type="slide" axis="0 0 1" {}/>{}</body>'
    law = model(tmp_path, 'stiffness="50" armature="0.1"', body=body, reach=0.05).law
    assert (law.inertia, law.stiffness) == pytest.approx((MASS + 0.1, 50.0))
    assert law.rest == pytest.approx(-MASS * G / 50.0)
    assert law.slide
    assert law.terms == ()


def test_damping_of_any_power(tmp_path: Path) -> None:
    found = model(tmp_path, 'damping="0.01 0.02 0.003"')
    assert found.law.damping == pytest.approx(0.01, rel=1e-6)
    assert {k: v for k, v in terms(found).items() if "r" in k} == pytest.approx(
        {"abs(r)*r": 0.02, "r^3": 0.003}
    )


def test_a_urdf_is_read(tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(
        '<robot name="r"><link name="base"/><link name="arm"><inertial><origin xyz="0 0 -0.3"/><mass value="0.4"/>'
        '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="hinge" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>'
        '<dynamics damping="0.1" friction="0.01"/></joint></robot>'
    )
    law = read_joint_model(path, "hinge", Recorded(1.0)).law
    assert (law.inertia, law.damping, law.friction) == pytest.approx((0.01 + 0.4 * 0.09, 0.1, 0.01))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"joint": 'range="-0.5 0.5" limited="true"'}, "a limit or another constraint acts"),
        ({"more": '<geom name="wall" size="0.1" pos="0.2 0 -0.25"/>'}, "wall and bob touch"),
        ({"body": BODY.replace("</body>", '<body><joint name="two"/><geom size=".1"/></body></body>')},
         "other joints move too: two"),
        ({"body": BODY.replace("0 1 0", "0 0 1")}, "does not oscillate"),
        ({"body": BODY.replace('name="hinge"', 'name="hinges"')}, "did you mean 'hinges'?"),
        ({"body": '<body><joint name="hinge" type="ball"/>{}{}</body>'}, "is not a hinge or slide"),
        ({"body": BODY.replace("axis=", "axes=")}, "MuJoCo cannot load it"),
        ({"option": 'timestep="0"'}, "its timestep of 0.0 s is not above zero"),
        ({"option": 'timestep="-1"'}, "its timestep of -1.0 s is not above zero"),
        ({"body": BODY.replace("0 1 0", "0 1 -1e308"), "joint": 'stiffness="1"'}, "its inertia is 0 kg m2"),
        ({"free": ("mass",)}, "unknown parameter 'mass'"),
        ({"free": ("inertia", "stiffness"), "joint": 'stiffness="1"', "gravity": 0.0}, "cannot both be"),
    ],
)  # fmt: skip
def test_what_cannot_be_the_nominal_model_is_refused_in_one_line(
    tmp_path: Path, change: dict, said: str
) -> None:
    with pytest.raises(TunnelError) as refusal:
        model(tmp_path, **change)
    assert said in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert refusal.value.remedy


def test_a_spring_of_tendons_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "tendon.xml"
    path.write_text(
        '<mujoco><worldbody><site name="a" pos="0.5 0 0"/><body><joint name="hinge" axis="0 1 0"/>'
        f'{BOB}<site name="b" pos="0 0 -0.3"/></body></worldbody><tendon>'
        '<spatial stiffness="30" springlength="0.1"><site site="a"/><site site="b"/></spatial></tendon></mujoco>'
    )
    with pytest.raises(TunnelError, match="its restoring moment comes not only from gravity and springs"):
        read_joint_model(path, "hinge", Recorded(1.0))


def reread(found: JointModel, folder: Path, *elements: Element) -> JointModel:
    spec, _ = patched(found, elements)
    path = folder / "out.xml"
    path.write_text(patched_xml(spec, found, folder))
    assert 'armature="-' not in path.read_text()
    return read_joint_model(path, "hinge", Recorded(0.05 if found.law.slide else 1.0))


@pytest.mark.parametrize("share", [0.6, 0.98, 1.3])
def test_the_inertia_written_leaves_gravity_as_it_is(tmp_path: Path, share: float) -> None:
    found = model(tmp_path, 'pos="0 0.1 0.05"')
    law = reread(found, tmp_path, Inertia(share * found.law.inertia)).law
    assert law.inertia == pytest.approx(share * found.law.inertia, rel=1e-5)
    assert law.stiffness == pytest.approx(found.law.stiffness, rel=1e-5)


@pytest.mark.parametrize("share", [0.6, 1.3])
def test_a_slide_keeps_its_place_as_its_inertia_changes(tmp_path: Path, share: float) -> None:
    body = '<body><joint name="hinge" type="slide" axis="0 0 1" {}/>{}</body>'
    found = model(tmp_path, 'stiffness="50 0 900" springref="0.02"', body=body, reach=0.05)
    law = reread(found, tmp_path, Inertia(share * found.law.inertia), Spring()).law
    assert (law.inertia, law.rest) == pytest.approx((share * found.law.inertia, found.law.rest), rel=1e-5)
    assert law.stiffness == pytest.approx(found.law.stiffness, rel=1e-4)


def test_springs_and_dampers_are_added_to_those_of_the_model(tmp_path: Path) -> None:
    found = model(tmp_path, 'stiffness="2 0 0.4" springref="0.5" damping="0.01"')
    added = Spring((0.0, 0.3, 0.2, 0.1)), Damper((0.02, 0.03, 0.0)), DryFriction(0.004)
    new = reread(found, tmp_path, *added)
    assert new.law.rest == pytest.approx(found.law.rest, abs=1e-5)
    assert new.law.stiffness == pytest.approx(found.law.stiffness + 0.3, rel=1e-5)
    before, after = terms(found), terms(new)
    assert after["b^2"] == pytest.approx(before["b^2"] + 0.2, rel=1e-4)
    assert after["b^3"] == pytest.approx(before["b^3"] + 0.1, rel=1e-4)
    assert (new.law.damping, after["abs(r)*r"], new.law.friction) == pytest.approx(
        (0.03, 0.03, 0.004), rel=1e-5
    )


def test_degrees_stay_degrees(tmp_path: Path) -> None:
    found = model(tmp_path, 'ref="30"', body=BODY)
    text = (tmp_path / "model.xml").read_text().replace('angle="radian"', 'angle="degree"')
    (tmp_path / "model.xml").write_text(text)
    found = read_joint_model(tmp_path / "model.xml", "hinge", Recorded(1.0))
    assert found.law.rest == pytest.approx(math.radians(30.0))
    new = reread(found, tmp_path, Spring((0.0, 0.5, 0.0, 0.0)))
    assert new.law.rest == pytest.approx(math.radians(30.0), abs=1e-5)


def test_a_moment_without_a_native_element_is_a_program_of_the_plugin(tmp_path: Path) -> None:
    found = model(tmp_path, 'ref="0.3"')
    formula = parse("-0.5*abs(b-0.3)*sin(3*b)-0.1*r", frozenset("br"))
    program = formula.program({}, {"b": "angle", "r": "rate"})
    spec, written = patched(found, [PluginMoment(program)])
    assert [w.name for w in written] == ["plugin vwt.yaw_moment"]
    (tmp_path / "out.xml").write_text(patched_xml(spec, found, tmp_path))
    engine = mujoco.MjModel.from_xml_path(str(tmp_path / "out.xml"))
    data = mujoco.MjData(engine)
    data.qpos[0], data.qvel[0] = 0.8, 1.5
    mujoco.mj_forward(engine, data)
    assert data.qfrc_passive[0] == pytest.approx(float(formula.value({"b": 0.8, "r": 1.5})), rel=1e-5)


def test_the_patched_model_moves_as_the_law_says(tmp_path: Path) -> None:
    from scipy.integrate import solve_ivp

    found = model(tmp_path, 'ref="0.3"', option='integrator="RK4" timestep="0.001"')
    inertia = 1.1 * found.law.inertia
    patch = Inertia(inertia), Spring((0.0, 0.4, 0.1, 0.2)), Damper((0.002, 0.003, 0.0))
    spec, _ = patched(found, patch, [Start("r1", 0.0, 1.2, -0.5)])
    motion = simulate_joint(spec.compile(), found.law.rest, Start("r1", 0.0, 1.2, -0.5), 3.0)
    weight = MASS * G * LENGTH

    def slope(_: float, state: np.ndarray) -> tuple[float, float]:
        b, r = state
        moment = -weight * math.sin(b) - 0.4 * b - 0.1 * b**2 - 0.2 * b**3 - 0.002 * r - 0.003 * abs(r) * r
        return r, moment / inertia

    exact = solve_ivp(
        slope, (0.0, 3.0), (1.2, -0.5), "DOP853", motion.time_s[motion.time_s <= 3.0], rtol=1e-10
    )
    assert motion.angle[: exact.t.size] == pytest.approx(exact.y[0], abs=2e-6)


def test_meshes_are_found_from_another_folder(tmp_path: Path) -> None:
    (tmp_path / "in" / "assets").mkdir(parents=True)
    (tmp_path / "out").mkdir()
    corners = ["0 0 0", "0.1 0 0", "0 0.1 0", "0 0 -0.5"]
    faces = ["1 3 2", "1 2 4", "2 3 4", "3 1 4"]
    lines = [f"v {c}" for c in corners] + [f"f {f}" for f in faces]
    (tmp_path / "in" / "assets" / "arm.obj").write_text("\n".join(lines) + "\n")
    (tmp_path / "in" / "model.xml").write_text(
        '<mujoco><compiler meshdir="assets"/><asset><mesh name="arm" file="arm.obj"/></asset><worldbody><body>'
        '<joint name="hinge" axis="0 1 0"/><geom type="mesh" mesh="arm"/></body></worldbody></mujoco>'
    )
    found = read_joint_model(tmp_path / "in" / "model.xml", "hinge", Recorded(1.0))
    spec, _ = patched(found, [DryFriction(0.1)])
    (tmp_path / "out" / "out.xml").write_text(patched_xml(spec, found, tmp_path / "out"))
    law = read_joint_model(
        tmp_path / "out" / "out.xml", "hinge", Recorded(1.0), asset_dir=tmp_path / "in"
    ).law
    assert law.friction == pytest.approx(0.1)
    assert law.stiffness == pytest.approx(found.law.stiffness, rel=1e-5)


def written(folder: Path, text: str) -> Path:
    path = folder / "model.xml"
    path.write_text(text)
    return path


MESH = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 -0.5\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
ARM = '<body><joint name="hinge" axis="0 1 0"/>{}</body>'
OF_MESH = (
    '<mujoco>{}<asset><mesh name="arm" file="arm.obj"/></asset><worldbody>'
    + ARM.format('<geom type="mesh" mesh="arm"/>')
    + "</worldbody></mujoco>"
)
PENDULUM = f"<mujocoinclude><worldbody>{ARM.format(BOB)}</worldbody></mujocoinclude>"


@pytest.mark.usefixtures("with_limits")
def test_the_law_from_the_process_with_limits_is_the_same(tmp_path: Path) -> None:
    found = model(tmp_path, 'stiffness="2 0.3" springref="0.5" frictionloss="0.002"')
    names, contents = found.files.to_parts()
    request = {"joint": "hinge", "recorded": {"reach": 1.0}, "names": names}
    here, _ = joint_model.law_of_request(request, contents)
    assert (found.law.rest, found.law.stiffness) == (here["law"]["rest"], here["law"]["stiffness"])
    assert terms(found) == {term["expression"]: term["coefficient"] for term in here["law"]["terms"]}
    assert found.law.free == ("inertia", "damping", "stiffness", "rest")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f'<mujoco><asset><hfield name="h" nrow="100000" ncol="100000" size="1 1 1 1"/></asset><worldbody>'
         f"{ARM.format(BOB)}</worldbody></mujoco>", "not enough memory"),
        (f'<mujoco><size memory="100G"/><worldbody>{ARM.format(BOB)}</worldbody></mujoco>', "memory"),
        ('<mujoco><worldbody><replicate count="100000000"><geom size="1"/></replicate>'
         f"{ARM.format(BOB)}</worldbody></mujoco>", "takes more than 0.2 s; leave out"),
    ],
    ids=["height field", "arena", "copies"],
)  # fmt: skip
@pytest.mark.usefixtures("with_limits")
def test_a_model_that_takes_too_much_is_refused(
    tmp_path: Path, text: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, "MODEL_SECONDS", 0.2)
    with pytest.raises(TunnelError, match=said):
        read_joint_model(written(tmp_path, text), "hinge", Recorded(1.0))


def long(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(400 * 2**20)  # of holes


def link(path: Path) -> None:
    path.symlink_to("/etc/hostname")


@pytest.mark.parametrize(
    ("text", "name", "make", "said"),
    [
        ("", "model.xml", os.mkfifo, "model.xml: cannot be read (it is not a regular file)"),
        ("", "model.xml", long, "model.xml: 419,430,400 bytes, more than 16,777,216"),
        ('<mujoco><include file="more.xml"/></mujoco>', "more.xml", os.mkfifo, "more.xml: cannot be read (it"),
        ('<mujoco><include file="more.xml"/></mujoco>', "more.xml", long, "more.xml: 419,430,400 bytes"),
        (OF_MESH.format(""), "arm.obj", os.mkfifo, "arm.obj: cannot be read (it is not a regular file)"),
        (OF_MESH.format(""), "arm.obj", long, "arm.obj: 419,430,400 bytes, more than 134,217,728"),
        (OF_MESH.format(""), "arm.obj", link, "names 'arm.obj', which is outside the model's folder"),
        (OF_MESH.format(""), "arm.obj", Path.mkdir, "MuJoCo cannot load it"),
        ('<mujoco><include file="/etc/hostname"/></mujoco>', "", os.mkfifo, "'/etc/hostname', which is outside"),
        ("<mujoco><include file='sub/../../more.xml'/></mujoco>", "../more.xml", os.mkfifo, "'../more.xml', wh"),
        ('<mujoco><include file="a.xml"/></mujoco>', "a.xml", lambda p: p.write_bytes(b"\xff"), "not UTF-8"),
        ('<mujoco><include file="model.xml"/></mujoco>', "", os.mkfifo, "MuJoCo cannot load it"),
        ('<mujoco><include file="&#0;"/></mujoco>', "", os.mkfifo, "MuJoCo cannot load it"),
        ("<mujoco>" + "".join(f'<include file="{i}"/>' for i in range(1001)), "", os.mkfifo, "1,001 names"),
        ("<mujoco>" + "".join(f'<compiler meshdir="{i}"/>' for i in range(21)), "", os.mkfifo, "21 folders"),
    ],
)  # fmt: skip
def test_only_small_regular_files_beside_the_model_are_read(
    tmp_path: Path, text: str, name: str, make: Callable[[Path], None], said: str
) -> None:
    (tmp_path / "in").mkdir()
    if text:
        written(tmp_path / "in", text)
    if name:
        make(tmp_path / "in" / name)
    with pytest.raises(TunnelError) as refusal:
        read_joint_model(tmp_path / "in" / "model.xml", "hinge", Recorded(1.0))
    assert said in str(refusal.value)
    assert refusal.value.remedy


@pytest.mark.usefixtures("with_limits")
def test_a_file_that_is_named_in_no_usual_way_is_not_opened(tmp_path: Path) -> None:
    """What the reading of the names overlooks, MuJoCo cannot open in the process with limits."""
    text = '<mujoco><include a=">" file="more.xml"/></mujoco>'
    (tmp_path / "more.xml").write_text(PENDULUM)
    with pytest.raises(TunnelError, match="MuJoCo cannot load it"):
        read_joint_model(written(tmp_path, text), "hinge", Recorded(1.0))


@pytest.mark.parametrize(
    ("text", "names"),
    [
        (OF_MESH.format('<compiler meshdir="parts"/>'), {"parts/arm.obj": MESH}),
        (OF_MESH.format("").replace("arm.obj", "parts\\arm.obj"), {"parts/arm.obj": MESH}),
        (OF_MESH.format('<compiler strippath="true"/>').replace("arm.obj", "/home/me/arm.obj"), {"arm.obj": MESH}),
        ('<mujoco><include file="sub/a.xml"/></mujoco>',
         {"sub/a.xml": '<mujocoinclude><include file="b.xml"/></mujocoinclude>', "sub/b.xml": PENDULUM}),
        ('<mujoco><!-- <mesh file="/etc/hostname"/> --><include file="a.xml"/></mujoco>', {"a.xml": PENDULUM}),
        ('<mujoco><asset><model name="m" file="sub/m.xml"/></asset><worldbody>'
         '<attach model="m" body="b" prefix="hin"/></worldbody></mujoco>',
         {"sub/m.xml": OF_MESH.format("").replace("<body>", '<body name="b">').replace("hinge", "ge"),
          "sub/arm.obj": MESH}),
        ('<mujoco><asset><mesh name="arm" file="l/a.obj"/><mesh name="other" file="r/a.obj"/></asset><worldbody>'
         '<geom type="mesh" mesh="other" contype="0" conaffinity="0"/>'
         + ARM.format('<geom type="mesh" mesh="arm"/>') + "</worldbody></mujoco>",
         {"l/a.obj": MESH, "r/a.obj": MESH.replace("v 0 0", "v 9 9")}),
    ],
    ids=["meshdir", "backslash", "strippath", "nested", "comment", "submodel", "same name"],
)  # fmt: skip
def test_its_files_are_found_as_mujoco_finds_them(tmp_path: Path, text: str, names: dict[str, str]) -> None:
    for name, content in names.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(content)
    found = read_joint_model(written(tmp_path, text), "hinge", Recorded(1.0))
    direct = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml")) if "home" not in text else None
    assert found.law.stiffness > 0.0
    if direct is not None:
        assert found.spec().compile().body_mass == pytest.approx(direct.body_mass)


def test_another_file_of_the_same_name_is_not_taken(tmp_path: Path) -> None:
    (tmp_path / "l").mkdir()
    (tmp_path / "l" / "a.obj").write_text(MESH)
    text = (
        OF_MESH.format("")
        .replace("</asset>", '<mesh name="b" file="l/a.obj"/></asset>')
        .replace("arm.obj", "a.obj")
    )
    with pytest.raises(TunnelError, match=r"names 'a\.obj', which is not there"):
        read_joint_model(written(tmp_path, text), "hinge", Recorded(1.0))


def test_files_of_another_folder_where_it_is_named(tmp_path: Path) -> None:
    for name in ("in", "parts"):
        (tmp_path / name).mkdir()
    (tmp_path / "parts" / "arm.obj").write_text(MESH)
    path = written(tmp_path / "in", OF_MESH.format('<compiler meshdir="../parts"/>'))
    with pytest.raises(TunnelError, match="--asset-dir"):
        read_joint_model(path, "hinge", Recorded(1.0))
    assert read_joint_model(path, "hinge", Recorded(1.0), asset_dir=tmp_path / "parts").law.stiffness > 0.0


def test_names_and_numbers_that_no_text_holds(tmp_path: Path) -> None:
    (tmp_path / "model.xml").write_bytes(BODY.format("", "").encode().replace(b"hinge", b"h\xff"))
    with pytest.raises(TunnelError, match="not UTF-8 text"):
        read_joint_model(tmp_path / "model.xml", "h\udcff", Recorded(1.0))
    model(tmp_path)
    with pytest.raises(TunnelError, match="there is no such joint; did you mean 'hinge'"):
        read_joint_model(tmp_path / "model.xml", "hing\udcff", Recorded(1.0))
    with pytest.raises(TunnelError, match="its moment overflows"):
        model(tmp_path, gravity=1e308)
