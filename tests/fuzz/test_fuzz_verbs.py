"""``identify`` and ``diagnose`` on degenerate campaigns, with what they print, write and draw.

Truth: a result holds finite numbers and is written, read and shown, or there is a refusal of one line.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.fuzz.campaigns import degenerate
from tests.fuzz.guard import answers_or_refuses
from tests.fuzz.values import one_in
from tunnel_sim.effects import ALL_EFFECTS
from tunnel_sim.vocabulary.campaign import Campaign

examples = settings.default.max_examples
kinds = st.lists(st.sampled_from(ALL_EFFECTS), min_size=1, max_size=3, unique=True)


def accepted(campaign: Campaign, folder: Path) -> Campaign:
    """A campaign that passes the writer and the reader."""
    from tunnel_sim.files.campaign_folder import read_campaign, write_campaign

    return read_campaign(write_campaign(campaign, folder / "campaign"))


@pytest.mark.slow
@given(campaign=degenerate(), number=st.integers(0, 99), draws=one_in(30))
def test_identify_answers_or_refuses_in_one_line(campaign, number, draws):
    from identification import identify
    from identification.estimate import Estimate
    from identification.estimators import ALL_ESTIMATORS
    from tunnel_lab.commands.identify import estimate_shown
    from tunnel_lab.terminal.outputs import show
    from tunnel_sim.files.writing import json_text

    name = ALL_ESTIMATORS[number % len(ALL_ESTIMATORS)]
    with answers_or_refuses() as folder:
        campaign = accepted(campaign, folder)
        found = identify(campaign, name, throw=False)
        document = json.loads(json_text(found.to_json_dict()))
        check_numbers(document, name)
        assert Estimate.from_json_dict(document) == found, f"{name}: the estimate is not what its JSON says"
        show(estimate_shown(campaign, document, folder, windows=True))
        if draws:
            draw_figures(campaign, found, folder)


def draw_figures(campaign: Campaign, found: Any, folder: Path) -> None:
    """The figures of ``tunnel plot``."""
    from identification.show import style
    from tunnel_lab.commands.show import spread
    from tunnel_lab.plotting import runs
    from tunnel_lab.plotting.runs import windows_figure

    for page in runs.trace_pages(campaign):
        style.save(page, folder / "traces.png")
    style.save(runs.spectrum_figure(spread(campaign)), folder / "spectrum.png")
    if any(run.windows for run in found.runs):
        style.save(windows_figure(found), folder / "windows.png")


@pytest.mark.slow
@settings(max_examples=max(1, examples // 10))  # each takes seconds
@given(campaign=degenerate(), kinds=kinds, reports=one_in(3))
def test_diagnose_answers_or_refuses_in_one_line(campaign, kinds, reports):
    from diagnosis import diagnose
    from tunnel_lab.commands.diagnose import show
    from tunnel_lab.report import write_report
    from tunnel_sim.files.writing import json_text

    with answers_or_refuses() as folder:
        campaign = accepted(campaign, folder)
        document = diagnose(campaign, kinds=kinds).to_json_dict()
        check_numbers(json.loads(json_text(document)), "diagnose")
        show(document)
        if reports:
            write_report(document, campaign, folder / "report.html")


def check_numbers(document: Any, where: str) -> None:
    """No NaN, no infinity, and no standard deviation below zero in JSON's types."""
    waiting = [("", document)]
    while waiting:
        place, value = waiting.pop()
        if isinstance(value, dict):
            waiting += [(f"{place}.{key}", one) for key, one in value.items()]
        elif isinstance(value, list):
            waiting += [(place, one) for one in value]
        elif isinstance(value, float):
            assert math.isfinite(value), f"{where}: {place} is {value}"
            is_std = place.endswith((".std", "_std"))
            assert not (is_std and value < 0.0), f"{where}: {place} is below zero"
