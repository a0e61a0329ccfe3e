"""Estimates of ωn and ζ of one record by other packages, each given only the record and its sample rate.

Every function takes times (s), reading (rad) and sample rate (Hz), and returns (ωn in rad/s, ζ). Functions that
cannot process twenty thousand samples get sixteen block means per cycle, like our matrix pencil.
"""

from __future__ import annotations

import importlib.util
import io
import logging
from collections.abc import Callable
from contextlib import redirect_stderr
from functools import partial

import numpy as np
from scipy.optimize import curve_fit

Method = Callable[[np.ndarray, np.ndarray, float], tuple[float, float]]
BLOCKS_PER_CYCLE = 16
SSI_ROWS = 50  # the best of 20, 50 and 100 over the benchmark's cells


def spectral_frequency(yaw: np.ndarray, rate: float) -> float:
    """Frequency of the highest bin of the spectrum, Hz."""
    power = np.abs(np.fft.rfft(yaw - yaw.mean()))
    return float(np.argmax(power) * rate / yaw.size)


def by_curve_fit(time: np.ndarray, yaw: np.ndarray, rate: float) -> tuple[float, float]:
    """scipy.optimize.curve_fit of the damped cosine, started at the spectrum's peak and ζ = 0.01."""

    def model(t: np.ndarray, a: float, phase: float, omega: float, zeta: float, zero: float) -> np.ndarray:
        damped = omega * np.sqrt(1.0 - zeta**2)
        return a * np.exp(-zeta * omega * t) * np.cos(damped * t + phase) + zero

    start = (np.ptp(yaw) / 2.0, 0.0, 2.0 * np.pi * spectral_frequency(yaw, rate), 0.01, yaw.mean())
    found, _ = curve_fit(model, time, yaw, p0=start)
    return abs(float(found[2])), float(found[3] * np.sign(found[2]))


def thinned(yaw: np.ndarray, rate: float) -> tuple[np.ndarray, float]:
    """Block means minus their mean, and their rate."""
    factor = max(1, int(rate / (BLOCKS_PER_CYCLE * spectral_frequency(yaw, rate))))
    count = yaw.size // factor
    means = yaw[: count * factor].reshape(count, factor).mean(axis=1)
    return means - means.mean(), rate / factor


def by_pyyeti(_: np.ndarray, yaw: np.ndarray, rate: float) -> tuple[float, float]:
    """pyyeti's eigensystem realisation, with an order for the zero; the mode at the spectrum's peak."""
    from pyyeti.era import ERA

    means, slow = thinned(yaw, rate)
    found = ERA(
        means, slow, svd_tol=4, auto=True, verbose=False, show_plot=False, all_lower_limits=0.0,
        damp_range=(-1.0, 1.0),
    )  # fmt: skip
    mode = int(np.argmin(np.abs(found.freqs_hz - spectral_frequency(yaw, rate))))
    return 2.0 * np.pi * float(found.freqs_hz[mode]), float(found.zeta[mode])


def by_pyoma2(_: np.ndarray, yaw: np.ndarray, rate: float, *, method: str) -> tuple[float, float]:
    """pyOMA2's stochastic subspace identification, of order three: the oscillation and the zero."""
    from pyoma2.algorithms import SSI
    from pyoma2.setup import SingleSetup

    logging.disable(logging.CRITICAL)
    means, slow = thinned(yaw, rate)
    limits = {"xi_max": 0.9, "mpc_lim": None, "mpd_lim": None, "CoV_max": None}
    with redirect_stderr(io.StringIO()):  # hides its progress bars
        setup = SingleSetup(means[:, None], slow)
        setup.add_algorithms(SSI(name="ssi", method=method, br=SSI_ROWS, ordmax=4, hc=limits))
        setup.run_by_name("ssi")
    found = setup["ssi"].result
    mode = int(np.nanargmin(np.abs(found.Fn_poles[:, 3] - spectral_frequency(yaw, rate))))
    return 2.0 * np.pi * float(found.Fn_poles[mode, 3]), float(found.Xi_poles[mode, 3])


RIG = """
<mujoco>
  <option integrator="RK4" gravity="0 0 0"/>
  <worldbody><body name="model">
    <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
    <joint name="yaw" type="hinge" axis="0 0 1" stiffness="1" damping="0"/>
  </body></worldbody>
  <sensor><jointpos name="yaw" joint="yaw"/></sensor>
</mujoco>
"""


def by_sysid(time: np.ndarray, yaw: np.ndarray, rate: float) -> tuple[float, float]:
    """mujoco.sysid on a hinge of unit inertia: stiffness, damping, release and zero, at the record's time step."""
    import mujoco
    from mujoco import sysid

    state_kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    spec = mujoco.MjSpec.from_string(RIG)
    spec.option.timestep = 1.0 / rate
    model = spec.compile()
    omega = 2.0 * np.pi * spectral_frequency(yaw, rate)
    params = sysid.ParameterDict()
    starts = {"stiffness": omega**2, "damping": 0.02 * omega, "angle": yaw[0] - yaw.mean(), "rate": 0.0}
    for name, value in {**starts, "zero": float(yaw.mean())}.items():
        low = 0.0 if name == "damping" else -1e4
        params.add(sysid.Parameter(name, float(value), low, 1e4))
    mapping = sysid.TimeSeries.compute_all_sensor_mapping(model)
    # a row of the sensors has the values at the start of its step: the last row needs a further step
    control = sysid.TimeSeries(np.append(time, time[-1] + 1.0 / rate), np.zeros((time.size + 1, 0)))
    sequence = sysid.ModelSequences(
        "run", spec, "run", np.zeros(mujoco.mj_stateSize(model, state_kind)), control,
        sysid.TimeSeries(time, yaw[:, None], mapping),
    )  # fmt: skip

    def build(given: sysid.ParameterDict, _spec: mujoco.MjSpec) -> mujoco.MjModel:
        made = spec.compile()
        made.jnt_stiffness[0], made.dof_damping[0] = given["stiffness"].value[0], given["damping"].value[0]
        return made

    def roll(*, param_dicts: list, **given: object) -> object:
        starts = [np.array([0.0, p["angle"].value[0], p["rate"].value[0]]) for p in param_dicts]
        return sysid.sysid_rollout(**{**given, "initial_states": np.stack(starts)})

    def difference(given: sysid.ParameterDict, predicted, record, *_a: object, **_k: object):
        residual = record.data[:, 0] - predicted.data[:, 0] - given["zero"].value[0]
        return residual[:, None], predicted, record

    residual = partial(
        sysid.residual, models_sequences=[sequence], build_model=build, custom_rollout=roll,
        modify_residual=difference, n_threads=1, resample_true=False,
    )  # fmt: skip
    found, _ = sysid.optimize(
        params, lambda x, p, **_: residual(x, p), verbose=False, x_scale="jac", xtol=1e-8, max_iters=40,
        output=io.StringIO(),
    )  # fmt: skip
    stiffness, damping = found["stiffness"].value[0], found["damping"].value[0]
    return float(np.sqrt(stiffness)), float(0.5 * damping / np.sqrt(stiffness))


def _sysid_installed() -> bool:
    from mujoco import sysid

    return hasattr(sysid, "ParameterDict")


def present() -> tuple[dict[str, Method], dict[str, str]]:
    """The installed packages, and the commands that install the others."""
    methods: dict[str, Method] = {"scipy curve_fit": by_curve_fit}
    absent = {}
    if importlib.util.find_spec("pyoma2"):
        methods["pyOMA2 SSI-cov"] = partial(by_pyoma2, method="cov")
        methods["pyOMA2 SSI-dat"] = partial(by_pyoma2, method="dat")
    else:
        absent["pyOMA2"] = "pip install pyOMA_2"
    if importlib.util.find_spec("pyyeti"):
        methods["pyyeti ERA"] = by_pyyeti
    else:
        absent["pyyeti"] = "pip install pyyeti"
    if _sysid_installed():
        methods["mujoco.sysid"] = by_sysid
    else:
        absent["mujoco.sysid"] = "pip install 'mujoco[sysid]'"
    return methods, absent
