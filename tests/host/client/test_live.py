"""Other masters, unmodified, on a live board: python-can's socketcand interface, canopen's CiA 402 node."""

import time
from collections.abc import Callable, Iterator

import can
import canopen
import pytest

from steptwin.emulator.live.can_bridge import INBOX_MAX, CanBridge
from steptwin.protocol import od
from steptwin.protocol.cia402 import Status
from tests.emulator.live.live_rig import TIMEOUT_S, LiveRig, await_true
from tests.host.client.machines import STEP
from tests.host.client.other_masters import Node402, node402

pytestmark = pytest.mark.live

NODE = 0x11

MakeNetwork = Callable[[], canopen.Network]


@pytest.fixture
def rig() -> Iterator[LiveRig]:
    with LiveRig() as rig:
        yield rig


@pytest.fixture
def connect(rig: LiveRig) -> Iterator[MakeNetwork]:
    """Return a function that connects another network at each call."""
    networks = []

    def make() -> canopen.Network:
        network = canopen.Network()
        network.connect(interface="socketcand", channel="vcan0", host="127.0.0.1", port=rig.port)
        networks.append(network)
        return network

    yield make
    for network in networks:
        network.disconnect()


def add_node(network: canopen.Network, node_id: int = NODE) -> Node402:
    """Add a node that waits long enough for answers on a busy computer."""
    node = node402(network, node_id)
    node.sdo.RESPONSE_TIMEOUT = TIMEOUT_S
    node.TIMEOUT_SWITCH_OP_MODE = node.TIMEOUT_SWITCH_STATE_FINAL = TIMEOUT_S
    return node


def test_the_device_name_tells_that_it_is_simulated(connect: MakeNetwork) -> None:
    node = add_node(connect())
    assert "SIMULATED" in node.sdo["Manufacturer device name"].raw


def test_a_402_node_makes_a_profile_move(rig: LiveRig, connect: MakeNetwork) -> None:
    """The node uses its own methods: load_configuration, setup_402_state_machine, TPDOs, states, operation modes."""
    node = add_node(connect())
    node.nmt.state = "PRE-OPERATIONAL"
    node.load_configuration()
    node.setup_402_state_machine()  # type: ignore[no-untyped-call]
    node.nmt.state = "OPERATIONAL"
    node.state = "READY TO SWITCH ON"
    node.state = "SWITCHED ON"
    node.op_mode = "PROFILED POSITION"
    node.state = "OPERATION ENABLED"
    node.write(od.TARGET_POSITION, 300 * STEP)
    node.controlword = 0x1F
    await_true(lambda: bool(node.read(od.STATUSWORD) & Status.SET_POINT_ACKNOWLEDGED), "the set-point is taken")
    node.controlword = 0x0F
    await_true(lambda: node.read(od.POSITION_ACTUAL) == 300 * STEP, "the axis is there")
    await_true(lambda: bool(node.read(od.STATUSWORD) & Status.TARGET_REACHED), "the axis reports its arrival")
    assert rig.board.trace(1).position_steps == 300
    assert rig.live.ticks.count > 100


def test_two_masters_at_once(connect: MakeNetwork) -> None:
    """Both masters read many times; each sees the answers that the other's node sends, too."""
    first, other = add_node(connect()), add_node(connect(), NODE - 1)
    for _ in range(50):
        assert first.read(od.DEVICE_TYPE) == other.read(od.DEVICE_TYPE) == 0x00040192


def bridge_to(bus: can.BusABC) -> tuple[LiveRig, CanBridge]:
    """Return a live board connected to a bus of python-can instead of a socketcand server."""
    rig = LiveRig(speed=20)
    rig.server.close()
    return rig, CanBridge(rig.loop, bus)


@pytest.fixture
def bridged() -> Iterator[tuple[LiveRig, CanBridge]]:
    rig, bridge = bridge_to(can.Bus("a board of this test", interface="virtual"))
    with rig:
        yield rig, bridge
        bridge.close()


@pytest.fixture
def virtual() -> Iterator[can.BusABC]:
    with can.Bus("a board of this test", interface="virtual") as bus:
        yield bus


READ_TYPE = can.Message(arbitration_id=0x610, data=bytes.fromhex("4000100000000000"), is_extended_id=False)


def receive(bus: can.BusABC, cob_id: int) -> can.Message:
    """Receive frames until one has this identifier; return it."""
    deadline_s = time.monotonic() + TIMEOUT_S
    while time.monotonic() < deadline_s:
        message = bus.recv(TIMEOUT_S)
        if message and message.arbitration_id == cob_id:
            return message
    raise AssertionError(f"no {cob_id:03X}")


@pytest.mark.usefixtures("bridged")
def test_on_a_bus_of_python_can(virtual: can.BusABC) -> None:
    for _ in range(20):
        virtual.send(READ_TYPE)
        answer = receive(virtual, 0x590)
        assert bytes(answer.data) == bytes.fromhex("4300100092010400")
        assert not answer.is_extended_id


def test_only_classical_frames_pass(bridged: tuple[LiveRig, CanBridge], virtual: can.BusABC) -> None:
    for foreign in (
        can.Message(arbitration_id=0x610, is_extended_id=True),
        can.Message(arbitration_id=0x610, is_extended_id=False, is_fd=True, data=bytes(12)),
        can.Message(is_error_frame=True),
    ):
        virtual.send(foreign)
    virtual.send(READ_TYPE)
    receive(virtual, 0x590)
    assert bridged[1].foreign_frames == 3


def test_a_remote_frame_asks_a_node_for_its_state(bridged: tuple[LiveRig, CanBridge], virtual: can.BusABC) -> None:
    """Node guarding: the toggle bit begins with 0. The answer to an SDO comes behind the boot-up message."""
    virtual.send(READ_TYPE)
    receive(virtual, 0x590)
    for state in (0x7F, 0xFF):
        virtual.send(can.Message(arbitration_id=0x710, is_extended_id=False, is_remote_frame=True))
        assert bytes(receive(virtual, 0x710).data) == bytes((state,))
    assert bridged[1].foreign_frames == 0


def test_a_flood_is_cut_and_counted(bridged: tuple[LiveRig, CanBridge], virtual: can.BusABC) -> None:
    """Of far more frames than the bus takes, each passes or is counted as cut; two boot-up messages pass, too."""
    rig, bridge = bridged
    count = 4 * INBOX_MAX
    for _ in range(count):
        virtual.send(can.Message(arbitration_id=0x123, is_extended_id=False))
    await_true(lambda: rig.bus.frames + bridge.overruns == count + 2, "all have passed or been cut")
    virtual.send(READ_TYPE)
    receive(virtual, 0x590)


class BrokenBus(can.BusABC):
    """An interface that fails as if its cable were pulled."""

    def __init__(self, error: Exception, *, sending: bool) -> None:
        super().__init__("broken")
        self._error = error
        self._sending = sending

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:  # noqa: ARG002
        if not self._sending:
            raise self._error
        time.sleep(0.01)
        return None, True

    def send(self, msg: can.Message, timeout: float | None = None) -> None:  # noqa: ARG002
        if self._sending:
            raise self._error


@pytest.mark.parametrize(
    ("error", "sending"),
    [(can.CanOperationError("cable pulled"), False), (OSError("cable pulled"), False), (OSError("cable pulled"), True)],
)
def test_a_bus_that_fails_ends_the_loop_with_its_reason(error: Exception, sending: bool) -> None:
    rig, bridge = bridge_to(BrokenBus(error, sending=sending))
    with rig:
        await_true(lambda: bridge.failure is not None, "the failure is noticed")
        bridge.close()
    assert bridge.failure == "cable pulled"


def test_frames_that_a_bus_does_not_take_are_counted() -> None:
    rig, bridge = bridge_to(BrokenBus(can.CanOperationError("no room"), sending=True))
    with rig:
        await_true(lambda: bridge.unsent_frames == 2, "both boot-up messages were refused")
        bridge.close()
    assert bridge.failure is None
