"""Reading the description of a rig."""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any

from tunnel_sim.files.toml_input import load_toml
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean, one_line
from tunnel_sim.vocabulary.rig import Air, Body, Dynamics, Potentiometer, Rig, Rod, WorkingSection

_SECTIONS: dict[str, type] = {
    "working_section": WorkingSection,
    "body": Body,
    "rod": Rod,
    "dynamics": Dynamics,
    "air": Air,
    "potentiometer": Potentiometer,
}
_MAY_BE_ZERO = {"rear_slant_deg", "mechanical_damping", "noise_std", "length_above_ceiling"}


def load_rig(path: Path | None = None) -> Rig:
    """Read a rig description.

    Args:
        path: a TOML file with the sections of the packaged ``rig.toml``; None: the packaged file, which describes
            the rig of the paper.

    Raises:
        TunnelError: when the file cannot be read, or a key is missing, unknown or out of range.
    """
    return parse_rig(rig_document(path), "rig.toml" if path is None else str(path))


def rig_document(path: Path | None = None) -> dict[str, Any]:
    """A rig description, sections by name, as read from its file, or the packaged one; not yet checked."""
    if path is not None:
        return load_toml(path, missing="give the path of a rig description")
    with resources.as_file(resources.files("tunnel_sim") / "data" / "rig.toml") as packaged:
        return load_toml(packaged, missing="reinstall the package")


def parse_rig(document: Mapping[str, Any], where: str) -> Rig:
    """Build a rig from its description: sections by name, as in the packaged ``rig.toml``, in SI units."""
    known = [*_SECTIONS, "springs"]
    for key in document:
        if key not in known:
            what = f"unknown section [{one_line(key)}]"
            raise TunnelError(what, where=where, remedy=did_you_mean(key, known))
    parts: dict[str, Any] = {}
    for name, kind in _SECTIONS.items():
        table, fields = document.get(name), kind.__annotations__
        if not isinstance(table, dict):
            remedy = f"add it with {', '.join(fields)}"
            raise TunnelError(f"section [{name}] is missing", where=where, remedy=remedy)
        for key in table:
            if key not in fields:
                what = f"unknown key {name}.{one_line(key)}"
                raise TunnelError(what, where=where, remedy=did_you_mean(key, fields))
        for key in fields:
            if key not in table:
                raise TunnelError(f"key {name}.{key} is missing", where=where, remedy="add it")
            _check_number(table[key], f"{name}.{key}", where, whole=fields[key] == "int")
        parts[name] = kind(**table)
    table = document.get("springs")
    if not isinstance(table, dict) or not table:
        remedy = "add one line per spring: 1 = 0.98"
        raise TunnelError("section [springs] is missing", where=where, remedy=remedy)
    springs: dict[int, float] = {}
    for key, value in table.items():
        if not re.fullmatch(r"[0-9]{1,9}", key):
            what = f"spring '{one_line(key, 40)}' is not a number"
            raise TunnelError(what, where=where, remedy="number the springs 1, 2, …")
        _check_number(value, f"springs.{key}", where)
        springs[int(key)] = float(value)
    return Rig(**parts, springs=MappingProxyType(springs))


def _check_number(value: object, key: str, where: str, *, whole: bool = False) -> None:
    kinds = (int,) if whole else (int, float)
    good = isinstance(value, kinds) and not isinstance(value, bool)
    if good:
        lowest = 0 if key.rsplit(".", 1)[-1] in _MAY_BE_ZERO else limits.SMALLEST_NUMBER
        good = lowest <= value <= limits.LARGEST_NUMBER  # type: ignore[operator]
    if not good:
        kind = "whole number" if whole else "number"
        what = f"{key} = {one_line(repr(value), 40)} is not a positive {kind}"
        raise TunnelError(what, where=where, remedy="correct it (SI units)")
