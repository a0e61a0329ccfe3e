"""The rig: a body on springs of stated stiffness; and a body on one spring of unknown stiffness."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from diagnosis.model.nominal import FitStart, NominalModel
from diagnosis.model.parameters import Parameter
from diagnosis.model.run_data import PreparedRuns, RunData
from diagnosis.model.starts import Shown, decay_squares
from tunnel_sim.effects import ALL_EFFECTS, Effect
from tunnel_sim.effects.parameters import ParameterInfo
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.dimensions import dimension, in_si, product
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

_STEP = 1e-5  # step of a derivative by central differences, as a share of the parameter
_LOSS = 0.01  # loss at a start, as a share of the angular frequency: a small damping

#: Parameters of effects that add to the spring's stiffness at small amplitudes, such as gravity's.
_STIFFNESSES = tuple(
    f"{kind.name}.{kind.parameters()[0].name}"
    for kind in ALL_EFFECTS
    if kind.channel == "stiffness" and kind.parameters()[0].unit == "N m/rad"
)


_OF_SWINGS = tuple(kind for kind in ALL_EFFECTS if "small_swings" in vars(kind))


def _changing_swings(names: Sequence[str]) -> dict[type[Effect], list[str]]:
    """The effects that change the motion of small swings, with the names of their parameters."""
    found = {kind: [one for one in names if one.startswith(f"{kind.name}.")] for kind in _OF_SWINGS}
    return {kind: own for kind, own in found.items() if own}


#: Units of moments on the yaw axis, and of moments per unit inertia.
_PER_INERTIA = {
    "N m": "rad/s2",
    "N m/rad": "1/s2",
    "N m s/rad": "1/s",
    "N m s2/rad2": "1/rad",
    "rad/(N m)": "s2",
}


def unit_per_inertia(unit: str) -> str:
    """The unit of a quantity per unit of inertia, such as rad/s2 for N m."""
    of = dimension(unit)
    by_mass = in_si(product(of, dimension("kg m2"), -of[0])) if of[0] else unit
    return _PER_INERTIA.get(unit, by_mass)


@dataclass(frozen=True)
class SpringModel(NominalModel):
    """A body on springs of stated stiffness: Izz β̈ + C β̇ + Kr β = Ka β + Ca β̇."""

    @classmethod
    def describes(cls, campaign: Campaign) -> bool:
        """Whether every run states its spring."""
        return all(run.spring_stiffness is not None for run in campaign.runs)

    def refuse(self, campaign: Campaign) -> None:
        """Refuse runs that do not state their spring, if this model is given.

        Raises:
            TunnelError: names all such runs.
        """
        bare = [run.id for run in campaign.runs if run.spring_stiffness is None]
        if bare:
            raise TunnelError(
                f"the nominal model {type(self).__name__} needs the spring of every run, and these state none: "
                f"{', '.join(bare)}",
                where=campaign.name,
                remedy="state spring_stiffness, or leave the model out",
            )

    def starts(self, data: PreparedRuns) -> Iterator[FitStart]:
        """Starts from the runs' spectra, then from their own decays as in `identify`."""
        yield self._start(data, Shown.of(data))
        squares = decay_squares(data)
        if squares is not None:
            yield self._start(data, Shown.of(data, squares))

    def _start(self, data: PreparedRuns, shown: Shown) -> FitStart:
        zero = float(np.median(shown.zeros))
        zeros = shown.zeros if self.own_zeros else [zero] * len(shown.zeros)
        own = [
            {"release_angle": float(np.mean(run.reading[:3]) - own_zero), "zero": own_zero}
            for run, own_zero in zip(data.runs, zeros, strict=True)
        ]
        return FitStart({**self.dynamics(data, shown), "zero": zero}, own)

    def dynamics(self, data: PreparedRuns, shown: Shown) -> dict[str, float]:
        """Starting values by name, apart from the zero.

        Inertia and aerodynamic stiffness are found by linear regression of the runs' frequencies.
        """
        spring = self.springs_at(data, np.sqrt(2.0) * shown.swing)
        pressure, moving = np.array([data.air_moment(run) for run in data.runs]), shown.moving
        # Kr = Izz ω² + pressure Cnβ, with equal relative errors
        design = np.column_stack([shown.squares, pressure]) / spring[:, None] * moving[:, None]
        if not self.windy:
            design = design[:, :1]
        solution = np.linalg.lstsq(design, moving, rcond=None)[0]
        inertia = float(solution[0])
        if inertia <= 0.0:
            inertia = float(np.median((spring / shown.squares)[moving > 0.0]))
        damping = _LOSS * inertia * float(np.sqrt(shown.typical))
        if shown.loss is not None:
            damping = inertia * shown.loss
        found = {"yaw_inertia": inertia, "mechanical_damping": damping, "drive_gain": inertia * shown.gain}
        return found | ({"cn_beta": float(solution[1])} if self.windy else {})


@dataclass(frozen=True)
class PerInertia(SpringModel):
    """A body on one spring of unknown stiffness: all moments are per unit inertia."""

    per_inertia: ClassVar[bool] = True
    coefficient_units: ClassVar[Mapping[str, str]] = {"omega_n": "rad/s", "zeta": "1"}
    #: Name of the parameter for the stiffness of the spring.
    of_spring: ClassVar[str] = "stiffness"

    @classmethod
    def describes(cls, campaign: Campaign) -> bool:
        """Whether a run states no spring."""
        return any(run.spring_stiffness is None for run in campaign.runs)

    def refuse(self, campaign: Campaign) -> None:
        """Refuse inputs of known gain beside inputs of unknown gain.

        Raises:
            TunnelError: when there are inputs of both kinds.
        """
        fitted = [drive for drive in campaign.inputs if self.fits_gain(drive)]
        mixed = {drive.gain_stated for drive in fitted}
        if len(mixed) > 1:
            raise TunnelError(
                "without spring_stiffness, inputs of known and of unknown gain cannot be diagnosed together",
                where=campaign.name,
                remedy="state spring_stiffness, or diagnose the two kinds of runs separately",
            )

    def moment_factor(self, campaign: Campaign, time: float) -> float:
        """Keep the inertia at 1."""
        del campaign
        return time**-2

    def inertial(self, data: PreparedRuns) -> tuple[Parameter, ...]:
        """The common stiffness, instead of the inertia."""
        del data
        return (
            Parameter(self.of_spring, "1/s2", lower=0.0, size=10.0),
            Parameter("mechanical_damping", "1/s", lower=0.0, size=0.02),
        )

    def spring(self, values: Mapping[str, float], run: RunData) -> float:
        """The common stiffness, 1/s²."""
        del run
        return values[self.of_spring]

    def dynamics(self, data: PreparedRuns, shown: Shown) -> dict[str, float]:
        """Starting values by name, apart from the zero."""
        del data
        loss = _LOSS * float(np.sqrt(shown.typical)) if shown.loss is None else shown.loss
        return {self.of_spring: shown.typical, "mechanical_damping": loss, "drive_gain": shown.gain}

    def fitted_spring(self, value: Mapping[str, float]) -> float | None:
        """The common stiffness, 1/s²."""
        return value[self.of_spring]

    def tells(self, info: ParameterInfo, swing: float) -> bool:
        """False for parameters that only a spring of stated stiffness determines."""
        del swing
        return not info.beside_spring

    def identified_unit(self, unit: str) -> str:
        """The unit of a quantity per unit of inertia."""
        return unit_per_inertia(unit)

    def coefficient(self, names: Sequence[str], common: Array, name: str) -> float | None:
        """The natural frequency (rad/s) or the damping ratio of small swings.

        Returns:
            Another parameter for its name; None where the model has none, and for the ratio if nothing restores.
        """
        value = dict(zip(names, common.tolist(), strict=True))
        if name not in self.coefficient_units:
            return value.get(name)
        stiffness = max(sum(value[part] for part in self._stiffnesses(names)), 0.0)
        damping = value["mechanical_damping"]
        for kind, own in _changing_swings(names).items():
            given = {info.name: info.default for info in kind.parameters()}
            given |= {one.rpartition(".")[2]: value[one] for one in own}
            stiffness, damping = kind.small_swings(stiffness, damping, given)
        omega = float(np.sqrt(stiffness))
        if name == "omega_n":
            return omega
        return damping / (2.0 * omega) if omega > 0.0 else None  # nothing swings

    def gradient(self, names: Sequence[str], common: Array, name: str) -> Array:
        """Derivative of a coefficient with respect to the common parameters, shape (common,)."""
        if name not in self.coefficient_units:
            return super().gradient(names, common, name)
        found = np.zeros(len(names))
        of_swings = [one for own in _changing_swings(names).values() for one in own]
        for one in ("mechanical_damping", *self._stiffnesses(names), *of_swings):
            place = list(names).index(one)
            step = _STEP * max(abs(float(common[place])), _STEP)
            ends = [common.copy(), common.copy()]
            ends[0][place] -= step
            ends[1][place] += step
            low, high = (self.coefficient(names, end, name) or 0.0 for end in ends)
            found[place] = (high - low) / (2.0 * step)
        return found

    def bounded_by(self, names: Sequence[str], name: str) -> str | None:
        """The damping; for the frequency the spring, unless gravity restores the body instead."""
        if name == "zeta":
            return "mechanical_damping"
        return self.of_spring if name == "omega_n" and len(self._stiffnesses(names)) == 1 else None

    def _stiffnesses(self, names: Sequence[str]) -> tuple[str, ...]:
        """The parameters that sum to the stiffness of small swings; a pendulum's only spring is gravity."""
        return (self.of_spring, *(name for name in _STIFFNESSES if name in names))

    def unseen(self, data: PreparedRuns) -> Sequence[str]:
        """The spring is not stated."""
        del data
        return ("an error of a single spring: the runs state no stiffness",)

    def planned_springs(self, data: PreparedRuns) -> tuple[float, ...]:
        """None: no stiffness is known."""
        del data
        return ()
