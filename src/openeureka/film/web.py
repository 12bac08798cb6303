"""A policy at work in a browser, in 3-D, through the web viewer that is part of MuJoCo.

That viewer asks for no password, listens on every interface and answers the pages of any site. It loads models that
they drop on it, with any file that a model names as a texture. Here it listens on loopback, answers only its own page
and loads nothing. From another machine, use `ssh -L 8080:localhost:8080`.
"""

from __future__ import annotations

import re
import threading
import time
from typing import TYPE_CHECKING, Any

from mujoco.studio import app, endpoints, launch_thread, messages, sim, step_control, viewer_protocol, web_viewer
from mujoco.studio.web import web_server

from .stage import Stage
from .viewer import ViewerUnavailable

if TYPE_CHECKING:
    from websockets.asyncio.server import Server, ServerConnection
    from websockets.http11 import Request, Response

LOOPBACK = "127.0.0.1"
_NAMES = re.compile(r"(127\.0\.0\.1|localhost)(:[0-9]+)?")
"""Names by which a browser calls this machine. Any port, as ssh may forward another one."""
_PATIENCE = 10.0
"""[s] that the server's thread may take to begin."""
_guarded = threading.Event()
_serve = web_server.serve


def _refused(connection: ServerConnection, request: Request) -> Response | None:
    hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
    if len(hosts) != 1 or not _NAMES.fullmatch(hosts[0]):  # a name of another site may resolve to this machine
        return connection.respond(403, "Open this page as localhost.\n")
    if any(origin != f"http://{hosts[0]}" for origin in origins):
        return connection.respond(403, "Only the viewer's own page may ask for this.\n")
    if request.path.partition("?")[0] == "/drop":
        return connection.respond(403, "This page shows a policy; it loads no other model.\n")
    return None


async def _serve_guarded(*args: Any, process_request: Any, **settings: Any) -> Server:
    """Serve as `websockets` does, but only requests that `_refused` lets pass; MuJoCo offers no setting for this."""
    _guarded.set()
    return await _serve(*args, process_request=lambda c, r: _refused(c, r) or process_request(c, r), **settings)


web_server.serve = _serve_guarded


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

    @messages.handler
    def _on_load(self, event: messages.LoadModelEvent) -> bool:
        """Returns True: this keeps the event from handlers that would load a file."""
        return True

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
        ViewerUnavailable: when the port is taken, or other machines or sites could connect.
    """

    def serve(endpoint: endpoints.ViewerEndpoint) -> None:
        config = viewer_protocol.ViewerConfig(title="openeureka", http_port=port)
        viewer = LoopbackViewer(config, endpoint, plugins=[app.App()], camera=stage.director.hand_over())
        if viewer.address != LOOPBACK:
            viewer.close()
            raise RuntimeError(
                f"this version of MuJoCo would serve its page at {viewer.address}, to other machines too"
            )
        if not _guarded.wait(_PATIENCE):
            viewer.close()
            raise RuntimeError("this version of MuJoCo would serve its page to other sites too")
        viewer_protocol.run_viewer_loop(viewer)

    try:
        with launch_thread.launch_thread(serve, sim_plugins=[Buttons(stage)]) as handle:
            while handle.is_running():
                handle.sync(stage.model, stage.data)
    except RuntimeError as error:
        raise ViewerUnavailable(f"No page: {error}.") from None
    except KeyboardInterrupt:
        pass  # this is how a person ends it
