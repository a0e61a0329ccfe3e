"""How well a campaign's stated inputs are known: standard uncertainties, and which errors are common to runs.

The campaign format states Kr, V, ρ, A and l as exact numbers; how well they are known comes from a small TOML:

    schema_version = 1

    [common]                      # one error for all runs: calibration of an instrument, a dimension
    spring_stiffness = 0.005      # relative standard uncertainties throughout: 0.005 is 0.5 %
    wind_speed = 0.01
    air_density = 0.003
    frontal_area = 0.005
    reference_length = 0.001

    [individual]                  # a separate error for every spring, or every wind-on run
    spring_stiffness = 0.002
    wind_speed = 0.005

    [[correlations]]              # between common errors, such as V from a pitot tube and ρ
    between = ["wind_speed", "air_density"]
    coefficient = -0.5
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from tunnel_sim.files.toml_input import StrictModel, read_document, shown
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean
from tunnel_sim.vocabulary.record import Array

_Relative = Annotated[
    float,
    Field(ge=0.0, lt=0.5, description="a relative standard uncertainty from 0 to 0.5, such as 0.01 for 1 %"),
]


class _IndividualTable(StrictModel):
    """``[individual]``."""

    spring_stiffness: _Relative = 0.0
    wind_speed: _Relative = 0.0
    air_density: _Relative = 0.0


class _CommonTable(_IndividualTable):
    """``[common]``."""

    frontal_area: _Relative = 0.0
    reference_length: _Relative = 0.0
    yaw_inertia: _Relative = 0.0
    clock: _Relative = 0.0


COMMON = tuple(_CommonTable.model_fields)
"""Inputs whose error may be common to all runs; ``clock`` is the scale of the time axis."""


@dataclass(frozen=True)
class InputUncertainties:
    """Relative standard uncertainties of the stated inputs; inputs that are not named are exact.

    Args:
        common: by name of `COMMON`: one error for all runs.
        individual: of ``spring_stiffness``, ``wind_speed`` and ``air_density``: independent errors of springs or
            wind-on runs, besides the common one.
        correlations: pairs of common inputs with their correlation coefficient.
    """

    common: Mapping[str, float] = field(default_factory=dict)
    individual: Mapping[str, float] = field(default_factory=dict)
    correlations: tuple[tuple[str, str, float], ...] = ()

    def correlation(self, names: tuple[str, ...]) -> Array:
        """Correlation matrix of common inputs.

        Args:
            names: of the inputs, n of them.

        Returns:
            Shape (n, n).
        """
        matrix = np.eye(len(names))
        for first, second, coefficient in self.correlations:
            if first in names and second in names:
                i, j = names.index(first), names.index(second)
                matrix[i, j] = matrix[j, i] = coefficient
        return matrix


class _CorrelationTable(StrictModel):
    """``[[correlations]]``."""

    between: list[str] = Field(min_length=2, max_length=2, description="a list of two inputs of [common]")
    coefficient: Annotated[float, Field(ge=-1.0, le=1.0)] = Field(description="a number from -1 to 1")


class _Document(StrictModel):
    """The whole file."""

    schema_version: int = Field(description="1")
    common: _CommonTable = Field(default=_CommonTable(), description="a [common] table")
    individual: _IndividualTable = Field(default=_IndividualTable(), description="an [individual] table")
    correlations: list[_CorrelationTable] = Field(default=[], description="[[correlations]] tables")


def load_uncertainties(path: Path) -> InputUncertainties:
    """Read a file of uncertainties, as at the top of this module.

    Raises:
        TunnelError: for the first thing that is wrong, in one line that names file, key and remedy.
    """
    missing = "name a TOML of uncertainties, see docs/how-to/state-uncertainties.md"
    document = read_document(_Document, path, missing=missing)
    where = shown(path)
    common = {name: value for name, value in document.common.model_dump().items() if value > 0.0}
    individual = {name: value for name, value in document.individual.model_dump().items() if value > 0.0}
    pairs: list[tuple[str, str, float]] = []
    for table in document.correlations:
        first, second = table.between
        for name in (first, second):
            if name not in COMMON:
                raise TunnelError(f"no input {name!r}", where=where, remedy=did_you_mean(name, COMMON))
            if name not in common:
                raise TunnelError(
                    f"correlated {name} has no uncertainty", where=where, remedy="state it under [common]"
                )
        if first == second or {first, second} in [{a, b} for a, b, _ in pairs]:
            raise TunnelError(
                f"{first} and {second} are correlated twice, or an input is correlated with itself",
                where=where,
                remedy="name every pair of different inputs once",
            )
        pairs.append((first, second, table.coefficient))
    found = InputUncertainties(common, individual, tuple(pairs))
    if np.linalg.eigvalsh(found.correlation(COMMON))[0] < -1e-12:
        raise TunnelError(
            "these correlations contradict one another", where=where, remedy="correct a coefficient"
        )
    return found
