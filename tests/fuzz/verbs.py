"""``identify`` and ``diagnose`` on degenerate campaigns, with what they print, write and draw."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from tests.fuzz.campaigns import degenerate
from tests.fuzz.values import Rng
from tunnel_sim.vocabulary.campaign import Campaign

PICTURES = 0.03
"""Share of the identified campaigns that are drawn."""
REPORTS = 0.3
"""Share of the diagnosed campaigns that get a report."""


def accepted_campaign(folder: Path, rng: Rng) -> Campaign:
    """A degenerate campaign that passes the reader.

    Raises:
        TunnelError: when the reader, or the writer for it, refuses the campaign.
    """
    from tunnel_sim.files.campaign_folder import read_campaign, write_campaign

    return read_campaign(write_campaign(degenerate(rng), folder / "campaign"))


def identify_campaign(folder: Path, rng: Rng) -> None:
    """One estimator on one campaign: the estimate holds finite numbers, is written, read and shown."""
    from identification import identify
    from identification.estimate import Estimate
    from identification.estimators import ALL_ESTIMATORS
    from tunnel_lab.terminal.outputs import show_estimate
    from tunnel_sim.files.writing import json_text

    campaign = accepted_campaign(folder, rng)
    name = ALL_ESTIMATORS[rng.integers(len(ALL_ESTIMATORS))]
    found = identify(campaign, name, throw=False)
    document = json.loads(json_text(found.to_json_dict()))
    check_numbers(document, name)
    assert Estimate.from_json_dict(document) == found, f"{name}: the estimate is not what its JSON says"
    show_estimate(campaign, found, windows=True)
    if rng.random() < PICTURES:
        draw(campaign, found, folder)


def draw(campaign: Campaign, found: Any, folder: Path) -> None:
    """The figures of ``tunnel plot``."""
    from tunnel_lab.commands.show import spread
    from tunnel_lab.plotting import runs, style
    from tunnel_lab.plotting.runs import windows_figure

    for page in runs.trace_pages(campaign):
        style.save(page, folder / "traces.png")
    style.save(runs.spectrum_figure(spread(campaign)), folder / "spectrum.png")
    if any(run.windows for run in found.runs):
        style.save(windows_figure(found), folder / "windows.png")


def diagnose_campaign(folder: Path, rng: Rng) -> None:
    """A diagnosis with a small vocabulary: shown, written and, now and then, reported."""
    from diagnosis import diagnose
    from tunnel_lab.commands.diagnose import show
    from tunnel_lab.report import write_report
    from tunnel_sim.effects import ALL_EFFECTS
    from tunnel_sim.files.writing import json_text

    campaign = accepted_campaign(folder, rng)
    chosen = sorted(rng.choice(len(ALL_EFFECTS), size=int(rng.integers(1, 4)), replace=False))
    document = diagnose(campaign, kinds=[ALL_EFFECTS[i] for i in chosen]).to_json_dict()
    check_numbers(json.loads(json_text(document)), "diagnose")
    show(document)
    if rng.random() < REPORTS:
        write_report(document, campaign, folder / "report.html")


def check_numbers(document: Any, where: str) -> None:
    """No NaN, no infinity, and no standard deviation below zero.

    Args:
        document: JSON's types.
        where: who says it, for the message.

    Raises:
        AssertionError: otherwise.
    """
    left = [("", document)]
    while left:
        place, value = left.pop()
        if isinstance(value, dict):
            left += [(f"{place}.{key}", one) for key, one in value.items()]
        elif isinstance(value, list):
            left += [(place, one) for one in value]
        elif isinstance(value, float):
            assert math.isfinite(value), f"{where}: {place} is {value}"
            is_std = place.endswith((".std", "_std"))
            assert not (is_std and value < 0.0), f"{where}: {place} is below zero"
