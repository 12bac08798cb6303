"""A policy at work in a browser, in 3-D, through the web viewer that is part of MuJoCo.

That viewer asks for no password and by itself listens on every interface; here it is bound to loopback. Who sits at
another machine comes through `ssh -L 8080:localhost:8080`.
"""

from __future__ import annotations

import time

from mujoco.studio import app, endpoints, launch_thread, messages, sim, step_control, viewer_protocol, web_viewer

from .stage import Stage
from .viewer import ViewerUnavailable

LOOPBACK = "127.0.0.1"


class LoopbackViewer(web_viewer.WebViewer):
    """The base class takes its address from `_host`, and offers no setting for it."""

    _host = property(lambda self: LOOPBACK, lambda self, value: None)

    @property
    def address(self) -> str:
        return self._http_sock.getsockname()[0]


class Buttons(step_control.StepControl):
    """The buttons of the page run, slow down and pause the policy instead of bare physics."""

    def __init__(self, stage: Stage) -> None:
        super().__init__()
        self._stage = stage
        self._due = 0.0

    @messages.handler(priority=messages.Priority.INTERNAL)
    def _on_step(self, event: messages.StepEvent) -> None:
        control = self.step_control
        if control.get_pause_state() == sim.PauseState.UNPAUSED and time.monotonic() >= self._due:
            self._due = time.monotonic() + self._stage.dt * 100.0 / max(control.get_speed(), 1.0)  # speed in percent
            self._stage.step()
        time.sleep(0.001)  # the server's threads need their turn


def page(stage: Stage, port: int) -> None:
    """Serve the stage to browsers on this machine until Ctrl-C; MuJoCo prints the address.

    Args:
        port: 0 takes the first free one from 8080 on.

    Raises:
        ViewerUnavailable: when the port is taken, or other machines could connect.
    """

    def serve(endpoint: endpoints.ViewerEndpoint) -> None:
        config = viewer_protocol.ViewerConfig(title="openeureka", http_port=port)
        viewer = LoopbackViewer(config, endpoint, plugins=[app.App()], camera=stage.director.hand_over())
        if viewer.address != LOOPBACK:
            viewer.close()
            raise RuntimeError(
                f"this version of MuJoCo would serve its page at {viewer.address}, to other machines too"
            )
        viewer_protocol.run_viewer_loop(viewer)

    try:
        with launch_thread.launch_thread(serve, sim_plugins=[Buttons(stage)]) as handle:
            while handle.is_running():
                handle.sync(stage.model, stage.data)
    except RuntimeError as error:
        raise ViewerUnavailable(f"No page: {error}.") from None
    except KeyboardInterrupt:
        pass  # the way to end it
