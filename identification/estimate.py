"""The result of an estimator: values with standard deviations, and statuses with their remedies.

A value that could not be identified is None, never NaN, and a `Status` gives the reason and the remedy.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import polars as pl
from pydantic import BeforeValidator, ConfigDict, Field, TypeAdapter

from identification.printing import estimate_blocks, estimate_brief
from identification.show.blocks import as_notebook, as_text
from identification.show.quantity import Quantity
from identification.status import Remark
from identification.status import Status as Status
from identification.status import by_severity as by_severity
from identification.trade_off import TradeOff
from tunnel_sim.files.reading import as_described, check_shape
from tunnel_sim.files.writing import as_json
from tunnel_sim.vocabulary.errors import TunnelError, installing, library
from tunnel_sim.vocabulary.freedom import Motion
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from pandas import DataFrame
    from uncertainties import UFloat
    from xarray import DataTree

PARAMETERS = ("cn_beta", "cn_r", "yaw_inertia", "mechanical_damping")
UNITS: Mapping[str, str] = {
    "cn_beta": "1/rad",
    "cn_r": "1/rad",
    "yaw_inertia": "kg m2",
    "mechanical_damping": "N m s/rad",
}

_FINITE = ConfigDict(allow_inf_nan=False)

Statuses = Annotated[
    tuple[Annotated[Status, BeforeValidator(lambda name: Status[name.upper()])], ...], Field(min_length=1)
]
"""In JSON: the names of the statuses, in lower case."""


@dataclass(frozen=True)
class NoiseLevel:
    """The sensor noise behind the standard deviations, compared with the residual.

    Args:
        std: standard deviation used, rad, quantisation included.
        source: ``stated`` (noise_std and resolution of the campaign) or ``residual`` (of the fit).
        residual_std: standard deviation of the residual, rad.
        slow_ratio: factor on the variances. In white noise it is 1. In coloured noise it is the noise power at
            the frequency of the motion over the power of white noise of ``std``. Where the model departs, it is
            the power of the residual's slow part over the power of white noise.
        departs: whether the residual has more power than white or coloured noise beyond chance (false-alarm rate
            1e-3).
        disagrees: whether the residual's white part contradicts the stated noise.
    """

    __pydantic_config__ = _FINITE

    std: float
    source: str
    residual_std: float
    slow_ratio: float
    departs: bool
    disagrees: bool


@dataclass(frozen=True)
class WindowEstimate:
    """The oscillation in one window of a few cycles, as in the paper's Table III.

    Args:
        start_s: start of the window since the record's first sample, s.
        duration_s: length of the window, s.
        amplitude: amplitude of the oscillation at mid-window, rad.
        omega_n: natural angular frequency, rad/s.
        zeta: damping ratio.
        cycles: number of periods; three, or one in a short record.
    """

    __pydantic_config__ = _FINITE

    start_s: float
    duration_s: float
    amplitude: Quantity
    omega_n: Quantity
    zeta: Quantity
    cycles: int = 3


_RUN_QUANTITIES = (
    "omega_n",
    "zeta",
    "initial_angle",
    "initial_rate",
    "sensor_zero",
    "aerodynamic_stiffness",
    "aerodynamic_damping",
    "process_noise",
)


@dataclass(frozen=True)
class RunEstimate:
    """The result for one run.

    Args:
        id: id of the run.
        statuses: from the gravest to the least; OK alone if there are no others.
        omega_n: natural angular frequency, rad/s; None for a body without a spring.
        zeta: damping ratio; None for a body without a spring.
        initial_angle: at the first sample, from the sensor's zero, rad; without a spring as the sensor reads it.
        initial_rate: at the first sample, rad/s.
        sensor_zero: zero of the sensor from this run alone, rad; None for a body without a spring.
        aerodynamic_stiffness: Ka, N m/rad, from the whole campaign; wind-on runs only.
        aerodynamic_damping: Ca, N m s/rad, from the whole campaign; wind-on runs only.
        process_noise: spectral intensity of a random moment over the inertia, rad²/s³; None if the method does
            not estimate it, or the run shows none.
        noise: the noise level behind the standard deviations; None if the method does not use one.
        windows: consecutive windows of three cycles.
    """

    __pydantic_config__ = _FINITE

    id: str
    statuses: Statuses = (Status.OK,)
    omega_n: Quantity | None = None
    zeta: Quantity | None = None
    initial_angle: Quantity | None = None
    initial_rate: Quantity | None = None
    sensor_zero: Quantity | None = None
    aerodynamic_stiffness: Quantity | None = None
    aerodynamic_damping: Quantity | None = None
    process_noise: Quantity | None = None
    noise: NoiseLevel | None = None
    windows: tuple[WindowEstimate, ...] = ()

    @property
    def status(self) -> Status:
        """The gravest status."""
        return self.statuses[0]

    @property
    def identified(self) -> bool:
        """Whether there is a result: ωn, or the fitted motion of a body without a spring."""
        return self.omega_n is not None or self.initial_angle is not None

    def to_json_dict(self) -> dict[str, Any]:
        """Fields by name; a missing value is None."""
        return {"id": self.id, **_statuses_json(self.statuses), **_fields_json(self, "statuses")}


@dataclass(frozen=True)
class RunScatter:
    """Chance differences of runs of equal conditions, beyond noise; the coefficients' intervals include them.

    Args:
        frequency: standard deviation of the natural frequency, a fraction of it; root mean square over the runs.
        damping: standard deviation of the decay rate, a fraction of it; root mean square over the runs.
        wind_speed: standard deviation of the runs' own speeds, a fraction; None where it does not count.
        spring_stiffness: standard deviation of the runs' own springs, a fraction; None where it does not count.
        mechanical_damping: standard deviation of the runs' own damping, a fraction; None where it does not
            count.
        stated: names of the sizes among these three that the campaign states; the others are estimated.
        covariances: contribution to the covariance of the parameters by each of the three that is not None, in
            the products of their units; shape (k, p, p).
    """

    __pydantic_config__ = _FINITE

    frequency: float
    damping: float
    wind_speed: Quantity | None = None
    spring_stiffness: Quantity | None = None
    mechanical_damping: Quantity | None = None
    stated: tuple[str, ...] = ()
    covariances: tuple[tuple[tuple[float, ...], ...], ...] = ()

    @property
    def widths(self) -> dict[str, Quantity]:
        """The standard deviations that count, by name."""
        every = {
            name: getattr(self, name) for name in ("wind_speed", "spring_stiffness", "mechanical_damping")
        }
        return {name: width for name, width in every.items() if width is not None}

    def among(self, kept: Sequence[int]) -> RunScatter:
        """The scatter for some of the parameters, given by their indices."""
        chosen = [tuple(tuple(rows[i][j] for j in kept) for i in kept) for rows in self.covariances]
        return replace(self, covariances=tuple(chosen))


_CAMPAIGN_QUANTITIES = (*PARAMETERS, "sensor_zero", "wind_off_inertia", "wind_off_intercept")


@dataclass(frozen=True)
class Estimate:
    """The result for a campaign.

    Args:
        campaign: the campaign's name.
        estimator: the method's name in the registry.
        runs: one estimate per run of the campaign, in its order.
        statuses: from the gravest to the least; OK alone if there are no others.
        cn_beta: Cnβ, 1/rad.
        cn_r: Cnr, 1/rad.
        yaw_inertia: Izz, kg m², from the method's own model.
        mechanical_damping: Cr, N m s/rad.
        sensor_zero: zero of the sensor, common to the campaign, rad.
        wind_off_inertia: Izz as the gradient of Kr against ωn² of the wind-off runs, kg m².
        wind_off_intercept: the intercept of that line, N m/rad; None with one spring.
        parameters: names of the covariance's rows and columns.
        covariance: covariance of the parameters, in the products of their units; shape (p, p).
        noise: the noise level behind the covariance; None where the method does not use it.
        remarks: remarks of the examination before the estimation, on runs left out, cut, or to be checked.
        repeatability: the scatter between runs, included in the covariance; None if none is stated and the runs
            show none beyond their noise.
        trade_off: the two most strongly correlated coefficients; None if the runs separate all of them.
        motion: ``displacement`` of a linear freedom: m, N and kg then replace rad, N m and kg m², and
            ``yaw_inertia`` is the mass; the JSON of an angle does not have it.
    """

    __pydantic_config__ = _FINITE

    campaign: str
    estimator: str
    runs: tuple[RunEstimate, ...]
    statuses: Statuses = (Status.OK,)
    cn_beta: Quantity | None = None
    cn_r: Quantity | None = None
    yaw_inertia: Quantity | None = None
    mechanical_damping: Quantity | None = None
    sensor_zero: Quantity | None = None
    wind_off_inertia: Quantity | None = None
    wind_off_intercept: Quantity | None = None
    parameters: tuple[str, ...] = ()
    covariance: tuple[tuple[float, ...], ...] = ()
    noise: NoiseLevel | None = None
    remarks: tuple[Remark, ...] = ()
    repeatability: RunScatter | None = None
    trade_off: TradeOff | None = None
    motion: Motion = "angle"

    @property
    def status(self) -> Status:
        """The gravest status."""
        return self.statuses[0]

    @property
    def covariance_matrix(self) -> Array:
        """The covariance as an array, shape (p, p), rows and columns as in ``parameters``."""
        size = len(self.parameters)
        return np.array(self.covariance, dtype=np.float64).reshape(size, size)

    def __str__(self) -> str:
        """The coefficients and the first runs as short tables, and the notes on them."""
        return as_text(estimate_blocks(self.to_json_dict()))

    def __repr__(self) -> str:
        """The coefficients, the number of runs, and what to call next, in three lines."""
        return estimate_brief(self.to_json_dict())

    def _repr_html_(self) -> str:
        """The text of `__str__` for notebooks."""
        return as_notebook(estimate_blocks(self.to_json_dict()))

    def coefficients_frame(self) -> pl.DataFrame:
        """A row for each coefficient: value, std, unit, and the ends low and high of its 95 % interval."""
        document = self.to_json_dict()
        rows = []
        for name in _CAMPAIGN_QUANTITIES:
            given = document[name]
            row: dict[str, Any] = {"quantity": name}
            if given is not None:
                low, high = getattr(self, name).ends
                row |= {key: given[key] for key in ("value", "std", "unit")} | {"low": low, "high": high}
            rows.append(row)
        numbers = dict.fromkeys(("value", "std"), pl.Float64)
        ends = dict.fromkeys(("low", "high"), pl.Float64)
        return pl.DataFrame(rows, schema={"quantity": pl.String, **numbers, "unit": pl.String, **ends})

    def to_frame(self) -> pl.DataFrame:
        """`coefficients_frame`, or `runs_frame` if the runs give no coefficients."""
        known = any(getattr(self, name) is not None for name in _CAMPAIGN_QUANTITIES)
        return self.coefficients_frame() if known else self.runs_frame()

    def to_pandas(self) -> DataFrame:
        """`to_frame` for pandas; needs the extra ``frames``."""
        return as_pandas(self.to_frame())

    def to_uncertainties(self) -> dict[str, UFloat]:
        """The coefficients of ``parameters`` by name for the package uncertainties, with their covariance.

        Raises:
            TunnelError: when uncertainties, of the extra ``frames``, is not installed.
        """
        values = {name: getattr(self, name) for name in self.parameters}
        return correlated(values, self.covariance_matrix)

    def to_arviz(self, rng: np.random.Generator, draws: int = 4000) -> DataTree:
        """Draws from the normal distribution of the values for ArviZ; needs the extra ``arviz``.

        Args:
            rng: source of all random numbers.
            draws: number of draws.

        Returns:
            One chain in the group ``posterior``: the coefficients of ``parameters`` with their covariance, and
                ``omega_n`` (rad/s) and ``zeta`` (1) of the identified runs over the dimension ``run``,
                independent.

        Raises:
            TunnelError: when arviz-base, a part of ArviZ 1, is not installed.
        """
        from_dict = library("arviz_base", "to_arviz", "arviz").from_dict
        std = np.sqrt(np.diag(self.covariance_matrix))
        powers, axes = np.linalg.eigh(self.covariance_matrix / np.outer(std, std))
        own = rng.standard_normal((draws, std.size)) * np.sqrt(np.maximum(powers, 0.0))
        values = np.array([getattr(self, name).value for name in self.parameters]) + own @ axes.T * std
        posterior = {name: values[None, :, i] for i, name in enumerate(self.parameters)}
        runs = [run for run in self.runs if run.omega_n is not None and run.zeta is not None]
        for name in ("omega_n", "zeta") if runs else ():
            found = [getattr(run, name) for run in runs]
            own = rng.standard_normal((1, draws, len(runs)))
            posterior[name] = np.array([q.value for q in found]) + own * np.array([q.std for q in found])
        data: DataTree = from_dict(
            {"posterior": posterior},
            coords={"run": [run.id for run in runs]},
            dims={"omega_n": ["run"], "zeta": ["run"]} if runs else {},
            attrs={"posterior": {"campaign": self.campaign, "estimator": self.estimator}},
        )
        return data

    def runs_frame(self) -> pl.DataFrame:
        """A row for each run: its id and status, and the quantities of `RunEstimate` with each ``_std``."""
        rows = [run.to_json_dict() for run in self.runs]
        return wide_frame(rows, {"id": pl.String, "status": pl.String}, _RUN_QUANTITIES)

    def windows_frame(self) -> pl.DataFrame:
        """A row for each window of each run: ``run``, then the fields of `WindowEstimate` with each ``_std``."""
        rows = [{"run": run.id} | as_json(window) for run in self.runs for window in run.windows]
        times = {"start_s": pl.Float64, "duration_s": pl.Float64, "cycles": pl.Int64}
        return wide_frame(rows, {"run": pl.String, **times}, ("amplitude", "omega_n", "zeta"))

    def to_json_dict(self) -> dict[str, Any]:
        """Fields by name; a missing value is None."""
        return {
            "campaign": self.campaign,
            "estimator": self.estimator,
            **_statuses_json(self.statuses),
            "remarks": as_json(self.remarks),
            **_fields_json(
                self, "statuses", "remarks", "runs", *(("motion",) if self.motion == "angle" else ())
            ),
            "runs": as_json(self.runs),
        }

    @classmethod
    def from_json_dict(cls, data: Mapping[str, Any]) -> Estimate:
        """The inverse of `to_json_dict`.

        Args:
            data: the document; further keys, such as those of the budget, are ignored.

        Raises:
            TunnelError: when it is not an estimate: a key is missing, or a value has the wrong type or is not
            finite.
        """
        where, remedy = "the estimate as JSON", "write it again with tunnel identify --json"
        check_shape(data, where, remedy)
        with as_described("is not an estimate", where, remedy):
            found = _adapter().validate_json(json.dumps(data), strict=True)
            if [len(row) for row in found.covariance] != [len(found.parameters)] * len(found.parameters):
                raise ValueError("the covariance does not match the parameters")
            return found


def estimate_schema() -> dict[str, Any]:
    """The JSON schema of `Estimate.to_json_dict`."""
    found = _adapter().json_schema()
    for part in (found, found["$defs"]["RunEstimate"]):  # statuses are written by name, with their text
        names = {"type": "string", "enum": [status.name.lower() for status in Status]}
        part["properties"] |= {
            "status": names,
            "message": {"type": "string", "description": "the first status in words"},
            "statuses": {"type": "array", "items": names},
        }
    return found


def as_pandas(frame: pl.DataFrame) -> DataFrame:
    """A pandas frame, built by columns: Polars' own conversion needs pyarrow."""
    try:
        from pandas import DataFrame  # imported here because it is an extra
    except ModuleNotFoundError as error:
        raise TunnelError("pandas is not installed", remedy=f"run {installing('frames')}") from error
    return DataFrame(frame.to_dict(as_series=False))


def correlated(values: Mapping[str, Any], covariance: Array) -> dict[str, UFloat]:
    """Values for the package uncertainties, of the extra ``frames``.

    Args:
        values: by name, as `AsNumber`.
        covariance: of the values in their order, in the products of their units, shape (n, n).
    """
    made = library("uncertainties", "to_uncertainties", "frames").correlated_values
    if not values:
        return {}
    return dict(zip(values, made([float(one) for one in values.values()], covariance), strict=True))


def wide_frame(
    rows: Sequence[Mapping[str, Any]], plain: Mapping[str, type[pl.DataType]], quantities: Sequence[str]
) -> pl.DataFrame:
    """A row for each document: the plain columns, then the value of each quantity, and its ``_std``.

    Args:
        plain: keys with values to copy unchanged, and their types.
        quantities: keys of quantities, which have a value and a std, or are None.
    """
    columns: dict[str, list[Any]] = {name: [row[name] for row in rows] for name in plain}
    for name in quantities:
        given = [row[name] or {} for row in rows]
        columns[name] = [quantity.get("value") for quantity in given]
        columns[f"{name}_std"] = [quantity.get("std") for quantity in given]
    return pl.DataFrame(columns, schema={name: plain.get(name, pl.Float64) for name in columns})


@cache
def _adapter() -> TypeAdapter[Estimate]:
    return TypeAdapter(Estimate)


def _statuses_json(statuses: tuple[Status, ...]) -> dict[str, Any]:
    return {
        "status": statuses[0].name.lower(),
        "message": statuses[0].value,
        "statuses": [status.name.lower() for status in statuses],
    }


def _fields_json(owner: Any, *without: str) -> dict[str, Any]:
    """A dataclass's fields by name, in JSON's types."""
    return {name: as_json(getattr(owner, name)) for name in owner.__dataclass_fields__ if name not in without}
