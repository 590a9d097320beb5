"""A board of one axis whose wires the tests break while it moves."""

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.drivers.axis_wires import Condition, Wire
from steptwin.emulator.drivers.driver_module import Module
from steptwin.emulator.simulation import Simulation
from steptwin.emulator.world.switches import Switch
from steptwin.features.faults.kinds.wiring import SetWire
from steptwin.protocol import od
from steptwin.protocol.frame import COB_SYNC, Frame
from steptwin.protocol.pvt import PvtRecord
from tests.emulator.pins import WIRES
from tests.emulator.simulations import NODE, STEP, switch_on


class Rig:
    """A board of one axis that moves 50 steps up in 100 ms, and has 16 ms before its motion's first tick."""

    def __init__(self, kernel: Kernel, module: Module | None = None, switches: tuple[Switch, ...] = ()) -> None:
        self.board = Board(BoardConfig(modules=(module or WIRES,), switches=switches), kernel)
        self.simulation = Simulation([self.board], Bus(1_000_000))
        if module:
            for address in (od.STEPLEN_NS, od.STEPSPACE_NS, od.DIRSETUP_NS, od.DIRHOLD_NS):
                self.board.firmware.nodes[0].dictionary.set(address, 200_000)
        switch_on(self.simulation)
        self._records = 0

    def wire(self, wire: Wire, condition: Condition) -> int:
        """Put a wire into a condition; return the tick from which on it is like that, in counts."""
        self.simulation.operate(SetWire(0, wire, condition))
        return self.board.firmware.motion.tick * TICK_COUNTS

    def move(self, steps: int = 50) -> None:
        record = PvtRecord(steps * STEP, 0, 100, self._records)
        self._records += 1
        for cob_id, data in ((0x200, b"\x0f\x00\x07"), (0x500, record.encode()), (0x300, b"\x1f\x00")):
            self.simulation.send(Frame(cob_id + NODE, data))
        self.simulation.send(Frame(COB_SYNC, b""))

    @property
    def monitor(self) -> tuple[int, int]:
        """Steps that the driver has counted, and steps lost, as the firmware reads them."""
        get = self.board.firmware.nodes[0].dictionary.get
        return get(od.ROTOR_POSITION_STEPS), get(od.LOST_STEPS)
