"""The environments' page: its code runs, what it shows is printed, its tables are those of the code."""

from __future__ import annotations

import re
from dataclasses import fields
from math import pi
from pathlib import Path

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "envs" / "free-decay.md"
TEXT = PAGE.read_text(encoding="utf-8")


def rows(text: str, heading: str) -> list[list[str]]:
    """The tables' rows of a section, without their heads."""
    section = text.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if "---" not in line][1:]


def test_the_page_has_every_section() -> None:
    found = re.findall(r"^## (.*)$", TEXT, re.MULTILINE)
    wanted = ["Action", "Observation", "Reward", "Start", "End", "Arguments", "Version history"]
    assert [heading for heading in found if heading in wanted] == wanted


def test_the_arguments_are_those_of_the_code() -> None:
    from tunnel_sim.envs.episode_conditions import FreeDecayConfig

    table = {name.strip("`"): default.strip("`") for name, default, _ in rows(TEXT, "Arguments")}
    defaults = FreeDecayConfig()
    for item in fields(FreeDecayConfig):
        shown = table.pop(item.name)
        value = getattr(defaults, item.name)
        if item.name == "resolution":
            assert (shown, value) == ("2π/3/4096", 2.0 * pi / 3.0 / 4096.0)
        else:
            assert shown.replace('"', "'") == repr(value)
    assert set(table) == {"render_mode", "width`, `height", "camera"}


def test_the_options_are_those_of_the_code() -> None:
    from tunnel_sim.envs.episode_conditions import OPTIONS, TRUTH

    words = {
        word for name, meaning, *_ in rows(TEXT, "Start") for word in re.findall(r"`(\w+)`", name + meaning)
    }
    assert set(OPTIONS) | set(TRUTH) <= words


def test_the_prior_is_that_of_the_code() -> None:
    from tunnel_sim.envs.information import Prior

    prior = Prior()
    shown = {name: values for name, values, _ in rows(TEXT, "Reward")}
    assert (prior.cn_beta, prior.cn_r) == (0.5, 0.5)
    assert shown["`cn_beta`, `cn_r`"] == "0.5, 0.5"
    assert (prior.yaw_inertia, prior.mechanical_damping) == (1e-4, 1e-3)
    assert shown["`yaw_inertia`, `mechanical_damping`"].startswith("10⁻⁴ Izz, 10⁻³ Cr")
    assert (prior.release_angle, prior.release_rate, prior.sensor_zero) == (0.01, 0.02, 0.01)
    assert (shown["`release_angle`, `release_rate`"], shown["`sensor_zero`"]) == ("0.01, 0.02", "0.01")
