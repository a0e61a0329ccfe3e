"""JSON files: arrays by name, records, matrices and lines. Truth: the numbers that were written."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.support.import_files import RATE, decay, written
from tunnel_sim import TunnelError
from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.condition_names import Conditions
from tunnel_sim.files.importing.conditions import Unstated
from tunnel_sim.files.importing.records import read_records

TIME, ANGLE = decay()
T, DEG = TIME.tolist(), np.rad2deg(ANGLE).tolist()
RECORDS = [{"t": t, "angle": y, "note": "x"} for t, y in zip(T, DEG, strict=True)]
CLOCK = [f"14:03:{t:08.5f}" for t in T]


@pytest.mark.parametrize(
    "document",
    [
        {"time_s": T, "yaw_deg": DEG},
        {"time_s": T, "yaw": DEG, "unit": "deg"},
        {"log": {"time": T, "angle": DEG}, "units": "deg"},
        {"time": T, "angle": DEG, "units": {"time": "s", "angle": "deg"}},
        {"device": "logger", "rate_hz": RATE, "unit": "deg", "data": RECORDS},
        {"rate_hz": RATE, "angle_deg": DEG},
        [{"t": t, "angle_deg": y} for t, y in zip(T, DEG, strict=True)],
        [{"time": t, "angle_deg": y} for t, y in zip(CLOCK, DEG, strict=True)],
        [{"t": str(t), "angle_deg": str(y)} for t, y in zip(T, DEG, strict=True)],
        {"columns": ["t", "angle_deg"], "data": [list(row) for row in zip(T, DEG, strict=True)]},
        {"t": {str(i): t for i, t in enumerate(T)}, "angle_deg": {str(i): y for i, y in enumerate(DEG)}},
        {
            "channels": [
                {"name": "t", "unit": "s", "values": T},
                {"name": "yaw", "unit": "deg", "values": DEG},
            ]
        },
        [[t, y] for t, y in zip(T, ANGLE.tolist(), strict=True)],
    ],
)
def test_a_document_is_read(tmp_path: Path, document: Any) -> None:
    (run,) = read_records([written(tmp_path, "log.json", json.dumps(document))]).campaign.runs
    np.testing.assert_allclose(run.record.time_s, TIME, atol=1e-6)
    np.testing.assert_allclose(run.record.yaw_rad, ANGLE, atol=1e-12)


def test_a_record_on_each_line(tmp_path: Path) -> None:
    for ending in ("jsonl", "ndjson"):
        text = "\n".join(json.dumps({"t": t, "yaw_deg": y}) for t, y in zip(T, DEG, strict=True))
        (run,) = read_records([written(tmp_path, f"log.{ending}", text)]).campaign.runs
        np.testing.assert_allclose(run.record.yaw_rad, ANGLE, atol=1e-12)


def test_conditions_of_all_runs_and_of_each(tmp_path: Path) -> None:
    runs = [
        {"id": "calm", "wind_speed": 0, "time": T, "angle_rad": ANGLE.tolist()},
        {"id": "windy", "wind_speed": "54 km/h", "time": T, "angle_rad": ANGLE.tolist()},
    ]
    document = {
        "rig": {"frontal_area": 0.036},
        "setup": {"Kr": 16.12, "air density": "1.2 kg/m3"},
        "runs": runs,
    }
    found = read_records([written(tmp_path, "log.json", json.dumps(document))]).campaign
    assert [(r.id, r.wind_speed, r.spring_stiffness, r.air_density) for r in found.runs] == [
        ("calm", 0.0, 16.12, 1.2),
        ("windy", pytest.approx(15.0), 16.12, 1.2),
    ]
    assert found.rig.frontal_area == 0.036


def test_records_that_name_their_run(tmp_path: Path) -> None:
    rows = [{"run": name, "t": t, "yaw_deg": y} for name in ("a", "b") for t, y in zip(T, DEG, strict=True)]
    runs = read_records([written(tmp_path, "log.json", json.dumps(rows))]).campaign.runs
    assert [run.id for run in runs] == ["a", "b"]


def test_a_speed_without_a_unit_is_said(tmp_path: Path) -> None:
    document = {"V": 12, "time_s": T, "yaw_deg": DEG}
    with pytest.raises(Unstated, match="'V' = 12 is left out"):
        read_records([written(tmp_path, "log.json", json.dumps(document))])


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("{", "is not a JSON file that can be read"),
        ('{"a": "b"}', "no arrays of numbers"),
        ("[" * 100_000, "is not a JSON file that can be read"),
        ("3", "no arrays of numbers"),
        ('{"t": [0, 1, 2], "yaw_rad": [1, 0, 1]}', "no arrays of numbers"),
        ('{"t": [' + "1e999," * 30 + "1]}", "column"),
    ],
)
def test_other_documents_are_refused_in_a_line(tmp_path: Path, text: str, what: str) -> None:
    with pytest.raises(TunnelError, match=what) as caught:
        read_records(
            [written(tmp_path, "log.json", text)], ImportChoices(conditions=Conditions(wind_speed=0.0))
        )
    assert "\n" not in str(caught.value)
