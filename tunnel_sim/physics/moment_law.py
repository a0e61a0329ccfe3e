"""What the compiled library lists: the moment law's parameters, the plugin's state, the fields of a run.

They are looked up by name, so that Python and C cannot disagree on an order (``mjcf/plugin/tables.c``).
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Mapping

import numpy as np

from tunnel_sim.physics.native import native_library
from tunnel_sim.vocabulary.record import Array


@functools.cache
def forward_library() -> ctypes.CDLL:
    """The compiled forward integrator, loaded once.

    Returns:
        The library with the argument types of its functions set.

    Raises:
        TunnelError: when the package was not built.
    """
    library = ctypes.CDLL(str(native_library("vwt_forward")))
    for kind in ("parameter_name", "parameter_unit", "state_name", "run_name"):
        getattr(library, f"vwt_{kind}").restype = ctypes.c_char_p
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


@functools.cache
def state_names() -> tuple[str, ...]:
    """The names of the numbers of the plugin's state, in their order (``mjcf/plugin/state.h``)."""
    library = forward_library()
    return tuple(library.vwt_state_name(i).decode() for i in range(library.vwt_state_count()))


def state_vector(values: Mapping[str, float]) -> Array:
    """The plugin's state as ``mjData.plugin_state`` holds it.

    Args:
        values: by name, in rad, rad/s and s; what is not given is zero.

    Returns:
        Array of shape (numbers of the state,).

    Raises:
        ValueError: when a name is unknown.
    """
    if unknown := set(values) - set(state_names()):
        raise ValueError(f"the plugin's state has no {', '.join(sorted(unknown))}")
    return np.array([float(values.get(name, 0.0)) for name in state_names()])


@functools.cache
def run_dtype() -> np.dtype[np.void]:
    """One run apart from its moment law, field for field the C structure ``vwt_run``."""
    library = forward_library()
    fields = range(library.vwt_run_count())
    return np.dtype(
        {
            "names": [library.vwt_run_name(i).decode() for i in fields],
            "formats": [np.uintp if library.vwt_run_is_pointer(i) else np.float64 for i in fields],
            "offsets": [library.vwt_run_offset(i) for i in fields],
            "itemsize": library.vwt_run_size(),
        }
    )
