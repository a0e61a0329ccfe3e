"""The stepper of the rig behind MuJoCo Studio's web viewer; imported only when used."""

from __future__ import annotations

import time
from typing import Any

import mujoco
from mujoco.studio import messages, step_control

from tunnel_lab.show.live import LiveRun, pose

_YIELD_S = 1e-3  # as in Studio's own stepper: otherwise the loop starves the viewer's threads


class _PuppetMaster(step_control.StepControl):  # type: ignore[misc]  # mujoco is untyped
    """Studio's pause, speed and single step, applied to the full physics instead of the shown model."""

    def __init__(self, live: LiveRun) -> None:
        super().__init__()
        self._live = live

    @messages.handler(priority=messages.Priority.INTERNAL)  # type: ignore[untyped-decorator]
    def _on_step(self, event: messages.StepEvent) -> None:
        live = self._live
        with self._send_if_changes():
            live.advance_by(lambda: self.step_control.advance(live.model.mj, live.data))
        pose(event.data, live.data)
        mujoco.mj_forward(event.model, event.data)
        time.sleep(_YIELD_S)

    @messages.handler(priority=messages.Priority.INTERNAL)  # type: ignore[untyped-decorator]
    def _on_reset_button(self, event: messages.ResetEvent) -> None:
        del event
        self._live.release()


def puppet_master(live: LiveRun) -> Any:
    """Studio's stepper for a run.

    Returns:
        A plugin for ``mujoco.studio.launch_web.launch``.
    """
    return _PuppetMaster(live)
