"""The plugin's README lists what the compiled library lists, and its example loads."""

from __future__ import annotations

import re
from contextlib import nullcontext
from pathlib import Path

import mujoco
import pytest

from tests.support.small_model import small_model
from tunnel_sim.physics.moment_law import parameter_names, parameter_units, parameter_vector

README = (Path(__file__).parents[4] / "mjcf" / "plugin" / "README.md").read_text(encoding="utf-8")
INPUTS = ("wind_speed", "wind_speed_interval", "forcing", "forcing_interval", "moment_program")
INPUTS += ("ambient", "ambient_interval", "drive", "drive_interval", "drive_held", "drive_on_end")


def _rows(heading: str) -> dict[str, list[str]]:
    """Cells after the first, by name, of all tables whose head begins with `heading`."""
    rows: dict[str, list[str]] = {}
    inside = False
    for line in README.splitlines():
        inside = line.startswith("|") and (inside or line.startswith(f"| {heading} |"))
        name = re.match(r"\| `(\w+)` \|", line)
        if inside and name:
            rows[name[1]] = [cell.strip() for cell in line.split("|")[2:-1]]
    return rows


def test_numerics_are_those_of_the_law_with_its_units() -> None:
    rows = _rows("numeric")
    assert set(rows) == {*parameter_names(), *INPUTS}
    for name, unit in parameter_units().items():
        assert rows[name][0] == unit, name


@pytest.mark.parametrize("name", parameter_names())
def test_default_and_bound_are_what_the_plugin_does(
    name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its log into the working directory
    default = _rows("numeric")[name][1]

    loads = {None: "required" not in default, "0.5": default != "refused"}
    loads["-0.5"] = default != "refused" and "≥ 0" not in default
    for value, expected in loads.items():
        with nullcontext() if expected else pytest.raises(ValueError, match=name):
            mujoco.MjModel.from_xml_string(small_model({name: value}))


def test_attributes_are_known() -> None:
    assert set(_rows("attribute")) == {"joint", "twist_joint"}
    mujoco.MjModel.from_xml_string(small_model(None, {"joint": "yaw", "twist_joint": "twist"}))


def test_example_loads() -> None:
    xml = re.search(r"```xml\n(.*?)```", README, re.DOTALL)
    assert xml is not None
    small_model()  # loads the plugin
    body = '<worldbody><body><joint name="yaw" axis="0 0 1"/><geom size="1"/></body></worldbody>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco>{body}{xml[1]}</mujoco>")
    assert model.nuserdata == 1


def test_vector_is_in_the_laws_order() -> None:
    vector = parameter_vector({"cn_r": 2.0, "air_density": 1.0})
    assert vector[parameter_names().index("cn_r")] == 2.0
    assert vector.sum() == 3.0
