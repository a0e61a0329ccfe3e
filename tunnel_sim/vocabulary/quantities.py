"""Numbers and arrays whose type states their unit and shape, in SI units and radians; n counts samples.

A signature with these types needs no ``Args:`` for unit and shape: ``time: Times, stiffness: NmPerRad``.
"""

from __future__ import annotations

from typing import Annotated, TypeAlias

from tunnel_sim.vocabulary.record import Array

Rad: TypeAlias = Annotated[float, "rad"]
RadPerS: TypeAlias = Annotated[float, "rad/s"]
Seconds: TypeAlias = Annotated[float, "s"]
Hertz: TypeAlias = Annotated[float, "Hz"]
Metres: TypeAlias = Annotated[float, "m"]
MPerS: TypeAlias = Annotated[float, "m/s"]
KgPerM3: TypeAlias = Annotated[float, "kg/m3"]
KgM2: TypeAlias = Annotated[float, "kg m2"]
Nm: TypeAlias = Annotated[float, "N m"]
NmPerRad: TypeAlias = Annotated[float, "N m/rad"]
NmSPerRad: TypeAlias = Annotated[float, "N m s/rad"]
Number: TypeAlias = Annotated[float, "dimensionless"]
Share: TypeAlias = Annotated[float, "a fraction from 0 to 1"]

PerSample: TypeAlias = Annotated[Array, "shape (n,)"]
"""One value for each sample, in a unit that the docstring or the name states."""
Times: TypeAlias = Annotated[Array, "shape (n,), s"]
Angles: TypeAlias = Annotated[Array, "shape (n,), rad"]
Rates: TypeAlias = Annotated[Array, "shape (n,), rad/s"]
Accelerations: TypeAlias = Annotated[Array, "shape (n,), rad/s2"]
Moments: TypeAlias = Annotated[Array, "shape (n,), N m"]
Speeds: TypeAlias = Annotated[Array, "shape (n,), m/s"]
Readings: TypeAlias = Annotated[Array, "shape (n,), rad, or rad/s or rad/s2 where the sensor measures those"]
Rows: TypeAlias = Annotated[Array, "shape (n,), in the unit of the file; NaN where there is no number"]
"""A column of a table of a file."""
PerRun: TypeAlias = Annotated[Array, "shape (runs,)"]
"""One value for each run, in a unit that the docstring or the name states."""
RatePerRun: TypeAlias = Annotated[Array, "shape (runs,), rad/s"]
SpeedPerRun: TypeAlias = Annotated[Array, "shape (runs,), m/s"]
DurationPerRun: TypeAlias = Annotated[Array, "shape (runs,), s"]
StiffnessPerRun: TypeAlias = Annotated[Array, "shape (runs,), N m/rad"]
Laws: TypeAlias = Annotated[Array, "shape (runs, parameters), the moment law's parameters in its order"]
