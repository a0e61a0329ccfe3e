"""Numbers with their units, and arrays with their shapes: the types of arguments that need no more words.

SI throughout. In shapes, n counts samples or other values, p shared parameters and m unknowns.
"""

from __future__ import annotations

from typing import Annotated, TypeAlias

from tunnel_sim.vocabulary.record import Array

Seconds: TypeAlias = Annotated[float, "s"]
Hertz: TypeAlias = Annotated[float, "Hz"]
Rad: TypeAlias = Annotated[float, "rad"]
RadPerS: TypeAlias = Annotated[float, "rad/s"]
Gain: TypeAlias = Annotated[float, "rad/s² per unit of the input"]
KgM2: TypeAlias = Annotated[float, "kg m²"]
Share: TypeAlias = Annotated[float, "a fraction of 1"]

Vector: TypeAlias = Annotated[Array, "shape (n,)"]
Times: TypeAlias = Annotated[Array, "shape (n,), s"]
Angles: TypeAlias = Annotated[Array, "shape (n,), rad"]
Rates: TypeAlias = Annotated[Array, "shape (n,), rad/s"]
Frequencies: TypeAlias = Annotated[Array, "shape (n,), Hz"]
PerParameter: TypeAlias = Annotated[Array, "shape (p,)"]
PerUnknown: TypeAlias = Annotated[Array, "shape (m,)"]
PerKind: TypeAlias = Annotated[Array, "shape (kinds,)"]
AnglePerRun: TypeAlias = Annotated[Array, "shape (runs,), rad"]
Square: TypeAlias = Annotated[Array, "shape (m, m)"]
