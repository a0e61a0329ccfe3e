"""The compiled moment law: the path of its library, and its names of parameters, states and operations.

Python reads the names from the library, so that their order always agrees with C (``mjcf/plugin/tables.c``).
"""

from __future__ import annotations

import ctypes
import functools
import importlib.metadata
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tunnel_sim.vocabulary.errors import REINSTALLING, TunnelError
from tunnel_sim.vocabulary.record import Array

#: Parameters of the moments of gravity that load a joint: greatest moment and angle of rest.
WEIGHTS = (("gravity_stiffness", "gravity_angle"), ("load_stiffness", "load_angle"))


def native_library(stem: str) -> Path:
    """The path of a compiled library in the installed package, even when the sources run from a checkout."""
    try:
        distribution = importlib.metadata.distribution("virtual-wind-tunnel")
    except importlib.metadata.PackageNotFoundError as error:
        raise TunnelError("the package is not installed", remedy=f"run {REINSTALLING}") from error
    folder = Path(str(distribution.locate_file("tunnel_sim/native")))
    for ending in (".so", ".dylib", ".dll"):
        path = folder / f"lib{stem}{ending}"
        if path.is_file():
            return path
    what = f"the compiled library {stem} is missing"
    raise TunnelError(what, where=str(folder), remedy=f"reinstall: run {REINSTALLING}")


@functools.cache
def forward_library() -> ctypes.CDLL:
    """The compiled forward integrator, loaded once, with the argument types of its functions set."""
    library = ctypes.CDLL(str(native_library("vwt_forward")))
    for kind in ("parameter_name", "parameter_unit", "state_name", "operation_name", "run_name", "term_name"):
        getattr(library, f"vwt_{kind}").restype = ctypes.c_char_p
    pointer, number = ctypes.c_void_p, ctypes.c_int
    library.vwt_forward.argtypes = [ctypes.c_int, pointer, pointer, pointer, pointer]
    library.vwt_terms.argtypes = [ctypes.c_int, *[pointer] * 3]
    library.vwt_terms.restype = None
    library.vwt_slopes.argtypes = [
        *(number, pointer, pointer, number, number, pointer, pointer, pointer, number),
        *[pointer] * 4,
    ]
    library.vwt_backlash.argtypes = [ctypes.c_int, pointer, ctypes.c_double, ctypes.c_double, pointer]
    library.vwt_backlash.restype = None
    library.vwt_evaluate.argtypes = [ctypes.c_int, pointer, ctypes.c_int, pointer, pointer]
    library.vwt_evaluate.restype = None
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
    """The law's parameters, in its units, in the form of the compiled code; the others are zero."""
    return np.array([float(values.get(name, 0.0)) for name in parameter_names()])


@functools.cache
def state_names() -> tuple[str, ...]:
    """The names of the plugin's state variables, in their order (``mjcf/plugin/state.h``)."""
    library = forward_library()
    return tuple(library.vwt_state_name(i).decode() for i in range(library.vwt_state_count()))


def state_vector(values: Mapping[str, float]) -> Array:
    """The plugin's state (rad, rad/s, s) in the form of ``mjData.plugin_state``; the other values are zero."""
    if unknown := set(values) - set(state_names()):
        raise ValueError(f"the plugin's state has no {', '.join(sorted(unknown))}")
    return np.array([float(values.get(name, 0.0)) for name in state_names()])


@functools.cache
def operation_names() -> tuple[str, ...]:
    """The operations of a program, by their numbers (``mjcf/plugin/expression.h``)."""
    library = forward_library()
    return tuple(library.vwt_operation_name(i).decode() for i in range(library.vwt_operation_count()))


@functools.cache
def run_dtype() -> np.dtype[np.void]:
    """One run without its moment law: the C structure ``vwt_run``, field by field."""
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
