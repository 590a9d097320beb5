"""A brown-out and a watchdog reset in motion: what the drivers do, when the nodes return, and what they have lost."""

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.node.pins import Pin
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.drivers.driver_module import fitted
from steptwin.emulator.drivers.limits import Rule
from steptwin.emulator.operations import Operation
from steptwin.emulator.simulation import BusOverloadError, Simulation
from steptwin.features.faults.kinds.machine import BrownOut, EmergencyStop, PowerUp, WatchdogReset
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, Status
from steptwin.protocol.drivers import PROFILES
from steptwin.protocol.frame import COB_SYNC, Frame
from steptwin.protocol.pvt import PvtRecord
from tests.emulator.pins import QUICK_WITH_16
from tests.emulator.simulations import MS, STEP, wait, write
from tests.messages import refusing

NODE = 0x10
SLOW_TIMING = {od.STEPLEN_NS: 160_000, od.STEPSPACE_NS: 160_000, od.DIRSETUP_NS: 150_000, od.DIRHOLD_NS: 320_000}
LAST_PULSES = {Rule.CLK_HIGH, Rule.CLK_LOW, Rule.DIR_SETUP, Rule.DIR_HOLD, Rule.POWER_ORDER}
"""The last pulse may be cut short, or its falling edge, where that makes the step, comes without power."""
START = Frame(0x000, bytes((1, NODE)))
BOOT_UPS = [Frame(0x700 + NODE, b"\0"), Frame(0x701 + NODE, b"\0")]


class Rig:
    """A board of two axes whose first moves 30 steps up in 100 ms, 40 ms ago."""

    def __init__(self, kernel: Kernel, drivers: str = "chip-330pf", boards: int = 1, bitrate: int = 1_000_000) -> None:
        profile = PROFILES[drivers]
        self.boards = [
            Board(BoardConfig(modules=(fitted(profile, 16),) * 2, first_node_id=node), kernel)
            for node in (NODE, NODE + 2)[:boards]
        ]
        self.board = self.boards[0]
        self.simulation = Simulation(self.boards, Bus(bitrate))
        wait(self.simulation, 5)
        for address, ns in SLOW_TIMING.items():
            write(self.simulation, NODE, address, ns)
        self.simulation.send(START)
        for word in (0x06, 0x07, 0x0F):
            self.simulation.send(Frame(0x200 + NODE, bytes((word, 0, 7))))
        self.move(30, 40)

    def move(self, steps: int, until_ms: float) -> None:
        record = PvtRecord(steps * STEP, 0, 100, 0)
        for cob_id, data in ((0x500 + NODE, record.encode()), (0x300 + NODE, b"\x1f\x00"), (COB_SYNC, b"")):
            self.simulation.send(Frame(cob_id, data))
        wait(self.simulation, until_ms)

    def strike(self, operation: Operation) -> int:
        """Operate the first board; return the instant."""
        self.before = len(self.simulation.bus.log_frames)
        self.simulation.operate(operation)
        return self.simulation.now_counts

    def sent_since(self) -> list[tuple[int, Frame]]:
        bus = self.simulation.bus
        return list(zip(bus.log_counts, bus.log_frames, strict=True))[self.before :]


@pytest.mark.parametrize(("down", "for_ms"), [(BrownOut(20), 20), (WatchdogReset(), 3), (BrownOut(7), 7)])
def test_the_nodes_announce_themselves_when_the_firmware_runs_again(
    fast_kernel: Kernel, down: Operation, for_ms: int
) -> None:
    rig = Rig(fast_kernel, boards=2)
    struck = rig.strike(down)
    assert rig.board.down
    rig.simulation.operate(EmergencyStop(pressed=True))  # nobody is there to see it
    wait(rig.simulation, for_ms - 0.001)
    assert rig.sent_since() == []
    wait(rig.simulation, 10)
    boot_ups = rig.sent_since()
    assert [frame for _, frame in boot_ups] == BOOT_UPS
    assert 0 < boot_ups[0][0] - (struck + for_ms * MS) < MS // 8
    assert not rig.board.firmware.nodes[0].statusword() & Status.POSITION_KNOWN
    assert rig.board.firmware.nodes[0].dictionary.get(od.DIGITAL_INPUTS) == DigitalInput.ESTOP
    assert not rig.boards[1].down
    wait(rig.simulation, 100)
    assert rig.sent_since() == boot_ups
    assert rig.board.firmware.nodes[0].dictionary.get(od.STEPLEN_NS) != 160_000


@pytest.mark.parametrize("drivers", QUICK_WITH_16)
@pytest.mark.parametrize(
    "off_ms", [pytest.param(0, marks=pytest.mark.slow), 0.09, 0.3, pytest.param(1.7, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("down", [BrownOut(20), WatchdogReset()])
def test_no_pulse_comes_after_it_and_only_the_last_one_may_break_limits(
    fast_kernel: Kernel, drivers: str, off_ms: float, down: Operation
) -> None:
    rig = Rig(fast_kernel, drivers)
    wait(rig.simulation, off_ms)
    struck = rig.strike(down)
    wait(rig.simulation, 100)
    trace = rig.board.trace(0)
    assert trace.clk_rise_counts.size
    assert trace.clk_rise_counts.max() < struck
    assert trace.clk_fall_counts[-1] <= struck or isinstance(down, BrownOut)
    assert (trace.violations.counts >= trace.clk_rise_counts[-1]).all()
    assert set(trace.violations.rules()) <= LAST_PULSES
    assert trace.dir_levels.tolist() == [1, 0]
    counted = trace.position_steps
    rig.simulation.operate(PowerUp())
    wait(rig.simulation, 1)
    rig.simulation.send(START)
    for address, ns in SLOW_TIMING.items():
        write(rig.simulation, NODE, address, ns)
    for word in (0x06, 0x07, 0x0F):
        rig.simulation.send(Frame(0x200 + NODE, bytes((word, 0, 7))))
    rig.move(10, 200)
    assert rig.board.trace(0).position_steps == counted + 10


@pytest.mark.parametrize(
    ("drivers", "down", "levels", "angle_stays"),
    [
        ("chip-330pf", WatchdogReset(), [0], False),
        ("3a-module", WatchdogReset(), [1], True),
        ("3a-module", BrownOut(20), [0], False),
    ],
)
def test_a_reset_of_the_processor_frees_a_bare_chips_motor_and_leaves_a_modules_held(
    fast_kernel: Kernel, drivers: str, down: Operation, levels: list[int], angle_stays: bool
) -> None:
    """The bare chip's pull-downs put it into reset, so its field is at the initial angle. The module has power: its
    EN is open, which means on, until the firmware runs and switches it off."""
    rig = Rig(fast_kernel, drivers)
    wait(rig.simulation, 0.4)
    struck = rig.strike(down)
    wait(rig.simulation, 2)
    outputs = rig.board.trace(0).outputs
    held = np.array([struck + MS])
    assert outputs.currents_a(held).any() == bool(levels[0])
    angles = outputs.field_substeps(np.array([struck - 1, struck + MS])).tolist()
    assert (angles[0] == angles[1]) == angle_stays
    wait(rig.simulation, 50)
    now = np.array([rig.simulation.now_counts])
    assert not rig.board.trace(0).outputs.currents_a(now).any()
    enables = [change for change in rig.board.pin_changes if (change.axis, change.pin) == (0, Pin.ENABLE)]
    assert [change.level for change in enables] == [1, 0]
    assert (enables[1].counts == struck) == (not levels[0])


def test_a_board_that_is_struck_again_stays_down_longer(fast_kernel: Kernel) -> None:
    rig = Rig(fast_kernel, boards=2)
    rig.strike(BrownOut(20))
    wait(rig.simulation, 10)
    rig.simulation.operate(WatchdogReset(3))
    wait(rig.simulation, 9)
    assert rig.board.down
    wait(rig.simulation, 2)
    assert not rig.board.down
    rig.strike(BrownOut(None))
    wait(rig.simulation, 500)
    assert rig.sent_since() == []
    rig.simulation.operate(PowerUp())
    wait(rig.simulation, 1)
    assert [frame for _, frame in rig.sent_since()] == BOOT_UPS


def test_a_frame_to_a_dead_board_waits_until_it_lives(fast_kernel: Kernel) -> None:
    """Nobody else is there to acknowledge: the host's controller repeats the frame, error passive."""
    rig = Rig(fast_kernel)
    struck = rig.strike(BrownOut(20))
    rig.simulation.send(Frame(0x000, b"\x81\x00"))
    assert rig.simulation.now_counts >= struck + 20 * MS
    assert rig.simulation.bus.error_frames > 100
    assert [frame.cob_id for _, frame in rig.sent_since()].count(0x000) == 1


def test_a_frame_to_a_board_that_stays_dead_is_given_up(fast_kernel: Kernel) -> None:
    rig = Rig(fast_kernel, bitrate=125_000)
    rig.strike(BrownOut(None))
    with refusing(BusOverloadError):
        rig.simulation.send(START)


@pytest.mark.parametrize("for_ms", [0, -1])
def test_a_time_that_is_none_is_refused(for_ms: int) -> None:
    for kind in (BrownOut, WatchdogReset):
        kind(1)
        with refusing(ValueError):
            kind(for_ms)
