"""The uncertainty budget: from noise, stated inputs, scatter of the runs and choice of model to one covariance.

First order after JCGM 100:2008 (GUM), correlated inputs after its 5.2: U = U_noise + Σ_ij ρ_ij uᵢ cᵢ (u_j c_j)ᵀ +
U_scatter + U_model. The estimate itself includes noise and scatter between runs, the latter by
`identification.campaign.run_scatter`. The uncertainties of stated inputs come from a TOML file
(docs/how-to/state-uncertainties.md). Errors that neither repeats nor other methods with the same model show are not
included: run the diagnosis.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import sqrt
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from identification import policy
from identification.campaign.derivatives import build_design
from identification.estimate import PARAMETERS, Estimate
from identification.show.quantity import Quantity
from tunnel_sim.files.toml_input import StrictModel, read_document, shown
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean
from tunnel_sim.vocabulary.quantities import PerParameter
from tunnel_sim.vocabulary.record import Array, Record

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
    """Relative standard uncertainties of the stated inputs; the others are exact.

    Args:
        common: by name of `COMMON`: one error for all runs.
        individual: independent errors of springs or wind-on runs, besides the common one.
        correlations: pairs of common inputs with their correlation coefficient.
    """

    common: Mapping[str, float] = field(default_factory=dict)
    individual: Mapping[str, float] = field(default_factory=dict)
    correlations: tuple[tuple[str, str, float], ...] = ()

    def correlation(self, names: tuple[str, ...]) -> Array:
        """Correlation matrix of common inputs, by n names: shape (n, n)."""
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
    """Read a file of uncertainties, as in docs/how-to/state-uncertainties.md.

    Raises:
        TunnelError: for the first fault, in one line that names file, key and remedy.
    """
    where, missing = shown(path), "name a TOML of uncertainties, see docs/how-to/state-uncertainties.md"
    document = read_document(_Document, path, missing=missing)
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


Identify = Callable[[Campaign], Estimate]
Progress = Callable[[str], None]
_NAMES = (*PARAMETERS, "wind_off_inertia")
# Exponents of a common scale of a stated input; the clock's is the scale of the time axis.
_POWERS: Mapping[str, tuple[float, float, float, float, float]] = {
    "spring_stiffness": (1.0, 1.0, 1.0, 1.0, 1.0),
    "wind_speed": (-2.0, -1.0, 0.0, 0.0, 0.0),
    "air_density": (-1.0, -1.0, 0.0, 0.0, 0.0),
    "frontal_area": (-1.0, -1.0, 0.0, 0.0, 0.0),
    "reference_length": (-1.0, -2.0, 0.0, 0.0, 0.0),
    "yaw_inertia": (0.0, 0.0, 0.0, 0.0, 0.0),  # the nominal inertia has no influence: Izz is identified
    "clock": (0.0, 1.0, 2.0, 1.0, 2.0),
}


@dataclass(frozen=True, eq=False)
class Component:
    """One line of the budget.

    Args:
        covariance: contribution of the component, shape (p, p), in the products of the quantities' units; a
            correlation may make it negative.
        note: why the contribution is zero or unknown; otherwise empty.
        known: whether the contribution could be determined; if not, its covariance is zero and the total omits
            it.
    """

    name: str
    kind: Literal["A", "B"]
    covariance: Array
    note: str = ""
    known: bool = True


@dataclass(frozen=True, eq=False)
class Budget:
    """The budget of an estimate, noise first.

    Args:
        names: names of p quantities: the estimate's parameters, and ``wind_off_inertia``.
    """

    names: tuple[str, ...]
    values: PerParameter
    components: tuple[Component, ...] = ()

    @property
    def covariance(self) -> Array:
        """Covariance of the quantities, all components together, shape (p, p)."""
        return np.asarray(np.sum([component.covariance for component in self.components], axis=0))

    def std(self, name: str) -> float:
        """Combined standard uncertainty of a quantity, in its unit."""
        return sqrt(float(self.covariance.diagonal()[self.names.index(name)]))

    def share(self, component: Component, name: str) -> float:
        """Share of a component of the budget in the variance of a quantity, as a fraction."""
        place = self.names.index(name)
        return float(component.covariance[place, place] / self.covariance[place, place])

    def to_json_dict(self) -> dict[str, Any]:
        """The combined standard uncertainty of each quantity, and for each component its signed deviation."""
        return {
            "combined_std": {name: self.std(name) for name in self.names},
            "components": [
                {
                    "name": one.name,
                    "type": one.kind,
                    "known": one.known,
                    "note": one.note,
                    "variance": dict(zip(self.names, np.diag(one.covariance).tolist(), strict=True)),
                }
                for one in self.components
            ],
        }


def make_budget(
    campaign: Campaign,
    estimate: Estimate,
    identify: Identify,
    inputs: InputUncertainties,
    *,
    others: Mapping[str, Identify] | None = None,
    progress: Progress = lambda _: None,
) -> Budget:
    """The budget of a campaign's coefficients.

    Args:
        others: other estimators, by name; their spread is the uncertainty of the choice of model.

    Raises:
        TunnelError: when the estimate has no coefficients.
    """
    names = tuple(name for name in _NAMES if getattr(estimate, name) is not None)
    if not set(names) & set(PARAMETERS):
        remedy = "state spring_stiffness, or leave --budget and --uncertainties out"
        raise TunnelError("no coefficients, so no uncertainty budget", where=campaign.name, remedy=remedy)
    quantities: list[Quantity] = [getattr(estimate, name) for name in names]
    budget = Budget(names, np.array([quantity.value for quantity in quantities]))
    covariance = np.diag([getattr(estimate, name).std ** 2 for name in budget.names])
    places = [budget.names.index(name) for name in estimate.parameters]
    covariance[np.ix_(places, places)] = estimate.covariance_matrix
    scatter, whole = _scatter(campaign, estimate, budget, inputs.individual)
    noise = Component("noise of the readings", "A", covariance - whole)
    # an error common to all runs scales the coefficients in closed form, whatever the method
    given = tuple(name for name in _POWERS if inputs.common.get(name, 0.0) > 0.0)
    columns = [_NAMES.index(name) for name in budget.names]
    moves = np.array(
        [budget.values * np.array(_POWERS[name])[columns] * inputs.common[name] for name in given]
    ).reshape(len(given), len(budget.names))
    notes = {"yaw_inertia": "the nominal inertia is not used"}
    if not campaign.in_wind:
        notes |= dict.fromkeys(("wind_speed", "air_density"), "no wind-on run")
    common = [
        Component(f"{name}, common", "B", np.outer(move, move), notes.get(name, ""))
        for name, move in zip(given, moves, strict=True)
    ]
    correlation = inputs.correlation(given) - np.eye(len(given))
    if np.any(correlation != 0.0):
        common.append(Component("correlations of these", "B", moves.T @ correlation @ moves))
    individual = _individual(campaign, budget, identify, inputs, progress)
    progress("choice of model")
    rivals = {name: other(campaign) for name, other in (others or {}).items()}
    halves = []
    for run in campaign.runs:
        half = slice(0, max(2, run.record.time_s.size // 2))
        halves.append(replace(run, record=Record(run.record.time_s[half], run.record.yaw_rad[half])))
    rivals["the first half of the records"] = identify(replace(campaign, runs=tuple(halves)))
    own_std, largest, blamed = np.sqrt(np.diag(covariance)), np.zeros(len(names)), []
    for name, rival in rivals.items():
        values = _values(rival, budget)
        if values is None:
            continue
        move = np.abs(values - budget.values)
        stds = np.array([getattr(rival, name).std for name in names])
        # The better of two unbiased estimates from the same records is uncorrelated with their difference.
        chance = np.sqrt(np.abs(stds**2 - own_std**2))
        move = np.where(move > policy.DIFFERENCE_DEVIATIONS * chance, move, 0.0)
        if np.any(move > 0.0):
            blamed.append(name)
        largest = np.maximum(largest, move)
    note = f"moved by {', '.join(blamed)}" if blamed else f"{', '.join(rivals)}: within chance"
    # The largest change beyond chance is the half-width of a rectangular distribution (GUM 4.3.7).
    model = Component("choice of model", "B", np.diag(largest**2 / 3.0), note)
    return replace(budget, components=(noise, *common, *individual, scatter, model))


def with_budget(estimate: Estimate, budget: Budget) -> Estimate:
    """The estimate with combined standard uncertainties and covariance instead of the noise's."""
    places = [budget.names.index(name) for name in estimate.parameters]
    total = budget.covariance[np.ix_(places, places)]
    quantities: dict[str, Any] = {
        name: replace(getattr(estimate, name), std=budget.std(name)) for name in budget.names
    }
    return replace(estimate, covariance=tuple(map(tuple, total.tolist())), **quantities)


def _individual(
    campaign: Campaign, budget: Budget, identify: Identify, inputs: InputUncertainties, progress: Progress
) -> list[Component]:
    """The contribution of an error of a single spring or run, with the input changed by one uncertainty.

    Kragten, Analyst 119 (1994) 2161–2165, doi 10.1039/AN9941902161.
    """
    components = []
    for name, size in inputs.individual.items():
        if size <= 0.0:
            continue
        groups = error_groups(campaign.runs, name)
        total = np.zeros((len(budget.names),) * 2)
        for number, group in enumerate(groups, 1):
            progress(f"{name}, {number} of {len(groups)}")
            runs = tuple(
                with_scaled_input(run, name, 1.0 + size) if i in group else run
                for i, run in enumerate(campaign.runs)
            )
            values = _values(identify(replace(campaign, runs=runs)), budget)
            if values is None:
                raise TunnelError(
                    f"no estimate with {name} of run {campaign.runs[group[0]].id} {100 * size:g} % larger",
                    where=campaign.name,
                    remedy="use another estimator, or state a smaller uncertainty",
                )
            total += np.outer(values - budget.values, values - budget.values)
        each = "spring" if name == "spring_stiffness" else "run"
        note = "" if groups else "no run states it"
        components.append(Component(f"{name}, each {each} its own", "B", total, note))
    return components


def _scatter(
    campaign: Campaign, estimate: Estimate, budget: Budget, individual: Mapping[str, float]
) -> tuple[Component, Array]:
    """The contribution of scatter between runs beyond the stated errors of single springs and runs; and the whole.

    A stated independent error of every run is scatter between them, and is in the budget already.
    """
    size, name = len(budget.names), "scatter between runs"
    whole, beyond = np.zeros((2, size, size))
    found = estimate.repeatability
    if found is None:
        shown = [
            run
            for run, one in zip(campaign.runs, estimate.runs, strict=True)
            if run.spring_stiffness is not None and one.omega_n is not None and one.zeta is not None
        ]
        spare = bool(shown) and 2 * len(shown) > build_design(shown, campaign.rig).size
        note = "none beyond the noise" if spare else "unknown, because the campaign has no redundant runs"
        return Component(name, "A", beyond, note, known=spare), whole
    places = np.ix_(*[[budget.names.index(one) for one in estimate.parameters]] * 2)
    for (kind, width), added in zip(found.widths.items(), found.covariances, strict=True):
        explained = (individual.get(kind, 0.0) / width.value) ** 2
        whole[places] += added
        beyond[places] += max(1.0 - explained, 0.0) * np.array(added)
    return Component(name, "A", beyond, "" if beyond.any() else "explained by the components above"), whole


def _values(estimate: Estimate, budget: Budget) -> Array | None:
    """The budget's quantities in another estimate; None if one is missing."""
    found: list[Quantity | None] = [getattr(estimate, name) for name in budget.names]
    given = [quantity.value for quantity in found if quantity is not None]
    return np.array(given) if len(given) == len(found) else None


def error_groups(runs: Sequence[Run], name: str) -> list[list[int]]:
    """Groups of runs with one individual error: the runs of a spring, or a single wind-on run."""
    if name != "spring_stiffness":
        return [[i] for i, run in enumerate(runs) if run.wind_on]
    springs: dict[float, list[int]] = {}
    for i, run in enumerate(runs):
        if run.spring_stiffness is not None:
            springs.setdefault(run.spring_stiffness, []).append(i)
    return list(springs.values())


def with_scaled_input(run: Run, name: str, factor: float) -> Run:
    """A run with one stated input changed; the same run if it does not state this input.

    Args:
        factor: factor on the input (1).
    """
    value = getattr(run, name)
    changed: dict[str, Any] = {} if value is None else {name: value * factor}
    return replace(run, **changed)
