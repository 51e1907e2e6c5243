"""Live views in three dimensions: meshcat's server, which nobody but this computer can reach.

meshcat's own server listens on all networks of the computer; this one listens on loopback only. It is a process of its
own, ``python -m sec_lab.viz.graph_3d_server``, that ends with the view or with the program that opened it.
"""

import contextlib
import subprocess
import sys
import threading
from types import TracebackType
from typing import Any

import zmq
from meshcat import Visualizer
from meshcat.servers.zmqserver import ZMQWebSocketBridge

from sec_lab.observation import Observation
from sec_lab.viz.graph_3d import FRAMES_PER_SECOND, Parts, Scene3D, packed, put_graph, scene_3d

LOOPBACK = "127.0.0.1"


class LiveView:
    """A meshcat visualizer with a server of its own on loopback; use it with ``with``, or close it.

    Attributes
    ----------
    visualizer : meshcat.Visualizer
        Takes any command of meshcat.
    url : str
        Where a browser on this computer sees it.

    Raises
    ------
    OSError
        If the server does not start.
    """

    def __init__(self) -> None:
        self._window: _Window | None = None
        # What it waits for is that its standard input ends: so it never outlives the program that opened it.
        self._server = subprocess.Popen(
            [sys.executable, "-m", "sec_lab.viz.graph_3d_server"], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, text=True, start_new_session=True,
        )  # fmt: skip
        assert self._server.stdout is not None
        said = [self._server.stdout.readline().strip() for _ in range(2)]
        if not all(said):
            self.close()
            raise OSError("3D view: expected a server to start, but it ended at once")
        zmq_url, self.url = said
        self._window = _Window(zmq_url, self.url)
        self.visualizer = Visualizer(window=self._window)

    def show(
        self, observation: Observation | Scene3D, *, parts: Parts | None = None,
        frames_per_second: float = FRAMES_PER_SECOND,
    ) -> None:  # fmt: skip
        """Show scene graphs; parameters and errors are those of :func:`~sec_lab.viz.graph_3d.draw_graph_3d`."""
        scene = scene_3d(observation) if isinstance(observation, Observation) else observation
        put_graph(self.visualizer, scene, parts=parts, frames_per_second=frames_per_second)

    def close(self) -> None:
        """End the server."""
        if self._window is not None:
            self._window.close()
        for pipe in (self._server.stdin, self._server.stdout):
            if pipe is not None:
                pipe.close()
        self._server.wait(timeout=10)

    def __enter__(self) -> "LiveView":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _repr_html_(self) -> str:
        return f'<iframe src="{self.url}" style="width:100%;height:420px;border:0" title="3D"></iframe>'


class _Window:
    """Sends the commands of a visualizer to a server; meshcat's own also prints, and leaves a socket open."""

    def __init__(self, zmq_url: str, web_url: str) -> None:
        self.web_url = web_url
        self._socket: zmq.Socket[bytes] = zmq.Context.instance().socket(zmq.REQ)
        self._socket.connect(zmq_url)

    def send(self, command: Any) -> None:
        """Send a command and wait until it is taken."""
        data = command.lower()
        self._socket.send_multipart([data["type"].encode(), data["path"].encode(), packed(data)])
        self._socket.recv()

    def close(self) -> None:
        """Give the socket back."""
        self._socket.close(linger=0)


class _Bridge(ZMQWebSocketBridge):  # type: ignore[misc]  # meshcat is untyped
    """meshcat's server on loopback; it finds free ports by itself."""

    def make_app(self) -> Any:
        app = super().make_app()
        listen = app.listen
        app.listen = lambda port, **options: listen(port, address=LOOPBACK, **options)
        return app


def main() -> None:
    """Serve until standard input ends; say both addresses first."""
    # meshcat says on standard output which ports are taken.
    with contextlib.redirect_stdout(sys.stderr):
        bridge = _Bridge(host=LOOPBACK)
    sys.stdout.write(f"{bridge.zmq_url}\n{bridge.web_url}\n")
    sys.stdout.flush()

    def wait() -> None:
        sys.stdin.read()
        bridge.ioloop.add_callback(bridge.ioloop.stop)

    threading.Thread(target=wait, daemon=True).start()
    bridge.run()


if __name__ == "__main__":
    main()
