"""Waits for digital inputs amid a trajectory: all axes hold together, go on together, and the time-out ends at rest."""

import numpy as np
import pytest

from steptwin.emulator.operations import InputOperation
from steptwin.host.client import Machine, StreamedMotion
from steptwin.host.client.pausing import pause_trajectory, resume_trajectory
from steptwin.host.client.waits import HOLD_MS, LEAD_MS, divide
from steptwin.host.common.arrays import AxisRecords
from steptwin.host.common.errors import DeviceFaultError, WaitTimeoutError
from steptwin.host.planning.motion import OutputChange, Wait
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.protocol import od
from steptwin.protocol.cia402 import DigitalInput, DigitalOutput
from steptwin.protocol.pvt import QUEUE_DEPTH, SEQUENCE_MODULUS, PvtRecord
from tests.compiled import on_sources_only
from tests.host.client.machines import AXES, STEP, TH1, TH3, WIRING, frames_to, still, travelling
from tests.messages import refusing

DONE_UNITS = [0, 0, 0, 2 * 18 * 80 * STEP + 4 * 40 * STEP, 0, 0]
"""The end of two travels of 20 records."""


def wait(at_s: float, timeout_s: float = 5.0, *, on: bool = True) -> Wait:
    return Wait("part", on, at_s, timeout_s, f"at {at_s:g} s")


def joined(first: tuple[AxisRecords, ...], second: tuple[AxisRecords, ...]) -> tuple[AxisRecords, ...]:
    return tuple(AxisRecords(*(a + b for a, b in zip(*pair, strict=True))) for pair in zip(first, second, strict=True))


def there_and_on() -> tuple[AxisRecords, ...]:
    """Return two travels of th1 of 0.4 s, with a rest between them."""
    return joined(travelling(20), travelling(20))


def set_part(board: EmbeddedBoard, *, on: bool) -> None:
    board.operate(InputOperation(TH1, DigitalInput.IN1, on))


def go_on_until(machine: Machine, board: EmbeddedBoard, t_s: float, poll_s: float = 0.001) -> None:
    """Let time pass up to a time of the executed motion."""
    start_s = board.evidence().start_counts / 72e6
    while board.now_s() < start_s + t_s:
        machine.wait(poll_s)


def sent_records(board: EmbeddedBoard, axis: int) -> list[PvtRecord]:
    def signed(data: bytes) -> int:
        return int.from_bytes(data, "little", signed=True)

    frames = [frame.data for frame in frames_to(board, 0x510 + axis)]
    return [PvtRecord(signed(data[:3]), signed(data[3:6]), data[6], data[7]) for data in frames]


@pytest.mark.slow
def test_all_axes_hold_the_same_records_until_the_input_has_its_level(board: EmbeddedBoard, machine: Machine) -> None:
    run = machine.start(StreamedMotion(there_and_on(), [0] * AXES, (), (wait(0.4),), WIRING))
    machine.wait(2.0)
    rest_units = machine.positions_units()
    assert rest_units[TH1] == DONE_UNITS[TH1] // 2
    assert not run.ended
    set_part(board, on=True)
    seen_s = board.now_s()
    while machine.positions_units() == rest_units:
        machine.wait(0.001)
    assert LEAD_MS - 20 <= 1000 * (board.now_s() - seen_s) <= LEAD_MS + 40
    machine.wait(1.0)
    assert run.ended
    assert machine.positions_units() == DONE_UNITS
    (held_ms,) = machine.holds_ms
    own = sent_records(board, TH1)
    hold = [0] * (held_ms // HOLD_MS)
    assert [record.displacement_units for record in own] == (
        travelling(20)[TH1].displacements_units + hold + travelling(20)[TH1].displacements_units
    )
    assert [record.duration_ms for record in own[20:-20]] == [HOLD_MS] * len(hold)
    assert {record.end_velocity for record in own[20:-20]} == {0}
    for axis in range(AXES):
        assert [(r.sequence, r.duration_ms) for r in sent_records(board, axis)] == [
            (r.sequence, r.duration_ms) for r in own
        ]


@pytest.mark.slow
def test_an_input_that_has_its_level_costs_only_the_lead(board: EmbeddedBoard, machine: Machine) -> None:
    set_part(board, on=True)
    machine.run(StreamedMotion(there_and_on(), [0] * AXES, (), (wait(0.4),), WIRING), lambda _: None)
    assert LEAD_MS <= machine.holds_ms[0] <= LEAD_MS + 2 * HOLD_MS
    assert machine.positions_units() == DONE_UNITS


@pytest.mark.slow
def test_a_level_that_has_gone_before_the_machine_comes_does_not_count(board: EmbeddedBoard, machine: Machine) -> None:
    run = machine.start(StreamedMotion(there_and_on(), [0] * AXES, (), (wait(0.4),), WIRING))
    set_part(board, on=True)
    machine.wait(0.3)
    set_part(board, on=False)
    machine.wait(2.0)
    assert not run.ended
    set_part(board, on=True)
    machine.wait(1.0)
    assert run.ended


@pytest.mark.slow
def test_waits_for_both_levels_one_after_the_other(board: EmbeddedBoard, machine: Machine) -> None:
    """At the very start, between the travels, and in the last record; outputs keep their places in the motion."""
    records = joined(joined(still(1, 10), there_and_on()), still(1, 10))
    command = OutputChange("magnet", True, 0.41, 0.41)
    run = machine.start(
        StreamedMotion(records, [0] * AXES, (command,), (wait(0.0), wait(0.41, on=False), wait(0.81)), WIRING)
    )
    machine.wait(1.0)
    assert machine.positions_units() == [0] * AXES
    set_part(board, on=True)
    machine.wait(1.5)
    assert machine.positions_units()[TH1] == DONE_UNITS[TH1] // 2
    assert machine.axes[TH3].read(od.DIGITAL_OUTPUTS) == 0
    set_part(board, on=False)
    machine.wait(1.5)
    assert machine.axes[TH3].read(od.DIGITAL_OUTPUTS) == DigitalOutput.OUT1
    assert machine.positions_units() == DONE_UNITS
    assert not run.ended
    set_part(board, on=True)
    machine.wait(1.0)
    assert run.ended
    assert len(machine.holds_ms) == 3


@pytest.mark.slow
@pytest.mark.parametrize("begins_s", [0.0, 0.1, 0.24, 0.26])
@pytest.mark.parametrize("on_after_s", [0.0, 0.2, 1.0, None])
def test_an_early_wait_holds_as_long_as_it_must(
    board: EmbeddedBoard, machine: Machine, begins_s: float, on_after_s: float | None
) -> None:
    """Also one that begins before the start's own records cover 250 ms; None: the input never comes on."""
    records = joined(still(round(100 * begins_s), 10), travelling(20))
    run = machine.start(StreamedMotion(records, [0] * AXES, (), (wait(begins_s, timeout_s=1.5),), WIRING))
    if on_after_s is None:
        with refusing(WaitTimeoutError):
            machine.wait(2.5)
        assert machine.positions_units() == [0] * AXES
        assert 1.5 <= machine.holds_ms[0] / 1000 <= 1.78
    else:
        go_on_until(machine, board, begins_s + on_after_s, poll_s=0.01)  # as often as `Machine.run` looks
        set_part(board, on=True)
        machine.wait(1.5)
        assert machine.positions_units()[TH1] == DONE_UNITS[TH1] // 2
        assert on_after_s + 0.23 <= machine.holds_ms[0] / 1000 <= on_after_s + 0.31
    assert run.ended
    assert [axis.error_codes for axis in machine.axes] == [[]] * AXES


@pytest.mark.slow
def test_the_next_wait_may_come_at_once(board: EmbeddedBoard, machine: Machine) -> None:
    """Waits 10 ms apart, each of which lasts most of a second."""
    records = joined(still(2, 10), travelling(20))
    waits = (wait(0.0), wait(0.01, on=False), wait(0.02))
    run = machine.start(StreamedMotion(records, [0] * AXES, (), waits, WIRING))
    for on_s, on in ((0.8, True), (1.6, False), (2.4, True)):
        go_on_until(machine, board, on_s)
        assert not run.ended
        set_part(board, on=on)
    machine.wait(1.5)
    assert run.ended
    assert [held_ms / 1000 for held_ms in machine.holds_ms] == pytest.approx([1.05, 0.79, 0.79], abs=0.04)


@pytest.mark.slow
@on_sources_only
@pytest.mark.parametrize("lost", [TH3, TH1])
def test_a_time_out_is_named_though_its_last_records_are_lost(
    board: EmbeddedBoard, machine: Machine, monkeypatch: pytest.MonkeyPatch, lost: int
) -> None:
    """The queue of one axis then runs dry before the others: at rest, as all of them do a little later."""
    run = machine.start(StreamedMotion(there_and_on(), [0] * AXES, (), (wait(0.4, timeout_s=1.0),), WIRING))
    go_on_until(machine, board, 1.3)
    monkeypatch.setattr(machine.axes[lost], "send_record", lambda _payload: None)
    with refusing(WaitTimeoutError):
        machine.wait(2.0)
    assert run.ended
    assert [axis.error_codes for axis in machine.axes] == [[]] * AXES


@pytest.mark.slow
@pytest.mark.parametrize(("on_after_s", "passes"), [(0.9, True), (1.1, False)])
def test_both_sides_of_the_time_out(board: EmbeddedBoard, machine: Machine, on_after_s: float, passes: bool) -> None:
    run = machine.start(StreamedMotion(there_and_on(), [0] * AXES, (), (wait(0.4, timeout_s=1.0),), WIRING))
    go_on_until(machine, board, 0.4 + on_after_s)
    set_part(board, on=True)
    if passes:
        machine.wait(1.0)
        assert machine.positions_units() == DONE_UNITS
        return
    with refusing(WaitTimeoutError) as caught:
        machine.wait(2.0)
    assert caught.value.exit_code == 3
    assert run.ended
    assert machine.positions_units()[TH1] == DONE_UNITS[TH1] // 2
    assert [axis.error_codes for axis in machine.axes] == [[]] * AXES
    assert 1000 <= machine.holds_ms[0] <= 1000 + LEAD_MS + 2 * HOLD_MS


@pytest.mark.slow
def test_the_time_out_stands_while_the_motion_is_halted(board: EmbeddedBoard, machine: Machine) -> None:
    run = machine.start(StreamedMotion(there_and_on(), [0] * AXES, (), (wait(0.4, timeout_s=1.0),), WIRING))
    machine.wait(0.8)
    assert pause_trajectory(machine)
    machine.wait(10.0)
    set_part(board, on=True)
    machine.wait(1.0)
    assert run.halted
    resume_trajectory(machine)
    machine.wait(1.0)
    assert run.ended
    assert machine.positions_units() == DONE_UNITS


@pytest.mark.slow
@pytest.mark.parametrize(("late_ms", "passes"), [(LEAD_MS - 30, True), (LEAD_MS + 60, False)])
def test_a_host_may_be_late_by_the_lead(board: EmbeddedBoard, machine: Machine, late_ms: int, passes: bool) -> None:
    """Beyond it the queues run dry at rest, which is said, and nothing moves."""
    machine.start(StreamedMotion(there_and_on(), [0] * AXES, (), (wait(0.4),), WIRING))
    machine.wait(1.5)
    board.wait(late_ms / 1000)
    if passes:
        machine.wait(1.0)
        return
    with refusing(DeviceFaultError):
        machine.wait(1.0)
    assert machine.positions_units()[TH1] == DONE_UNITS[TH1] // 2


@pytest.mark.slow
def test_a_long_wait_passes_every_sequence_number(board: EmbeddedBoard, machine: Machine) -> None:
    """Four seconds are some 360 records of standstill."""
    run = machine.start(StreamedMotion(there_and_on(), [0] * AXES, (), (wait(0.4, timeout_s=60.0),), WIRING))
    go_on_until(machine, board, 4.0)
    set_part(board, on=True)
    machine.wait(1.0)
    assert run.ended
    assert machine.positions_units() == DONE_UNITS
    assert machine.holds_ms[0] == pytest.approx(4_000 - 400 + LEAD_MS, abs=30)
    assert machine.holds_ms[0] / HOLD_MS > SEQUENCE_MODULUS + QUEUE_DEPTH
    assert run.fraction == 1.0


def test_legs() -> None:
    commands = [OutputChange("magnet", True, t_s, t_s) for t_s in (0.0, 0.019, 0.02, 0.05)]
    legs = divide(still(5, 10), commands, [wait(0.0), wait(0.02)])
    assert [len(leg.records[0].durations_ms) for leg in legs] == [0, 2, 3]
    assert [[command.from_s for command in leg.outputs] for leg in legs] == [[], [0.0, 0.019], [0.02, 0.05]]
    (whole,) = divide(still(5, 10), commands, [])
    assert whole == (still(5, 10), tuple(commands))
    with refusing(ValueError):
        divide(still(5, 10), [], [wait(0.02), wait(0.01)])
    with refusing(ValueError):
        divide(still(5, 10), [], [wait(0.025)])
    assert np.all([leg.records[0].durations_ms is not leg.records[1].durations_ms for leg in legs])
