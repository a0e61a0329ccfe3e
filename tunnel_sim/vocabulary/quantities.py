"""Numbers and arrays with types that state their unit and shape, in SI units and radians.

In shapes, n counts samples or other values, p shared parameters and m unknowns.

A signature with these types needs no ``Args:`` for unit and shape: ``time: Times, angle: Angles``.
"""

from __future__ import annotations

from typing import Annotated, TypeAlias

from tunnel_sim.vocabulary.record import Array

Rad: TypeAlias = Annotated[float, "rad"]
RadPerS: TypeAlias = Annotated[float, "rad/s"]
Seconds: TypeAlias = Annotated[float, "s"]
Hertz: TypeAlias = Annotated[float, "Hz"]
KgM2: TypeAlias = Annotated[float, "kg m2"]
Gain: TypeAlias = Annotated[float, "rad/s2 per unit of the input"]
Number: TypeAlias = Annotated[float, "dimensionless"]
Share: TypeAlias = Annotated[float, "a fraction from 0 to 1"]

Vector: TypeAlias = Annotated[Array, "shape (n,)"]
PerSample: TypeAlias = Annotated[Array, "shape (n,)"]
"""One value for each sample, in a unit that the docstring or the name states."""
Times: TypeAlias = Annotated[Array, "shape (n,), s"]
Angles: TypeAlias = Annotated[Array, "shape (n,), rad"]
Rates: TypeAlias = Annotated[Array, "shape (n,), rad/s"]
Frequencies: TypeAlias = Annotated[Array, "shape (n,), Hz"]
Moments: TypeAlias = Annotated[Array, "shape (n,), N m"]
Readings: TypeAlias = Annotated[Array, "shape (n,), rad, or rad/s or rad/s2 where the sensor measures those"]
Rows: TypeAlias = Annotated[Array, "shape (n,), in the unit of the file; NaN where there is no number"]
"""A column of a table of a file."""
PerRun: TypeAlias = Annotated[Array, "shape (runs,)"]
"""One value for each run, in a unit that the docstring or the name states."""
AnglePerRun: TypeAlias = Annotated[Array, "shape (runs,), rad"]
RatePerRun: TypeAlias = Annotated[Array, "shape (runs,), rad/s"]
SpeedPerRun: TypeAlias = Annotated[Array, "shape (runs,), m/s"]
DurationPerRun: TypeAlias = Annotated[Array, "shape (runs,), s"]
StiffnessPerRun: TypeAlias = Annotated[Array, "shape (runs,), N m/rad"]
Laws: TypeAlias = Annotated[Array, "shape (runs, parameters), the moment law's parameters in its order"]

PerParameter: TypeAlias = Annotated[Array, "shape (p,)"]
PerUnknown: TypeAlias = Annotated[Array, "shape (m,)"]
PerKind: TypeAlias = Annotated[Array, "shape (kinds,)"]
Square: TypeAlias = Annotated[Array, "shape (m, m)"]
