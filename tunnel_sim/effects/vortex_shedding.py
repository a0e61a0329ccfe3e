"""A periodic moment from vortices shed by the body."""

from __future__ import annotations

from dataclasses import dataclass

from tunnel_sim.effects.base import Drawn, Effect, with_law
from tunnel_sim.effects.parameters import parameter
from tunnel_sim.physics.run_settings import RunSettings


@dataclass(frozen=True)
class VortexShedding(Effect):
    """A periodic moment from vortices shed by the body.

    Args:
        amplitude: coefficient of the moment, dimensionless.
        strouhal_number: Strouhal number based on the body's width, dimensionless.
    """

    name = "vortex_shedding"
    place = 14
    channel = "forcing"
    condition = "wind_on"
    advice = "Choose wind speeds at which the vortices are shed far from the rig's frequency"
    equation = "c ½ρV²Al sin(2π St V t/width + φ), φ drawn for every run"
    signature = "A spectral line whose frequency is proportional to the wind speed."
    references = ("Bearman, Annu. Rev. Fluid Mech. 16 (1984) 195, doi 10.1146/annurev.fl.16.010184.001211",)
    example = (0.1, 0.02)
    autonomous = False
    line = "shedding"
    random = "narrow_band"

    amplitude: float = parameter(
        "c", "1", "coefficient of the moment", scale=0.01, lower=0.0, upper=5.0, per_pressure=True
    )
    strouhal_number: float = parameter(
        "St",
        "1",
        "Strouhal number based on the body's width",
        scale=0.15,
        lower=0.001,
        upper=2.0,
        default=0.15,
    )

    def on_run(self, run: RunSettings, stated: RunSettings, drawn: Drawn) -> RunSettings:
        """Set the terms of the moment law, with the phase drawn for the run."""
        del stated
        if self.is_null:
            return run
        return with_law(
            run,
            shedding_amplitude=self.amplitude,
            strouhal_number=self.strouhal_number,
            shedding_phase=self.drawn_number(drawn),
        )
