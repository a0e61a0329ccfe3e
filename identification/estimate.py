"""The result of an estimator: values with standard deviations, and statuses that say what to do.

All estimators return an `Estimate`. A value that could not be identified is None, never NaN, and a `Status` says
why and what to do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np
import polars as pl

from identification.printing.estimate_tables import estimate_parts
from identification.printing.frames import long_frame, wide_frame
from identification.printing.table import as_html, as_text
from identification.remark import Remark
from identification.status import Status as Status
from identification.status import by_gravity as by_gravity
from tunnel_sim.files.reading import as_described, check_shape
from tunnel_sim.vocabulary.errors import one_line
from tunnel_sim.vocabulary.record import Array

PARAMETERS = ("cn_beta", "cn_r", "yaw_inertia", "mechanical_damping")
UNITS: Mapping[str, str] = {
    "cn_beta": "1/rad",
    "cn_r": "1/rad",
    "yaw_inertia": "kg m2",
    "mechanical_damping": "N m s/rad",
}


@dataclass(frozen=True)
class Quantity:
    """An estimated value.

    Args:
        value: in the unit.
        std: its standard deviation, in the unit.
        unit: SI, e.g. ``rad/s``; ``1`` where there is none.
        interval: lower and upper end of the 95 % interval, in the unit, where the method gives one;
            otherwise it is value ± 1.96 std.
    """

    value: float
    std: float
    unit: str
    interval: tuple[float, float] | None = None

    def to_json_dict(self) -> dict[str, Any]:
        """``{"value", "std", "unit"}``, and ``"interval"`` where there is one."""
        data = {"value": self.value, "std": self.std, "unit": self.unit}
        return data if self.interval is None else data | {"interval": list(self.interval)}

    @classmethod
    def from_json_dict(cls, data: Mapping[str, Any]) -> Quantity:
        """The inverse of `to_json_dict`; raises `TunnelError` for a malformed document."""
        with _taken_apart("quantity"):
            interval = data.get("interval")
            ends = None
            if interval is not None:
                low, high = interval
                ends = (_number(low), _number(high))
            return cls(_number(data["value"]), _number(data["std"]), _text(data["unit"]), ends)


@dataclass(frozen=True)
class NoiseLevel:
    """The sensor noise behind the standard deviations, compared with the residual.

    Args:
        std: standard deviation used, rad, quantisation included.
        source: ``stated`` (noise_std and resolution of the campaign) or ``residual`` (of the fit).
        residual_std: standard deviation of the residual, rad.
        slow_ratio: power of the residual's slow part over that of white noise; 1 where the model explains the
            data; where it does not, the variances are multiplied by it.
        departs: whether the slow ratio is beyond chance (false-alarm rate 1e-3).
        disagrees: whether the residual's white part contradicts the stated noise.
    """

    std: float
    source: str
    residual_std: float
    slow_ratio: float
    departs: bool
    disagrees: bool

    def to_json_dict(self) -> dict[str, Any]:
        """Fields by name."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}

    @classmethod
    def from_json_dict(cls, data: Mapping[str, Any]) -> NoiseLevel:
        """The inverse of `to_json_dict`; raises `TunnelError` for a malformed document."""
        with _taken_apart("noise level"):
            return cls(
                std=_number(data["std"]),
                source=_text(data["source"]),
                residual_std=_number(data["residual_std"]),
                slow_ratio=_number(data["slow_ratio"]),
                departs=_flag(data["departs"]),
                disagrees=_flag(data["disagrees"]),
            )


@dataclass(frozen=True)
class WindowEstimate:
    """The oscillation in one window of a few cycles, as in the paper's Table III.

    Args:
        start_s: start of the window since the record's first sample, s.
        duration_s: length of the window, s.
        amplitude: of the oscillation at mid-window, rad.
        omega_n: natural angular frequency, rad/s.
        zeta: damping ratio.
        cycles: number of periods; three, or one in a short record.
    """

    start_s: float
    duration_s: float
    amplitude: Quantity
    omega_n: Quantity
    zeta: Quantity
    cycles: int = 3

    def to_json_dict(self) -> dict[str, Any]:
        """Fields by name."""
        return {
            "start_s": self.start_s,
            "duration_s": self.duration_s,
            "amplitude": self.amplitude.to_json_dict(),
            "omega_n": self.omega_n.to_json_dict(),
            "zeta": self.zeta.to_json_dict(),
            "cycles": self.cycles,
        }

    @classmethod
    def from_json_dict(cls, data: Mapping[str, Any]) -> WindowEstimate:
        """The inverse of `to_json_dict`; raises `TunnelError` for a malformed document."""
        with _taken_apart("window"):
            names = ("amplitude", "omega_n", "zeta")
            quantities = {name: Quantity.from_json_dict(data[name]) for name in names}
            start, duration = _number(data["start_s"]), _number(data["duration_s"])
            return cls(start, duration, cycles=int(_number(data["cycles"])), **quantities)


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
        id: the run's.
        statuses: from the gravest; only OK where there are no others.
        omega_n: natural angular frequency, rad/s.
        zeta: damping ratio.
        initial_angle: at the first sample, from the sensor's zero, rad.
        initial_rate: at the first sample, rad/s.
        sensor_zero: from this run alone, rad.
        aerodynamic_stiffness: Ka, N m/rad, from the whole campaign; wind-on runs only.
        aerodynamic_damping: Ca, N m s/rad, from the whole campaign; wind-on runs only.
        process_noise: spectral intensity of a random moment over the inertia, rad²/s³; None where the method
            does not estimate it, or the run shows none.
        noise: the noise level behind the standard deviations; None where the method does not use it.
        windows: consecutive windows of three cycles.
    """

    id: str
    statuses: tuple[Status, ...] = (Status.OK,)
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

    def to_json_dict(self) -> dict[str, Any]:
        """Fields by name; None where there is no value."""
        return {
            "id": self.id,
            **_statuses_json(self.statuses),
            **_quantities_json(self, _RUN_QUANTITIES),
            "noise": self.noise.to_json_dict() if self.noise else None,
            "windows": [window.to_json_dict() for window in self.windows],
        }

    @classmethod
    def from_json_dict(cls, data: Mapping[str, Any]) -> RunEstimate:
        """The inverse of `to_json_dict`; raises `TunnelError` for a malformed document."""
        with _taken_apart("run"):
            return cls(
                id=_text(data["id"]),
                statuses=_statuses_from_json(data),
                noise=None if data["noise"] is None else NoiseLevel.from_json_dict(data["noise"]),
                windows=tuple(WindowEstimate.from_json_dict(window) for window in data["windows"]),
                **_quantities_from_json(data, _RUN_QUANTITIES),
            )


_CAMPAIGN_QUANTITIES = (*PARAMETERS, "sensor_zero", "wind_off_inertia", "wind_off_intercept")


@dataclass(frozen=True)
class Estimate:
    """The result for a campaign.

    Args:
        campaign: the campaign's name.
        estimator: the method's name in the registry.
        runs: one per run of the campaign, in its order.
        statuses: from the gravest; only OK where there are no others.
        cn_beta: Cnβ, 1/rad.
        cn_r: Cnr, 1/rad.
        yaw_inertia: Izz, kg m², from the method's own model.
        mechanical_damping: Cr, N m s/rad.
        sensor_zero: common to the campaign, rad.
        wind_off_inertia: Izz as the gradient of Kr against ωn² of the wind-off runs, kg m².
        wind_off_intercept: the intercept of that line, N m/rad; None with one spring.
        parameters: names of the covariance's rows and columns.
        covariance: of the parameters, in the products of their units; shape (p, p).
        noise: the noise level behind the covariance; None where the method does not use it.
        remarks: of the examination before the estimation, on runs left out, cut or to look at.
    """

    campaign: str
    estimator: str
    runs: tuple[RunEstimate, ...]
    statuses: tuple[Status, ...] = (Status.OK,)
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
        """The coefficients and the first runs as short tables, and what is to be said of them."""
        return as_text(estimate_parts(self.to_json_dict()))

    def _repr_html_(self) -> str:
        """The same for notebooks."""
        return as_html(estimate_parts(self.to_json_dict()))

    def coefficients_frame(self) -> pl.DataFrame:
        """A row for each coefficient: value, std, unit, and the ends low and high of its 95 % interval."""
        document = self.to_json_dict()
        return long_frame({name: document[name] for name in _CAMPAIGN_QUANTITIES})

    def runs_frame(self) -> pl.DataFrame:
        """A row for each run: its id and status, and the quantities of `RunEstimate` with each ``_std``."""
        rows = [run.to_json_dict() for run in self.runs]
        return wide_frame(rows, {"id": pl.String, "status": pl.String}, _RUN_QUANTITIES)

    def windows_frame(self) -> pl.DataFrame:
        """A row for each window of each run: ``run``, then the fields of `WindowEstimate` with each ``_std``."""
        rows = [{"run": run.id} | window.to_json_dict() for run in self.runs for window in run.windows]
        times = {"start_s": pl.Float64, "duration_s": pl.Float64, "cycles": pl.Int64}
        return wide_frame(rows, {"run": pl.String, **times}, ("amplitude", "omega_n", "zeta"))

    def to_json_dict(self) -> dict[str, Any]:
        """Fields by name; None where there is no value."""
        return {
            "campaign": self.campaign,
            "estimator": self.estimator,
            **_statuses_json(self.statuses),
            "remarks": [remark.to_json_dict() for remark in self.remarks],
            **_quantities_json(self, _CAMPAIGN_QUANTITIES),
            "parameters": list(self.parameters),
            "covariance": [list(row) for row in self.covariance],
            "noise": self.noise.to_json_dict() if self.noise else None,
            "runs": [run.to_json_dict() for run in self.runs],
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
        check_shape(data, _WHERE, _REMEDY)
        with _taken_apart("estimate"):
            return cls(
                campaign=_text(data["campaign"]),
                estimator=_text(data["estimator"]),
                runs=tuple(RunEstimate.from_json_dict(run) for run in data["runs"]),
                statuses=_statuses_from_json(data),
                parameters=tuple(_text(name) for name in data["parameters"]),
                covariance=_covariance(data["covariance"], len(data["parameters"])),
                noise=None if data["noise"] is None else NoiseLevel.from_json_dict(data["noise"]),
                remarks=tuple(Remark.from_json_dict(remark) for remark in data.get("remarks", ())),
                **_quantities_from_json(data, _CAMPAIGN_QUANTITIES),
            )


def _statuses_json(statuses: tuple[Status, ...]) -> dict[str, Any]:
    return {
        "status": statuses[0].name.lower(),
        "message": statuses[0].value,
        "statuses": [status.name.lower() for status in statuses],
    }


def _statuses_from_json(data: Mapping[str, Any]) -> tuple[Status, ...]:
    statuses = tuple(Status[_text(name).upper()] for name in data["statuses"])
    if not statuses:
        raise ValueError("no status")
    return statuses


def _covariance(rows: Sequence[Sequence[float]], size: int) -> tuple[tuple[float, ...], ...]:
    """Rows of a covariance, shape (size, size)."""
    found = tuple(tuple(_number(value) for value in row) for row in rows)
    if [len(row) for row in found] != [size] * size:
        raise ValueError("the covariance does not match the parameters")
    return found


_WHERE = "the estimate as JSON"
_REMEDY = "write it again with tunnel identify --json"


def _taken_apart(kind: str) -> AbstractContextManager[None]:
    """Turn the errors that a malformed document causes into one `TunnelError`."""
    return as_described(f"is no {kind}", _WHERE, _REMEDY)


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise ValueError(f"{one_line(repr(value), 20)} is not a finite number")
    return float(value)


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{one_line(repr(value), 20)} is not text")
    return value


def _flag(value: object) -> bool:
    if not isinstance(value, bool | np.bool):
        raise TypeError(f"{one_line(repr(value), 20)} is neither true nor false")
    return bool(value)


def _quantities_json(owner: object, names: tuple[str, ...]) -> dict[str, Any]:
    quantities: dict[str, Quantity | None] = {name: getattr(owner, name) for name in names}
    return {name: None if value is None else value.to_json_dict() for name, value in quantities.items()}


def _quantities_from_json(data: Mapping[str, Any], names: tuple[str, ...]) -> dict[str, Quantity | None]:
    return {name: None if data.get(name) is None else Quantity.from_json_dict(data[name]) for name in names}
