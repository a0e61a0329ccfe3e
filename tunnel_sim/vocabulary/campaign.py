"""A campaign: the runs of one rig with one sensor, measured or simulated."""

from __future__ import annotations

from dataclasses import dataclass

from tunnel_sim.vocabulary.record import Record


@dataclass(frozen=True)
class RigProperties:
    """What a campaign states of its rig; None where it does not say.

    Args:
        yaw_inertia: nominal Izz of model and support, kg m².
        frontal_area: A, m²; needed for non-dimensional coefficients.
        reference_length: l, m; likewise.
        width: body width, m (Strouhal numbers).
    """

    yaw_inertia: float | None = None
    frontal_area: float | None = None
    reference_length: float | None = None
    width: float | None = None


@dataclass(frozen=True)
class SensorProperties:
    """What a campaign states of its angle sensor; None where it does not say.

    Args:
        sample_rate: Hz.
        resolution: step of the reading, rad.
        noise_std: standard deviation of the reading's noise, rad.
        plausible: False keeps what looks like a slip of units or a sampling too slow.
    """

    sample_rate: float | None = None
    resolution: float | None = None
    noise_std: float | None = None
    plausible: bool | None = None


@dataclass(frozen=True)
class Run:
    """One run: its record and the conditions it was made in.

    Args:
        id: unique in the campaign.
        record: the sensor's reading.
        wind_speed: V, m/s; 0 is wind-off.
        spring_stiffness: Kr, N m/rad; None: the run is identified in normalised form.
        air_density: ρ, kg/m³; present where wind_speed > 0.
        release_angle: nominal, rad.
    """

    id: str
    record: Record
    wind_speed: float
    spring_stiffness: float | None = None
    air_density: float | None = None
    release_angle: float | None = None

    @property
    def wind_on(self) -> bool:
        """Whether the wind blows."""
        return self.wind_speed > 0.0


@dataclass(frozen=True)
class Campaign:
    """The runs of one rig with one sensor, whose zero is unknown and common to all of them.

    Args:
        name: short name, also the folder's.
        rig: what is stated of the rig.
        sensor: what is stated of the sensor.
        runs: at least one run, with unique ids.
        description: free text.
    """

    name: str
    rig: RigProperties
    sensor: SensorProperties
    runs: tuple[Run, ...]
    description: str = ""
