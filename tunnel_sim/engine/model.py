"""The rig's MuJoCo model: the structure comes from ``mjcf/rig.xml``, the numbers from the rig description."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import resources

import mujoco
import numpy as np

from tunnel_sim.engine import scenery
from tunnel_sim.engine.plugin import load_plugin
from tunnel_sim.physics.moment_law import state_vector
from tunnel_sim.physics.release import spring_end_angle
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.physics.steps import check_stable
from tunnel_sim.vocabulary.davis import davis_vertices
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import Rig

_SERIES = ("wind_speed", "forcing")
_THINNEST = 1e-3  # least width over length: MuJoCo refuses the inertias of a body of zero width
_COMPILED: dict[tuple[object, ...], mujoco.MjModel] = {}  # by rig and layout; only copies are given away
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
        """The same model with the numbers of another run, without compiling again.

        Args:
            settings: must have the same layout: see `RunSettings.layout`.

        Returns:
            A model whose physics is bit-identical to that of one compiled from ``build_spec(rig, settings)``.

        Raises:
            TunnelError: when the plugin refuses the numbers, or the steps are too long for them.
        """
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
        mj.numeric_data[:] = numeric_vector(mj, numerics(self.rig, settings))
        try:
            mujoco.mj_setConst(mj, mujoco.MjData(mj))
        except (ValueError, mujoco.FatalError) as error:
            raise _refusal(error) from error
        return Model(mj, self.rig, settings)

    def release_state(self) -> mujoco.MjData:
        """The state at the release, where the body has been held at its angle until now.

        With a flexible rod the body is at the release angle, and the rod's upper end is in equilibrium between
        spring and twisted rod. The plugin's state starts there too: the lag at the body's angle, the deflection
        of the friction contact at zero.
        """
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
    """Build the model of one run; compiled, which takes nearly all of the time, once for all runs of a layout.

    Args:
        settings: spring, damper, inertia, air and every further term of the moment law.
        drawn: with the shapes, lights and cameras. The motion is bit-identical without them, and a step takes four
            fifths of the time.

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
                _undraw(spec)
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
    _place_scenery(spec, rig)
    _place_rig(spec, rig)
    _set_dynamics(spec, rig, settings)
    _set_numerics(spec, rig, settings)
    return spec


def _undraw(spec: mujoco.MjSpec) -> None:
    shapes = (*spec.geoms, *spec.sites, *spec.meshes, *spec.materials, *spec.textures)
    bodies = (spec.body("view_centre"), spec.body("working_section"))
    for part in (*shapes, *spec.lights, *spec.cameras, *bodies):
        spec.delete(part)


def _place_scenery(spec: mujoco.MjSpec, rig: Rig) -> None:
    section, rod = rig.working_section, rig.rod
    spring = scenery.coil(
        2.4 * rod.diameter, rod.diameter / 4, section.height + 0.25 * rod.length_above_ceiling,
        section.height + 0.9 * rod.length_above_ceiling, turns=7,
    )  # fmt: skip
    pieces = {
        "floor": scenery.floor(section),
        "glass": scenery.glass(section),
        "frame": scenery.frame(rig),
        "marks": scenery.marks(rig),
        "spring": spring,
    }
    for name, piece in pieces.items():
        mesh = spec.mesh(name)
        mesh.uservert, mesh.userface = piece.vertices.ravel(), piece.faces.ravel()
    spec.body("view_centre").pos = (0.0, 0.0, 0.45 * section.height)


def _place_rig(spec: mujoco.MjSpec, rig: Rig) -> None:
    body = rig.body
    centre = body.ground_clearance + body.height / 2
    top = rig.working_section.height + 1.2 * rig.rod.length_above_ceiling  # the pointer turns above the yoke
    spec.body("davis").pos = (0.0, 0.0, centre)
    spec.site("nose").pos = (body.length / 2, 0.0, 0.0)
    spec.mesh("davis_body").uservert = davis_vertices(body).ravel()
    rod = spec.geom("rod")
    rod.size = (rig.rod.diameter / 2, (top - centre) / 2, 0.0)
    rod.pos = (0.0, 0.0, (top + centre) / 2)
    pointer = spec.geom("pointer")
    pointer.size = (0.07, rig.rod.diameter / 5, rig.rod.diameter / 5)
    pointer.pos = (0.07, 0.0, top)


def _set_dynamics(spec: mujoco.MjSpec, rig: Rig, settings: RunSettings) -> None:
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


def _set_inertia(body: mujoco.MjsBody, rig: Rig, yaw_inertia: float, mass: float) -> None:
    body.explicitinertial = True
    body.mass = mass
    body.ipos, body.iquat = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    body.inertia = _inertia(rig, yaw_inertia)


def _inertia(rig: Rig, yaw_inertia: float) -> tuple[float, float, float]:
    """Principal inertias, kg m²: yaw as given, the others (which never matter) as of a box in proportion."""
    length, height = rig.body.length, rig.body.height
    width = max(rig.body.width, _THINNEST * length)
    scale = yaw_inertia / (length**2 + width**2)
    return scale * (width**2 + height**2), scale * (length**2 + height**2), yaw_inertia


def _set_numerics(spec: mujoco.MjSpec, rig: Rig, settings: RunSettings) -> None:
    for name, values in numerics(rig, settings).items():
        spec.add_numeric(name=name, data=list(values), size=len(values))


def numerics(rig: Rig, settings: RunSettings) -> dict[str, tuple[float, ...]]:
    """The ``<numeric>`` elements of the MJCF: the moment law's parameters, sampled inputs and program.

    Args:
        rig: gives frontal area, reference length and width.

    Returns:
        Values by name, without those that are attributes of joint and body.

    Raises:
        TunnelError: when a series has an unknown name.
    """
    law = settings.law(rig)
    values: dict[str, tuple[float, ...]] = {
        name: (value,) for name, value in law.items() if name not in _NATIVE
    }
    values["wind_speed"] = (settings.wind_speed,)
    for name, series in settings.series.items():
        if name not in _SERIES:
            raise TunnelError(f"unknown series {name!r}", remedy=did_you_mean(name, _SERIES))
        values[name] = series.values
        values[f"{name}_interval"] = (series.interval,)
    if settings.program:
        values["moment_program"] = settings.program
    return values


def numeric_vector(model: mujoco.MjModel, values: Mapping[str, Sequence[float]]) -> Array:
    """A model's ``numeric_data`` with some values changed.

    Args:
        values: by name: a new number, or a series of the same length.

    Returns:
        Array of shape (nnumericdata,).
    """
    data = np.array(model.numeric_data)
    for name, value in values.items():
        numeric = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_NUMERIC, name)
        start = model.numeric_adr[numeric]
        data[start : start + model.numeric_size[numeric]] = value
    return data
