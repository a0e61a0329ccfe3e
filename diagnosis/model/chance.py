"""Chance differences between runs, as a fit has them: what a run's own deviation changes of its motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from diagnosis.model.parameters import Parameter, Prior
from diagnosis.model.run_data import Data
from tunnel_sim.effects import Effect
from tunnel_sim.effects.base import Drawn
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.plan import AeroDerivatives

_WIDE = 10.0  # widths of a usual scatter that steps of differences are a share of
#: Share of the air's damping that deviations of the damping are relative to at least: a bearing may have none.
_LEAST_DAMPING = 0.1


@dataclass(frozen=True)
class Chance:
    """One chance difference between runs: of the wind speed, the spring or the damping.

    A deviation changes the linear stiffness and damping of its run, by what the nominal model gives them. An effect
    that depends on the speed or the spring does not see it: a deviation is to follow no error of its form. The
    exception is vortex shedding. It keeps time with the true speed; at the stated speed its phase is lost within
    some cycles.

    Args:
        kind: the effect of the vocabulary that it is.
        width: standard deviation of the runs' relative deviations, dimensionless.
        derivatives: of the nominal model.
        damping: mechanical damping of the nominal model, N m s/rad.
        shown: whether the runs show that they differ in this rather than in the others, beyond what is stated.
    """

    kind: type[Effect]
    width: float
    derivatives: AeroDerivatives
    damping: float
    shown: bool = False

    @property
    def name(self) -> str:
        """Name of the effect, and of a run's own deviation."""
        return self.kind.name

    @property
    def usual(self) -> float:
        """Usual width."""
        return self.kind.parameters()[0].scale

    @property
    def parameter(self) -> Parameter:
        """A run's own relative deviation."""
        return Parameter(self.name, "1", size=_WIDE * self.usual, owner="per_run", prior=Prior(self.width))

    def as_wide_as(self, width: float) -> Chance:
        """The same with another width."""
        return replace(self, width=float(width))

    def change(self, stated: RunSettings, data: Data) -> tuple[float, float]:
        """What a relative deviation of 1 changes of a run's stiffness (N m/rad) and damping (N m s/rad).

        Args:
            stated: the nominal physics of the run.
        """
        pressure, speed = data.air_moment(stated), stated.wind_speed
        rate = pressure * data.reference_length / speed if speed > 0.0 else 0.0
        stiffness, damping = pressure * self.derivatives.cn_beta, rate * self.derivatives.cn_r
        own = max(self.damping, _LEAST_DAMPING * abs(damping))
        return self.kind.departure(stated.spring_stiffness, own, stiffness, damping)


_FOLLOWS_SPEED = "strouhal_number"


class RunDeparture(Effect):
    """What a run's own deviations change of its motion; no effect of the vocabulary, and the last of a chain."""

    name = "run_departure"

    def on_run(self, run: RunSettings, stated: RunSettings, drawn: Drawn) -> RunSettings:
        """Add stiffness and damping, and change the wind's speed by a share; ``drawn`` in this order."""
        del stated
        stiffness, damping, faster = self.drawn_numbers(drawn)
        followed = run.parameters.get(_FOLLOWS_SPEED, 0.0)
        if followed and faster:
            run = run.with_parameters({_FOLLOWS_SPEED: (1.0 + float(faster)) * followed})
        return replace(
            run,
            spring_stiffness=max(run.spring_stiffness + float(stiffness), 0.0),
            mechanical_damping=run.mechanical_damping + float(damping),
        )


#: The chance differences of a fit.
Scatter = tuple[Chance, ...]


def departure(
    scatter: Sequence[Chance], deviations: Sequence[float], stated: RunSettings, data: Data
) -> tuple[float, float, float]:
    """What the deviations of a run change.

    Args:
        deviations: relative, one for each chance difference.
        stated: the nominal physics of the run.

    Returns:
        Changes of the stiffness, N m/rad, and of the damping, N m s/rad, and that of the wind speed as a share.
    """
    changes = [one.change(stated, data) for one in scatter]
    stiffness = sum(k * e for (k, _), e in zip(changes, deviations, strict=True))
    damping = sum(c * e for (_, c), e in zip(changes, deviations, strict=True))
    of_speed = (e for one, e in zip(scatter, deviations, strict=True) if one.kind.scatters == "wind_speed")
    return stiffness, damping, sum(of_speed)
