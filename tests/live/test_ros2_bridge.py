"""`steptwin ros2-bridge` on a served board in real time, with a rosbridge server of WebSockets in this process."""

import json
import signal
import socket
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from queue import Queue
from typing import Any

import pytest

from tests.emulator.live.live_rig import TIMEOUT_S
from tests.end_to_end.served import Server, in_real_time, kept_serving

pytest.importorskip("websockets")

from websockets.exceptions import ConnectionClosed
from websockets.sync.server import Server as WebSocketServer
from websockets.sync.server import ServerConnection, serve

ROBOT = "teaching-scara"
ACTION = "/joint_trajectory_controller/follow_joint_trajectory"
JOINTS = ["th1", "th2", "d3", "th4"]


class StubServer:
    """A rosbridge server that keeps what its one client tells it."""

    def __init__(self) -> None:
        self.connection: Queue[ServerConnection] = Queue()
        self.told: Queue[dict[str, Any]] = Queue()
        self.reading = threading.Event()
        self.reading.set()
        # Where no more than two messages wait, a server that reads none of them answers no ping either.
        self._server: WebSocketServer = serve(self._serve, "127.0.0.1", 0, max_queue=2)
        self.port: int = self._server.socket.getsockname()[1]
        self._thread = threading.Thread(target=self._server.serve_forever)
        self._thread.start()

    def _serve(self, connection: ServerConnection) -> None:
        self.connection.put(connection)
        try:
            for text in connection:
                self.told.put(json.loads(text))
                self.reading.wait()
        except ConnectionClosed:
            return

    def until(self, op: str) -> dict[str, Any]:
        """Return the next message of an operation."""
        while (message := self.told.get(timeout=TIMEOUT_S))["op"] != op:
            pass
        return message

    def end(self) -> None:
        self.reading.set()
        self._server.shutdown()
        self._thread.join()


@contextmanager
def bridged(server: Server) -> Iterator[tuple[StubServer, subprocess.Popen[str]]]:
    """Let the bridge run on a board whose position is known; kill it at the end."""
    assert server.run("home", ROBOT, "--here", "0 0 0 0") == 0
    stub = StubServer()
    bridge = server.start("ros2-bridge", ROBOT, "--rosbridge", f"127.0.0.1:{stub.port}", "--json")
    try:
        yield stub, bridge
    finally:
        bridge.kill()
        bridge.communicate()
        stub.end()


def goal(end_rad: float, seconds: int) -> str:
    points = [{"positions": [end_rad, 0.0, 0.0, 0.0], "time_from_start": {"sec": seconds, "nanosec": 0}}]
    args = {"trajectory": {"joint_names": JOINTS, "points": points}}
    return json.dumps({"op": "send_action_goal", "id": "g1", "action": ACTION, "args": args, "feedback": True})


@in_real_time
def test_a_goal_and_a_cancellation() -> None:
    with kept_serving(ROBOT) as server, bridged(server) as (stub, bridge):
        assert stub.until("advertise_action")["action"] == ACTION
        connection = stub.connection.get(timeout=TIMEOUT_S)
        assert stub.until("publish")["msg"] == {"name": JOINTS, "position": [0.0] * 4}
        connection.send(goal(0.1, 1))
        result = stub.until("action_result")
        assert (result["status"], result["values"]) == (4, {"error_code": 0, "error_string": ""})
        connection.send(goal(0.4, 60))
        stub.until("action_feedback")
        connection.send(json.dumps({"op": "cancel_action_goal", "id": "g1", "action": ACTION}))
        assert stub.until("action_result")["status"] == 5
        bridge.send_signal(signal.SIGINT)
        out, err = bridge.communicate(timeout=TIMEOUT_S)
        assert bridge.returncode == 0, err
        assert json.loads(out)["goals"] == {"succeeded": 1, "canceled": 1, "aborted": 0}
        assert stub.until("unadvertise_action")["action"] == ACTION


@pytest.mark.parametrize("silently", [False, True])
@in_real_time
def test_a_connection_that_ends_stops_the_axes(silently: bool) -> None:
    """Also without a word: the server's computer is off, or it hangs."""
    with kept_serving(ROBOT) as server, bridged(server) as (stub, bridge):
        connection = stub.connection.get(timeout=TIMEOUT_S)
        connection.send(goal(0.4, 60))
        stub.until("action_feedback")
        if silently:
            stub.reading.clear()
        else:
            connection.close()
        _, err = bridge.communicate(timeout=TIMEOUT_S)
        assert bridge.returncode == 4
        assert err.splitlines()[-1] == (
            f"steptwin: rosbridge at 127.0.0.1:{stub.port}: the connection has ended;"
            " a motion that was under way has stopped"
        )
        assert {axis["state"] for axis in server.json("status", ROBOT)["axes"]} == {"QUICK STOP ACTIVE"}


def test_without_a_server(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken, kept_serving(ROBOT) as server:
        free = taken.getsockname()[1]
        taken.close()
        assert server.run("ros2-bridge", ROBOT, "--rosbridge", f"127.0.0.1:{free}") == 4
        assert capsys.readouterr().err == (
            f"steptwin: rosbridge at 127.0.0.1:{free}: Connection refused: is rosbridge_server running?\n"
        )
