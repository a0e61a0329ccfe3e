"""A small MJCF around the plugin, written by hand."""

from __future__ import annotations

from collections.abc import Mapping

from tunnel_sim.engine.model import load_plugin

NUMERICS: Mapping[str, str] = {
    "air_density": "1.204",
    "frontal_area": "0.036",
    "reference_length": "0.625",
    "wind_speed": "20",
    "cn_beta": "0.35",
    "cn_r": "-0.7",
}


def small_model(
    numerics: Mapping[str, str | None] | None = None,
    config: Mapping[str, str] | None = None,
    *,
    flags: str = "",
) -> str:
    """XML with a yawing hinge, a slide and a second hinge; a numeric of None is left out."""
    load_plugin()
    given = {**NUMERICS, **(numerics or {})}
    custom = "".join(f'<numeric name="{k}" data="{v}"/>' for k, v in given.items() if v is not None)
    keys = "".join(f'<config key="{k}" value="{v}"/>' for k, v in (config or {"joint": "yaw"}).items())
    return f"""
<mujoco>
  <option integrator="RK4" timestep="0.001">{flags}</option>
  <size memory="256K"/>
  <extension><plugin plugin="vwt.yaw_moment"><instance name="air">{keys}</instance></plugin></extension>
  <custom>{custom}</custom>
  <worldbody>
    <body name="end">
      <joint name="slide" type="slide" axis="0 0 1"/>
      <joint name="yaw" axis="0 0 1" stiffness="16" damping="0.02"/>
      <inertial pos="0 0 0" mass="1" diaginertia="0.05 0.05 0.05"/>
      <body name="body"><joint name="twist" axis="0 0 1" stiffness="500" damping="0.01"/>
        <inertial pos="0 0 0" mass="1" diaginertia="0.05 0.05 0.05"/></body>
    </body>
  </worldbody>
  <sensor><plugin name="moment" plugin="vwt.yaw_moment" instance="air"/></sensor>
</mujoco>"""
