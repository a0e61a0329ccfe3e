"""The rig's MuJoCo model: the structure comes from ``mjcf/rig.xml``, the numbers from the rig description.

Drawn shapes do not affect the motion. Each is a single mesh, because MuJoCo computes the pose of
every geom in every step.
"""

from __future__ import annotations

import copy
import functools
from dataclasses import dataclass
from functools import cached_property
from importlib import resources
from math import cos, pi, radians, sin

import mujoco
import numpy as np
from numpy.typing import NDArray

from tunnel_sim.physics.moment_law import native_library, state_vector
from tunnel_sim.physics.run_settings import RunSettings, spring_end_angle
from tunnel_sim.physics.steps import check_stable
from tunnel_sim.vocabulary.errors import REINSTALLING, TunnelError, did_you_mean
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import Rig, WorkingSection, davis_vertices

BUILT_FOR = "4.0.0"
"""The version of MuJoCo for which the plugin is built, as required by ``pyproject.toml``."""


@functools.cache
def load_plugin() -> None:
    """Register the plugin with MuJoCo; a second call does nothing.

    Raises:
        TunnelError: when another version of MuJoCo is installed than the plugin is built for.
    """
    if mujoco.__version__ != BUILT_FOR:
        what = f"MuJoCo {mujoco.__version__} is installed, and the engine plugin was built for {BUILT_FOR}"
        raise TunnelError(what, remedy=f"reinstall: run {REINSTALLING}")
    mujoco.mj_loadPluginLibrary(str(native_library("vwt_plugin")))


_BEAM = 0.03  # m, width of the frame's beams
_GLASS = 0.012  # m, thickness of the walls
_CORNERS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))
_BOX_FACES = (
    (0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4),
    (1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7),
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Mesh:
    """A closed surface of triangles.

    Args:
        vertices: shape (n, 3), m.
        faces: shape (m, 3), indices of vertices, counter-clockwise seen from outside.
    """

    vertices: Array
    faces: NDArray[np.int64]


def box_mesh(low: tuple[float, float, float], high: tuple[float, float, float], turn: float = 0.0) -> Mesh:
    """A box between two corners, rotated about the vertical axis.

    Args:
        low, high: least and greatest x, y and z, m.
        turn: rotation, rad, counter-clockwise seen from above.
    """
    vertices = np.asarray(low) + np.array(_CORNERS, dtype=float) * (np.asarray(high) - np.asarray(low))
    rotation = np.array([[cos(turn), -sin(turn), 0.0], [sin(turn), cos(turn), 0.0], [0.0, 0.0, 1.0]])
    return Mesh(vertices @ rotation.T, np.array(_BOX_FACES))


def merged_mesh(parts: list[Mesh]) -> Mesh:
    """Several surfaces as one mesh."""
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = [part.faces + start for part, start in zip(parts, starts, strict=False)]
    return Mesh(np.concatenate([part.vertices for part in parts]), np.concatenate(faces))


def coil_mesh(radius: float, wire: float, low: float, high: float, turns: int) -> Mesh:
    """A coil spring about the vertical axis.

    Args:
        radius, wire: radii of the coil and of its wire, m.
        low, high: heights of its ends, m.
    """
    around, along = 8, 24 * turns + 1
    turn = np.linspace(0.0, 2 * pi * turns, along)[:, None]
    ring = np.linspace(0.0, 2 * pi, around, endpoint=False)[None, :]
    out = radius + wire * np.cos(ring)
    height = np.linspace(low + wire, high - wire, along)[:, None] + wire * np.sin(ring)
    grid = np.stack([out * np.cos(turn), out * np.sin(turn), height], axis=-1)
    faces = []
    for i in range(along - 1):
        for k in range(around):
            here, beside = i * around + k, i * around + (k + 1) % around
            faces += [(here, here + around, beside), (beside, here + around, beside + around)]
    last = (along - 1) * around
    for k in range(1, around - 1):
        faces += [(0, k, k + 1), (last, last + k + 1, last + k)]
    return Mesh(grid.reshape(-1, 3), np.array(faces))


def floor_mesh(section: WorkingSection) -> Mesh:
    """The floor: a slab with its top at height 0."""
    x, y = section.length / 2, section.width / 2
    return box_mesh((-x, -y, -_BEAM), (x, y, 0.0))


def glass_mesh(section: WorkingSection) -> Mesh:
    """Two walls and the ceiling; the section is open along the flow."""
    x, y, z = section.length / 2, section.width / 2, section.height
    left, right = box_mesh((-x, y, 0.0), (x, y + _GLASS, z)), box_mesh((-x, -y - _GLASS, 0.0), (x, -y, z))
    return merged_mesh([left, right, box_mesh((-x, -y, z), (x, y, z + _GLASS))])


def frame_mesh(rig: Rig) -> Mesh:
    """The beams along the edges of the working section, and the yoke above it for spring and sensor."""
    section = rig.working_section
    x, y, z = section.length / 2, section.width / 2, section.height
    b, parts = _BEAM, []
    for side in (-y - b, y):
        for end in (-x, x - b):
            parts.append(box_mesh((end, side, -b), (end + b, side + b, z + b)))
        parts += [box_mesh((-x, side, low), (x, side + b, low + b)) for low in (-b, z)]
    parts += [box_mesh((end, -y, low), (end + b, y, low + b)) for end in (-x, x - b) for low in (-b, z)]
    half, top = 0.14, z + rig.rod.length_above_ceiling
    for side in (-half, half - b):
        parts.append(box_mesh((-b / 2, side, z + _GLASS), (b / 2, side + b, top)))
    parts.append(box_mesh((-b / 2, -y, z), (b / 2, y, z + b)))  # the beam across the ceiling, below the frame
    return merged_mesh([*parts, box_mesh((-b, -half, top), (b, half, top + b / 2))])


def marks_mesh(rig: Rig) -> Mesh:
    """Lines on the floor: the wind direction, and a mark every ten degrees of yaw around the body."""
    reach, height = 0.62 * rig.body.length, 0.002
    x = rig.working_section.length / 2
    parts = [box_mesh((-x, -0.003, 0.0), (x, 0.003, height))]
    for degrees in range(-60, 61, 10):
        length = 0.07 if degrees % 30 == 0 else 0.04
        for turn in (radians(degrees), radians(degrees) + pi):
            parts.append(box_mesh((reach, -0.003, 0.0), (reach + length, 0.003, height), turn))
    return merged_mesh(parts)


_SERIES = ("wind_speed", "forcing", "ambient")
_THINNEST = 1e-3  # least ratio of width to length: MuJoCo refuses the inertias of a body of zero width
_COMPILED: dict[tuple[object, ...], mujoco.MjModel] = {}  # by rig and layout; callers get copies only
_MOST_COMPILED = 16
_NATIVE = frozenset({"spring_stiffness", "mechanical_damping", "yaw_inertia"})  # attributes of joint and body


@dataclass(frozen=True, eq=False)
class Model:
    """A compiled model of the rig in one run."""

    mj: mujoco.MjModel
    rig: Rig
    settings: RunSettings

    @cached_property
    def spec(self) -> mujoco.MjSpec:
        """The complete MJCF specification; ``spec.to_xml()`` writes it."""
        return build_spec(self.rig, self.settings)

    @cached_property
    def yaw_address(self) -> int:
        """Index of the angle of the rod's upper end in ``qpos``, and of its rate in ``qvel``."""
        return int(self.mj.joint("yaw").qposadr[0])

    def with_settings(self, settings: RunSettings) -> Model:
        """The model of another run of the same `RunSettings.layout`, bit-identical to one compiled anew."""
        check_stable(self.rig, settings)
        mj = copy.copy(self.mj)
        twist = settings.rod_twist
        share = twist.inertia_share if twist is not None else 0.0
        mj.joint("yaw").stiffness = settings.spring_stiffness
        mj.joint("yaw").damping = settings.mechanical_damping
        mj.body("davis").inertia = _inertia(self.rig, settings.yaw_inertia * (1.0 - share))
        if twist is not None:
            mj.joint("rod_twist").stiffness = 1.0 / twist.compliance
            mj.joint("rod_twist").damping = twist.damping(settings.yaw_inertia)
            mj.body("rod_end").inertia = _inertia(self.rig, settings.yaw_inertia * share)
        for name, value in numerics(self.rig, settings).items():
            numeric = mujoco.mj_name2id(mj, mujoco.mjtObj.mjOBJ_NUMERIC, name)
            start = mj.numeric_adr[numeric]
            mj.numeric_data[start : start + mj.numeric_size[numeric]] = value
        try:
            mujoco.mj_setConst(mj, mujoco.MjData(mj))
        except (ValueError, mujoco.FatalError) as error:
            raise _refusal(error) from error
        return Model(mj, self.rig, settings)

    def release_state(self) -> mujoco.MjData:
        """The state at the release, with the body held and rod and spring in equilibrium."""
        data = mujoco.MjData(self.mj)
        release = self.settings.release_angle
        end = spring_end_angle(self.settings)
        if self.settings.rod_twist is not None:
            data.joint("rod_twist").qpos = release - end
        data.joint("yaw").qpos = end
        data.joint("yaw").qvel = self.settings.release_rate
        started = {"lagged": release, "angle": end, "twist": release - end, "started": 1.0}
        data.plugin_state[:] = state_vector({**started, "rate": self.settings.release_rate})
        return data


def build_model(rig: Rig, settings: RunSettings, *, drawn: bool = True) -> Model:
    """Build the model of one run; compilation, the slowest part, is done once for all runs of a layout.

    Args:
        settings: spring, damper, inertia, air and every further term of the moment law.
        drawn: whether to include shapes, lights and cameras. The motion is bit-identical without them, and a
            step takes 80 % of the time.

    Raises:
        TunnelError: when MuJoCo or the plugin refuses the settings, or the steps are too long for them.
    """
    check_stable(rig, settings)
    key = (repr(rig), settings.layout(), drawn)
    compiled = _COMPILED.get(key)
    if compiled is None:
        try:
            spec = build_spec(rig, settings)
            if not drawn:
                shapes = (*spec.geoms, *spec.sites, *spec.meshes, *spec.materials, *spec.textures)
                bodies = (spec.body("view_centre"), spec.body("working_section"))
                for part in (*shapes, *spec.lights, *spec.cameras, *bodies):
                    spec.delete(part)
            compiled = spec.compile()
        except (ValueError, mujoco.FatalError) as error:
            raise _refusal(error) from error
        if len(_COMPILED) >= _MOST_COMPILED:
            _COMPILED.clear()
        _COMPILED[key] = compiled
    return Model(compiled, rig, settings).with_settings(settings)


def _refusal(error: Exception) -> TunnelError:
    text = " ".join(str(error).split())
    return TunnelError(f"MuJoCo refuses the model: {text}", remedy="correct the run's settings")


def build_spec(rig: Rig, settings: RunSettings) -> mujoco.MjSpec:
    """The complete MJCF specification of one run."""
    load_plugin()
    with resources.as_file(resources.files("mjcf") / "rig.xml") as path:
        spec = mujoco.MjSpec.from_file(str(path))
    spec.option.timestep = settings.timestep
    section, body = rig.working_section, rig.body
    spring = coil_mesh(
        2.4 * rig.rod.diameter,
        rig.rod.diameter / 4,
        section.height + 0.25 * rig.rod.length_above_ceiling,
        section.height + 0.9 * rig.rod.length_above_ceiling,
        turns=7,
    )
    scenery = {"floor": floor_mesh(section), "glass": glass_mesh(section), "frame": frame_mesh(rig)}
    for name, piece in {**scenery, "marks": marks_mesh(rig), "spring": spring}.items():
        mesh = spec.mesh(name)
        mesh.uservert, mesh.userface = piece.vertices.ravel(), piece.faces.ravel()
    spec.body("view_centre").pos = (0.0, 0.0, 0.45 * section.height)
    centre = body.ground_clearance + body.height / 2
    top = section.height + 1.2 * rig.rod.length_above_ceiling  # the pointer turns above the yoke
    spec.body("davis").pos = (0.0, 0.0, centre)
    spec.site("nose").pos = (body.length / 2, 0.0, 0.0)
    spec.mesh("davis_body").uservert = davis_vertices(body).ravel()
    rod = spec.geom("rod")
    rod.size = (rig.rod.diameter / 2, (top - centre) / 2, 0.0)
    rod.pos = (0.0, 0.0, (top + centre) / 2)
    pointer = spec.geom("pointer")
    pointer.size = (0.07, rig.rod.diameter / 5, rig.rod.diameter / 5)
    pointer.pos = (0.07, 0.0, top)
    for geom in spec.geoms:
        geom.mass = 0.0  # mass and inertia are set below, not derived from the shapes
    twist = settings.rod_twist
    share = twist.inertia_share if twist is not None else 0.0
    _set_inertia(spec.body("davis"), rig, settings.yaw_inertia * (1.0 - share), rig.body.mass)
    yaw = spec.joint("yaw")
    yaw.stiffness[0], yaw.damping[0] = settings.spring_stiffness, settings.mechanical_damping
    if twist is not None:
        _set_inertia(spec.body("rod_end"), rig, settings.yaw_inertia * share, 0.1 * rig.body.mass)
        spec.body("davis").add_joint(name="rod_twist", type=mujoco.mjtJoint.mjJNT_HINGE, axis=(0.0, 0.0, 1.0))
        spec.joint("rod_twist").stiffness[0] = 1.0 / twist.compliance
        spec.joint("rod_twist").damping[0] = twist.damping(settings.yaw_inertia)
        spec.plugins[0].config = {"joint": "yaw", "twist_joint": "rod_twist"}
    for name, values in numerics(rig, settings).items():
        spec.add_numeric(name=name, data=list(values), size=len(values))
    return spec


def _set_inertia(body: mujoco.MjsBody, rig: Rig, yaw_inertia: float, mass: float) -> None:
    body.explicitinertial = True
    body.mass = mass
    body.ipos, body.iquat = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    body.inertia = _inertia(rig, yaw_inertia)


def _inertia(rig: Rig, yaw_inertia: float) -> tuple[float, float, float]:
    """Principal inertias, kg m²: yaw as given, the others (which never matter) in the proportions of a box."""
    length, height = rig.body.length, rig.body.height
    width = max(rig.body.width, _THINNEST * length)
    scale = yaw_inertia / (length**2 + width**2)
    return scale * (width**2 + height**2), scale * (length**2 + height**2), yaw_inertia


def numerics(rig: Rig, settings: RunSettings) -> dict[str, tuple[float, ...]]:
    """The ``<numeric>`` elements of the MJCF by name: the law's other parameters, series and program."""
    law = settings.law(rig).items()
    values: dict[str, tuple[float, ...]] = {name: (value,) for name, value in law if name not in _NATIVE}
    values["wind_speed"] = (settings.wind_speed,)
    for name, series in settings.series.items():
        if name not in _SERIES:
            raise TunnelError(f"unknown series {name!r}", remedy=did_you_mean(name, _SERIES))
        values[name] = series.values
        values[f"{name}_interval"] = (series.interval,)
    if settings.program:
        values["moment_program"] = settings.program
    if settings.drive is None:
        return values
    drive = settings.drive.acting
    times, given, held, step = drive.time_s, drive.values, drive.held, settings.timestep
    if not drive.at_steps(step):  # by its means over the steps, a method of second order
        given = drive.means(step * np.arange(round((times[-1] + max(drive.delay, 0.0)) / step) + 3))
        held = True
        times = step * np.arange(given.size, dtype=np.float64)
    return values | {
        "drive": tuple((drive.scale * given).tolist()),
        "drive_interval": (float(times[-1]) / max(1, times.size - 1),),
        "drive_held": (float(held),),
        "drive_on_end": (float(not drive.on_body),),
    }
