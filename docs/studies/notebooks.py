"""Run the notebooks and store their output, for readers without an installation.

``python -m docs.studies.notebooks`` in the source tree; with names, only those, such as ``ten-minutes``.
"""

from __future__ import annotations

import argparse
from importlib import import_module
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parents[1] / "notebooks"
LONGEST_S = 600.0  # time limit of a cell, on a busy machine


def executed(path: Path) -> Any:
    """A notebook with the outputs of a run of all its cells, without times and without the kernel's version."""
    from nbclient import NotebookClient

    nbformat: Any = import_module("nbformat")
    notebook = nbformat.read(path, as_version=4)
    kept = dict(notebook.metadata)
    resources = {"metadata": {"path": str(path.parent)}}  # where Jupyter starts a notebook
    NotebookClient(notebook, timeout=LONGEST_S, resources=resources, record_timing=False).execute()
    notebook.metadata = nbformat.from_dict({**kept, "language_info": {"name": "python"}})
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs = [one for one in cell.outputs if one.get("name") != "stderr"]
    return notebook


def main() -> None:
    """Store the outputs of the named notebooks, or of all."""
    nbformat: Any = import_module("nbformat")
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", help="notebooks without .ipynb; default: all")
    wanted = parser.parse_args().names or sorted(path.stem for path in FOLDER.glob("*.ipynb"))
    for name in wanted:
        path = FOLDER / f"{name}.ipynb"
        nbformat.write(executed(path), path)
        print(f"Written: {path}")


if __name__ == "__main__":
    main()
