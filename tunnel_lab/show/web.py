"""The rig in real time in a browser: MuJoCo Studio's web viewer.

A browser does not have the engine plugin and refuses a model that names it. Therefore the physics runs here,
with the plugin, and the browser shows a copy without it: the same bodies in the same pose.
"""

from __future__ import annotations

import socket
import time

from tunnel_lab.show.live import LiveRun, Puppet
from tunnel_lab.show.request import ShownRun
from tunnel_lab.terminal.tables import say
from tunnel_sim.vocabulary.errors import TunnelError

WARNING = (
    "The server listens on all network interfaces, without a password or a check of the Origin. Anyone who reaches "
    "this port, and any web page in a browser of this machine, can watch and control the view. "
    "Use it only in a network that you trust."
)
"""MuJoCo 4.0 has no option that binds the loopback only; see docs/reference/limits.md."""


_FIRST_PORT, _PORTS = 8080, 100


def view_in_browser(
    run: ShownRun, *, port: int, camera: str, open_browser: bool, seconds: float | None = None
) -> None:
    """Serve the run to browsers until interrupted.

    Args:
        port: TCP port (index); 0 takes the first free one from 8080 on.
        camera: of ``mjcf/rig.xml``, from which the page looks first.
        seconds: time until it stops, s; None runs until interrupted.

    Raises:
        TunnelError: when the port is taken or MuJoCo Studio is not installed.
    """
    try:
        from mujoco.studio import app, launch_web, viewer_protocol
    except ImportError as error:
        remedy = "install the full mujoco package (pip install mujoco), not only mujoco-core"
        raise TunnelError("MuJoCo Studio is missing", where="tunnel view --web", remedy=remedy) from error
    from tunnel_lab.show.overlay import overlay
    from tunnel_lab.show.stepper import puppet_master

    live = LiveRun(run)
    puppet = Puppet(live)
    puppet.model.vis.global_.cameraid = puppet.model.camera(camera).id
    port = port or _free_port()
    address = f"http://localhost:{port}/"
    say(f"Serving {address}; Ctrl-C ends it. {WARNING}", stderr=True)
    config = viewer_protocol.ViewerConfig(
        gfx="web", http_port=port, open_browser=open_browser, title="virtual wind tunnel"
    )
    # The inspector lies where the trace is, and shows the copy rather than the physics.
    plugins = [app.App(app.Config(show_inspector=False)), puppet_master(live), overlay(live, address)]
    begun = time.monotonic()
    try:
        with launch_web.launch(config, plugins=plugins) as handle:
            handle.set_model(puppet.model, data=puppet.data)
            while handle.is_running() and (seconds is None or time.monotonic() - begun < seconds):
                handle.sync()
    except RuntimeError as error:
        raise TunnelError(str(error), where="tunnel view --web", remedy="name another --port") from error


def _free_port() -> int:
    """The first free TCP port from 8080 on; 0, which lets Studio choose, where there is none."""
    for port in range(_FIRST_PORT, _FIRST_PORT + _PORTS):
        with socket.socket(socket.AF_INET6 if socket.has_ipv6 else socket.AF_INET) as trial:
            try:
                trial.bind(("", port))
            except OSError:
                continue
            return port
    return 0
