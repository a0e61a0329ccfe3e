"""A campaign as MJCF models of MuJoCo's toolbox `mujoco.sysid`: the causes that MJCF can express, and their fits.

Each run is a model with the stated spring and wind. Parameters of the rig are common to all runs; each run has
its own release, which enters through the toolbox's `custom_rollout`. The tendon is the spring. The joint's own
stiffness and damping represent air and bearing. Two actuators, with a constant and a growing control, represent the
wind's constant moment and its drift.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.causes.moments import Array, own_decay, stiffness
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.vocabulary.campaign import Run

ROWS, SUBSTEPS, FINER, ITERATIONS = 16, 2, 4, 8
_STEP = 1e-5  # step of the finite differences: well above the tolerance of the solver for dry friction
NOMINAL = ("inertia", "damping", "cn_beta", "cn_r", "zero")
BOUNDS = {
    "coulomb_friction": (0.0, 50.0), "quadratic_damping": (-50.0, 50.0), "structural_damping": (-50.0, 50.0),
    "cubic_stiffness": (-50.0, 50.0), "asymmetric_stiffness": (-50.0, 50.0), "free_play": (0.0, 50.0),
    "rod_flexibility": (-50.0, 50.0), "sensor_clipping": (0.0, 50.0), "nonlinear_yaw_moment": (-500.0, 500.0),
    "wind_speed_drift": (-50.0, 50.0), "unsteady_aero_lag": (-50.0, 50.0), "flow_misalignment": (-50.0, 50.0),
    "wind_speed_offset": (-50.0, 50.0),
}  # fmt: skip
"""Causes with one number, and its bounds in hundredths of the rig's own scales."""
_WINDY = tuple(BOUNDS)[-5:]
_XML = """<mujoco><compiler angle="radian"/>
<option timestep="{step}" integrator="RK4" gravity="0 0 0"><flag contact="disable"/></option>
<worldbody><body name="body"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><joint name="yaw" type="hinge"
axis="0 0 1" solreffriction="0.002 1" solimpfriction="0.99 0.999 0.001"/></body></worldbody>
<tendon><fixed name="spring" springlength="0 0"><joint joint="yaw" coef="1"/></fixed></tendon>
<actuator><general name="steady" joint="yaw"/><general name="growing" joint="yaw" gaintype="affine"/></actuator>
<sensor><jointpos name="angle" joint="yaw"/></sensor></mujoco>"""


@dataclass(frozen=True, eq=False)
class ToolboxRun:
    """A run ready for the toolbox.

    Args:
        rows: means of the reading's blocks, rad, shape (n,).
        noise: standard deviation of a row, rad.
        interval: between rows, s.
        start: angle (rad) and rate (rad/s) at the first row, of the damped sinusoid nearest to the run.
        decay: angular frequency (rad/s), decay (1/s) and resting angle (rad) of that sinusoid.
        spring: stated stiffness, N m/rad.
        wind: ½ρV A l, kg m/s: times V and Cnβ the stiffness, times l and Cnr the damping.
        speed: V, m/s.
    """

    rows: Array
    noise: float
    interval: float
    start: tuple[float, float]
    decay: tuple[float, float, float]
    spring: float
    wind: float
    speed: float

    @classmethod
    def of(cls, run: Run, size: float) -> ToolboxRun:
        """Thin one run; `size` is the frontal area times the reference length, m³."""
        record, (omega, sigma, rest) = run.record, own_decay(run)
        y, dt = record.yaw_rad, record.sample_interval
        if not record.uniform:
            y = np.interp(record.time_s[0] + dt * np.arange(y.size), record.time_s, y)
        block = max(1, round(2.0 * np.pi / (ROWS * omega * dt)))
        rows = y[: y.size // block * block].reshape(-1, block).mean(axis=1)
        noise = max(float(np.std(np.diff(y, 2))) / np.sqrt(6.0), 1e-9) / np.sqrt(block)
        free = np.exp((1j * omega - sigma) * block * dt * np.arange(rows.size))
        a, b = np.linalg.lstsq(np.column_stack((free.real, -free.imag)), rows - rest, rcond=None)[0]
        start = (float(a), float(-omega * b - sigma * a))
        wind = 0.5 * (run.air_density or 0.0) * run.wind_speed * size
        decay = (omega, sigma, rest)
        return cls(rows, noise, block * dt, start, decay, stiffness(run), wind, run.wind_speed)


@dataclass(frozen=True, eq=False)
class ToolboxFit:
    """A set of causes fitted: parameters by name, their values and two for each release, residuals and Jacobian."""

    causes: tuple[str, ...]
    names: tuple[str, ...]
    x: Array
    residuals: Array
    jacobian: Array

    @property
    def chi2(self) -> float:
        return float(self.residuals @ self.residuals)


class ToolboxRig:
    """The runs of a campaign as models; parameters are in hundredths of the rig's own scales."""

    def __init__(self, folder: Path) -> None:
        campaign = read_campaign(folder)
        self.length = campaign.rig.reference_length or 1.0
        size = (campaign.rig.frontal_area or 1.0) * self.length
        self.trials = [ToolboxRun.of(run, size) for run in campaign.runs]
        self.springs = sorted({t.spring for t in self.trials})
        self.swing = max(float(np.hypot(t.start[0], t.start[1] / t.decay[0])) for t in self.trials)
        self.fastest = max(t.speed for t in self.trials)
        self.rest = float(np.median([t.decay[2] for t in self.trials if not t.speed] or [0.0]))
        omega, sigma = (np.array([t.decay[i] for t in self.trials]) for i in (0, 1))
        wind, speed, spring = np.array([(t.wind, t.speed, t.spring) for t in self.trials]).T
        self.omega = float(np.median(omega))
        # K − ½ρV²Al Cnβ = I (ω² + σ²) and C − ½ρVAl² Cnr = 2 I σ, run by run
        both = np.column_stack((omega**2 + sigma**2, wind * speed))
        self.inertia, cn_beta = np.linalg.lstsq(both, spring, rcond=1e-9)[0].tolist()
        both = np.column_stack((np.ones_like(wind), -wind * self.length))
        self.damping, cn_r = np.linalg.lstsq(both, 2.0 * self.inertia * sigma, rcond=1e-9)[0].tolist()
        self.cn = {"cn_beta": cn_beta, "cn_r": cn_r}
        unit = self.inertia * self.omega**2 / max(float(np.max(wind * speed)), 1e-12)
        self.unit = {"cn_beta": unit, "cn_r": unit * self.fastest / (self.length * self.omega)}
        self.stated = self.fastest > 0.0 and campaign.rig.frontal_area is not None

    @cached_property
    def residuals(self) -> dict[int, list[Any]]:
        """The toolbox's residual functions of the runs, by the factor on their number of steps."""
        return {n: [self._residual(i, n) for i in range(len(self.trials))] for n in (1, FINER)}

    def candidates(self, causes: Sequence[str]) -> list[tuple[str, tuple[str, ...]]]:
        """Causes outside a set, each with its parameters."""
        found = [(n, (n,)) for n in BOUNDS if n not in causes and (self.fastest or n not in _WINDY)]
        if "gravity_stiffness" not in causes:
            found.append(("gravity_stiffness", ("gravity x", "gravity y")))
        if len(self.springs) > 2 and "spring_miscalibration" not in causes:
            found += [("spring_miscalibration", (f"spring {k:g}",)) for k in self.springs]
        return found

    def write(self, spec: Any, trial: ToolboxRun, x: Mapping[str, float]) -> Any:
        """The compiled model of a run with parameters by name."""
        p = {name: 0.01 * value for name, value in x.items()}
        inertia, omega, swing = self.inertia, self.omega, self.swing
        own, arm = inertia * (1.0 + p["inertia"]), 0.1 * np.sqrt(inertia)
        k = trial.spring * (1.0 + p.get(f"spring {trial.spring:g}", 0.0))
        k /= 1.0 + p.get("rod_flexibility", 0.0) * trial.spring / self.springs[-1]
        shift = 1.0 + (p.get("wind_speed_offset", 0.0) * self.fastest / trial.speed if trial.speed else 0.0)
        cn = {name: self.cn[name] + p[name] * self.unit[name] for name in self.cn}
        ka = trial.wind * trial.speed * shift**2 * cn["cn_beta"]
        ca = trial.wind * self.length * shift * cn["cn_r"]
        c = self.damping + p["damping"] * inertia * omega - ca
        c += p.get("structural_damping", 0.0) * np.sqrt(trial.spring * inertia)
        joint, body, tendon = spec.joint("yaw"), spec.body("body"), spec.tendon("spring")
        body.ipos, body.inertia = [arm, 0.0, 0.0], [own, own, own - arm**2]
        weight = inertia * omega**2 / arm
        spec.option.gravity = [p.get(f"gravity {axis}", 0.0) * weight for axis in "xy"] + [0.0]
        joint.armature = p.get("unsteady_aero_lag", 0.0) * inertia if trial.speed else 0.0
        joint.frictionloss = max(p.get("coulomb_friction", 0.0), 0.0) * inertia * omega**2 * swing
        joint.damping = [c, p.get("quadratic_damping", 0.0) * inertia / swing, 0.0]
        joint.stiffness = [-ka, 0.0, -ka * p.get("nonlinear_yaw_moment", 0.0) / swing**2]
        bent, hard = (p.get(f"{name}_stiffness", 0.0) for name in ("asymmetric", "cubic"))
        tendon.stiffness = [k, k * bent / swing, k * hard / swing**2]
        play = max(p.get("free_play", 0.0), 0.0) * swing
        tendon.springlength = [-play, play]
        spec.actuator("steady").gainprm[0] = ka * p.get("flow_misalignment", 0.0) * swing
        drift = p.get("wind_speed_drift", 0.0)
        spec.actuator("growing").gainprm[:3] = [0.0, 2.0 * drift * ka, drift * ca]
        limit = p.get("sensor_clipping")
        spec.sensor("angle").cutoff = 0.0 if limit is None else swing * (1.0 - max(limit, 0.0))
        return spec.compile()

    def _residual(self, number: int, finer: int) -> Any:
        """The toolbox's residual function of one run, with ``finer`` times as many steps."""
        import mujoco
        from mujoco import sysid

        trial, every = self.trials[number], SUBSTEPS * finer
        spec = mujoco.MjSpec.from_string(_XML.format(step=trial.interval / every))
        model = spec.compile()
        time = trial.interval / every * np.arange(every * trial.rows.size)
        control = sysid.TimeSeries(time, np.column_stack((np.ones_like(time), time / time[-1])))
        measured = sysid.TimeSeries.from_names(time[::every], trial.rows[:, None], model)
        start = sysid.create_initial_state(model, np.array(trial.start[:1]), np.array(trial.start[1:]))

        def build(params: Any, spec: Any) -> Any:
            return self.write(spec, trial, dict(zip(params.names, params["rig"].value, strict=True)))

        def rollout(*, initial_states: Any, param_dicts: Any, **given: Any) -> Any:
            states = np.array(initial_states)
            own = np.array([p["release"].value.reshape(-1, 2)[number] for p in param_dicts])
            states[:, 1:3] += 0.01 * self.swing * own * [1.0, trial.decay[0]]
            return sysid.sysid_rollout(initial_states=states, **given)

        def compare(params: Any, predicted: Any, seen: Any, *_: Any, **__: Any) -> Any:
            zero = self.rest + 0.01 * self.swing * params["rig"].value[NOMINAL.index("zero")]
            # a sensor is read before its step: its first row is the initial state's
            shown = sysid.TimeSeries(seen.times, predicted.data[::every] + zero, seen.signal_mapping)
            return (shown.data - seen.data)[:, 0] / trial.noise, shown, seen

        sequence = sysid.ModelSequences(f"run {number}", spec, "measured", start, control, measured)
        return sysid.build_residual_fn(
            models_sequences=[sequence], build_model=build, custom_rollout=rollout,
            modify_residual=compare, n_threads=1, resample_true=False,
        )  # fmt: skip

    def params(self, names: Sequence[str], x: Array) -> Any:
        """Parameters of the rig and of the releases in the toolbox's form."""
        from mujoco import sysid

        low, high = np.array([BOUNDS.get(n, (-500.0, 500.0)) for n in names]).T
        found, free = sysid.ParameterDict(), np.full(2 * len(self.trials), 500.0)
        found.names = tuple(names)
        found.add(sysid.Parameter("rig", np.zeros(len(names)), low, high))
        found.add(sysid.Parameter("release", np.zeros(free.size), -free, free))
        found.update_from_vector(x)
        return found

    def runs(self, params: Any) -> Any:
        """The residual functions of all runs."""
        return self.residuals[FINER if "coulomb_friction" in params.names else 1]

    def jacobian(
        self, params: Any, x: Array, left: Array, which: Sequence[int], step: float = _STEP, releases: int = 2
    ) -> Array:
        """Forward differences, run by run: a run depends on no other run's release."""
        found, row = np.zeros((left.size, x.size)), 0
        for number, residual in enumerate(self.runs(params)):
            at = [*which, *(x.size - 2 * len(self.trials) + 2 * number + i for i in range(releases))]
            moved = np.tile(x.reshape(-1, 1), len(at))
            moved[at, range(len(at))] += step
            rows = slice(row, row + self.trials[number].rows.size)
            found[rows, at] = (residual(moved, params)[0][0] - left[rows].reshape(-1, 1)) / step
            row = rows.stop
        return found

    def fit(self, causes: tuple[str, ...], names: tuple[str, ...], x: Array) -> ToolboxFit:
        """Fit by the toolbox.

        Args:
            names: names of the parameters of the rig.
            x: starting values of these parameters and of two for each release.
        """
        from mujoco import sysid

        def left(x: Array, params: Any) -> tuple[list[Array], None, None]:
            return [r for one in self.runs(params) for r in one(x, params)[0]], None, None

        given = self.params(names, x)
        fitted, result = sysid.optimize(
            given, left, "mujoco", verbose=False, max_iters=ITERATIONS, x_scale="jac", xtol=1e-4, mu_factor=4.0,
            mu_max=1e3, jacobian=lambda at, r: self.jacobian(given.copy(), at, r, range(len(names))),
            output=io.StringIO(),
        )  # fmt: skip
        rest = np.concatenate(left(result.x.reshape(-1, 1), fitted)[0])[:, 0]
        return ToolboxFit(causes, names, np.ravel(result.x), rest, result.jac)
