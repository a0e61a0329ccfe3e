"""Seconds and memory of a diagnosis, and the same candidates fitted with `mujoco.sysid`.

Run as ``python -m benchmarks.diagnosis``; see README.md beside it. The campaigns come from the MuJoCo model. Each
diagnosis runs in a separate process; its peak memory is the operating system's figure.
"""

from __future__ import annotations

import argparse
import dataclasses
import io
import logging
import multiprocessing
import resource
import time
from typing import Any

import mujoco
import numpy as np
from mujoco import sysid
from rich.console import Console
from rich.table import Table

from benchmarks.throughput import numbers
from diagnosis import diagnose
from diagnosis.likelihood.least_squares import Fit, fit
from diagnosis.likelihood.motions import campaign_rig
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.starting_points import StartingPoint, nominal_start, starting_points
from diagnosis.model.blocks import prepare
from diagnosis.noise.sensor_noise import campaign_noise
from diagnosis.settings import Settings
from tunnel_sim.effects import ALL_EFFECTS
from tunnel_sim.engine.model import Model, build_model
from tunnel_sim.engine.virtual_campaign import simulate_campaign
from tunnel_sim.physics.run_settings import RunSettings, released_by_spring_end
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.plan import CampaignPlan, Condition, EffectSetting, SensorModel, Truth

CAUSES = {
    "no effect": (),
    "flexible rod": (EffectSetting("rod_flexibility", {"compliance": 3e-4, "inertia_share": 0.1}),),
    "dry friction": (EffectSetting("coulomb_friction", {"friction_moment": 0.003}),),
    "nonlinear yaw moment and sensor drift": (
        EffectSetting("nonlinear_yaw_moment", {"coefficient": 0.3}),
        EffectSetting("sensor_drift", {"drift": 0.002}),
    ),
}
STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS.value
UNBOUNDED = 1e3  # bounds for sysid if a parameter has none
STEP = 4e-3  # s, on both sides of the comparison


def make_campaign(
    effects: tuple[EffectSetting, ...], *, springs: tuple[float, ...], duration: float, rate: float
) -> Campaign:
    """Every spring at three speeds from 20°; with three springs also the first at the same speeds from 8°."""
    cases = [(k, v, 0.35) for k in springs for v in (0.0, 15.0, 25.0)]
    if len(springs) > 2:
        cases += [(springs[0], v, 0.14) for v in (0.0, 15.0, 25.0)]
    conditions = tuple(
        Condition(f"r{i:02d}", k, v, 1.204, angle, duration) for i, (k, v, angle) in enumerate(cases)
    )
    truth, sensor = Truth(0.45, -0.15, 0.1014, 0.012), SensorModel(rate, 4e-4)
    return simulate_campaign(CampaignPlan("benchmark", 1, truth, conditions, sensor, effects, ""))


def measured(campaign: Campaign) -> tuple[tuple[str, ...], float, dict[str, float], float]:
    """Causes, seconds, seconds by step and peak memory in MiB of one diagnosis, in a fresh process."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        return pool.apply(_diagnosed, (campaign,))


def _diagnosed(campaign: Campaign) -> tuple[tuple[str, ...], float, dict[str, float], float]:
    begin = time.perf_counter()
    answer = diagnose(campaign)
    seconds = time.perf_counter() - begin
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return answer.causes, seconds, dict(answer.seconds), peak


def full_size(console: Console) -> None:
    """Measure the campaign of the time limit: 12 runs of 10 s at 1 kHz."""
    table = Table(title="One diagnosis, 12 runs of 10 s at 1 kHz (targets: 30 s on two cores, 2 GiB)")
    for head in ("campaign", "answer", "seconds", "peak MiB", "seconds by step"):
        table.add_column(head, justify="right" if head in ("seconds", "peak MiB") else "left")
    for name, effects in CAUSES.items():
        data = make_campaign(effects, springs=(16.12, 35.02, 67.98), duration=10.0, rate=1000.0)
        causes, seconds, steps, peak = measured(data)
        by_step = ", ".join(f"{step} {value:.1f}" for step, value in steps.items())
        rest = seconds - sum(steps.values())
        table.add_row(
            name, ", ".join(causes) or "none", f"{seconds:.1f}", f"{peak:.0f}", f"{by_step}, rest {rest:.1f}"
        )
    console.print(table)


class SysidFit:
    """One candidate as a problem for `mujoco.sysid`: its parameters, residual and optimiser, with our MuJoCo model.

    sysid takes releases as fixed and measures at a model's sensors. Here releases are parameters, written by a
    custom rollout, and the sensor's zero and effects on the reading modify the residual; both are extension points
    of sysid. Each run uses one compiled model, which saves sysid compilations.
    """

    def __init__(self, lead: StartingPoint) -> None:
        self.lead, self.problem = lead, lead.problem
        self.rig = campaign_rig(self.problem.data)
        self.own = lead.point.per_run.shape[1]
        self.params = sysid.ParameterDict()
        lower, upper = self.problem.bounds
        for name, value, low, high in zip(self.problem.names, lead.point.common, lower, upper, strict=True):
            self.params.add(sysid.Parameter(name, value, max(low, -UNBOUNDED), min(high, UNBOUNDED)))
        for run, own in zip(self.problem.data.runs, lead.point.per_run, strict=True):
            self.params.add(sysid.Parameter(run.id, own, own * 0.0 - 50.0, own * 0.0 + 50.0))
        self.models = [build_model(self.rig, self._settings(self.params, i)) for i in range(len(self._runs))]
        self.sequences = [self._sequence(i, model) for i, model in enumerate(self.models)]

    @property
    def _runs(self) -> tuple[Any, ...]:
        return self.problem.data.runs

    def _values(self, params: Any, index: int) -> tuple[np.ndarray, np.ndarray]:
        common = np.array([params[name].value[0] for name in self.problem.names])
        return common, params[self._runs[index].id].value

    def _settings(self, params: Any, index: int) -> RunSettings:
        common, own = self._values(params, index)
        stated = self.problem.stated(common, own, self._runs[index])
        stated = dataclasses.replace(stated, timestep=STEP)
        chain = dataclasses.replace(self.problem.chain(common, own, self._runs[index]), stated=stated)
        return released_by_spring_end(chain.physics())

    def _model(self, params: Any, index: int) -> Model:
        return self.models[index].with_settings(self._settings(params, index))

    @staticmethod
    def _state(model: Model) -> np.ndarray:
        state = np.empty(mujoco.mj_stateSize(model.mj, STATE))
        mujoco.mj_getState(model.mj, model.release_state(), state, STATE)
        return state

    def _sequence(self, index: int, model: Model) -> Any:
        run = self._runs[index]
        times = STEP * np.arange(run.reading.size)
        mapping = sysid.TimeSeries.compute_all_sensor_mapping(model.mj)
        reading = np.zeros((times.size, model.mj.nsensordata))
        reading[:, 0] = run.reading
        # a row of the sensors has the values at the start of its step: the last row needs a further step
        control = sysid.TimeSeries(STEP * np.arange(times.size + 1), np.zeros((times.size + 1, 0)))
        sensors = sysid.TimeSeries(times, reading, mapping)
        return sysid.ModelSequences(run.id, model.spec, run.id, self._state(model), control, sensors)

    def residual(self, x: np.ndarray, params: Any, **_: Any) -> tuple[list[np.ndarray], list[Any], list[Any]]:
        """sysid's residual by run; every run has its own model."""
        found = [
            sysid.residual(
                x, params, [sequence],
                build_model=lambda p, _spec, i=i: self._model(p, i).mj,
                custom_rollout=lambda i=i, **given: self._rollout(i, **given),
                modify_residual=lambda p, predicted, measured, *_a, i=i, **_k: self._difference(
                    i, p, predicted, measured
                ),
                n_threads=2, resample_true=False,
            )
            for i, sequence in enumerate(self.sequences)
        ]  # fmt: skip
        return [r for part in found for r in part[0]], [], []

    def _rollout(self, index: int, *, models: Any, param_dicts: Any, **given: Any) -> Any:
        settings = [self._settings(params, index) for params in param_dicts]
        states = [
            self._state(dataclasses.replace(self.models[index], mj=model, settings=one))
            for model, one in zip(models, settings, strict=True)
        ]
        return sysid.sysid_rollout(models, **{**given, "initial_states": np.stack(states)})

    def _difference(
        self, index: int, params: Any, predicted: Any, record: Any
    ) -> tuple[np.ndarray, Any, Any]:
        common, own = self._values(params, index)
        run = self._runs[index]
        chain = self.problem.chain(common, own, run)
        angle = chain.angle(predicted.data[:, 0], record.times)
        reading = chain.reading(angle + common[self.problem.names.index("zero")])
        residual = (record.data[:, 0] - reading) / run.noise.scale
        return residual[:, None], predicted, record

    def optimise(self) -> tuple[float, float]:
        """Seconds and final χ², from the same start as the diagnosis's own fit."""
        begin = time.perf_counter()
        _, result = sysid.optimize(
            self.params, self.residual, verbose=False, max_iters=30, x_scale="jac", xtol=1e-5,
            output=io.StringIO(),
        )  # fmt: skip
        seconds = time.perf_counter() - begin
        left = np.concatenate(self.residual(result.x, self.params)[0])
        return seconds, float(left @ left)


def against_sysid(console: Console, wanted: int) -> None:
    """On a smaller campaign, compare a whole diagnosis with sysid's fits of all candidates from the same starts."""
    data = make_campaign(CAUSES["dry friction"], springs=(16.12, 44.84), duration=4.0, rate=250.0)
    causes, whole, _, _ = measured(data)
    prepared = prepare(data, campaign_noise(data, Settings().noise).variance)
    begin = time.perf_counter()
    nominal = fit(Problem(prepared), nominal_start(prepared))
    own_total, other_total, candidates = time.perf_counter() - begin, 0.0, 0
    heads = ("candidate", "own s", "sysid s", "ratio", "own χ²", "sysid χ²")
    table = numbers("Nominal model and one effect, 6 runs of 4 s at 250 Hz", *heads)
    for kind in ALL_EFFECTS:
        starts = starting_points(nominal, kind) if kind.fitted and kind.tries < 3 else []
        if not starts or candidates >= wanted:
            continue
        own, chi2 = timed_fit(starts[0], nominal)
        other, other_chi2 = SysidFit(starts[0]).optimise()
        table.add_row(
            kind.name, f"{own:.2f}", f"{other:.1f}", f"{other / own:.0f}", f"{chi2:.0f}", f"{other_chi2:.0f}"
        )
        own_total, other_total, candidates = own_total + own, other_total + other, candidates + 1
    table.add_row("all", f"{own_total:.2f}", f"{other_total:.1f}", f"{other_total / own_total:.0f}", "", "")
    console.print(table)
    console.print(
        f"A whole diagnosis of it (answer: {', '.join(causes)}), pairs, random moments and held-out runs included, "
        f"takes {whole:.1f} s: {candidates} candidates with mujoco.sysid take {other_total / whole:.0f} times as "
        f"long (aim: 20)."
    )


def timed_fit(lead: StartingPoint, nominal: Fit) -> tuple[float, float]:
    """Seconds and χ² of the diagnosis's own fit."""
    begin = time.perf_counter()
    found = fit(lead.problem, lead.point, base=nominal)
    return time.perf_counter() - begin, found.total


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.diagnosis", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--candidates", type=int, default=len(ALL_EFFECTS), help="effects fitted with sysid")
    parser.add_argument("--only", choices=("diagnosis", "sysid"), help="one of the two parts")
    options = parser.parse_args()
    if options.only != "diagnosis" and not hasattr(sysid, "ParameterDict"):
        parser.error(
            "mujoco.sysid misses its dependencies: pip install 'mujoco[sysid]', or give --only diagnosis"
        )
    logging.getLogger().setLevel(logging.ERROR)  # sysid's remarks on parameters that start at a bound
    console = Console(width=140)
    if options.only != "sysid":
        full_size(console)
    if options.only != "diagnosis":
        against_sysid(console, options.candidates)


if __name__ == "__main__":
    main()
