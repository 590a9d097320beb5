"""A motor is shorted: what the firmware learns of it, and what brings the axis back, by the driver's fault output."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.drivers.driver_module import fitted
from steptwin.emulator.drivers.limits import Rule
from steptwin.emulator.simulation import Simulation
from steptwin.features.faults.kinds.machine import BrownOut, Supply
from steptwin.features.faults.kinds.wiring import ShortCircuit
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, ErrorCode, State
from steptwin.protocol.drivers import PROFILES
from steptwin.protocol.frame import Frame
from tests.emulator.simulations import switch_on, wait

FAULT_RESET = Frame(0x210, b"\x80\0\7")


class Machine:
    """One axis, enabled, with such a driver."""

    def __init__(self, kernel: Kernel, driver: str, *, wired: bool) -> None:
        self.board = Board(BoardConfig((fitted(PROFILES[driver], 8, fault_wired=wired),)), kernel)
        self.simulation = Simulation([self.board], Bus(1_000_000))
        switch_on(self.simulation)
        self.wait(5)

    def wait(self, ms: float) -> None:
        wait(self.simulation, ms)

    def short(self, *, shorted: bool) -> None:
        self.simulation.operate(ShortCircuit(0, shorted))
        self.wait(5)

    def reset_fault(self) -> State:
        """Reset the fault; return the state after it."""
        self.simulation.send(Frame(0x210, b"\0\0\7"))
        self.simulation.send(FAULT_RESET)
        self.wait(5)
        return self.state

    def enable(self) -> State:
        switch_on(self.simulation)
        self.wait(5)
        return self.state

    @property
    def state(self) -> State:
        return self.board.firmware.nodes[0].drive.state

    @property
    def error(self) -> int:
        return self.board.firmware.nodes[0].dictionary.get(od.ERROR_CODE)

    @property
    def rules(self) -> list[Rule]:
        self.board.drain()
        return self.board.drivers.drivers[0].violations.rules()


@pytest.mark.parametrize("driver", ["drv8825", "tmc2209", "tmc5160"])
def test_a_fault_output_that_is_wired_stops_the_axis(fast_kernel: Kernel, driver: str) -> None:
    machine = Machine(fast_kernel, driver, wired=True)
    assert machine.state is State.OPERATION_ENABLED
    machine.short(shorted=True)
    assert (machine.state, machine.error) == (State.FAULT, ErrorCode.OUTPUT_STAGE)
    assert machine.rules == [Rule.OVER_CURRENT]


@pytest.mark.slow
@pytest.mark.parametrize(("driver", "wired"), [("drv8825", False), ("a4988", False), ("dm542", False)])
def test_without_it_nothing_tells(fast_kernel: Kernel, driver: str, wired: bool) -> None:
    machine = Machine(fast_kernel, driver, wired=wired)
    machine.short(shorted=True)
    assert (machine.state, machine.error) == (State.OPERATION_ENABLED, 0)
    assert machine.rules == [Rule.OVER_CURRENT]


def test_a_drv8825_stays_in_fault_until_the_power_is_off(fast_kernel: Kernel) -> None:
    machine = Machine(fast_kernel, "drv8825", wired=True)
    machine.short(shorted=True)
    machine.short(shorted=False)
    assert machine.reset_fault() is State.FAULT
    machine.simulation.operate(BrownOut(for_ms=5))
    machine.wait(10)
    assert machine.board.inputs.levels == [DigitalInput(0)]
    assert machine.enable() is State.OPERATION_ENABLED
    assert machine.rules == [Rule.OVER_CURRENT]


def test_a_tmc2209_is_free_when_its_enable_is_off_and_trips_again_while_it_lasts(fast_kernel: Kernel) -> None:
    machine = Machine(fast_kernel, "tmc2209", wired=True)
    machine.short(shorted=True)
    assert machine.board.inputs.levels == [DigitalInput(0)]  # the firmware has taken ENABLE away
    assert machine.reset_fault() is State.SWITCH_ON_DISABLED
    assert machine.enable() is State.FAULT
    assert machine.rules == [Rule.OVER_CURRENT] * 2
    machine.short(shorted=False)
    assert machine.reset_fault() is State.SWITCH_ON_DISABLED
    assert machine.enable() is State.OPERATION_ENABLED
    assert machine.rules == [Rule.OVER_CURRENT] * 2


def test_the_environment_knows_it_and_the_end_of_a_fault_repairs_it(fast_kernel: Kernel) -> None:
    machine = Machine(fast_kernel, "tmc2209", wired=True)
    before = machine.board.environment
    fault = ShortCircuit(0, shorted=True)
    machine.simulation.operate(fault)
    assert machine.board.environment.axes[0].shorted
    assert fault.undo(before) == ShortCircuit(0, shorted=False)


@pytest.mark.parametrize(("supply_10mv", "rules"), [(5200, []), (5201, [Rule.OVER_VOLTAGE])])
def test_a_dm542_switches_itself_off_above_52_v(fast_kernel: Kernel, supply_10mv: int, rules: list[Rule]) -> None:
    machine = Machine(fast_kernel, "dm542", wired=False)
    machine.simulation.operate(Supply(supply_10mv))
    machine.wait(5)
    assert machine.rules == rules
    assert machine.error == ErrorCode.OVERVOLTAGE  # the board's own limit, 34 V
