"""The emulated board on its bus: what it records of the pins that the firmware holds at a level."""

import pytest

from controller.backend import Kernel
from controller.firmware import Pin, PinChange
from emulator.board import Board, BoardConfig
from emulator.bus import Bus
from emulator.simulation import Simulation
from protocol.cia402 import DigitalOutput
from protocol.frame import Frame
from protocol.pvt import PvtRecord

MS = 72_000
NODE = 0x10
OUT1, OUT2 = DigitalOutput.OUT1, DigitalOutput.OUT2


@pytest.fixture
def simulation(fast_kernel: Kernel) -> Simulation:
    return Simulation([Board(BoardConfig(axis_count=2, osc_pf=(330.0, 330.0)), fast_kernel)], Bus(1_000_000))


def send(simulation: Simulation, frame: Frame) -> int:
    """Send a frame; return the instant at which it became valid at the board."""
    sent = len(simulation.bus.log_frames)
    simulation.send(frame)
    return simulation.bus.log_counts[simulation.bus.log_frames.index(frame, sent)]


def switch(simulation: Simulation, levels: int, axis: int = 0) -> int:
    """Write 0x60FE:01 by SDO; return the instant of the request."""
    request = bytes.fromhex("23fe6001") + levels.to_bytes(4, "little")
    return send(simulation, Frame(0x600 + NODE + axis, request))


def wait(simulation: Simulation, dt_ms: float) -> None:
    simulation.run_until(simulation.now_counts + round(dt_ms * MS))


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


def test_they_stand_among_all_changes_of_held_pins(simulation: Simulation) -> None:
    instant = switch(simulation, OUT1)
    simulation.boards[0].drain()
    powered = [PinChange(0, axis, Pin.RESET, 1) for axis in (0, 1)]
    assert simulation.boards[0].pin_changes == [*powered, PinChange(instant, 0, Pin.OUT1, 1)]


def test_an_output_switches_in_the_middle_of_a_motion(simulation: Simulation) -> None:
    """50 steps in 100 ms: pulses are computed ahead, outputs are not."""
    record = PvtRecord(50 * 1024, 0, 100, 0)
    simulation.send(Frame(0x000, b"\x01\x00"))
    for word in (0x06, 0x07, 0x0F):
        simulation.send(Frame(0x200 + NODE, bytes((word, 0, 7))))
    for frame in (Frame(0x500 + NODE, record.encode()), Frame(0x300 + NODE, b"\x1f\x00"), Frame(0x080, b"")):
        simulation.send(frame)
    wait(simulation, 51.3)
    instant = switch(simulation, OUT2)
    wait(simulation, 100)
    trace = simulation.boards[0].trace(0)
    assert simulation.boards[0].output_changes() == [PinChange(instant, 0, Pin.OUT2, 1)]
    assert trace.position_steps == len(trace.step_counts) == 50
    assert trace.step_counts[20] < instant < trace.step_counts[30]
