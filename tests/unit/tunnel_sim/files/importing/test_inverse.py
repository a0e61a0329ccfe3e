"""An export read again is the campaign that was exported. Truth: the campaign."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.support.import_files import decay
from tunnel_sim.files.exporting import WRITERS, export_campaign
from tunnel_sim.files.importing.formats.text import is_number
from tunnel_sim.files.importing.records import read_records
from tunnel_sim.vocabulary.campaign import Campaign, Repeatability, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

NAMES = ("b 2", "a,1", "10", "9", "nan", "ä", "x;y", "007", "r/1", "..", "r_1", "-")
FORMULAS = (
    "=1+1",
    "+a",
    "-5",
    "@x",
    "'=a",
    "''-",
    "=cmd|' /C calc'!A0",
    "＝x",
    "-2+3+cmd|'",
    "'",
    "'a",
    "+1",
)


def twelve_runs() -> Campaign:
    """Wind off and on, three springs and none, densities, and names that sort and read badly."""
    runs = []
    for number, name in enumerate(NAMES):
        # A rest that is longer than the motion, which an import of a logger's record would cut off.
        time, swing = decay(number, duration=8.0 + 0.1 * number)
        wind = 0.0 if number % 2 == 0 else 5.0 + number / 4.0
        runs.append(
            Run(
                name,
                Record(time, swing * np.exp(-(1.0 + 0.1 * number) * time)),
                wind,
                None if number > 8 else (16.12, 44.84, 6.1)[number % 3],
                round(1.204 + number / 1000.0, 3) if wind else None,
                None if number == 5 else round(0.349 - 0.01 * number, 3),
            )
        )
    return Campaign("twelve", RigProperties(0.11, 0.036, 0.625, 0.225), SensorProperties(), tuple(runs))


@pytest.mark.parametrize("kind", WRITERS)
def test_names_that_spreadsheets_take_for_formulas_are_texts_and_come_back(kind: str, tmp_path: Path) -> None:
    campaign = twelve_runs()
    named = zip(campaign.runs, FORMULAS, strict=True)
    campaign = replace(campaign, runs=tuple(replace(run, id=name) for run, name in named))
    path = export_campaign(campaign, tmp_path / f"rig.{kind}", kind)
    assert [run.id for run in read_records([path]).campaign.runs] == list(FORMULAS)
    if kind == "csv":
        first = {line.partition(",")[0].strip('"') for line in path.read_text("utf-8").splitlines()}
        assert not [
            cell for cell in first if cell[:1] in "=@＝" or (cell[:1] in "+-" and not is_number(cell))
        ]


@pytest.mark.parametrize("kind", WRITERS)
@pytest.mark.parametrize("count", [1, 12])
def test_an_import_of_an_export_is_the_campaign(kind: str, count: int, tmp_path: Path) -> None:
    campaign = twelve_runs()
    known = Repeatability(0.003, None, 0.01) if count > 1 else None
    campaign = replace(campaign, runs=campaign.runs[-count:], repeatability=known)
    found = read_records([export_campaign(campaign, tmp_path / f"rig.{kind}", kind)]).campaign
    assert found.rig == campaign.rig
    assert found.repeatability == campaign.repeatability
    assert [replace(run, record=None) for run in found.runs] == [
        replace(run, record=None) for run in campaign.runs
    ]
    for run, truth in zip(found.runs, campaign.runs, strict=True):
        # Workbooks hold sixteen digits.
        tolerance = 1e-15 if kind == "xlsx" else 0.0
        np.testing.assert_allclose(run.record.yaw_rad, truth.record.yaw_rad, rtol=tolerance, atol=0.0)
        np.testing.assert_allclose(run.record.time_s, truth.record.time_s, rtol=tolerance, atol=0.0)
