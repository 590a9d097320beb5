"""A served board with a further node: the canopen library is the master of both, the control port moves the inputs."""

import json
import signal
import time
from collections.abc import Callable
from pathlib import Path

import canopen
import pytest

from steptwin.host.client.control_client import ControlClient
from steptwin.host.common.errors import InputError
from tests.emulator.live.live_rig import TIMEOUT_S
from tests.end_to_end.served import in_real_time, serving
from tests.features.nodes.test_simple_node import EDS, ID

INPUTS = "0x6000:01"


def soon(true: Callable[[], bool]) -> None:
    """Wait until something is true."""
    until_s = time.monotonic() + TIMEOUT_S
    while not true():
        assert time.monotonic() < until_s
        time.sleep(0.005)


@in_real_time
def test_a_master_of_a_whole_machine(tmp_path: Path) -> None:
    log = tmp_path / "run.log"
    with serving("lab-scara", "--machine", f"node={ID}={EDS}", "--control-port", "0", "--log", str(log)) as server:
        assert server.banner[2] == f"further node 0x40: {EDS}"
        port = int(server.banner[3].split(",")[0].rpartition(":")[2])
        network = canopen.Network()
        network.connect(interface="socketcand", channel="vcan0", host="127.0.0.1", port=server.port)
        with ControlClient("127.0.0.1", port) as control:
            module = network.add_node(ID, str(EDS))
            axis = network.add_node(0x10, canopen.ObjectDictionary())  # type: ignore[no-untyped-call]
            assert module.sdo[0x1008].raw == "An input and output module"
            assert axis.sdo.upload(0x1000, 0) == bytes.fromhex("92010400")
            module.sdo[0x1017].raw = 50
            module.nmt.wait_for_heartbeat(TIMEOUT_S)
            module.tpdo[1].read()
            seen: list[int] = []
            module.tpdo[1].add_callback(lambda pdo: seen.append(pdo[0].raw))
            module.nmt.state = "OPERATIONAL"
            soon(lambda: 0 in seen)
            assert control.set_node_value(ID, INPUTS, 4) == 4
            soon(lambda: 4 in seen)
            network.send_message(0x200 + ID, bytes((7, 0, 0, 0)))
            soon(lambda: control.node_value(ID, "0x6200:01") == 7)
            assert control.node_emergency(ID, 0x5000).document["nodes"] == {"0x40": "OPERATIONAL"}
            soon(lambda: [entry.code for entry in module.emcy.log] == [0x5000])
            refusals(control)
            assert control.switch_node(ID, on=False).document["nodes"] == {"0x40": "OFF"}
            control.switch_node(ID, on=True)
            soon(lambda: module.nmt.state == "PRE-OPERATIONAL")
        network.disconnect()
        assert server.end(signal.SIGTERM)[0] == 0
    assert " 740#00" in log.read_text(encoding="utf-8")


def refusals(control: ControlClient) -> None:
    for node_id, place, value, told in (
        (0x41, INPUTS, 0, "node: 65 is no further node; there are 64"),
        (ID, "0x6000:09", 0, "object: 0x6000:09 is not in .*; near is 0x6000:0"),
        (ID, "door", 0, "object: 'door' is not an object such as 0x6000:01"),
        (ID, INPUTS, 256, "value: 256 is not from 0 to 255"),
        (ID, INPUTS, "on", "value: 'on' is no whole number"),
        (ID, "0x2403", 1, "value: 1 is no text"),
    ):
        with pytest.raises(InputError, match=told):
            control.set_node_value(node_id, place, value)
    with pytest.raises(InputError, match="code: 'x' is not a whole number"):
        control.ask("node-emergency", node=ID, code="x")
    with pytest.raises(InputError, match="bit: there is no such key; there are node, object, value"):
        control.ask("node", node=ID, object=INPUTS, bit=1)
    assert json.dumps(control.node_value(ID, "0x2400")) == "21.5"
