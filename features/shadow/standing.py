"""Bring a twin to the reported state of a running machine, by a host's frames on the twin's own bus.

State that no frame can set, but that hosts rely on, is set in the firmware: the numbers of the last fault and of the
next PVT record.
"""

from collections.abc import Iterable, Iterator, Mapping
from typing import Final

import numpy as np

from steptwin.controller.node.axis_node import AxisNode
from steptwin.emulator.simulation import Simulation
from steptwin.features.shadow.asking import KEPT, NodeValues
from steptwin.host.common.errors import InputError
from steptwin.host.robots.robot import Robot
from steptwin.protocol import od
from steptwin.protocol.cia402 import ENABLE_OPERATION, QUICK_STOP, SHUTDOWN, SWITCH_ON, Control, Mode, State, Status
from steptwin.protocol.entry import encode
from steptwin.protocol.frame import COB_ID_INVALID, COB_NMT, COB_SDO_REQUEST, FIRST_NODE_ID, Frame
from steptwin.protocol.homing_methods import HOME_HERE
from steptwin.protocol.nmt import NmtCommand
from steptwin.protocol.objects import ENTRIES
from steptwin.protocol.sdo_frames import download_request
from steptwin.protocol.storage import NO_NAME
from steptwin.protocol.timer import COUNTS_PER_MS

_ANSWERED_COUNTS: Final = 4 * COUNTS_PER_MS
"""Time for a request and its answer, at the slowest bit rate."""
_SETTLED_COUNTS: Final = (od.SETTLING_US_MAX // 1000 + 100) * COUNTS_PER_MS
_PASSES: Final = 3
"""Number of passes over the settings: some are refused until others are written."""
_LED: Final = frozenset((od.CONTROLWORD, od.MODE_OF_OPERATION, od.CHARGE_TOKEN))
"""Entries that command the drive; they are written last, in order."""
_BY_STATE: Final[Mapping[State, tuple[int, ...]]] = {
    State.SWITCH_ON_DISABLED: (),
    State.READY_TO_SWITCH_ON: (SHUTDOWN,),
    State.SWITCHED_ON: (SHUTDOWN, SWITCH_ON),
    State.OPERATION_ENABLED: (SHUTDOWN, SWITCH_ON, ENABLE_OPERATION),
    State.QUICK_STOP_ACTIVE: (SHUTDOWN, SWITCH_ON, ENABLE_OPERATION, QUICK_STOP),
}
"""Controlwords from power-up to each state."""
PAST: Final = frozenset(
    (
        od.ERROR_HISTORY_COUNT,
        *od.ERROR_HISTORY,
        *(address for address in ENTRIES if address >> 8 in (od.PVT_ACCEPTED >> 8, od.FRAMES_LOST >> 8)),
        od.FAULT_AGE_MS,
        od.HOMING_ERROR,
        od.TIME_STAMP,
    )
)
"""Entries with history from before the joining; the twin has other values."""


class TwinNode:
    """One node of the twin, on its way to the state of the machine's node."""

    def __init__(self, simulation: Simulation, node: AxisNode, name: str, values: NodeValues) -> None:
        self._simulation = simulation
        self._node = node
        self._name = name
        self._values = values
        self.sent: list[Frame] = []
        """Frames sent to it."""

    @property
    def _state(self) -> State:
        return State.of(self._node.dictionary.get(od.STATUSWORD))

    def stand(self) -> None:
        """Bring the node to the state of the machine's node."""
        values = self._values
        self._preset()
        self._settle()
        for controlword in _BY_STATE[State.of(values[od.STATUSWORD])]:
            self._write(od.CONTROLWORD, controlword)
            self._simulation.run_until(self._simulation.now_counts + _ANSWERED_COUNTS)
        if State.of(values[od.STATUSWORD]) is State.OPERATION_ENABLED:
            self._await_enabled()
        self._write(od.CONTROLWORD, values[od.CONTROLWORD])
        self._write(od.MODE_OF_OPERATION, values[od.MODE_OF_OPERATION])
        drive = self._node.drive
        drive.fault_number = values[od.FAULT_NUMBER]
        drive.interpolation.next_sequence = values[od.PVT_NEXT_SEQUENCE]
        if not values[od.PVT_FREE_RECORDS]:
            drive.interpolation.close()

    def begin(self) -> None:
        """Start process data if the machine's node has them, and claim the node for the program with the lease.

        A lease ends within a second without its heartbeat, so this comes last, for all nodes.

        Raises:
            InputError: the node has refused a value; the first one is named.
        """
        values, get = self._values, self._node.dictionary.get
        if values[od.STATUSWORD] & Status.REMOTE:
            self._send(Frame(COB_NMT, bytes((NmtCommand.START, self._node.node_id))))
        self._write_all((od.CHARGE_TOKEN,))
        self._check(State.of(values[od.STATUSWORD]) is self._state, od.STATUSWORD)
        for address in (od.MODE_OF_OPERATION_DISPLAY, *KEPT):
            self._check(get(address) == values[address], address)

    def _preset(self) -> None:
        """Set the position by a homing of the axis at standstill."""
        values = self._values
        if values[od.ROBOT_NAME_CRC] == NO_NAME:
            self._node.dictionary.write(od.ROBOT_NAME, b"")
        self._write_all((od.MICROSTEPS, od.MICROSTEPS_WORD, od.POLARITY))
        self._write(od.HOMING_METHOD, HOME_HERE)
        self._write(od.HOME_OFFSET, values[od.POSITION_DEMAND])
        self._write(od.HOMING_PARTIAL, int(not values[od.STATUSWORD] & Status.POSITION_KNOWN))
        self._write(od.MODE_OF_OPERATION, Mode.HOMING)
        for controlword in _BY_STATE[State.OPERATION_ENABLED]:
            self._write(od.CONTROLWORD, controlword)
        self._await_enabled()
        self._write(od.CONTROLWORD, ENABLE_OPERATION | Control.START)
        if values[od.MODE_OF_OPERATION] != Mode.HOMING:
            self._write(od.MODE_OF_OPERATION, Mode.NONE)
        self._write(od.CONTROLWORD, 0)

    def _await_enabled(self) -> None:
        until_counts = self._simulation.now_counts + _SETTLED_COUNTS
        while self._state is not State.OPERATION_ENABLED and self._simulation.now_counts < until_counts:
            self._simulation.run_until(self._simulation.now_counts + _ANSWERED_COUNTS)

    def _settle(self) -> None:
        """Write the settings: those of each PDO while it does not exist, and its mapping while it is empty."""
        for communication, mapping in (
            *zip(od.RPDO_COMMUNICATION, od.RPDO_MAPPING, strict=True),
            *zip(od.TPDO_COMMUNICATION, od.TPDO_MAPPING, strict=True),
        ):
            addresses = [address for address in KEPT if address >> 8 in (communication, mapping)]
            if not self._differing(addresses):
                continue
            count, cob_id = od.address_of(mapping), od.address_of(communication, od.PDO_COB_ID)
            self._write(cob_id, self._node.dictionary.get(cob_id) | COB_ID_INVALID)
            self._write(count, 0)
            self._write_all(address for address in addresses if address not in (count, cob_id))
            self._write_all((count, cob_id))
        for _ in range(_PASSES):
            self._write_all(address for address in KEPT if address not in _LED)

    def _differing(self, addresses: Iterable[int]) -> list[int]:
        return [address for address in addresses if self._node.dictionary.get(address) != self._values[address]]

    def _write_all(self, addresses: Iterable[int]) -> None:
        for address in self._differing(addresses):
            self._write(address, self._values[address])

    def _write(self, address: int, value: int) -> None:
        data = encode(ENTRIES[address].data_type, value)
        self._send(Frame(COB_SDO_REQUEST + self._node.node_id, download_request(address, data)))

    def _send(self, frame: Frame) -> None:
        self.sent.append(frame)
        self._simulation.host.send(frame, self._simulation.now_counts)
        self._simulation.run_until(self._simulation.now_counts + _ANSWERED_COUNTS)

    def _check(self, taken: bool, address: int) -> None:
        if not taken:
            has = self._node.dictionary.get(address)
            raise InputError(
                f"{self._name}: its twin cannot take {self._values[address]} at {od.place_text(address)} and keeps"
                f" {has}: join by its boot-up"
            )


def reported_joints(robot: Robot, standing: Mapping[int, NodeValues]) -> dict[str, float]:
    """Return the position of each joint in mm and degrees, by name, if the positions of its axes are known."""
    values = [standing[node_id] for node_id in range(FIRST_NODE_ID, FIRST_NODE_ID + len(robot.axes))]
    positions = robot.to_positions(np.array([each[od.POSITION_DEMAND] for each in values])).tolist()
    known = [bool(each[od.STATUSWORD] & Status.POSITION_KNOWN) for each in values]
    return {
        name: positions[joint]
        for joint, name in enumerate(robot.joint_names)
        if all(known[axis] for axis in robot.coupling.axes_of(joint))
    }


def stand(simulation: Simulation, names: Mapping[int, str], standing: Mapping[int, NodeValues]) -> Iterator[Frame]:
    """Bring a booted twin to the state of its machine; yield the frames sent.

    Raises:
        InputError: a node of the twin refuses a value, which is named.
    """
    firmware = (node for board in simulation.boards for node in board.own.firmware.nodes)
    nodes = [
        TwinNode(simulation, node, names[node_id], standing[node_id])
        for node_id, node in enumerate(firmware, start=FIRST_NODE_ID)
    ]
    for node in nodes:
        node.stand()
    for node in nodes:
        node.begin()
        yield from node.sent
