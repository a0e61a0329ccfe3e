"""Try it: the virtual rig with sliders, and the trace that follows them."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path

from nicegui import events, ui

from tunnel_lab.bench import work
from tunnel_lab.bench.chart import Chart
from tunnel_lab.bench.parts import Fault, address, button
from tunnel_lab.bench.rig_trial import Trial, effect_words, plan_text, said, simulate
from tunnel_lab.bench.workspace import new_session
from tunnel_sim.files.writing import write_whole
from tunnel_sim.vocabulary.errors import TunnelError

_SLIDERS = {
    "cn_beta": ("Cnβ", "1/rad", -1.0, 1.5, 0.01),
    "cn_r": ("Cnr", "1/rad", -1.0, 0.5, 0.01),
    "spring_stiffness": ("spring Kr", "N m/rad", 1.0, 70.0, 0.01),
    "wind_speed": ("wind speed V", "m/s", 0.0, 40.0, 0.5),
    "release_angle_deg": ("release", "°", -40.0, 40.0, 1.0),
    "duration": ("duration", "s", 2.0, 40.0, 1.0),
}


class Car(ui.element, component="static/car.js"):
    """The model from above, which swings as the trace does, in real time."""

    def show(self, time: list[float], angle: list[float]) -> None:
        """Swing by a trace: times in s, angles in rad."""
        self._props.update(time=time, angle=angle)
        self.update()


def build(folder: Path) -> None:
    """Build the page."""
    _TryIt(folder)


class _TryIt:
    """The page."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._trial, self._busy = folder, Trial(), False
        ui.label(
            "The rig by the fast integrator, without noise. Grey: the nominal model; blue: with the effect."
        ).classes("lede")
        with ui.element("div").classes("bench"):
            with ui.element("div").classes("sliders"):
                for key, (name, unit, low, high, step) in _SLIDERS.items():
                    self._slider(key, name, unit, low, high, step)
                self._effects()
            with ui.element("div").classes("shown"):
                self._chart = Chart(
                    "Yaw angle",
                    "time [s]",
                    "yaw angle [rad]",
                    [("nominal model", "quiet"), ("with the effect", "after")],
                    [],
                )
                self._words = ui.label().classes("soft").props("role=status aria-live=polite")
                self._fault = Fault()
                self._car = Car()
        self._campaign()
        ui.timer(0.0, self._simulate, once=True)

    def _slider(self, key: str, name: str, unit: str, low: float, high: float, step: float) -> None:
        with ui.element("div").classes("slider"):
            label = ui.label(f"{name}: {getattr(self._trial, key):g} {unit}")

            async def change(event: events.ValueChangeEventArguments[float | None]) -> None:
                value = float(event.value or 0.0)
                label.set_text(f"{name}: {value:g} {unit}")
                await self._change(**{key: value})

            slider = ui.slider(
                min=low, max=high, step=step, value=getattr(self._trial, key), on_change=change
            )
            slider.props(f'aria-label="{name} [{unit}]"')

    def _effects(self) -> None:
        from tunnel_sim.effects import known_effects

        self._kinds = {kind.name: kind for kind in known_effects()}
        names = {"": "none", **{name: name.replace("_", " ") for name in self._kinds}}
        ui.select(names, label="Effect", value="", on_change=self._choose).props("dense")
        self._severity = ui.element("div").classes("slider")

    async def _choose(self, event: events.ValueChangeEventArguments[str]) -> None:
        self._severity.clear()
        name = event.value or ""
        if not name:
            await self._change(effect="", severity=0.0)
            return
        kind = self._kinds[name]
        info, example = kind.parameters()[0], kind.example[0]
        low, high = max(info.lower, -2.0 * abs(example)), min(info.upper, 2.0 * abs(example))
        unit = "" if info.unit == "1" else f" {info.unit}"
        with self._severity:
            label = ui.label(f"{info.meaning}: {example:.3g}{unit}")

            async def change(event: events.ValueChangeEventArguments[float | None]) -> None:
                value = float(event.value or 0.0)
                label.set_text(f"{info.meaning}: {value:.3g}{unit}")
                await self._change(severity=value)

            ui.slider(min=low, max=high, step=(high - low) / 200.0, value=example, on_change=change).props(
                f'aria-label="{info.meaning} [{info.unit}]"'
            )
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
                    time, nominal, seen = await asyncio.to_thread(simulate, shown)
                    if self._chart.is_deleted:  # the page was left
                        return
                    self._chart.show([time.tolist(), nominal.tolist(), seen.tolist()])
                    self._words.set_text(said(shown, time, nominal, seen))
                    self._car.show(time[::4].tolist(), seen[::4].tolist())
        finally:
            self._busy = False

    def _campaign(self) -> None:
        fault = Fault()
        name = "try-it"

        async def write() -> None:
            with fault.around():
                session = new_session(self._folder, name)
                plan, log = self._folder / f"{session.name}.plan.toml", session.log("simulation")
                write_whole(plan, plan_text(self._trial, session.name).encode())
                words = ("simulate", str(plan), "--out", str(session.campaign), *effect_words(self._trial))
                await asyncio.to_thread(work.start, words, log)
                while (one := work.work_of(log)).running:
                    await asyncio.sleep(0.2)
                if one.error:
                    raise TunnelError(one.error)
                ui.navigate.to(address(session, "records"))

        with ui.element("p").classes("buttons"):
            button("Simulate a campaign of this rig", write)
        ui.label("Two springs, wind off and on, with the sensor's noise, as tunnel simulate does.").classes(
            "soft"
        )
