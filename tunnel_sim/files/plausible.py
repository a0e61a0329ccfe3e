"""What a rig, its air and its clock may plausibly be: outside, a slip of units is likelier than such a rig.

The ranges are wide enough for towing carriages, pressurised tunnels and models of a few centimetres, so a slip is
seen where it leaves them, and not otherwise. Speeds in km/h, a factor of 3.6, mostly stay inside: nothing in a
free decay tells V from a scale of Cnβ and Cnr. Stiffness and inertia have no range at all, for both scale with
the fifth power of a rig's size.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Record

KEEP = "state plausible = false under [sensor] to keep it"
#: Samples to a cycle: fewer show the swing's peaks to 5 % only, and the true motion may be an alias above half the
#: sampling rate that nothing in the record betrays.
LEAST_SAMPLES_PER_CYCLE = 10.0
_LOOKS = "it looks like"


@dataclass(frozen=True)
class Range:
    """The plausible values of one quantity.

    Args:
        low: least plausible value, in the unit.
        high: largest, in the unit.
        unit: as the format states it.
        above: what a value above looks like.
        below: what a value below looks like.
        reason: why the ends are where they are.
    """

    low: float
    high: float
    unit: str
    above: str
    below: str
    reason: str


RANGES: Mapping[str, Range] = {
    "air_density": Range(
        0.05, 50.0, "kg/m3", "g/m3, or water", "g/cm3",
        "air at 20 km altitude has 0.09, a tunnel at 20 bar or heavy gas stays below 30; water has 1000",
    ),
    "wind_speed": Range(
        0.0, 120.0, "m/s", "km/h or mm/s", "",
        "beyond a Mach number of 0.35 the air's compressibility changes the coefficients themselves",
    ),
    "frontal_area": Range(
        1e-5, 100.0, "m2", "cm2 or mm2", "km2",
        "a model 3 mm across up to a lorry or a ship of 10 m across",
    ),
    "reference_length": Range(
        3e-3, 50.0, "m", "cm or mm", "km",
        "a model of some millimetres up to a lorry with its trailer",
    ),
    "width": Range(1e-3, 20.0, "m", "cm or mm", "km", "as the reference length, and a third of it"),
    "step": Range(
        1e-7, 0.5, "s", "milliseconds", "minutes or hours",
        "10 MHz is beyond any angle sensor, and a rig is sampled more often than twice a second",
    ),
    "period": Range(
        1e-3, 100.0, "s", "milliseconds", "minutes or hours",
        "a rig that takes minutes for a swing is a ship, one above 1 kHz a tuning fork",
    ),
}  # fmt: skip
"""By the key of ``campaign.toml``; of a run file, the step of ``time_s`` and the period of the swing."""


def plausible_values(values: Mapping[str, Any], where: str) -> None:
    """Refuse stated values that look like a slip of units.

    Args:
        values: by the key of ``campaign.toml``, in its units; keys without a range and None are passed over.
        where: file and table or run, for messages.

    Raises:
        TunnelError: for the first value out of its range.
    """
    for key, value in values.items():
        allowed = RANGES.get(key)
        if allowed is not None and value is not None:
            _check(f"{key} = {value:g} {allowed.unit}", value, allowed, where)


def plausible_run(record: Record, cycles: float, where: str) -> None:
    """Refuse a record whose clock looks like a slip of units, or that is sampled too slowly.

    Args:
        record: the run's reading.
        cycles: how many periods of its oscillation it holds (a count).
        where: file and run, for messages.

    Raises:
        TunnelError: a step or a period out of its range, or fewer than ten samples to a cycle.
    """
    step, per_cycle = record.sample_interval, record.yaw_rad.size / cycles
    _check(f"time_s steps by {step:.3g} s", step, RANGES["step"], where)
    _check(f"a swing takes {step * per_cycle:.3g} s", step * per_cycle, RANGES["period"], where)
    if per_cycle < LEAST_SAMPLES_PER_CYCLE:
        raise TunnelError(
            f"{per_cycle:.1f} samples to a cycle: {_LOOKS} a sampling too slow, by which a faster motion may pass "
            f"for this one",
            where=where,
            remedy=f"sample at {LEAST_SAMPLES_PER_CYCLE / (step * per_cycle):.3g} Hz or more; {KEEP}",
        )


def _check(said: str, value: float, allowed: Range, where: str) -> None:
    if allowed.low <= value <= allowed.high:
        return
    slip = allowed.above if value > allowed.high else allowed.below
    raise TunnelError(f"{said}: {_LOOKS} {slip}", where=where, remedy=f"give it in {allowed.unit}; {KEEP}")
