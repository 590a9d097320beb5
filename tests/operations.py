"""Operations that tests of the core do to a machine; features have their own, which describe themselves to users."""

from dataclasses import dataclass, replace

from steptwin.emulator.board.board import Board
from steptwin.emulator.drivers.axis_wires import Condition, Wire
from steptwin.emulator.operations import AxisOperation, BoardOperation, Operation
from steptwin.emulator.simulation import Simulation
from steptwin.protocol.cia402 import DigitalInput


@dataclass(frozen=True, slots=True)
class EmergencyStop(BoardOperation):
    """The button is pressed or pulled out."""

    pressed: bool

    def apply_to(self, board: Board, _now_counts: int) -> None:
        board.inputs.emergency_stop = self.pressed


@dataclass(frozen=True, slots=True)
class Supply(BoardOperation):
    """The motor supply has this voltage."""

    supply_10mv: int

    def apply_to(self, board: Board, now_counts: int) -> None:
        board.measure(replace(board.measurements, supply_10mv=self.supply_10mv), now_counts)


@dataclass(frozen=True, slots=True)
class BoardTemperature(BoardOperation):
    """The board has this temperature."""

    temperature_decidegc: int

    def apply_to(self, board: Board, now_counts: int) -> None:
        board.measure(replace(board.measurements, temperature_decidegc=self.temperature_decidegc), now_counts)


@dataclass(frozen=True, slots=True)
class DriverProtect(AxisOperation):
    """A driver's Protect pin is held low from outside, or released."""

    active: bool

    def apply_to(self, board: Board, _now_counts: int) -> None:
        board.hold_protect(self.axis, held=self.active)


@dataclass(frozen=True, slots=True)
class StuckSwitch(AxisOperation):
    """A switch sticks closed or open, or is free (None)."""

    switch: DigitalInput
    closed: bool | None

    def apply_to(self, board: Board, _now_counts: int) -> None:
        board.inputs.stick(self.axis, self.switch, closed=self.closed)


@dataclass(frozen=True, slots=True)
class Slip(AxisOperation):
    """A rotor jumps by full steps."""

    full_steps: int

    def apply_to(self, board: Board, _now_counts: int) -> None:
        board.slip(self.axis, self.full_steps)


@dataclass(frozen=True, slots=True)
class OscCapacitor(AxisOperation):
    """The capacitor at a chip's OSC pin has another value."""

    osc_pf: float

    def apply_to(self, board: Board, _now_counts: int) -> None:
        board.drain()
        board.drivers.change_capacitor(self.axis, self.osc_pf)


@dataclass(frozen=True, slots=True)
class SetWire(AxisOperation):
    """A wire to a driver is like this."""

    wire: Wire
    condition: Condition

    def apply_to(self, board: Board, _now_counts: int) -> None:
        board.set_wire(self.axis, self.wire, self.condition)


@dataclass(frozen=True, slots=True)
class BrownOut(Operation):
    """The logic's supply of a board breaks down for a time."""

    for_ms: int

    def apply(self, simulation: Simulation, number: int) -> None:
        simulation.take_down(number, lambda board, now_counts: board.power_down(now_counts), self.for_ms)


@dataclass(frozen=True, slots=True)
class WatchdogReset(Operation):
    """The processor is held in reset for a time, while the drivers keep their supply."""

    for_ms: int = 3

    def apply(self, simulation: Simulation, number: int) -> None:
        simulation.take_down(number, lambda board, now_counts: board.reset(now_counts), self.for_ms)


@dataclass(frozen=True, slots=True)
class BoardOff(Operation):
    """A board's CAN controller goes into bus-off."""

    def apply(self, simulation: Simulation, number: int) -> None:
        simulation.bus.throw_off(simulation.boards[number].can, simulation.now_counts)


@dataclass(frozen=True, slots=True)
class HostBitRate(Operation):
    """The host's adapter has another bit rate."""

    bitrate: int

    def apply(self, simulation: Simulation, _number: int) -> None:
        simulation.bus.set_host_bitrate(simulation.host, self.bitrate)
