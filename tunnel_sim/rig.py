"""The description of the rig: the one owner of its numbers."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from math import radians
from pathlib import Path
from types import MappingProxyType
from typing import Any

from tunnel_sim import limits
from tunnel_sim.errors import TunnelError, did_you_mean, one_line
from tunnel_sim.toml_input import load_toml


@dataclass(frozen=True)
class WorkingSection:
    """The tunnel's working section.

    Args:
        width: across the flow, m.
        height: m.
        length: along the flow, m.
    """

    width: float
    height: float
    length: float


@dataclass(frozen=True)
class Body:
    """The car-like body (paper, Table I).

    Args:
        length: reference length l, m.
        width: m.
        height: m.
        rear_slant_deg: angle of the rear slant below the roof, degrees.
        ground_clearance: m.
        mass: of model and oscillating mechanism, kg.
        frontal_area: A, m².
        side_area: m².
    """

    length: float
    width: float
    height: float
    rear_slant_deg: float
    ground_clearance: float
    mass: float
    frontal_area: float
    side_area: float


@dataclass(frozen=True)
class Rod:
    """The support rod.

    Args:
        diameter: m.
        length_above_ceiling: m.
    """

    diameter: float
    length_above_ceiling: float


@dataclass(frozen=True)
class Dynamics:
    """The rig's yaw dynamics with the wind off.

    Args:
        yaw_inertia: Izz of model and support, kg m².
        mechanical_damping: Cr, N m s/rad.
        default_spring: number of the spring fitted where none is named.
    """

    yaw_inertia: float
    mechanical_damping: float
    default_spring: int


@dataclass(frozen=True)
class Air:
    """The air in the tunnel.

    Args:
        density: ρ, kg/m³.
    """

    density: float


@dataclass(frozen=True)
class Potentiometer:
    """The angle sensor on top of the rod.

    Args:
        sample_rate: Hz.
        half_range_deg: the converter covers ± this angle, degrees.
        bits: resolution of the converter, bits.
        noise_std: standard deviation of the noise before conversion, rad.
    """

    sample_rate: float
    half_range_deg: float
    bits: int
    noise_std: float

    @property
    def resolution(self) -> float:
        """Step of the reading, rad."""
        return 2.0 * radians(self.half_range_deg) / float(2**self.bits)


@dataclass(frozen=True)
class Rig:
    """The whole rig.

    Args:
        working_section: the tunnel.
        body: the model.
        rod: its support.
        dynamics: inertia and damping.
        air: density.
        potentiometer: the sensor.
        springs: torsional stiffness by spring number, N m/rad (paper, Table II).
    """

    working_section: WorkingSection
    body: Body
    rod: Rod
    dynamics: Dynamics
    air: Air
    potentiometer: Potentiometer
    springs: Mapping[int, float]

    def spring(self, number: int) -> float:
        """The stiffness of a numbered spring.

        Args:
            number: as in Table II.

        Returns:
            Kr, N m/rad.

        Raises:
            TunnelError: when there is no such spring.
        """
        if number not in self.springs:
            known = ", ".join(str(n) for n in self.springs)
            raise TunnelError(f"there is no spring {number}", remedy=f"use one of {known}")
        return self.springs[number]


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
        path: a TOML file with the sections of the packaged ``rig.toml``; None reads the packaged one,
            the rig of the paper.

    Returns:
        The rig.

    Raises:
        TunnelError: when the file cannot be read, or a key is missing, unknown or out of range.
    """
    return parse_rig(rig_document(path), "rig.toml" if path is None else str(path))


def rig_document(path: Path | None = None) -> dict[str, Any]:
    """A rig description as it stands in its file, not yet checked.

    Args:
        path: as in `load_rig`.

    Returns:
        Its sections by name.

    Raises:
        TunnelError: when the file cannot be read or is no TOML.
    """
    if path is not None:
        return load_toml(path, missing="give the path of a rig description")
    with resources.as_file(resources.files("tunnel_sim") / "data" / "rig.toml") as packaged:
        return load_toml(packaged, missing="install the program anew")


def parse_rig(document: Mapping[str, Any], where: str) -> Rig:
    """A rig from its description.

    Args:
        document: sections by name, as in the packaged ``rig.toml``; SI units.
        where: the file, for messages.

    Returns:
        The rig.

    Raises:
        TunnelError: when a key is missing, unknown or out of range.
    """
    for key in document:
        if key not in (*_SECTIONS, "springs"):
            raise TunnelError(
                f"unknown section [{one_line(key)}]",
                where=where,
                remedy=did_you_mean(key, [*_SECTIONS, "springs"]),
            )
    parts = {name: _section(document, name, kind, where) for name, kind in _SECTIONS.items()}
    return Rig(**parts, springs=_springs(document, where))


def _section(document: Mapping[str, Any], name: str, kind: type, where: str) -> Any:
    table = document.get(name)
    fields: dict[str, str] = kind.__annotations__
    if not isinstance(table, dict):
        raise TunnelError(
            f"section [{name}] is missing", where=where, remedy=f"add it with {', '.join(fields)}"
        )
    for key in table:
        if key not in fields:
            raise TunnelError(
                f"unknown key {name}.{one_line(key)}", where=where, remedy=did_you_mean(key, fields)
            )
    for key in fields:
        if key not in table:
            raise TunnelError(f"key {name}.{key} is missing", where=where, remedy="add it")
        _check_number(table[key], f"{name}.{key}", where, whole=fields[key] == "int")
    return kind(**table)


def _check_number(value: object, key: str, where: str, *, whole: bool = False) -> None:
    kinds = (int,) if whole else (int, float)
    good = isinstance(value, kinds) and not isinstance(value, bool)
    if good:
        lowest = 0 if key.rsplit(".", 1)[-1] in _MAY_BE_ZERO else limits.SMALLEST_NUMBER
        good = lowest <= value <= limits.LARGEST_NUMBER  # type: ignore[operator]
    if not good:
        kind = "whole number" if whole else "number"
        raise TunnelError(
            f"{key} = {one_line(repr(value), 40)} is not a positive {kind}",
            where=where,
            remedy="correct it (SI units)",
        )


def _springs(document: Mapping[str, Any], where: str) -> Mapping[int, float]:
    table = document.get("springs")
    if not isinstance(table, dict) or not table:
        raise TunnelError(
            "section [springs] is missing", where=where, remedy="add one line per spring: 1 = 0.98"
        )
    springs: dict[int, float] = {}
    for key, value in table.items():
        if not re.fullmatch(r"[0-9]{1,9}", key):
            raise TunnelError(
                f"spring '{one_line(key, 40)}' is not a number",
                where=where,
                remedy="number the springs 1, 2, …",
            )
        _check_number(value, f"springs.{key}", where)
        springs[int(key)] = float(value)
    return MappingProxyType(springs)
