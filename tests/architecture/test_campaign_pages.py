"""The pages of the campaign environment: code runs, tables are those of the code."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

from tests.architecture.test_env_pages import rows

DOCS = Path(__file__).parents[2] / "docs"
PAGE = DOCS / "reference" / "envs" / "campaign.md"
TEXT = PAGE.read_text(encoding="utf-8")


def test_the_page_has_every_section() -> None:
    wanted = ["Action", "Observation", "Reward", "Start", "End", "Arguments", "Version history"]
    assert re.findall(r"^## (.*)$", TEXT, re.MULTILINE) == wanted


def test_the_arguments_are_those_of_the_code() -> None:
    from tunnel_lab.envs.campaign import CampaignEnv

    table = {
        name: default.strip("`").replace('"', "'")
        for names, default, _ in rows(TEXT, "Arguments")
        for name in re.findall(r"`(\w+)`", names)
    }
    parameters = inspect.signature(CampaignEnv.__init__).parameters.values()
    assert table == {
        p.name: repr(p.default) for p in parameters if p.name != "self" and p.kind is not p.VAR_KEYWORD
    }


def test_the_menus_are_those_of_the_code() -> None:
    from tunnel_lab.envs.menu import PRESETS

    for _, name, *shown, _ in rows(TEXT, "Action"):
        key = name.split("`")[1]
        for preset, values in zip(PRESETS.values(), shown, strict=True):
            assert [float(value) for value in values.split(",")] == list(getattr(preset, key))
    words = {
        name: text for names, _, text in rows(TEXT, "Arguments") for name in re.findall(r"`(\w+)`", names)
    }
    for effect, (low, high) in PRESETS["diagnosis"].severities.items():
        assert f"`{effect}` {low:g} to {high:g}" in words["severities"]
    assert words["noise_std"].endswith("0.05; 0.01 in the diagnosis preset")
    assert [preset.noise_std for preset in PRESETS.values()] == [0.05, 0.01]
    assert [preset.max_runs for preset in PRESETS.values()] == [24, 12]


def test_the_truth_is_drawn_as_the_page_says() -> None:
    from tunnel_lab.envs.session import MEAN, STD

    shown = {name.strip("`"): (float(mean), float(std)) for _, name, mean, std, _ in rows(TEXT, "Start")}
    assert shown.pop("sensor_zero") == (0.0, 0.004)
    assert shown == {name: (MEAN[name], STD[name]) for name in MEAN}


def test_the_costs_are_those_of_the_code() -> None:
    from tunnel_lab.envs.menu import Costs

    costs = Costs()
    for name in ("setup", "spring_change", "speed_change"):
        assert f"`{name}` {getattr(costs, name):g} s" in TEXT
