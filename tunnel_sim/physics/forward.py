"""The compiled forward integrator: the plugin's moment law without MuJoCo, for fits of many runs.

It uses RK4 steps, computes the aerodynamic lag as the plugin does, and locates reversals under Coulomb
friction. Tests compare it with the MuJoCo model for every term. Calls release the global interpreter lock.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.physics.moment_law import forward_library, parameter_names, parameter_vector, run_dtype
from tunnel_sim.physics.run_settings import Motion, RunSettings, sampling, spring_end_angle
from tunnel_sim.vocabulary.quantities import Angles, Hertz, Laws, Rad
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import Rig

_NONE: Array = np.zeros(0)


def integrate(
    law: Laws, runs: NDArray[np.void], samples: int | NDArray[np.int64]
) -> tuple[Array, Array, int]:
    """Integrate runs: angle (rad) and rate (rad/s) of the rod's upper end, shape (runs, samples of the longest).

    The status is 0, or one more than the index of the first run with a diverging motion (this run and the later
    ones are unset). Beyond the end of a run both are 0.

    Args:
        runs: of `run_dtype`; the arrays behind its pointers must stay alive.
        samples: number of samples of every run, or one number for all, the first at time 0.
    """
    count = len(runs)
    law = np.ascontiguousarray(law, dtype=np.float64)
    if law.shape != (count, len(parameter_names())):
        raise ValueError(f"law has shape {law.shape}, not {(count, len(parameter_names()))}")
    runs = np.ascontiguousarray(runs)
    runs["samples"], size = samples, int(np.max(samples))
    angle, rate = np.zeros((count, size)), np.zeros((count, size))
    pointers = [
        (array.ctypes.data + np.arange(len(array)) * array.strides[0]).astype(np.uintp)
        for array in (angle, rate)
    ]
    status = forward_library().vwt_forward(
        count, law.ctypes.data, runs.ctypes.data, pointers[0].ctypes.data, pointers[1].ctypes.data
    )
    return angle, rate, int(status)


def forward_motion(rig: Rig, settings: RunSettings, sample_rate: Hertz) -> Motion:
    """Integrate one run with its timestep; a ValueError where the motion diverges."""
    samples, steps = sampling(settings, sample_rate)
    run, keep_alive = forward_run(settings)
    run["steps"] = steps
    angle, rate, status = integrate(parameter_vector(settings.law(rig))[None], run, samples)
    del keep_alive
    if status:
        raise ValueError("the motion grows without bound")
    return Motion(np.arange(samples) / sample_rate, angle[0], rate[0])


def forward_run(settings: RunSettings) -> tuple[NDArray[np.void], Sequence[Array]]:
    """A run at its release for the compiled code, shape (1,), of `run_dtype`, and the arrays to keep alive."""
    wind = settings.series.get("wind_speed")
    forcing = settings.series.get("forcing")
    values = np.array(wind.values if wind is not None else [settings.wind_speed], dtype=np.float64)
    ambient = settings.series.get("ambient")
    imposed = _NONE if forcing is None else np.array(forcing.values, dtype=np.float64)
    beside = _NONE if ambient is None else np.array(ambient.values, dtype=np.float64)
    program = np.array(settings.program, dtype=np.float64) if settings.program else _NONE
    drive = None if settings.drive is None else settings.drive.exerted
    driven = () if drive is None else (drive.values, drive.time_s)
    fields = {
        "wind": values.ctypes.data,
        "wind_count": values.size,
        "wind_interval": wind.interval if wind is not None else 0.0,
        "forcing": imposed.ctypes.data,
        "forcing_count": imposed.size,
        "forcing_interval": forcing.interval if forcing is not None else 0.0,
        "ambient": beside.ctypes.data,
        "ambient_count": beside.size,
        "ambient_interval": ambient.interval if ambient is not None else 0.0,
        "program": program.ctypes.data,
        "program_count": program.size,
        "angle": settings.release_angle,
        "rate": settings.release_rate,
        "lagged": settings.release_angle,
        "step": settings.timestep,
        "steps": 1,
    }
    if drive is not None:
        fields |= {
            "moment": drive.values.ctypes.data,
            "moment_time": drive.time_s.ctypes.data,
            "moment_count": drive.values.size,
            "moment_scale": drive.scale,
            "moment_delay": drive.delay,
            "moment_held": float(drive.held),
            "moment_on_end": float(not drive.on_body),
            "moment_offset": drive.offset,
        }
    if settings.rod_twist is not None:
        twist, end = settings.rod_twist, spring_end_angle(settings)
        fields |= {
            "angle": end,
            "twist": settings.release_angle - end,
            "twist_stiffness": 1.0 / twist.compliance,
            "twist_damping": twist.damping(settings.yaw_inertia),
            "inertia_share": twist.inertia_share,
        }
    names = run_dtype().names
    assert names is not None
    row = tuple(fields.get(name, 0) for name in names)  # all fields at once: setting single fields is slow
    return np.array([row], dtype=run_dtype()), (values, imposed, beside, program, *driven)


def backlash(angle: Angles, half_width: Rad, start: Rad) -> Angles:
    """The reading behind a backlash: it moves only when pushed, at first from a starting reading."""
    source = np.ascontiguousarray(angle, dtype=np.float64)
    result = np.empty_like(source)
    forward_library().vwt_backlash(source.size, source.ctypes.data, half_width, start, result.ctypes.data)
    return result
