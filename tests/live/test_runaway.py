"""No target outlives the program that gave it: after a jog, however it ends, a command moves only what it names."""

import signal
import subprocess
from collections.abc import Callable

import pytest

from steptwin.host.client.links.bus_link import BusLink, Connection, open_bus
from steptwin.host.client.waiting import require
from steptwin.host.operate.jogging import jog
from steptwin.host.operate.recovering import reset
from steptwin.host.operate.session import Session
from steptwin.host.robots import load_robot
from steptwin.protocol import od
from steptwin.protocol.cia402 import State
from tests.emulator.live.live_rig import TIMEOUT_S
from tests.end_to_end.served import Server, in_real_time, kept_serving

ROBOT = load_robot("warehouse-scara")
TH1 = ROBOT.joint_names.index("th1")
HOME = "0 0 100 0 60 30"
MOVING = (State.OPERATION_ENABLED, State.FAULT_REACTION_ACTIVE)
JOG = ("jog", ROBOT.name, "th1", "-10", "--seconds", "60")

End = Callable[[Server, subprocess.Popen[str]], object]
ENDS: dict[str, End] = {
    "Ctrl-C": lambda _server, jogging: jogging.send_signal(signal.SIGINT),
    "stop": lambda server, _jogging: server.run("stop", ROBOT.name),
    "estop": lambda server, _jogging: server.run("estop", ROBOT.name),
    "kill": lambda _server, jogging: jogging.kill(),
}


@pytest.mark.parametrize("end", ENDS)
@in_real_time
def test_a_jog_that_was_ended_does_not_go_on(end: str) -> None:
    with kept_serving(ROBOT.name) as server:
        assert server.run("home", ROBOT.name, "--here", HOME) == 0
        with BusLink(open_bus(Connection("socketcand", None, None, "127.0.0.1", server.port)), "the server") as link:
            session = Session(link, ROBOT)
            th1 = session.machine.axes[TH1]
            jogging = server.start(*JOG)
            require(link, lambda: bool(th1.read(od.VELOCITY_ACTUAL)), "the jog does not begin", TIMEOUT_S)
            ENDS[end](server, jogging)
            jogging.communicate(timeout=TIMEOUT_S)
            # A killed program is missed after 350 ms.
            require(link, lambda: th1.state() not in MOVING and not th1.read(od.VELOCITY_ACTUAL), "no stop", TIMEOUT_S)
            reset(session)
            stood_units = th1.read(od.POSITION_ACTUAL)
            jog(session, "L1", 5.0, 0.5)
            assert th1.read(od.POSITION_ACTUAL) == stood_units
            assert th1.state() is State.OPERATION_ENABLED
            assert server.run("move", ROBOT.name, "th1=0") == 0
