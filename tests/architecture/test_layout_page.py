"""How the code is laid out: the page and its picture are true of the tree, and its examples run."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from docs.studies import layout
from identification import check_estimator
from identification.datasets import measured_campaign
from tunnel_sim.effects import effect_class, registry

TEXT = (layout.ROOT / "docs/explanation/how-the-code-is-laid-out.md").read_text(encoding="utf-8")
EXAMPLES = dict(
    zip(
        ("effect", "estimator", "reader", "command"),
        re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL),
        strict=True,
    )
)


PATH = re.compile(r"`((?:tunnel_\w+|identification|diagnosis|mjcf)/[\w/.]*)`")


def run(example: str) -> dict[str, object]:
    names: dict[str, object] = {"__name__": __name__}
    exec(compile(EXAMPLES[example], example, "exec", dont_inherit=True), names)
    return names


def test_every_folder_is_a_room() -> None:
    for package in layout.PACKAGES:
        folders = {path.parent.name for path in (layout.ROOT / package).glob("*/__init__.py")}
        assert folders == {room.name for room in layout.rooms() if room.package == package and room.is_folder}


def test_the_picture_is_drawn_from_this_tree(tmp_path: Path) -> None:
    layout.draw(tmp_path / "layout.svg")
    texts = [
        re.findall(r"<text[^>]*>(.*?)</text>", path.read_text(encoding="utf-8"))
        for path in (tmp_path / "layout.svg", layout.PICTURE)
    ]
    assert texts[0] == texts[1]
    assert {room.name for room in layout.rooms() if room.is_folder} <= set(texts[0])


def test_every_path_on_the_page_exists() -> None:
    for path in PATH.findall(TEXT):
        assert (layout.ROOT / path).exists(), path
    for step in re.findall(r"^\| \w+ \| `(\w+)` \|", TEXT, re.MULTILINE):
        assert (layout.ROOT / "diagnosis" / step).is_dir(), step


def test_every_question_is_answered_by_files_that_have_the_names() -> None:
    rows = re.findall(r"^\| (Where .*\?) \| (.*) \|$", TEXT, re.MULTILINE)
    assert len(rows) >= 10
    for question, answer in rows:
        paths = [layout.ROOT / path for path in PATH.findall(answer)]
        assert paths, question
        sources = "".join(path.read_text("utf-8") for path in paths if path.is_file())
        for name in re.findall(r"`(\w+)`", answer):
            assert re.search(rf"\b{name}\b", sources), (question, name)


def test_every_step_of_an_answer_is_where_the_page_says() -> None:
    rows = re.findall(r"^\| \d\. \w[\w ]* \| (`diagnosis/.*?) \| (.*) \|$", TEXT, re.MULTILINE)
    assert len(rows) == 4
    for place, content in rows:
        (path,) = PATH.findall(place)
        names = re.findall(r"`(\w+)`", place) + re.findall(r"`([a-z_]+)`", content)
        source = (layout.ROOT / path).read_text("utf-8") if path.endswith(".py") else ""
        assert [name for name in names if not re.search(rf"\b{name}\b", source)] == []


def test_the_findings_have_the_files_and_types_that_the_page_names() -> None:
    findings = layout.ROOT / "diagnosis" / "findings"
    rows = re.findall(r"^\| (`[a-z_]+\.py`(?:, `[a-z_]+\.py`)*) \| (.*) \|$", TEXT, re.MULTILINE)
    assert len(rows) >= 5
    for files, content in rows:
        sources = "".join((findings / name).read_text("utf-8") for name in re.findall(r"`(\w+\.py)`", files))
        for name in re.findall(r"`([A-Z]\w+)`", content):
            assert re.search(rf"^class {name}\b", sources, re.MULTILINE), name


def test_the_way_of_a_result_leads_through_modules_that_exist() -> None:
    for package, way in layout.WAYS.items():
        named = re.findall(r"(\w+\.py)", way)
        assert named
        assert [name for name in named if not (layout.ROOT / package / name).is_file()] == []


def test_the_effect_is_registered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(registry, "_registered", {})
    kind = run("effect")["ExtraStiffness"]
    assert effect_class("extra_stiffness") is kind


def test_the_estimator_finds_the_frequency() -> None:
    found = run("estimator")["ZeroCrossings"]().estimate(measured_campaign("rotary-pendulum"))  # type: ignore[operator]
    assert all(run.omega_n.value > 5.0 * run.omega_n.std > 0.0 for run in found.runs)


def test_the_estimator_passes_the_check() -> None:
    check_estimator(run("estimator")["ZeroCrossings"])  # type: ignore[arg-type]


def test_the_reader_reads() -> None:
    pairs = np.array([[0.0, 0.1], [0.01, 0.2]])
    (table,) = run("reader")["DAT"].read_tables(pairs.tobytes(), "log.dat")  # type: ignore[attr-defined]
    assert [channel.values.tolist() for channel in table.channels] == pairs.T.tolist()


def test_the_command_counts() -> None:
    app = typer.Typer()
    app.command()(run("command")["count"])  # type: ignore[type-var]
    done = CliRunner().invoke(app, [str(layout.ROOT / "identification/data/measured/rotary-pendulum")])
    assert (done.exit_code, done.output) == (0, f"{len(measured_campaign('rotary-pendulum').runs)} runs\n")
