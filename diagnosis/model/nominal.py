"""Nominal models: the parameters, equations, starting points, coefficients and sentences of a kind of rig.

One type describes one kind of rig, in one file. It is chosen once for a campaign, and no other code in the
package depends on the kind.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np

from diagnosis.model.parameters import GAIN, Parameter, released
from diagnosis.model.run_data import PreparedRuns, RunData
from diagnosis.model.similarity import REFERENCE_STIFFNESS, Similarity
from tunnel_sim.effects import BetweenRuns, Effect
from tunnel_sim.effects.parameters import ParameterInfo
from tunnel_sim.physics.expression import Expression, parse
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.physics.run_settings import REFERENCE_SPEED, RunSettings, SettingsTable
from tunnel_sim.vocabulary.campaign import Campaign, mean_wind_speed
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.quantities import AnglePerRun, KgM2
from tunnel_sim.vocabulary.record import Array

#: Moments of the air in the strongest wind that give the size of a coefficient, whatever the air.
_AIR_STIFFNESS, _AIR_DAMPING = 4.0, 0.02  # N m/rad and N m s/rad


@dataclass(frozen=True)
class FitStart:
    """The start of a fit of the nominal model.

    Args:
        common: values of the common parameters by name; 0 where not given.
        own: values of each run's own parameters, by run and name.
    """

    common: Mapping[str, float]
    own: Sequence[Mapping[str, float]]


@dataclass(frozen=True)
class NominalModel:
    """The model of a kind of rig, without any effect.

    A kind overrides the parts in which it differs. All values are in the units of the similar campaign
    (`diagnosis.model.similarity`); its inertia is 1 where unknown.

    Args:
        windy: whether the wind is on in any run of the campaign.
        mean_speed: mean speed of the campaign's runs with the wind on, m/s.
        own_zeros: whether the sensor's zero differs from run to run.
        unknown_gain: whether a run of the campaign has an input with a gain to be fitted.
        in_air: whether the air may add stiffness and damping.
    """

    windy: bool = False
    mean_speed: float = REFERENCE_SPEED
    own_zeros: bool = False
    unknown_gain: bool = False
    in_air: bool = True

    #: Whether moments are per unit inertia, because no run shows them in N m.
    per_inertia: ClassVar[bool] = False
    #: Whether the body has a restoring moment, so that it swings about a place and its angle does not drift
    #: away.
    restored: ClassVar[bool] = True
    #: Whether the body is the joint of a machine: its springs and wind cannot be chosen.
    of_robot: ClassVar[bool] = False
    #: Whether the model states moments at the true size of the angle, so that the angle cannot be scaled.
    own_size: ClassVar[bool] = False
    #: Whether the resonance of a driven run is known, so that the run need not show it.
    resonance_known: ClassVar[bool] = False
    #: Units of the stated coefficients, by name.
    coefficient_units: ClassVar[Mapping[str, str]] = {"cn_beta": "1/rad", "cn_r": "1/rad"}

    # ---- how it is chosen ----

    @classmethod
    def describes(cls, campaign: Campaign) -> bool:
        """Whether it is the model of a campaign without a given model."""
        del campaign
        return False

    def of(self, campaign: Campaign) -> NominalModel:
        """The model with the values that it takes from a campaign."""
        return dataclasses.replace(
            self,
            windy=bool(campaign.in_wind),
            mean_speed=mean_wind_speed((run.wind_speed for run in campaign.runs), REFERENCE_SPEED),
            own_zeros=campaign.sensor.zero == "per_run" and self.restored and "zero" not in self.held,
            unknown_gain=any(map(self.fits_gain, campaign.inputs)),
            in_air=campaign.sensor.freedom.windy and not self.of_robot,
        )

    def among(self, runs: Sequence[RunData]) -> NominalModel:
        """The model of some runs by themselves, without the parameters that these runs do not have."""
        return dataclasses.replace(
            self,
            windy=any(run.wind_on for run in runs),
            unknown_gain=any(run.multiplied_by == GAIN for run in runs),
        )

    def fits_gain(self, drive: Input) -> bool:
        """Whether the gain of an input is fitted.

        Per unit inertia, a known moment also has an unknown gain: one over the inertia. Motion of the spring's
        root acts through the spring's stiffness, and rotation of the base through the inertia.
        """
        return self.multiplied_by(drive) == GAIN

    def multiplied_by(self, drive: Input) -> str:
        """The parameter that multiplies the moment of an input as stated by the run; empty: none."""
        kind = drive.kind
        if kind.by_inertia:
            return "" if self.per_inertia else "yaw_inertia"
        return GAIN if drive.on_body and (self.per_inertia or not drive.gain_stated) else ""

    def refuse(self, campaign: Campaign) -> None:
        """Refuse runs that the model cannot describe.

        Raises:
            TunnelError: names the first such run.
        """
        del campaign

    def untried(self, campaign: Campaign, kinds: Sequence[type[Effect]]) -> dict[str, list[type[Effect]]]:
        """The effects that the model excludes, by the sentence with the reason and a place for their names."""
        del campaign, kinds
        return {}

    # ---- its scale ----

    def moment_factor(self, campaign: Campaign, time: float) -> float:
        """The factor on moments that makes the campaign similar to the reference rig, dimensionless.

        Args:
            time: the factor on times, dimensionless.
        """
        del time
        springs = [run.spring_stiffness for run in campaign.runs if run.spring_stiffness is not None]
        return REFERENCE_STIFFNESS / float(np.median(springs))

    def similar(self, change: Similarity) -> NominalModel:
        """The model with its constants in the units of the similar campaign."""
        del change
        return self

    # ---- its parameters and equations ----

    @property
    def held(self) -> Mapping[str, float]:
        """Values of parameters that are not fitted, by name."""
        return {}

    def parameters(self, data: PreparedRuns) -> tuple[Parameter, ...]:
        """The model's parameters; the common ones are in the order of a fit's vectors."""
        named = (*self.inertial(data), *self.air(data), *self.input_gain(data), *self.offset(data))
        own_zero = Parameter("zero", "rad", owner="per_run") if self.own_zeros else None
        return *(one for one in named if one.name not in self.held), *released(own_zero)

    def inertial(self, data: PreparedRuns) -> tuple[Parameter, ...]:
        """Inertia, damping and stiffness, if they are fitted."""
        del data
        return (
            Parameter("yaw_inertia", "kg m2", lower=1e-9, size=0.1),
            Parameter("mechanical_damping", "N m s/rad", lower=0.0, size=0.02),
        )

    def air(self, data: PreparedRuns) -> tuple[Parameter, ...]:
        """The aerodynamic derivatives; none in still air."""
        if not self.windy:
            return ()
        stiffness = max(map(data.air_moment, data.in_wind), default=1.0)
        damping = max(map(data.air_damping, data.in_wind), default=1.0)
        return (
            Parameter("cn_beta", "1/rad", size=_AIR_STIFFNESS / stiffness),
            Parameter("cn_r", "1/rad", size=_AIR_DAMPING / damping),
        )

    def input_gain(self, data: PreparedRuns) -> tuple[Parameter, ...]:
        """The gain of an input, if it is not known."""
        if not self.unknown_gain:
            return ()
        inputs = [float(np.max(np.abs(drive.values))) for drive in data.inputs]
        size = 1e-2 * REFERENCE_STIFFNESS * data.swing / max(inputs, default=1.0)
        return (Parameter(GAIN, "N m", size=size),)

    def offset(self, data: PreparedRuns) -> tuple[Parameter, ...]:
        """The sensor's zero, if it is common to the runs."""
        del data
        return () if self.own_zeros else (Parameter("zero", "rad"),)

    @property
    def shares_zero(self) -> bool:
        """Whether the sensor's zero is common to the runs, so that their means can be compared with it."""
        return not self.own_zeros

    def run_settings(self, values: Mapping[str, float], run: RunData) -> RunSettings:
        """The physics of one run.

        Args:
            values: values of all parameters by name, including the run's own and the held ones.
        """
        return self.settings({name: np.array([value]) for name, value in values.items()}, [run]).row(0)

    def settings(self, values: Mapping[str, Array], runs: Sequence[RunData]) -> SettingsTable:
        """The physics of several runs.

        Args:
            values: values of all parameters by name, including each run's own and the held ones, shape (runs,)
                each.
            runs: the runs; a run may occur several times with different values.
        """
        table, names = SettingsTable.empty(len(runs)), tuple(values)
        rows = [
            dict(zip(names, row, strict=True))
            for row in zip(*(one.tolist() for one in values.values()), strict=True)
        ]
        spring = [self.spring(row, run) for row, run in zip(rows, runs, strict=True)]
        columns = {
            "spring_stiffness": np.maximum(spring, 0.0),
            "yaw_inertia": values.get("yaw_inertia", 1.0),
            "wind_speed": [run.wind_speed for run in runs],
            "air_density": [run.air_density for run in runs],
            "mean_speed": self.mean_speed,
            "duration": [run.duration for run in runs],
            **{name: values[name] for name in ("mechanical_damping", "release_angle", "release_rate")},
            **{name: values[name] for name in ("cn_beta", "cn_r") if name in values},
        }
        for name, column in columns.items():
            table[name][:] = column
        table.set(self.law_parameters)
        moments: dict[tuple[RunData, float, float], InputMoment | None] = {}  # equal moments are one object
        for place, (row, run) in enumerate(zip(rows, runs, strict=True)):
            if self.moment:
                table.program[place] = _program(self.moment, spring[place])
            key = run, row.get(run.multiplied_by, 1.0), row.get("moment_offset", 0.0)
            if key not in moments:
                moments[key] = run.moment(*key[1:])
            table.drive[place] = moments[key]
        return table

    def spring(self, values: Mapping[str, float], run: RunData) -> float:
        """Stiffness of the spring in a run, N m/rad."""
        del values
        assert run.spring_stiffness is not None
        return run.spring_stiffness

    @property
    def law_parameters(self) -> Mapping[str, float]:
        """Parameters of the moment law beside a linear spring and damper."""
        return {}

    @property
    def moment(self) -> str:
        """The moment beside a linear spring and damper, N m, as an expression; empty: none.

        A function of the angle ``b`` (rad) from rest, the rate ``r`` (rad/s) and the stiffness ``Kr`` of the
        run's spring (N m/rad), in the notation of user-defined effects. Effects are added to it.
        """
        return ""

    @property
    def lead(self) -> float:
        """Time by which the motion leads its input, s."""
        return 0.0

    def possible_leads(self) -> tuple[float, ...]:
        """Leads that may explain more than no lead, s, the first of them 0; empty: the model has no lead."""
        return ()

    def with_lead(self, lead: float) -> NominalModel:
        """This model with another lead, s."""
        del lead
        return self

    def notes(self) -> tuple[str, ...]:
        """Remarks on reading the answer, in sentences."""
        return ()

    def gain_words(self) -> str:
        """The gain of the input as stated by the model, in a sentence; empty: none."""
        return ""

    def lead_words(self, change: Similarity) -> tuple[str, ...]:
        """The lead of the motion, in a sentence; none without a lead.

        Args:
            change: how the campaign was made similar.
        """
        del change
        return ()

    def springs_at(self, data: PreparedRuns, amplitude: AnglePerRun) -> Array:
        """Stiffness of every run's spring at an amplitude, by harmonic balance, N m/rad, shape (runs,)."""
        spring = np.array([run.spring_stiffness for run in data.runs], dtype=np.float64)
        if not self.moment:
            return spring
        phase = 2.0 * np.pi * np.arange(_PHASES) / _PHASES
        at: dict[str, float | Array] = {
            "b": amplitude[:, None] * np.cos(phase),
            "r": 0.0,
            "Kr": spring[:, None],
        }
        further = _expression(self.moment).value(at)
        seen = spring - 2.0 * np.mean(further * np.cos(phase), axis=1) / np.maximum(amplitude, 1e-12)
        return np.where(seen > 0.0, seen, spring)

    # ---- its starting points ----

    def starts(self, data: PreparedRuns) -> Iterator[FitStart]:
        """Starting points for the model's fit; the second is used if the fit from the first misses the motion."""
        raise NotImplementedError

    # ---- motion ----

    def frequency(self, inertia: KgM2, stiffness: float) -> float:
        """Frequency of the free motion, Hz; without a restoring moment, the frequency of the reference rig.

        Args:
            stiffness: stiffness of the restoring moment, N m/rad.
        """
        return float(np.sqrt(max(stiffness, 1e-12) / inertia) / (2.0 * np.pi))

    def restoring(self, inertia: float, stiffness: float) -> float:
        """The stiffness that gives that frequency, N m/rad; arguments as in `frequency`."""
        del inertia
        return stiffness

    def critical_damping(self, inertia: float, stiffness: float) -> float | None:
        """The critical damping, N m s/rad; None without a restoring moment."""
        return 2.0 * math.sqrt(inertia * stiffness) if stiffness > 0.0 else None

    def may_scatter(self, kinds: Sequence[type[Effect]]) -> Sequence[type[BetweenRuns]]:
        """The chance differences between runs that the model allows."""
        return [kind for kind in kinds if issubclass(kind, BetweenRuns)]

    def fitted_spring(self, value: Mapping[str, float]) -> float | None:
        """Stiffness of a fitted spring, N m/rad; None where the stiffness is stated or there is no spring."""
        del value
        return None

    def tells(self, info: ParameterInfo, swing: float) -> bool:
        """Whether the runs can distinguish a parameter of an effect from the model's own parameters.

        Args:
            swing: largest angle of the motion, rad.
        """
        del info, swing
        return True

    # ---- its coefficients ----

    @property
    def moment_unit(self) -> str:
        """Unit of an identified moment."""
        return "rad/s2" if self.per_inertia else "N m"

    def identified_unit(self, unit: str) -> str:
        """Unit of an identified quantity, from its unit in SI."""
        return unit

    def coefficient_names(self, names: Sequence[str]) -> tuple[str, ...]:
        """The coefficients that a diagnosis states.

        Args:
            names: names of the common parameters of the fit.
        """
        del names
        return tuple(self.coefficient_units)

    def coefficient(self, names: Sequence[str], common: Array, name: str) -> float | None:
        """A coefficient of a fit in its unit; None if the model has no such coefficient.

        Args:
            names: names of the common parameters.
            common: their values, shape (common,).
        """
        return dict(zip(names, common.tolist(), strict=True)).get(name)

    def gradient(self, names: Sequence[str], common: Array, name: str) -> Array:
        """Derivative of a coefficient with respect to the common parameters, shape (common,).

        Args:
            names: names of the common parameters.
            common: their values, shape (common,).
            name: name of the coefficient; the derivative is zero if it is held.
        """
        del common
        return np.array([float(one == name) for one in names])

    def bounded_by(self, names: Sequence[str], name: str) -> str | None:
        """The fitted parameter whose bound limits this coefficient; None if there is none."""
        del names
        return name if name == "mechanical_damping" else None

    # ---- limits of the runs, and further runs ----

    def blind_spots(self, data: PreparedRuns) -> tuple[str, ...]:
        """The limits of these runs, as clauses; limits of every campaign come last."""
        speeds, found = data.wind_speeds, [*self.unseen(data)]
        if not self.windy:
            found += ["any effect of the air: there is no run with the wind on"] if self.in_air else []
        elif len(speeds) < 2:
            found.append(
                "a lag, a wind-speed offset or a dependence of Cnβ on the speed: there is one wind speed only, and "
                "Cnβ and Cnr absorb them"
            )
        elif len(speeds) == _TOLD_BY:
            found.append(
                "a wind-speed offset as opposed to a dependence of Cnβ on the speed, except by the damping: there "
                "are only two wind speeds"
            )
        if self.windy and not data.in_still_air:
            found.append("whether an effect is mechanical or aerodynamic: there is no run with the wind off")
        common = [one for one in self.parameters(data) if one.owner == "common" and one.name != "zero"]
        if len(data.runs) == 1:
            found.append("how well runs repeat: a single run shows no scatter between runs")
        elif _OF_A_DECAY * len(data.runs) <= len(common) and not (data.driven or data.repeatability):
            found.append(
                "how well runs repeat: no two runs can be compared, and ± assumes runs that repeat exactly"
            )
        last = (_OF_WIND,) if self.windy else ()
        if data.driven:
            found.append("a lag of the sensor as opposed to a delay of the input: only their sum is visible")
            return *found, ALWAYS_BLIND[1], self.unseen_scale, *last
        return *found, *ALWAYS_BLIND, *last

    def unseen(self, data: PreparedRuns) -> Sequence[str]:
        """Clauses on what the springs of these runs cannot show."""
        if len(data.springs) > 1:
            return ()
        return (
            "structural as opposed to viscous damping, gravity, or a wrong stiffness: there is one spring only",
        )

    @property
    def unseen_scale(self) -> str:
        """The clause on a common scale that driven runs cannot show."""
        return ALWAYS_BLIND[2]

    def planned_springs(self, data: PreparedRuns) -> tuple[float, ...]:
        """Stiffnesses of the springs available for a further run, ascending, N m/rad."""
        return data.springs


@lru_cache(maxsize=8)
def _expression(text: str) -> Expression:
    return parse(text, frozenset({"b", "r", "Kr"}))


@lru_cache(maxsize=64)  # enough for the springs of a campaign
def _program(text: str, spring: float) -> tuple[float, ...]:
    """A moment beside spring and damper as the moment law evaluates it."""
    return _expression(text).program({"Kr": spring}, {"b": "angle", "r": "rate"})


_OF_A_DECAY = 2  # quantities that a run determines: its frequency and its damping
# number of wind speeds: an offset of the speed and a coefficient that depends on it both fit two stiffnesses
_TOLD_BY = 2
_PHASES = 64  # instants of a cycle, for its mean
ALWAYS_BLIND = (
    "a constant sensor lag or filter: it only shifts the release",
    "an error of the clock",
    "a common scale on the inertia and all stiffnesses",
)
_OF_WIND = "a scale error of wind speed or air density: Cnβ and Cnr absorb it"
