"""Effects of the actuator of a driven run: its lag, its greatest moment and its greatest rate of change.

They change the moment on the body that the run file states, not the motion of a root or a base. Between its
samples the input is held or linear, as the run states. In any combination, the moment is first clipped, then
its rate is limited, then it is lagged. At the start of a recorded run the actuator has settled at its first
sample.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

from tunnel_sim.effects.base import Drawn, Effect
from tunnel_sim.effects.parameters import Circumstances, Trial, parameter
from tunnel_sim.effects.traits import Text
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.physics.run_settings import SettingsTable

_FRANKLIN = "Franklin, Powell & Emami-Naeini, Feedback Control of Dynamic Systems, 8th ed., Pearson 2019"
_SLOW = 0.03
"""Minimum ωτ of a lag. The gain of a faster lag falls by (ωτ)²/2, less than half a thousandth: it is a delay."""
_LIMITS = (0.95, 0.85, 0.7, 0.5, 0.3)
"""Tried limits of the moment, over the greatest demanded moment."""
_SOFT_LIMITS, _SOFT = (3.0, 1.5, 0.75), 0.45
"""Tried soft limits over the greatest demanded moment, and their softness, close to a hyperbolic tangent."""
_RATES = (0.8, 0.5, 0.3, 0.15, 0.06, 0.02, 0.007)
"""Tried limits of the rate, over the greatest demanded rate: for a smooth input, and for one that jumps."""


@dataclass(frozen=True)
class ActuatorEffect(Effect):
    """The actuator of a moment on the body, not of the motion of a root or a base: each effect sets a property."""

    channel = "forcing"
    condition = "always"
    autonomous = False
    driven = True

    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        """Change the actuators; a free decay has none."""
        del stated, drawn
        runs.change_inputs(effects, cls._exerted)

    def _exerted(self, drive: InputMoment) -> InputMoment:
        if self.is_null or not drive.kind.by_actuator:
            return drive
        own = {info.name: getattr(self, info.name) for info in self.parameters()}
        return dataclasses.replace(drive, actuator=dataclasses.replace(drive.actuator, **own))


@dataclass(frozen=True)
class ActuatorSaturation(ActuatorEffect):
    """An actuator whose moment is limited: by its supply, sharply, or by a magnet that saturates, softly."""

    name = "actuator_saturation"
    place = 30
    size = "an actuator that exerts at most {limit}"
    advice = "Command smaller moments, or record the moment of the actuator"
    equation = "|moment| ≤ M, in driven runs; general form: u/(1 + |u/M|^(1/s))^s for the demanded moment u"
    signature = (
        "Small inputs act as stated; at the peaks of large inputs the motion is smaller than predicted by the "
        "nominal model."
    )
    references = (
        _FRANKLIN,
        "Rapp, Proc. 2nd European Conf. Satellite Communications, Liège (1991) 179 (the soft limit)",
    )
    example = (0.6,)
    tries = 2

    limit: float = parameter("M", "N m", "greatest moment (0: no limit)", scale=1.0, lower=0.0, upper=1e6)
    softness: float = parameter(
        "s", "1", "softness of the limit (0: hard; near 0.4: a hyperbolic tangent)",
        scale=0.4, lower=0.0, upper=1.0, fit_lower=0.02, form=True,
    )  # fmt: skip

    @classmethod
    def phrase(cls, values: Mapping[str, float], stds: Mapping[str, float | None], text: Text) -> str:
        """The greatest moment, and whether the actuator approaches it softly."""
        said = super().phrase(values, stds, text)
        return f"{said}, which it approaches softly" if values.get("softness", 0.0) > 0.0 else said

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """Limits near the greatest demanded moment of any run."""
        greatest = campaign.greatest_moment
        hard = [Trial({"limit": share * greatest}, None) for share in _LIMITS]
        soft = [Trial({"limit": share * greatest, "softness": _SOFT}, None) for share in _SOFT_LIMITS]
        return [*hard, *soft]


@dataclass(frozen=True)
class ActuatorRateLimit(ActuatorEffect):
    """An actuator whose moment changes at a limited rate."""

    name = "actuator_rate_limit"
    place = 31
    size = "an actuator whose moment changes by at most {rate}"
    advice = "Command slower changes, or record the moment of the actuator"
    equation = "|d moment/dt| ≤ R, in driven runs"
    signature = (
        "Slow parts of the input act as stated; for fast and large inputs the moment is triangular, late and too "
        "small."
    )
    references = (_FRANKLIN,)
    example = (3.0,)
    tries = 2

    rate: float = parameter(
        "R", "N m/s", "greatest rate of change (0: no limit)", scale=10.0, lower=0.0, upper=1e9
    )

    @classmethod
    def trials(cls, campaign: Circumstances) -> Sequence[Trial]:
        """Rates below the greatest demanded rate of any run."""
        return [Trial({"rate": share * campaign.fastest_moment}, None) for share in _RATES]


@dataclass(frozen=True)
class ActuatorLag(ActuatorEffect):
    """An actuator whose moment follows the input with a lag of first order."""

    name = "actuator_lag"
    place = 32
    size = "an actuator that follows its input with a time constant of {lag}"
    advice = "Record the moment of the actuator, or use a faster actuator"
    equation = "τ dm/dt + m = u for the moment m of the stated input u, in driven runs"
    signature = (
        "The phase between input and angle falls by arctan ωτ and the gain by √(1 + ω²τ²). At low frequencies "
        "this is a delay; at high frequencies the delay and the gain decrease."
    )
    references = (_FRANKLIN,)
    example = (0.02,)

    lag: float = parameter(
        "τ", "s", "time constant of the lag",
        scale=0.002, lower=0.0, upper=10.0, fit_upper=1.0,
    )  # fmt: skip

    def plausible(self, omega: float, duration: float, readings: tuple[float, float]) -> bool:
        """Whether the lag is more than a delay between input and motion: at least as slow as `_SLOW`."""
        del duration, readings
        return self.lag * omega > _SLOW
