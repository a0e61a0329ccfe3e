"""Whatever is wrong with the plugin's configuration refuses to load, with a message that names it."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import mujoco
import pytest

from tests.skips import PLATFORM
from tests.support.small_model import NUMERICS, small_model
from tunnel_sim.engine.model import load_plugin
from tunnel_sim.physics.moment_law import parameter_names
from tunnel_sim.vocabulary.errors import TunnelError

pytestmark = pytest.mark.usefixtures("in_a_folder_of_its_own")

PLUGIN_SOURCE = Path(__file__).parents[4] / "mjcf" / "plugin"
NOT_NEGATIVE = ("air_density", "frontal_area", "reference_length", "width", "strouhal_number")
NOT_NEGATIVE += ("friction_moment", "presliding", "free_play")
NOT_NEGATIVE += ("friction_exponent", "friction_saturation", "friction_peak", "friction_peak_rate")
OWNED = ("spring_stiffness", "mechanical_damping", "yaw_inertia")
SERIES = {"wind_speed": "20 21 22", "wind_speed_interval": "0.5"}


def _refused(message: str, *arguments: object, flags: str = "") -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        mujoco.MjModel.from_xml_string(small_model(*arguments, flags=flags))  # type: ignore[arg-type]


def test_the_model_of_these_tests_loads() -> None:
    model = mujoco.MjModel.from_xml_string(small_model())
    mujoco.mj_step(model, mujoco.MjData(model))
    mujoco.MjModel.from_xml_string(small_model(SERIES, {"joint": "yaw", "twist_joint": "twist"}))


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ({"twist_joint": "twist"}, "attribute joint is missing"),
        ({"joint": ""}, "attribute joint is missing"),
        ({"joint": "jaw"}, 'joint="jaw" names no hinge'),
        ({"joint": "yaw", "twist_joint": "tvist"}, 'twist_joint="tvist" names no hinge'),
        ({"joint": "yaw", "twist_joint": "slide"}, 'twist_joint="slide" names no hinge'),
        ({"joint": "yaw", "twist_joint": "yaw"}, "twist_joint is the same hinge as joint"),
        ({"joint": "yaw", "twist_jiont": "twist"}, "twist_jiont"),
        ({"joint": "yaw", "cn_beta": "0.3"}, "cn_beta"),
    ],
)
def test_attribute(config: dict[str, str], message: str) -> None:
    _refused(message, None, config)


@pytest.mark.parametrize("name", NUMERICS)
def test_missing(name: str) -> None:
    _refused(f"numeric {name} is missing", {name: None})


@pytest.mark.parametrize("name", [name for name in parameter_names() if name not in OWNED])
def test_several_values_where_one_is_due(name: str) -> None:
    _refused(f"numeric {name} must be one finite number", {name: "1 2"})


@pytest.mark.parametrize("name", NOT_NEGATIVE)
def test_negative(name: str) -> None:
    _refused(f"numeric {name} must be one finite number of zero or more", {name: "-0.1"})


@pytest.mark.parametrize("name", OWNED)
def test_repeats_what_joint_or_body_owns(name: str) -> None:
    _refused(f"numeric {name} repeats what the joint or body owns", {name: "1"})


@pytest.mark.parametrize("name", ["moment_cubc", "Cn_beta", "windspeed", "cn_beta_"])
def test_unknown_numeric(name: str) -> None:
    _refused(f"numeric {name} is unknown", {name: "1"})


def test_numeric_of_another_program() -> None:
    mujoco.MjModel.from_xml_string(small_model({"user_anything": "1 2 3"}))


@pytest.mark.parametrize(
    ("numerics", "message"),
    [
        ({"wind_speed": "-1"}, "numeric wind_speed is negative at sample 0"),
        ({**SERIES, "wind_speed": "20 -1 3"}, "numeric wind_speed is negative at sample 1"),
        ({"wind_speed": "20 21"}, "give its wind_speed_interval"),
        ({"forcing": "0.1 0.2"}, "give its forcing_interval"),
        ({**SERIES, "wind_speed_interval": "0"}, "wind_speed_interval must be one positive number"),
        ({**SERIES, "wind_speed_interval": "-0.5"}, "wind_speed_interval must be one positive number"),
        ({**SERIES, "wind_speed_interval": "0.5 0.5"}, "wind_speed_interval must be one positive number"),
        ({"forcing_interval": "0.1"}, "forcing_interval is given without forcing"),
        ({"ambient": "0.1 0.2"}, "give its ambient_interval"),
        ({"ambient_interval": "0.1"}, "ambient_interval is given without ambient"),
        ({"drive": "0.1"}, "give its drive_interval"),
        ({"drive_held": "1"}, "drive_held is given without drive"),
    ],
)
def test_series(numerics: dict[str, str], message: str) -> None:
    _refused(message, numerics)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
@pytest.mark.parametrize("name", ["cn_beta", "aero_lag", "wind_speed", "forcing", "ambient"])
def test_not_finite(name: str, value: float) -> None:
    # XML gives a warning for NaN on its own; a specification in Python does not
    spec = mujoco.MjSpec.from_string(small_model({name: None}))
    spec.add_numeric(name=name, data=[value], size=1)
    with pytest.raises(ValueError, match=f"numeric {name} .*finite"):
        spec.compile()


def test_springs_and_dampers_disabled_together() -> None:
    _refused("springs and dampers are both disabled", flags='<flag spring="disable" damper="disable"/>')
    mujoco.MjModel.from_xml_string(small_model(flags='<flag damper="disable"/>'))


def test_value_spoilt_after_compiling() -> None:
    model = mujoco.MjModel.from_xml_string(small_model())
    model.numeric("air_density").data[0] = -1.0
    with pytest.raises(mujoco.FatalError, match="air_density"):
        mujoco.MjData(model)


def test_refusals_do_not_harm_the_process() -> None:
    bad = small_model({"air_density": "-1"})
    for _ in range(200):
        with pytest.raises(ValueError, match="air_density"):
            mujoco.MjModel.from_xml_string(bad)
    model = mujoco.MjModel.from_xml_string(small_model())
    data = mujoco.MjData(model)
    data.joint("yaw").qpos = 0.1
    mujoco.mj_step(model, data, 10)
    assert data.qpos[1] != 0.1


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason=f"{PLATFORM}: the library has another name")
def test_another_version_of_mujoco_is_refused(tmp_path: Path) -> None:
    source = tmp_path / "other_version.c"
    parts = "".join(
        f'#include "{PLUGIN_SOURCE / name}.c"\n'
        for name in ("plugin", "instance", "find_ids", "binding", "parameters", "lag", "moment", "expression")
    )
    source.write_text(
        f"#include <mujoco/mujoco.h>\n#undef mjVERSION_HEADER\n#define mjVERSION_HEADER 1\n{parts}",
        encoding="utf-8",
    )
    mujoco_dir = Path(mujoco.__file__).parent
    library = next(mujoco_dir.glob("libmujoco.so.*"))
    built = tmp_path / "libother.so"
    include = [f"-I{mujoco_dir / 'include'}", f"-I{PLUGIN_SOURCE}"]
    command = ["cc", "-shared", "-fPIC", *include, str(source), str(library), "-lm", "-o", str(built)]
    subprocess.run(command, check=True, capture_output=True)
    model = tmp_path / "model.xml"
    model.write_text(small_model(), encoding="utf-8")
    script = (
        "import mujoco, sys\n"
        "mujoco.mj_loadPluginLibrary(sys.argv[1])\n"
        "try:\n    mujoco.MjModel.from_xml_path(sys.argv[2])\n"
        "except ValueError as error:\n    print(error)\n"
    )
    outcome = subprocess.run(
        [sys.executable, "-c", script, str(built), str(model)], capture_output=True, text=True, check=True
    )
    assert "built against MuJoCo 1 but loaded by" in outcome.stdout


def test_another_version_of_the_engine_is_named_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mujoco, "__version__", "4.0.1")
    with pytest.raises(TunnelError, match=r"MuJoCo 4\.0\.1 is installed.*for 4\.0\.0; reinstall: run"):
        load_plugin.__wrapped__()
