"""The moment law's parameters, as the compiled library lists them (``mjcf/plugin/moment.h``)."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Mapping

import numpy as np

from tunnel_sim.native import native_library
from tunnel_sim.record import Array


@functools.cache
def forward_library() -> ctypes.CDLL:
    """The compiled forward integrator, loaded once.

    Returns:
        The library with the argument types of its functions set.

    Raises:
        TunnelError: when the package was not built.
    """
    library = ctypes.CDLL(str(native_library("vwt_forward")))
    library.vwt_parameter_name.restype = ctypes.c_char_p
    library.vwt_parameter_unit.restype = ctypes.c_char_p
    pointer = ctypes.c_void_p
    library.vwt_forward.argtypes = [ctypes.c_int, pointer, pointer, pointer, pointer]
    library.vwt_backlash.argtypes = [ctypes.c_int, pointer, ctypes.c_double, ctypes.c_double, pointer]
    library.vwt_backlash.restype = None
    return library


@functools.cache
def parameter_names() -> tuple[str, ...]:
    """The names of the law's parameters, in the law's order."""
    library = forward_library()
    return tuple(library.vwt_parameter_name(i).decode() for i in range(library.vwt_parameter_count()))


@functools.cache
def parameter_units() -> Mapping[str, str]:
    """The unit of every parameter by name."""
    library = forward_library()
    return {name: library.vwt_parameter_unit(i).decode() for i, name in enumerate(parameter_names())}


def parameter_vector(values: Mapping[str, float]) -> Array:
    """The law's parameters as the compiled code takes them.

    Args:
        values: by name, in the law's units; what is not given is zero.

    Returns:
        Array of shape (number of parameters,).
    """
    return np.array([float(values.get(name, 0.0)) for name in parameter_names()])
