"""A body without a restoring moment: a constant moment replaces the sensor's zero."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from diagnosis.model.nominal import FitStart, NominalModel
from diagnosis.model.parameters import Parameter
from diagnosis.model.run_data import PreparedRuns
from diagnosis.model.similarity import (
    REFERENCE_FREQUENCY,
    REFERENCE_INERTIA,
    REFERENCE_STIFFNESS,
    response_to_input,
)
from diagnosis.model.starts import ShownResponse
from tunnel_sim.effects import BetweenRuns, Effect
from tunnel_sim.effects.parameters import SWING, ParameterInfo
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError

_SLOW = 0.1  # 1/s: a small decay rate of the similar rig
_NO_MOMENT = (
    "These effects are not tried, because they have no moment without a spring: {}. Play is visible if a spring of "
    "stated stiffness preloads the joint."
)
_NO_ZERO = (
    "These effects of the sensor are not tried, because its zero is not determined without a spring: {}."
)


@dataclass(frozen=True)
class LooseBody(NominalModel):
    """A driven body without a restoring moment: Izz β̈ + C β̇ = M + M0."""

    restored: ClassVar[bool] = False
    of_robot: ClassVar[bool] = True
    resonance_known: ClassVar[bool] = True
    coefficient_units: ClassVar[Mapping[str, str]] = {
        "yaw_inertia": "kg m2",
        "mechanical_damping": "N m s/rad",
        "added_stiffness": "N m/rad",
        "moment_offset": "N m",
    }

    @classmethod
    def describes(cls, campaign: Campaign) -> bool:
        """Whether every run states a stiffness of 0, and the wind is off."""
        return campaign.unrestrained

    def untried(self, campaign: Campaign, kinds: Sequence[type[Effect]]) -> dict[str, list[type[Effect]]]:
        """Effects of a spring, and of the sensor's zero."""
        del campaign
        of_spring = [kind for kind in kinds if kind.on_spring]
        of_sensor = [k for k in kinds if k.channel == "sensor" and k.fitted and k not in of_spring]
        return {_NO_MOMENT: of_spring, _NO_ZERO: of_sensor}

    def refuse(self, campaign: Campaign) -> None:
        """Refuse an input of unknown gain.

        Raises:
            TunnelError: when a run has such an input.
        """
        if any(run.input_gain is None for run in campaign.runs):
            raise TunnelError(
                "without a spring, inertia and moments cannot be identified when the gain is unknown",
                where=campaign.name,
                remedy="state drive_gain, or record the moment as moment_nm",
            )

    def moment_factor(self, campaign: Campaign, time: float) -> float:
        """Let the inertia swing at the reference frequency on a spring of the reference stiffness."""
        inertia = campaign.rig.yaw_inertia
        if not inertia:  # from the response to the known moments
            found = [(run.input_gain or 1.0, response_to_input(run)) for run in campaign.runs]
            inertia = float(
                np.median([gain / response[2] for gain, response in found if response is not None])
            )
        return REFERENCE_INERTIA / (inertia * time**2)

    def offset(self, data: PreparedRuns) -> tuple[Parameter, ...]:
        """A constant moment; the zero cannot be separated from the initial angle."""
        return (Parameter("moment_offset", "N m", size=REFERENCE_STIFFNESS * data.swing),)

    @property
    def shares_zero(self) -> bool:
        """False: the means of the runs differ."""
        return False

    def starts(self, data: PreparedRuns) -> Iterator[FitStart]:
        """Inertia and damping by the response to the known moments; no other moment."""
        shown = filter(None, map(ShownResponse.of, data.runs))
        found = [(response.inertia, 2.0 * response.rate) for response in shown]
        inertia, loss = np.median(found or [(REFERENCE_INERTIA, 0.0)], axis=0).tolist()
        own = [
            {
                "release_angle": float(np.mean(run.reading[:3])),
                "release_rate": float((run.reading[1] - run.reading[0]) / run.interval),
            }
            for run in data.runs
        ]
        yield FitStart({"yaw_inertia": inertia, "mechanical_damping": inertia * max(loss, _SLOW)}, own)

    def frequency(self, inertia: float, stiffness: float) -> float:
        """The frequency of the reference rig, Hz."""
        del inertia, stiffness
        return REFERENCE_FREQUENCY

    def restoring(self, inertia: float, stiffness: float) -> float:
        """The stiffness with which the body would swing at the reference frequency, N m/rad."""
        del stiffness
        return inertia * (2.0 * np.pi * REFERENCE_FREQUENCY) ** 2

    def critical_damping(self, inertia: float, stiffness: float) -> float | None:
        """None: the body does not swing."""
        del inertia, stiffness
        return None

    def may_scatter(self, kinds: Sequence[type[Effect]]) -> Sequence[type[BetweenRuns]]:
        """Empty: chance differences are defined for a swing."""
        del kinds
        return ()

    def tells(self, info: ParameterInfo, swing: float) -> bool:
        """False for a rest angle: in small swings it acts like a constant moment on a body without a spring."""
        return not (info.beside_spring and swing < SWING)

    def coefficient_names(self, names: Sequence[str]) -> tuple[str, ...]:
        """Inertia, damping and constant moment, if they are fitted."""
        return tuple(name for name in self.coefficient_units if name in names)

    def unseen(self, data: PreparedRuns) -> Sequence[str]:
        """The zero."""
        del data
        return ("the sensor's zero, and its drift as opposed to a constant moment: there is no spring",)

    @property
    def unseen_scale(self) -> str:
        """The clause on a common scale that driven runs cannot show."""
        return "a common scale on the inertia and the moment of the input"
