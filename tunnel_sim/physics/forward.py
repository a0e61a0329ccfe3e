"""The compiled forward integrator: the plugin's moment law without MuJoCo, for fits of many runs.

It uses RK4 steps, computes the aerodynamic lag as the plugin does, and locates reversals under Coulomb
friction. Tests compare it with the MuJoCo model for every term. Calls release the global interpreter lock.
"""

from __future__ import annotations

import cmath
import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.physics.moment_law import forward_library, parameter_names, parameter_vector, run_dtype
from tunnel_sim.physics.run_settings import Motion, RunSettings, sampling, spring_end_angle
from tunnel_sim.vocabulary.plan import aerodynamic_damping, aerodynamic_stiffness
from tunnel_sim.vocabulary.quantities import Angles, Hertz, Laws, Rad, Rates, Seconds
from tunnel_sim.vocabulary.record import Array
from tunnel_sim.vocabulary.rig import Rig

_NONE: Array = np.zeros(0)


def integrate(law: Laws, runs: NDArray[np.void], samples: int) -> tuple[Array, Array, int]:
    """Integrate runs of equal length: angle (rad) and rate (rad/s) of the rod's upper end, shape (runs, samples).

    The status is 0, or one more than the index of the first run whose motion diverged (that run and
    the later ones are unset).

    Args:
        runs: of `run_dtype`; the arrays behind its pointers must stay alive.
        samples: samples per run, the first at time 0.
    """
    count = len(runs)
    law = np.ascontiguousarray(law, dtype=np.float64)
    if law.shape != (count, len(parameter_names())):
        raise ValueError(f"law has shape {law.shape}, not {(count, len(parameter_names()))}")
    runs = np.ascontiguousarray(runs)
    runs["samples"] = samples
    angle, rate = np.zeros((count, samples)), np.zeros((count, samples))
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
    row = tuple(fields.get(name, 0) for name in names)  # at once: setting single fields is slow
    return np.array([row], dtype=run_dtype()), (values, imposed, beside, program, *driven)


def backlash(angle: Angles, half_width: Rad, start: Rad) -> Angles:
    """The reading behind a backlash: it moves only when pushed, at first from a starting reading."""
    source = np.ascontiguousarray(angle, dtype=np.float64)
    result = np.empty_like(source)
    forward_library().vwt_backlash(source.size, source.ctypes.data, half_width, start, result.ctypes.data)
    return result


# A rod rings many times faster than the body swings and decays soon, but an integrator has to resolve it to the
# end. Here the two oscillations of the linear rig are separated instead. The slow one is integrated with a rigid
# rod whose inertia, damping and lead of the body give its exact frequency, damping and shape. The ringing is added
# in closed form. Nonlinear terms act only on the slow motion.

#: How many times faster than the body the rod must ring for the two to be separated.
SEPARATION = 5.0
_GONE = 1e-9  # rad: ringing below this is not computed
_MOST_ITERATIONS = 60
_CONVERGED = 1e-14  # relative


@dataclass(frozen=True)
class Ringing:
    """A decaying oscillation of the rod's upper end, Re(amplitude · exp(root · t)), rad; root: 1/s, Im > 0."""

    amplitude: complex
    root: complex

    def added(self, angle: Angles, rate: Rates, interval: Seconds) -> tuple[Angles, Rates]:
        """Angle and rate of the slow motion, at equal intervals from the release, with the ringing."""
        size = abs(self.amplitude)
        if size <= _GONE:
            return angle, rate
        lasting = np.log(size / _GONE) / max(-self.root.real * interval, 1e-9)
        count = min(angle.size, int(lasting) + 1)
        ringing = self.amplitude * np.exp(self.root * interval * np.arange(count))
        angle, rate = angle.copy(), rate.copy()
        angle[:count] += ringing.real
        rate[:count] += (self.root * ringing).real
        return angle, rate


@dataclass(frozen=True)
class SlowMotion:
    """A run with a rigid rod and the slow oscillation of the run with a flexible rod.

    Args:
        lead: of the body before the upper end, as a share of the angle there.
        rod_stiffness: of the leading rod, seen from the upper end, N m/rad.
        body_release: the body's release angle, rad.
    """

    run: RunSettings
    lead: float
    rod_stiffness: float
    body_release: float
    ringing: Ringing

    def forward_run(self) -> tuple[NDArray[np.void], Sequence[Array]]:
        """The run for the compiled integrator; result as of `forward_run`."""
        row, keep_alive = forward_run(self.run)
        row["lead"], row["rod_stiffness"], row["lagged"] = self.lead, self.rod_stiffness, self.body_release
        return row, keep_alive


def slow_motion(run: RunSettings, rig: Rig) -> SlowMotion | None:
    """Separate the rod's ringing from the motion of the body on its spring; the run's release angle is the body's.

    None for a rigid rod, and where the two oscillations are not `SEPARATION` apart or one of them does not
    oscillate.
    """
    twist = run.rod_twist
    if twist is None:
        return None
    upper, lower = (share * run.yaw_inertia for share in (twist.inertia_share, 1.0 - twist.inertia_share))
    flow = rig.body.flow(run.air_density, run.wind_speed)
    air = aerodynamic_stiffness(run.derivatives.cn_beta, **flow)
    air_damping = aerodynamic_damping(run.derivatives.cn_r, **flow)
    spring = run.spring_stiffness + run.parameters.get("gravity_stiffness", 0.0)
    loss, rod, rod_loss = run.mechanical_damping, 1.0 / twist.compliance, twist.damping(run.yaw_inertia)

    def lead_at(root: complex) -> complex:
        """The twist per angle of the upper end in an oscillation exp(root · t), from the balance of the body."""
        free = air + air_damping * root - lower * root**2
        return free / (rod + rod_loss * root - free)

    lead, root = 0j, 0j
    for _ in range(_MOST_ITERATIONS):
        previous = root
        # the balance of the whole rig, whose body moves 1 + lead times as far as the upper end
        body = 1.0 + lead
        root = _upper_root(upper + lower * body, loss - air_damping * body, spring - air * body)
        lead = lead_at(root)
        if abs(root - previous) <= _CONVERGED * abs(root):
            break
    else:
        return None
    if not root.imag > 0.0:
        return None
    # The four roots' sum and product give the other two.
    total = (loss + rod_loss) / upper + (rod_loss - air_damping) / lower
    product = (rod * (spring - air) - air * spring) / (upper * lower)
    fast = _upper_root(1.0, total + 2.0 * root.real, product / abs(root) ** 2)
    if not (fast.imag > 0.0 and abs(fast) > SEPARATION * abs(root)):
        return None
    end = spring_end_angle(run)
    # Amplitudes of two oscillations that add up to the release's angle, its rate, the twist and its rate.
    roots, leads = (root, fast), (lead, lead_at(fast))
    rows = [(1.0, 1.0), roots, leads, (roots[0] * leads[0], roots[1] * leads[1])]
    matrix = [[part for value in row for part in (value.real, -value.imag)] for row in rows]
    state = np.array((end, run.release_rate, run.release_angle - end, 0.0))
    found = np.linalg.solve(np.array(matrix), state).tolist()
    slow, ringing = complex(found[0], found[1]), complex(found[2], found[3])
    shape = (1.0 + lead.real) ** 2  # a moment on the body does work on its own angle
    strained = rod * lead.real**2
    inertia = (spring + strained - air * shape) / abs(root) ** 2
    if not inertia > 0.0:
        return None
    damping = -2.0 * root.real * inertia + air_damping * shape
    rigid = dataclasses.replace(
        run,
        rod_twist=None,
        yaw_inertia=inertia,
        mechanical_damping=damping,
        release_angle=slow.real,
        release_rate=(root * slow).real,
    )
    return SlowMotion(rigid, lead.real, strained, run.release_angle, Ringing(ringing, fast))


def _upper_root(inertia: complex, damping: complex, stiffness: complex) -> complex:
    """The root of inertia s² + damping s + stiffness with the larger imaginary part, 1/s."""
    half = damping / (2.0 * inertia)
    return -half + 1j * cmath.sqrt(stiffness / inertia - half * half)
