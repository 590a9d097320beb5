"""The emulated board on its bus: pin changes, power cycles, wiring to the chips, lost steps, records."""

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.node.pins import Pin, PinChange
from steptwin.emulator.board.board import Board, BoardConfig
from steptwin.emulator.bus.can_bus import Bus
from steptwin.emulator.drivers.driver_module import Module, fitted
from steptwin.emulator.drivers.limits import Rule
from steptwin.emulator.simulation import Simulation
from steptwin.emulator.world.switches import Switch
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, DigitalOutput
from steptwin.protocol.drivers import PROFILES, Cooling
from steptwin.protocol.frame import Frame
from steptwin.protocol.pvt import PvtRecord
from tests.emulator.pins import CHIP, QUICK_WITH_16, WIRES, times
from tests.emulator.simulations import NODE, STEP, switch_on, wait, write

SLOW_TIMING = {
    od.STEPLEN_NS: 160_000,
    od.STEPSPACE_NS: 160_000,
    od.DIRSETUP_NS: 150_000,
    od.DIRHOLD_NS: 320_000,
}
"""A step timing that is slow enough for all driver profiles."""
OUT1, OUT2 = DigitalOutput.OUT1, DigitalOutput.OUT2


@pytest.fixture
def simulation(fast_kernel: Kernel) -> Simulation:
    return Simulation([Board(BoardConfig((WIRES,) * 2), fast_kernel)], Bus(1_000_000))


def send(simulation: Simulation, frame: Frame) -> int:
    """Send a frame; return the instant at which it became valid at the board."""
    sent = len(simulation.bus.log_frames)
    simulation.send(frame)
    return simulation.bus.log_counts[simulation.bus.log_frames.index(frame, sent)]


SIXTEENTHS = (Pin.M2, Pin.RESET)
"""Pins that are high at power-up: the chip leaves its reset in the mode of 16 microsteps."""


def switch(simulation: Simulation, levels: int, axis: int = 0) -> int:
    """Write the digital outputs (60FEh:01) by SDO; return the instant of the request."""
    request = bytes.fromhex("23fe6001") + levels.to_bytes(4, "little")
    return send(simulation, Frame(0x600 + NODE + axis, request))


def test_outputs_change_in_the_instant_of_their_frame(simulation: Simulation) -> None:
    wait(simulation, 1.7)
    first = switch(simulation, OUT1)
    wait(simulation, 0.1)
    second = switch(simulation, OUT2, axis=1)
    expected = [PinChange(first, 0, Pin.OUT1, 1), PinChange(second, 1, Pin.OUT2, 1)]
    assert simulation.boards[0].output_changes() == expected
    third = switch(simulation, OUT2)
    expected += [PinChange(third, 0, Pin.OUT1, 0), PinChange(third, 0, Pin.OUT2, 1)]
    assert simulation.boards[0].output_changes() == simulation.boards[0].output_changes() == expected


def test_outputs_are_among_all_pin_changes(simulation: Simulation) -> None:
    instant = switch(simulation, OUT1)
    simulation.boards[0].drain()
    powered = [PinChange(0, axis, pin, 1) for axis in (0, 1) for pin in SIXTEENTHS]
    assert simulation.boards[0].pin_changes == [*powered, PinChange(instant, 0, Pin.OUT1, 1)]


def test_an_output_switches_in_the_middle_of_a_motion(simulation: Simulation) -> None:
    """50 steps in 100 ms: pulses are computed ahead, outputs are not."""
    record = PvtRecord(50 * STEP, 0, 100, 0)
    simulation.send(Frame(0x000, b"\x01\x00"))
    for word in (0x06, 0x07, 0x0F):
        simulation.send(Frame(0x200 + NODE, bytes((word, 0, 7))))
    start(simulation, record)
    wait(simulation, 51.3)
    instant = switch(simulation, OUT2)
    wait(simulation, 100)
    trace = simulation.boards[0].trace(0)
    assert simulation.boards[0].output_changes() == [PinChange(instant, 0, Pin.OUT2, 1)]
    assert trace.position_steps == len(trace.step_counts) == 50
    assert trace.step_counts[20] < instant < trace.step_counts[30]


def start(simulation: Simulation, record: PvtRecord) -> None:
    """Let the first axis, which is enabled, go through one record."""
    for frame in (Frame(0x500 + NODE, record.encode()), Frame(0x300 + NODE, b"\x1f\x00"), Frame(0x080, b"")):
        simulation.send(frame)


def home_offset(board: Board) -> int:
    return board.firmware.nodes[0].dictionary.get(od.HOME_OFFSET)


class TestPower:
    SAVE = int.from_bytes(b"save", "little")

    def test_only_stored_parameters_outlive_it(self, simulation: Simulation) -> None:
        write(simulation, NODE, od.HOME_OFFSET, 77)
        simulation.power_cycle()
        assert home_offset(simulation.boards[0]) == 0
        write(simulation, NODE, od.HOME_OFFSET, 77)
        write(simulation, NODE, od.STORE_ALL, self.SAVE)
        write(simulation, NODE, od.HOME_OFFSET, 78)
        simulation.power_cycle()
        assert home_offset(simulation.boards[0]) == 77

    def test_another_board_begins_with_a_given_flash(self, simulation: Simulation, fast_kernel: Kernel) -> None:
        write(simulation, NODE, od.HOME_OFFSET, 77)
        write(simulation, NODE, od.STORE_ALL, self.SAVE)
        config = simulation.boards[0].config
        assert home_offset(Board(config, fast_kernel)) == 0
        assert home_offset(Board(config, fast_kernel, simulation.boards[0].own.flash)) == 77

    def test_all_pins_fall_and_the_nodes_announce_themselves_again(self, simulation: Simulation) -> None:
        wait(simulation, 3.3)
        switch(simulation, OUT1)
        wait(simulation, 1)
        simulation.boards[0].drain()
        before = len(simulation.boards[0].pin_changes)
        frames = len(simulation.bus.log_frames)
        now = simulation.now_counts
        simulation.power_cycle()
        wait(simulation, 1)
        simulation.boards[0].drain()
        resets = [PinChange(now, axis, Pin.RESET, 0) for axis in (0, 1)]
        others = [PinChange(now, *place, 0) for place in ((0, Pin.M2), (1, Pin.M2), (0, Pin.OUT1))]
        risen = [PinChange(now, axis, pin, 1) for axis in (0, 1) for pin in SIXTEENTHS]
        assert simulation.boards[0].pin_changes[before:] == [*resets, *others, *risen]
        assert simulation.bus.log_frames[frames:] == [Frame(0x710, b"\0"), Frame(0x711, b"\0")]

    def test_a_motion_ends_with_the_power_and_the_next_begins_from_zero(self, simulation: Simulation) -> None:
        for round_ in (1, 2):
            for cob_id, data in ((0x000, "0110"), (0x210, "060007"), (0x210, "070007"), (0x210, "0f0007")):
                simulation.send(Frame(cob_id, bytes.fromhex(data)))
            start(simulation, PvtRecord(20 * STEP, 0, 100, 0))
            wait(simulation, 50)
            simulation.power_cycle()
            wait(simulation, 200)
            trace = simulation.boards[0].trace(0)
            assert trace.position_steps == pytest.approx(10 * round_, abs=round_)
            assert not trace.violations.counts.size
            assert simulation.boards[0].firmware.motion.axes[0].demand_units == 0

    @pytest.mark.parametrize("drivers", QUICK_WITH_16)
    @pytest.mark.parametrize("off_ms", [40, 50.3, 70.7])
    def test_goes_in_order_in_the_middle_of_a_motion_too(
        self, fast_kernel: Kernel, drivers: str, off_ms: float
    ) -> None:
        """DIR and ENABLE are high. The next motion goes down, for which the firmware need not change DIR."""
        profile = PROFILES[drivers]
        board = Board(BoardConfig(modules=(fitted(profile, 16),)), fast_kernel)
        simulation = Simulation([board], Bus(1_000_000))
        for units, until_ms in ((20 * STEP, off_ms), (-10 * STEP, 200)):
            for address, ns in SLOW_TIMING.items():
                write(simulation, NODE, address, ns)
            switch_on(simulation)
            start(simulation, PvtRecord(units, 0, 100, 0))
            wait(simulation, until_ms)
            reached = board.position_steps(0)
            if units > 0:
                assert 0 < reached < 20
                before = reached
                simulation.power_cycle()
        assert reached == pytest.approx(before - 10, abs=2)
        trace = board.trace(0)
        assert trace.violations.rules() == []
        assert (np.diff(trace.dir_counts) > 0).all()
        assert trace.dir_levels.tolist() == [1, 0]

    def test_every_mode_is_left_in_reset(self, simulation: Simulation) -> None:
        """M1, which rises long after RESET, falls after it."""
        simulation.send(Frame(0x600 + NODE, bytes.fromhex("2f00200108000000")))
        simulation.boards[0].drain()
        assert [change.level for change in simulation.boards[0].pin_changes if change.pin is Pin.M1] == [1]
        simulation.power_cycle()
        assert simulation.boards[0].trace(0).violations.rules() == []


class TestDrivers:
    def test_the_firmwares_pins_reach_the_chip(self, simulation: Simulation) -> None:
        """Supplied in order, out of reset in the mode of 16 microsteps, off until the drive is switched on."""
        wait(simulation, 1)
        driven = simulation.boards[0].trace(0).outputs
        now = np.array([simulation.now_counts])
        assert driven.angle_deg(now).tolist() == [0]
        assert driven.currents_a(now).tolist() == [[0, 0]]
        enabled = switch_on(simulation)
        wait(simulation, 1)
        times = enabled + np.array([0, 3 * 72])
        assert simulation.boards[0].trace(0).outputs.currents_a(times).tolist() == [
            [0, 0],
            [pytest.approx(1.5), 0],
        ]
        assert not simulation.boards[0].trace(0).violations.counts.size

    def test_steps_turn_the_field(self, simulation: Simulation) -> None:
        """Ten steps up, which are counterclockwise."""
        switch_on(simulation)
        start(simulation, PvtRecord(10 * STEP, 0, 100, 0))
        wait(simulation, 200)
        outputs = simulation.boards[0].trace(0).outputs
        steps = simulation.boards[0].trace(0).position_steps
        assert steps == pytest.approx(10, abs=1)
        assert outputs.field_substeps(np.array([simulation.now_counts])).tolist() == [64 - steps]

    def test_protect_goes_low_with_the_heat(self, fast_kernel: Kernel) -> None:
        """A chip of tiny heat capacity gets hot within some ms, once it is enabled; the other one stays cold."""
        crumb = Module(CHIP, cooling=Cooling(resistance_k_per_w=200, capacity_j_per_k=1e-4))
        board = Board(BoardConfig(modules=(crumb, WIRES)), fast_kernel)
        simulation = Simulation([board], Bus(1_000_000))
        wait(simulation, 100)
        nodes = board.firmware.nodes
        assert [node.dictionary.get(od.DIGITAL_INPUTS) for node in nodes] == [0, 0]
        switch_on(simulation)
        wait(simulation, 100)
        assert [node.dictionary.get(od.DIGITAL_INPUTS) for node in nodes] == [DigitalInput.DRIVER_PROTECT, 0]
        assert board.trace(0).violations.rules() == [Rule.OVER_TEMPERATURE]

    @pytest.mark.parametrize("module", [WIRES, Module(CHIP, times=times(dirhold_ns=1_000_000))])
    @pytest.mark.parametrize(("switch_steps", "closed"), [(11, True), (12, False)])
    def test_the_last_step_of_a_motion_may_close_a_switch(
        self, fast_kernel: Kernel, module: Module, switch_steps: int, closed: bool
    ) -> None:
        """This holds also if the driver counts the step only a millisecond later."""
        switch = Switch(0, DigitalInput.HOME, from_substeps=switch_steps)
        board = Board(BoardConfig(switches=(switch,), modules=(module,)), fast_kernel)
        simulation = Simulation([board], Bus(1_000_000))
        switch_on(simulation)
        start(simulation, PvtRecord(11 * STEP, 0, 100, 0))
        wait(simulation, 150)
        assert board.trace(0).position_steps == 11
        seen = DigitalInput(board.firmware.nodes[0].dictionary.get(od.DIGITAL_INPUTS))
        assert bool(seen & DigitalInput.HOME) == closed
        assert not board.moving

    def test_the_firmware_reads_lost_steps_and_violations(self, fast_kernel: Kernel) -> None:
        """Objects 2F00h:01 to :03: the chip counts none of ten steps, and each is a violation."""
        deaf = Module(CHIP, times=times(steplen_ns=40_000))
        board = Board(BoardConfig(modules=(deaf,)), fast_kernel)
        simulation = Simulation([board], Bus(1_000_000))
        switch_on(simulation)
        start(simulation, PvtRecord(10 * STEP, 0, 100, 0))
        wait(simulation, 150)
        read = [
            board.firmware.nodes[0].dictionary.get(address)
            for address in (od.ROTOR_POSITION_STEPS, od.LOST_STEPS, od.DRIVER_VIOLATIONS)
        ]
        assert read == [0, 10, 10]

    def test_a_question_about_an_axis_takes_no_other_drivers_time(self, fast_kernel: Kernel) -> None:
        board = Board(BoardConfig((WIRES,) * 2), fast_kernel)
        simulation = Simulation([board], Bus(1_000_000))
        switch_on(simulation)
        start(simulation, PvtRecord(10 * STEP, 0, 100, 0))
        wait(simulation, 150)
        undrained = []
        for axis in (1, 0):
            assert board.firmware.nodes[axis].dictionary.get(od.ROTOR_POSITION_STEPS) == (10 if axis == 0 else 0)
            undrained.append(board.firmware.motion.axes[0].undrained_pulses)
        assert undrained == [10, 0]
        assert board.position_steps(0) == 10


def test_a_listener_is_told_of_each_record_that_the_queue_takes_also_after_a_power_cycle(
    simulation: Simulation,
) -> None:
    taken: list[PvtRecord] = []
    simulation.boards[0].own.on_record(simulation.boards[0], 0, taken.append)
    start = Frame(0, bytes((1, 0)))
    first, second, gap, other = (PvtRecord(5, 64, 10, sequence) for sequence in (0, 1, 3, 0))
    simulation.send(start)
    for record in (first, second, second, gap):
        simulation.send(Frame(0x500 + NODE, record.encode()))
    simulation.send(Frame(0x500 + NODE + 1, other.encode()))
    assert taken == [first, second]
    simulation.power_cycle()
    simulation.send(start)
    simulation.send(Frame(0x500 + NODE, first.encode()))
    assert taken == [first, second, first]
