"""A diagnosis read from the file that ``tunnel diagnose --json`` wrote."""

from __future__ import annotations

from pathlib import Path

from diagnosis.result import Diagnosis
from tunnel_sim.files.reading import read_json
from tunnel_sim.files.toml_input import check_version
from tunnel_sim.vocabulary.errors import shown

REMEDY = "give a file that tunnel diagnose --json wrote"


def read_diagnosis(path: Path) -> Diagnosis:
    """The diagnosis of a file, without its runs.

    Raises:
        TunnelError: when the file is not the document of a diagnosis.
    """
    document = read_json(path, remedy=REMEDY)
    check_version(document, path)
    return Diagnosis.from_json_dict(document, where=shown(path), remedy=REMEDY)
