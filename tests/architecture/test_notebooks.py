"""The notebooks: the first cell installs what is missing, and the stored outputs are those of a run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from docs.studies.quotes import difference

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
each_notebook = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


def code_cells(path: Path) -> list[dict[str, Any]]:
    return [
        cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"
    ]


def printed(cells: list[dict[str, Any]]) -> list[list[str]]:
    """Lines of text of every cell: printed, or shown as the last expression."""
    found = []
    for cell in cells:
        texts = [
            "".join(out.get("text", out.get("data", {}).get("text/plain", []))) for out in cell["outputs"]
        ]
        # The address of an object that is drawn differs from run to run.
        found.append([line for text in texts for line in text.splitlines() if " at 0x" not in line])
    return found


@each_notebook
def test_the_first_cell_installs_the_clone_where_it_is_missing(path: Path) -> None:
    source = "".join(code_cells(path)[0]["source"])
    assert 'find_spec("tunnel_sim") is None' in source
    (target,) = [line.split()[-1] for line in source.splitlines() if "%pip install" in line]
    assert (path.parent / target).resolve() == ROOT
    assert (path.parent / target / "pyproject.toml").is_file()


@each_notebook
def test_every_cell_has_been_run_in_order(path: Path) -> None:
    cells = code_cells(path)
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    for cell in cells:
        if "print(" in "".join(cell["source"]) or "plt.show" in "".join(cell["source"]):
            assert cell["outputs"], "run: python -m docs.studies.notebooks"
    assert not any(out["output_type"] == "error" for cell in cells for out in cell["outputs"])
    assert str(ROOT) not in path.read_text(encoding="utf-8")


@pytest.mark.slow
@each_notebook
def test_the_stored_outputs_are_those_of_a_run(path: Path) -> None:
    from docs.studies.notebooks import executed

    fresh = [cell for cell in executed(path)["cells"] if cell["cell_type"] == "code"]
    for stored, real in zip(printed(code_cells(path)), printed(fresh), strict=True):
        assert difference(stored, real) == "", f"run: python -m docs.studies.notebooks {path.stem}"
