"""Try it: the virtual rig with sliders, and its trace."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import degrees, radians
from pathlib import Path

import numpy as np
from nicegui import events, ui

from tunnel_lab.bench import work
from tunnel_lab.bench.parts import Chart, Fault, address, button
from tunnel_lab.bench.workspace import new_session
from tunnel_sim.effects import Effect, EffectChain, effect_class, known_effects
from tunnel_sim.effects.chain import read_motion
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.files.writing import write_whole
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.physics.steps import follow_fastest
from tunnel_sim.vocabulary.dimensions import beside
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import AeroDerivatives, SensorModel
from tunnel_sim.vocabulary.record import Array

_SLIDERS = {
    "cn_beta": ("Cnβ", "1/rad", -1.0, 1.5, 0.01),
    "cn_r": ("Cnr", "1/rad", -1.0, 0.5, 0.01),
    "spring_stiffness": ("spring Kr", "N m/rad", 1.0, 70.0, 0.01),
    "wind_speed": ("wind speed V", "m/s", 0.0, 40.0, 0.5),
    "release_angle_deg": ("release", "°", -40.0, 40.0, 1.0),
    "duration": ("duration", "s", 2.0, 40.0, 1.0),
}
RATE = 200.0
"""Sample rate of a trial, Hz: ten to a hundred times the rig's frequencies."""


class Car(ui.element, component="static/car.js"):
    """The model from above, swinging with the trace in real time."""

    def show(self, time: list[float], angle: list[float]) -> None:
        """Swing by a trace: times in s, angles in rad."""
        self._props.update(time=time, angle=angle)
        self.update()


class TryItPage:
    """The page: the trace follows every slider."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._trial, self._busy = folder, RigTrial(), False
        # duration of free decays
        self._kinds = {kind.name: kind for kind in known_effects() if not kind.driven}
        words = (
            "The rig by the fast integrator, without noise. Grey: the nominal model; blue: with the effect."
        )
        ui.label(words).classes("lede")
        with ui.element("div").classes("bench"):
            with ui.element("div").classes("sliders"):
                for key, (name, unit, *limits) in _SLIDERS.items():
                    with ui.element("div").classes("slider"):
                        self._slider(key, name, unit, limits, getattr(self._trial, key), "g")
                names = {"": "none", **{name: name.replace("_", " ") for name in self._kinds}}
                ui.select(names, label="Effect", value="", on_change=self._choose).props("dense")
                self._severity = ui.element("div").classes("slider")
            with ui.element("div").classes("shown"):
                curves = [("nominal model", "quiet"), ("with the effect", "after")]
                self._chart = Chart("Yaw angle", "time [s]", "yaw angle [rad]", curves, [])
                self._words = ui.label().classes("soft").props("role=status aria-live=polite")
                self._fault = Fault()
                self._car = Car()
        self._campaign_fault = Fault()
        with ui.element("p").classes("buttons"):
            button("Simulate a campaign of this rig", self._write)
        words = "Two springs, wind off and on, with the sensor's noise, as tunnel simulate does."
        ui.label(words).classes("soft")
        ui.timer(0.0, self._simulate, once=True)

    def _slider(
        self, key: str, name: str, unit: str, limits: Sequence[float], value: float, form: str
    ) -> None:
        """A slider for a field of the trial, below its name and value; limits: least, greatest and step."""
        mark = beside(unit)
        label = ui.label(f"{name}: {value:{form}}{mark}")

        async def change(event: events.ValueChangeEventArguments[float | None]) -> None:
            now = float(event.value or 0.0)
            label.set_text(f"{name}: {now:{form}}{mark}")
            await self._change(**{key: now})

        low, high, step = limits
        slider = ui.slider(min=low, max=high, step=step, value=value, on_change=change)
        slider.props(f'aria-label="{name} [{unit}]"')

    async def _choose(self, event: events.ValueChangeEventArguments[str]) -> None:
        self._severity.clear()
        name = event.value or ""
        if not name:
            await self._change(effect="", severity=0.0)
            return
        kind = self._kinds[name]
        info, example = kind.parameters()[0], kind.example[0]
        low, high = max(info.lower, -2.0 * abs(example)), min(info.upper, 2.0 * abs(example))
        with self._severity:
            limits = (low, high, (high - low) / 200.0)
            self._slider("severity", info.meaning, info.unit, limits, example, ".3g")
            ui.label(kind.equation).classes("soft equation")
        await self._change(effect=name, severity=example)

    async def _change(self, **values: float | str) -> None:
        self._trial = replace(self._trial, **values)  # type: ignore[arg-type]
        await self._simulate()

    async def _simulate(self) -> None:
        """Follow the sliders; changes made meanwhile are simulated together afterwards."""
        if self._busy:
            return
        shown, self._busy = None, True
        try:
            while shown != self._trial:
                shown = self._trial
                with self._fault.around():
                    time, nominal, affected = await asyncio.to_thread(simulate, shown)
                    if self._chart.is_deleted:  # the page was left
                        return
                    self._chart.show([time.tolist(), nominal.tolist(), affected.tolist()])
                    self._words.set_text(trial_sentence(shown, time, nominal, affected))
                    self._car.show(time[::4].tolist(), affected[::4].tolist())
        finally:
            self._busy = False

    async def _write(self) -> None:
        with self._campaign_fault.around():
            session = new_session(self._folder, "try-it")
            plan, log = self._folder / f"{session.name}.plan.toml", session.log("simulation")
            write_whole(plan, plan_text(self._trial, session.name).encode())
            words = ("simulate", str(plan), "--out", str(session.campaign), *effect_words(self._trial))
            await asyncio.to_thread(work.start, words, log)
            while (state := work.work_of(log)).running:
                await asyncio.sleep(0.2)
            if state.error:
                raise TunnelError(state.error)
            ui.navigate.to(address(session, "records"))


@dataclass(frozen=True)
class RigTrial:
    """The settings of the sliders.

    Args:
        cn_beta: Cnβ, 1/rad.
        cn_r: Cnr, 1/rad.
        spring_stiffness: Kr, N m/rad.
        wind_speed: V, m/s; 0 is wind-off.
        release_angle_deg: release angle, degrees.
        duration: duration, s.
        effect: name of the effect; empty: none.
        severity: severity of the effect, in its unit.
    """

    cn_beta: float = 0.4719
    cn_r: float = -0.1033
    spring_stiffness: float = 16.12
    wind_speed: float = 10.0
    release_angle_deg: float = 20.0
    duration: float = 10.0
    effect: str = ""
    severity: float = 0.0


def chosen_effect(trial: RigTrial) -> Effect | None:
    """The effect of a trial with the values of its example, except the severity; None if it has no influence."""
    if not trial.effect or trial.severity == 0.0:
        return None
    kind = effect_class(trial.effect)
    infos = kind.parameters()
    values = {info.name: value for info, value in zip(infos, kind.example, strict=False)}
    spring = kind.chosen_spring()
    values |= {infos[0].name: trial.severity} | ({} if spring is None else {spring: trial.spring_stiffness})
    return kind(**values)


def simulate(trial: RigTrial) -> tuple[Array, Array, Array]:
    """Times (s), and readings (rad) without noise of the nominal model and with the effect, shape (n,) each.

    Raises:
        TunnelError: when the motion grows without bound.
    """
    rig = load_rig()
    stated = RunSettings(
        spring_stiffness=trial.spring_stiffness,
        derivatives=AeroDerivatives(trial.cn_beta, trial.cn_r),
        yaw_inertia=rig.dynamics.yaw_inertia,
        mechanical_damping=rig.dynamics.mechanical_damping,
        wind_speed=trial.wind_speed,
        air_density=rig.air.density,
        release_angle=radians(trial.release_angle_deg),
        duration=trial.duration,
    )
    effect = chosen_effect(trial)
    sensor = SensorModel(RATE, noise_std=0.0, resolution=0.0)
    records = []
    for effects in ((),) if effect is None else ((), (effect,)):
        rng = np.random.default_rng(1)  # the same random moments after every change
        chain = EffectChain.draw(stated, effects, rng)
        try:
            motion = forward_motion(rig, follow_fastest(rig, chain.physics()), RATE)
        except ValueError as error:
            remedy = "choose a stiffer spring or a smaller Cnβ"
            raise TunnelError(str(error), where="the rig", remedy=remedy) from error
        records.append(read_motion(motion, sensor, rng, chain))
    nominal, affected = records[0].yaw_rad, records[-1].yaw_rad
    size = min(nominal.size, affected.size)  # an effect may drop samples
    return records[0].time_s[:size], nominal[:size], affected[:size]


def plan_text(trial: RigTrial, name: str) -> str:
    """The plan of a small campaign for ``tunnel simulate``; the effect is an option of the command."""
    import tomli_w

    return tomli_w.dumps(
        {
            "name": name,
            "seed": 1,
            "spring_stiffness": [trial.spring_stiffness, 2.0 * trial.spring_stiffness],
            "wind_speeds": [0.0, trial.wind_speed] if trial.wind_speed > 0.0 else [0.0],
            "release_angles_deg": [trial.release_angle_deg],
            "duration": trial.duration,
            "truth": {"cn_beta": trial.cn_beta, "cn_r": trial.cn_r},
        }
    )


def effect_words(trial: RigTrial) -> list[str]:
    """The effect as an option of ``tunnel simulate``; empty if there is none."""
    effect = chosen_effect(trial)
    if effect is None:
        return []
    values = ",".join(f"{info.name}={getattr(effect, info.name)!r}" for info in effect.parameters())
    return ["--effect", f"{effect.name}:{values}"]


def trial_sentence(trial: RigTrial, time: Array, nominal: Array, affected: Array) -> str:
    """A sentence on the result of the trial.

    Args:
        time: times, s, shape (n,).
        nominal: reading of the nominal model, rad, shape (n,).
        affected: reading with the effect, rad, shape (n,).
    """
    crossings = np.flatnonzero(np.diff(np.sign(nominal)) != 0)
    parts = []
    if crossings.size > 2:
        half = float(np.mean(np.diff(time[crossings])))
        parts.append(f"The nominal model swings at {0.5 / half:.3g} Hz.")
    if trial.effect and trial.severity:
        apart = degrees(float(np.sqrt(np.mean((affected - nominal) ** 2))))
        parts.append(f"With the effect the reading differs by {apart:.2g}° in root mean square.")
    return " ".join(parts)
