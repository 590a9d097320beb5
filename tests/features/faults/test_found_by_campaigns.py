"""What campaigns have found: faults in quick succession, before the motion, and within a servo tick."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.features.faults.lost_host import HostLostError
from steptwin.features.faults.options import FaultOptions
from steptwin.features.faults.part import part_of, repair
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.protocol.cia402 import State
from steptwin.protocol.timer import COUNTS_PER_SECOND
from tests.features.faults.short_runs import ROBOT, carry, played, scenario
from tests.messages import refusing


@pytest.mark.parametrize("part", [0.2, 0.4, 0.6, 0.8])
def test_no_pulse_begins_after_a_brown_out_within_a_tick(fast_kernel: Kernel, part: float) -> None:
    """The report looks at the machine when a fault begins; the tick's later pulses were through by then."""
    at_s = 0.5 + part * TICK_COUNTS / COUNTS_PER_SECOND
    outcome, report = played(fast_kernel, f'[[fault]]\nat_s = {at_s:.7f}\ndo = "brown-out"\nfor_ms = 5\n')
    assert report.passed, report.reasons
    evidence = outcome.comparison.evidence
    off_counts = evidence.start_counts + at_s * COUNTS_PER_SECOND
    for axis in evidence.axes:
        assert (axis.clk_rise_counts <= off_counts).all(), axis.name
    assert any(axis.clk_rise_counts[-1] > off_counts - TICK_COUNTS for axis in evidence.axes)


def test_a_fault_is_answered_even_after_the_next_one_has_begun(fast_kernel: Kernel) -> None:
    """The second comes a tick after the first, before the first one's EMCYs are on the bus."""
    _, report = played(
        fast_kernel,
        """
        [[fault]]
        name = "button"
        at_s = 0.5
        do = "estop"
        pressed = true
        [[fault]]
        name = "driver"
        at_state = { joint = "th1", state = "FAULT REACTION ACTIVE" }
        do = "protect"
        joint = "th2"
        held = true
        """,
    )
    assert report.passed, report.reasons
    assert all(fault.struck for fault in report.faults)


def test_a_short_press_may_replace_reports(fast_kernel: Kernel) -> None:
    """The inputs change back before their reports are sent: newer ones take their places, which the board tells."""
    _, report = played(fast_kernel, '[[fault]]\nat_s = 0.5\nfor_s = 0.0007\ndo = "estop"\npressed = true\n')
    assert report.passed, report.reasons


def test_positions_given_before_the_motion_are_no_lost_steps(fast_kernel: Kernel) -> None:
    """The fault begins with power-up; then the host tells each axis where it stands."""
    _, report = played(fast_kernel, '[[fault]]\npower_up_s = 0.0\ndo = "delay"\nframes = "sync"\nby_s = 0.01\n')
    assert report.passed, report.reasons


def test_a_motor_that_is_elsewhere_may_come_to_a_limit_switch(fast_kernel: Kernel) -> None:
    """The run stops with EMCY 0x8612, and says that the drivers have counted otherwise: it is told."""
    text = '[[fault]]\nat_s = 0.2\ndo = "slip"\njoint = "th1"\nfull_steps = -4000\n'
    outcome, report = played(fast_kernel, text)
    assert outcome.fault is not None
    assert not outcome.fault.positions_agree
    assert [told.code for told in report.faults[0].emcys if told.joint == "th1"] == [0x8612]
    assert report.passed, report.reasons


@pytest.mark.parametrize("how", ["death", "restart"])
def test_short_records_run_dry_before_the_host_is_missed(fast_kernel: Kernel, how: str) -> None:
    """At the motion's end fewer points are queued: the queue runs dry, or holds all that is left of the motion."""
    text = f'[[fault]]\nat_s = 0.05\ndo = "host"\nhow = "{how}"\n' + ("by_s = 0.9\n" if how == "restart" else "")
    _, report = played(fast_kernel, text)
    assert report.passed, report.reasons


def test_a_drive_that_its_host_has_switched_off_need_not_fail(fast_kernel: Kernel) -> None:
    """Requests to th2 are lost: at the motion's end th1 is switched off, then the host gives up and is missed."""
    _, report = played(fast_kernel, '[[fault]]\nat_s = 0.3\ndo = "loss"\nframes = "requests"\njoint = "th2"\n')
    states = [joint.state for joint in report.faults[0].joints.values()]
    assert states == [State.SWITCH_ON_DISABLED, State.FAULT, State.FAULT, State.FAULT]
    assert report.passed, report.reasons


def test_positions_given_before_a_motion_that_never_begins_are_no_lost_steps(fast_kernel: Kernel) -> None:
    """The only SYNC is lost: the host, which has told each axis where it stands, gives up."""
    _, report = played(fast_kernel, '[[fault]]\npower_up_s = 0.0\ndo = "loss"\nframes = "sync"\n')
    assert report.passed, report.reasons


def test_a_fault_is_not_blamed_for_steps_that_another_one_loses(fast_kernel: Kernel) -> None:
    """While a wire of th2 is broken, that of th1 is whole: the verdict tells what th2 has lost, and only that."""
    outcome, report = played(
        fast_kernel,
        """
        [[fault]]
        name = "broken"
        at_s = 0.3
        do = "wire"
        joint = "th2"
        wire = "step"
        condition = "broken"
        [[fault]]
        name = "mended"
        at_s = 0.5
        do = "wire"
        joint = "th1"
        wire = "step"
        condition = "whole"
        """,
    )
    assert any("th2" in reason for reason in outcome.report.reasons)
    assert report.passed, report.reasons


def test_a_repair_leaves_the_machine_as_it_was_before_the_first_fault(fast_kernel: Kernel) -> None:
    """Two faults of one place last: the end of both puts back what was before the first."""
    boards: list[EmbeddedBoard] = []
    text = """
        [[fault]]
        name = "sags"
        at_s = 0.2
        do = "supply"
        supply_v = 20
        [[fault]]
        name = "more"
        at_s = 0.3
        do = "supply"
        supply_v = 12
        """
    execute(carry(), "carry", fast_kernel, extras=[FaultOptions(scenario=scenario(text))], on_board=boards.append)
    repair(boards[0])
    part = part_of(boards[0])
    assert part is not None
    assert part.engine.target.environment.supply_10mv == 2400


def test_a_wait_ends_in_which_the_host_dies_before_its_next_heartbeat(fast_kernel: Kernel) -> None:
    """The heartbeat that is due then is not sent, and not waited for."""
    death = scenario('[[fault]]\npower_up_s = 0.03\ndo = "host"\nhow = "death"\n')
    board = EmbeddedBoard(
        ROBOT, fast_kernel, MachineOptions(stand_at=list(carry().start_joints), extras=[FaultOptions(scenario=death)])
    )
    board.network.send_periodic(0x77F, b"\x05", 0.04)
    until_s = board.now_s() + 0.1
    with refusing(HostLostError):
        board.wait(0.1)
    assert board.now_s() == pytest.approx(until_s)
    assert sum(frame.cob_id == 0x77F for _, frame in board.bus_log) == 1
