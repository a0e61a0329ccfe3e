"""The true motion of a run, and how it is sampled."""

from __future__ import annotations

from dataclasses import dataclass, field

from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array, read_only


@dataclass(frozen=True, eq=False)
class Motion:
    """The true motion of one run at the sensor's sample times.

    Args:
        time_s: shape (n,), s from the release.
        angle: of the rod's upper end, which carries spring and sensor, shape (n,), rad.
        rate: of the same end, shape (n,), rad/s.
    """

    time_s: Array
    angle: Array
    rate: Array = field(repr=False)

    def __post_init__(self) -> None:
        """Copy the arrays and make them read-only."""
        for name in ("time_s", "angle", "rate"):
            object.__setattr__(self, name, read_only(getattr(self, name)))


def sampling(settings: RunSettings, sample_rate: float) -> tuple[int, int]:
    """The number of samples in a run, and of integration steps between two samples.

    Args:
        settings: duration and timestep, s.
        sample_rate: Hz.

    Returns:
        (samples, steps between samples).

    Raises:
        TunnelError: when the sample rate is outside its limits, or the sample interval is not a whole number of
            timesteps.
    """
    if not limits.SLOWEST_RATE <= sample_rate <= limits.FASTEST_RATE:
        raise TunnelError(
            f"the sample rate of {sample_rate:g} Hz is not between {limits.SLOWEST_RATE:g} and "
            f"{limits.FASTEST_RATE:g} Hz",
            remedy="give it in Hz",
        )
    steps = 1.0 / (sample_rate * settings.timestep)
    if abs(steps - round(steps)) > 1e-9 * steps or round(steps) < 1:
        raise TunnelError(
            f"the sample interval at {sample_rate:g} Hz is not a whole number of {settings.timestep:g} s steps",
            remedy="choose a timestep that divides the sample interval",
        )
    return max(2, round(settings.duration * sample_rate)), round(steps)
