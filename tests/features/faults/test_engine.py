"""Triggers: each strikes at its instant, and one that never strikes fails the run with its reason."""

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.controller.motion.kernel import TICK_COUNTS
from steptwin.features.faults.kinds.host import HostCondition, HostFault, HostFaultKind
from steptwin.host.twin.embedded.execution import execute
from steptwin.protocol.timer import COUNTS_PER_SECOND
from tests.features.faults.short_runs import carry, played


@pytest.mark.slow
def test_a_run_with_a_scenario_that_does_nothing_has_the_same_bytes(fast_kernel: Kernel) -> None:
    """A sensor that is off already is switched off: the engine itself leaves no trace."""
    plain = execute(carry(), "carry", fast_kernel)
    outcome, scenario = played(
        fast_kernel,
        """
        [[fault]]
        at_position = { joint = "th1", value = 1000 }
        do = "estop"
        pressed = true
        [[fault]]
        at_s = 0.5
        do = "supply"
        supply_v = 24
        """,
    )
    assert outcome.bus_log == plain.bus_log
    for mine, theirs in zip(outcome.comparison.evidence.axes, plain.comparison.evidence.axes, strict=True):
        assert (mine.clk_rise_counts == theirs.clk_rise_counts).all()
        assert (mine.dir_edge_counts == theirs.dir_edge_counts).all()
    assert outcome.passed
    assert not scenario.passed
    assert scenario.reasons[0].startswith("1 estop: never struck: th1 passes 1000: th1 was seen from ")
    assert scenario.faults[1].as_documented


@pytest.mark.slow
@pytest.mark.parametrize(
    ("trigger", "reason"),
    [
        ("at_s = 5", "at 5 s: the motion ended at 1 s, before at_s 5"),
        ("power_up_s = 90", "at 90 s from power-up: the run ended"),
        ('at_position = { joint = "th1", value = 5, direction = "up" }', "th1 rises to 5: th1 was seen from"),
        ("on_frame = { id = 0x510, n = 4000 }", "on frame 4000 of 0x510: there were"),
        ('at_state = { joint = "th1", state = "FAULT" }', "th1 in FAULT: it was in "),
        ("at_random = { from_s = 40, to_s = 41 }", "at 40."),
    ],
)
def test_a_fault_that_never_struck_fails_the_run(fast_kernel: Kernel, trigger: str, reason: str) -> None:
    outcome, scenario = played(fast_kernel, f'[[fault]]\n{trigger}\ndo = "estop"\npressed = true\n')
    assert outcome.passed
    (line,) = scenario.reasons
    assert line.startswith(f"1 estop: never struck: {reason}")


@pytest.mark.slow
def test_instants_of_triggers(fast_kernel: Kernel) -> None:
    outcome, scenario = played(
        fast_kernel,
        """
        seed = 3
        [[fault]]
        name = "time"
        at_s = 0.4
        do = "temperature"
        temperature_degc = 60
        [[fault]]
        name = "position"
        at_position = { joint = "th1", value = -20, direction = "down" }
        do = "temperature"
        temperature_degc = 61
        for_s = 0.1
        [[fault]]
        name = "frame"
        on_frame = { id = 0x510, n = 100 }
        do = "temperature"
        temperature_degc = 62
        [[fault]]
        name = "random"
        at_random = { from_s = 0.1, to_s = 0.9 }
        do = "temperature"
        temperature_degc = 63
        [[fault]]
        name = "state"
        at_state = { joint = "d3", state = "OPERATION ENABLED" }
        do = "temperature"
        temperature_degc = 64
        """,
    )
    assert scenario.passed, scenario.reasons
    struck = {fault.name: fault.struck_s for fault in scenario.faults}
    start_counts = outcome.comparison.evidence.start_counts
    assert struck["time"] == 0.4
    th1 = outcome.comparison.counted[0]
    per_unit = outcome.plan.robot.steps_per_unit[0]
    passed_s = next(t for t, after in zip(th1.time_s, th1.positions[1:], strict=True) if after / per_unit <= -20)
    assert struck["position"] is not None
    assert passed_s <= struck["position"] <= passed_s + TICK_COUNTS / 72e6
    assert scenario.faults[1].ended_s == pytest.approx(struck["position"] + 0.1, abs=1e-9)
    records = [counts for counts, frame in outcome.bus_log if frame.cob_id == 0x510]
    assert struck["frame"] == pytest.approx((records[99] - start_counts) / 72e6, abs=1e-9)
    assert struck["random"] is not None
    assert 0.1 <= struck["random"] <= 0.9
    assert struck["state"] is not None
    assert struck["state"] < 0


@pytest.mark.parametrize(
    ("first_s", "second_s", "expected"),
    [
        ((0.2, 0.2), (0.3, 0.2), [(0.2, 60), (0.3, 70), (0.5, 25)]),
        ((0.2, 0.4), (0.3, 0.1), [(0.2, 60), (0.3, 70), (0.4, 60), (0.6, 25)]),
        ((0.2, 0.1), (0.3, 0.1), [(0.2, 60), (0.3, 25), (0.3, 70), (0.4, 25)]),
    ],
    ids=["one after the other has begun", "one within the other", "one after the other"],
)
def test_faults_of_one_place_may_overlap(
    fast_kernel: Kernel,
    first_s: tuple[float, float],
    second_s: tuple[float, float],
    expected: list[tuple[float, float]],
) -> None:
    """The end of the last one makes the machine as it was before the first, whatever the order of their ends."""
    outcome, scenario = played(
        fast_kernel,
        "".join(
            f'[[fault]]\nat_s = {at_s}\nfor_s = {for_s}\ndo = "temperature"\ntemperature_degc = {degrees}\n'
            for (at_s, for_s), degrees in ((first_s, 60), (second_s, 70))
        ),
    )
    assert scenario.passed, scenario.reasons
    start_s = outcome.comparison.evidence.start_counts / COUNTS_PER_SECOND
    done = [(round(each["at_s"] - start_s, 6), each["temperature_degc"]) for each in outcome.operations]
    assert done == expected


@pytest.mark.slow
def test_a_host_that_hangs_for_a_time_goes_on(fast_kernel: Kernel) -> None:
    """Before the motion, and after the machine has come to rest: the host then finds what has stopped it."""
    hang = '[[fault]]\ndo = "host"\nhow = "hang"\n'
    outcome, scenario = played(fast_kernel, f"{hang}power_up_s = 0.02\nfor_s = 0.05\n")
    assert outcome.passed
    assert scenario.passed, scenario.reasons
    for end in ("for_s = 2.0", "by_s = 2.0"):
        outcome, scenario = played(fast_kernel, f"{hang}at_s = 0.1\n{end}\n")
        assert scenario.passed, scenario.reasons
        assert scenario.faults[0].ended_s == pytest.approx(2.1)
        assert outcome.fault is not None
        assert outcome.fault.message.startswith("th1: pvt underrun (EMCY 0xFF01)")


def test_two_faults_of_the_host_end_on_their_own(fast_kernel: Kernel) -> None:
    late = '[[fault]]\ndo = "host"\nhow = "late"\nby_s = 0.002\n'
    condition = HostCondition()
    one, other = (HostFault(HostFaultKind.LATE, by_s) for by_s in (0.002, 0.003))
    for fault in (one, other):
        condition.begin(fault, 0)
    assert condition.late_s == pytest.approx(0.005)
    condition.end(one)
    assert condition.late_s == pytest.approx(0.003)
    outcome, scenario = played(fast_kernel, f"{late}at_s = 0.1\nfor_s = 0.2\n{late}at_s = 0.2\nfor_s = 0.2\n")
    assert outcome.passed
    assert scenario.passed, scenario.reasons
