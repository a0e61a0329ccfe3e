"""``[drive]`` of a plan: the runs it adds, their inputs, and what is refused."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from tests.support.plans import planned
from tunnel_sim.files.plan_file import PlanDocument, SensorModelTable, TruthTable
from tunnel_sim.files.plan_input import InputTable
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import square

HEAD = """
name = "driven"
seed = 1
springs = [5]
wind_speeds = [0, 10.0]
duration = 10.0
truth = { cn_beta = 0.47, cn_r = -0.1 }
sensor.sample_rate = 100.0
"""
SINE = '[drive]\nkind = "sine"\nfrequency_hz = 2.0\namplitudes_nm = [0.1, 0.4]\n'
BAND = '[drive]\nkind = "multisine"\nfrom_hz = 0.5\nto_hz = 5.0\namplitudes_rad = [0.02]\n'
TIME = np.arange(1000) / 100.0


def test_every_amplitude_is_run_at_every_spring_and_speed_beside_the_decays(tmp_path: Path) -> None:
    plan = planned(tmp_path, "release_angles_deg = [20]\nrepeats = 2\n" + HEAD + SINE)
    kinds = ("a20-1", "a20-2", "d0.1-1", "d0.1-2", "d0.4-1", "d0.4-2")
    assert [c.id for c in plan.conditions] == [f"s5-v{v}-{kind}" for v in (0, 10) for kind in kinds]
    for condition in plan.conditions:
        assert (condition.drive is None) == ("-a20" in condition.id) == (condition.release_angle > 0.0)


def test_an_amplitude_is_the_peak_in_the_unit_of_its_column(tmp_path: Path) -> None:
    small, large = (c.drive for c in planned(tmp_path, HEAD + SINE).conditions[:2])
    assert small is not None
    assert large is not None
    assert (small.column, small.hold) == ("moment_nm", "linear")
    assert np.allclose(small.values, 0.1 * np.sin(4.0 * np.pi * TIME))
    assert np.allclose(large.values, 4.0 * small.values)
    (root,) = {c.drive.column for c in planned(tmp_path, HEAD + BAND).conditions if c.drive}
    assert root == "base_rad"


def test_drawn_inputs_differ_from_run_to_run_and_are_those_of_the_seed(tmp_path: Path) -> None:
    def inputs(text: str) -> list[np.ndarray]:
        return [
            c.drive.values for c in planned(tmp_path, "repeats = 2\n" + HEAD + text).conditions if c.drive
        ]

    drawn = inputs(BAND + "seed = 4")
    assert all(not np.array_equal(drawn[0], other) for other in drawn[1:])
    assert all(np.array_equal(a, b) for a, b in zip(drawn, inputs(BAND + "seed = 4"), strict=True))
    assert not np.array_equal(drawn[0], inputs(BAND + "seed = 5")[0])
    schroeder = inputs(BAND)
    assert all(np.array_equal(schroeder[0], other) for other in schroeder[1:])
    noise = inputs(BAND.replace("multisine", "random"))
    assert not np.array_equal(noise[0], noise[1])


@pytest.mark.parametrize("hold", ["zero", "linear"])
def test_a_file_is_read_at_the_times_of_the_samples(tmp_path: Path, hold: str) -> None:
    rows = "time_s,moment_nm\n" + "".join(f"{5 + 0.25 * i},{(-1) ** (i // 2) * (1 + i)}\n" for i in range(41))
    (tmp_path / "input.csv").write_text(rows, encoding="utf-8")
    plan = planned(tmp_path, HEAD + f'[drive]\nkind = "file"\nfile = "input.csv"\nhold = "{hold}"')
    (first, second) = (c.drive for c in plan.conditions)
    assert [c.id for c in plan.conditions] == ["s5-v0-file", "s5-v10-file"]
    assert first is not None
    assert first is second
    assert first.hold == hold
    given = (-1.0) ** (np.arange(41) // 2) * (1 + np.arange(41))
    assert np.allclose(first.values[::25], given[:-1])
    between = first.values[12::25]
    assert np.allclose(between, given[:-1] + (0.48 * np.diff(given) if hold == "linear" else 0.0))


def test_a_square_wave_is_one_of_the_kinds(tmp_path: Path) -> None:
    drive = planned(tmp_path, HEAD + SINE.replace('"sine"', '"square"')).conditions[0].drive
    assert drive is not None
    assert np.array_equal(drive.values, 0.1 * square(TIME, 2.0))


FILE = '[drive]\nkind = "file"\nfile = "input.csv"\n'
BAD = {
    "no start": (HEAD, "'release_angles_deg' is empty or missing.*or a \\[drive\\]"),
    "kind": (HEAD + SINE.replace("sine", "sinus"), r"\[drive\].*'kind' = 'sinus'.*give kind as 'sine'"),
    "no frequency": (HEAD + SINE.replace("frequency_hz = 2.0", ""), "kind = 'sine' needs frequency_hz; give"),
    "another's key": (HEAD + SINE + "to_hz = 3.0", "kind = 'sine' does not take to_hz; leave it out"),
    "seed of a sine": (HEAD + SINE + "seed = 3", "does not take seed"),
    "no amplitude": (HEAD + SINE.replace("[0.1, 0.4]", "[]"), "no amplitudes; give amplitudes_nm"),
    "both amplitudes": (HEAD + SINE + "amplitudes_rad = [0.1]", "both amplitudes_nm and amplitudes_rad"),
    "amplitude twice": (HEAD + SINE.replace("0.4", "0.1"), "hold a value twice.*repeats"),
    "amplitude zero": (HEAD + SINE.replace("0.4", "0"), "'amplitudes_nm' = 0.*positive|'amplitudes_nm' = 0"),
    "degrees": (HEAD + BAND.replace("0.02", "20"), "'amplitudes_rad' = 20"),
    "hold": (HEAD + SINE + 'hold = "cubic"', "'hold' = 'cubic'"),
    "too fast": (HEAD + SINE.replace("2.0", "50.0"), "frequency_hz = 50 is not below half the sample rate"),
    "too fast a band": (HEAD + BAND.replace("5.0", "70"), "to_hz = 70 is not below half the sample rate"),
    "one step too fast": (
        HEAD + '[drive]\nkind = "stepped_sine"\nfrequencies_hz = [1, 60]\namplitudes_nm = [1]',
        "frequencies_hz = 60 is not below half",
    ),
    "no line": (
        HEAD + BAND.replace("0.5", "0.51").replace("5.0", "0.59"),
        "no multiple of 0.1 Hz.*longer duration",
    ),
    "band reversed": (HEAD + BAND.replace("0.5", "6.5"), "lies between from_hz = 6.5 and to_hz = 5"),
    "no such file": (HEAD + FILE.replace("input", "other"), r"\[drive\] file 'other.csv': no such file"),
    "unknown gain": (HEAD + FILE.replace("input", "volts"), "the column drive has no known unit"),
    "file too short": (HEAD + FILE.replace("input", "short"), "ends after 1 s, before the last sample"),
    "constant file": (HEAD + FILE.replace("input", "constant"), "is constant; give an input that changes"),
    "file without input": (
        HEAD + FILE.replace("input", "reading"),
        "no column moment_nm or drive or base_rad",
    ),
    "file without time": (HEAD + FILE.replace("input", "untimed"), "no column time_s"),
    "file back in time": (HEAD + FILE.replace("input", "back"), "time_s does not increase"),
    "file of another kind": (HEAD + FILE.replace(".csv", ".txt"), "unsupported file type '.txt'"),
    "too many runs": (
        "repeats = 1000\n" + HEAD + SINE.replace("[0.1, 0.4]", str([0.1 * i for i in range(1, 7)])),
        "12,000 runs",
    ),
}
FILES = {
    "volts": "time_s,drive\n0,1\n10,2\n",
    "short": "time_s,moment_nm\n0,1\n1,2\n",
    "constant": "time_s,moment_nm\n0,1\n10,1\n",
    "reading": "time_s,yaw_rad\n0,1\n10,2\n",
    "untimed": "t,moment_nm\n0,1\n10,2\n",
    "back": "time_s,moment_nm\n0,1\n10,2\n9,3\n",
}


def test_the_reference_page_has_every_key_and_kind() -> None:
    page = (Path(__file__).parents[4] / "docs" / "reference" / "plan.md").read_text(encoding="utf-8")
    kinds = get_args(InputTable.model_fields["kind"].annotation)
    known = {*PlanDocument.model_fields, *InputTable.model_fields, *kinds, *SensorModelTable.model_fields}
    shown = set(re.findall(r"`(?:\[+)?(\w+)(?:\]+)?`", page))
    assert known | set(TruthTable.model_fields) <= shown


@pytest.mark.parametrize("case", BAD)
def test_a_bad_drive_is_refused_in_one_line(tmp_path: Path, case: str) -> None:
    text, message = BAD[case]
    for name, content in FILES.items():
        (tmp_path / f"{name}.csv").write_text(content, encoding="utf-8")
    with pytest.raises(TunnelError, match=message) as caught:
        planned(tmp_path, text)
    assert str(tmp_path / "plan.toml") in str(caught.value)
    assert caught.value.remedy
    assert str(caught.value).isprintable()
