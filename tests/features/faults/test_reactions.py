"""Every row of the table of documented reactions, on both sides of its limit, and answers that are not documented."""

import json
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.faults.fault import Fault
from steptwin.features.faults.judge import longest_ramp_ms
from steptwin.features.faults.kinds import DOCUMENTED
from steptwin.features.faults.kinds.bus import BusOff
from steptwin.features.faults.kinds.machine import BrownOut, EmergencyStop, PowerUp, WatchdogReset
from steptwin.features.faults.kinds.wiring import DriverMode, DriverProtect, OscCapacitor
from steptwin.features.faults.options import FaultOptions
from steptwin.features.faults.reaction import GOES_ON, MotionEffect, Reaction
from steptwin.features.faults.report import FaultReport, ScenarioReport, print_run, report_in
from steptwin.features.faults.scenario import Scenario
from steptwin.host.cli.app import run
from steptwin.host.common.errors import BusError, InputError
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.embedded.outcome import NotBegunError
from steptwin.protocol.cia402 import ErrorCode, State
from tests.features.faults.short_runs import ROBOT, carry, played, scenario
from tests.messages import refusing

STOPS, GOES, REFUSED = "STOPPED", "PASSED", "FAILED"
RAMP_END_MS = 9
"""A ramp's last step comes so long before its end at most: near standstill a step takes long."""


DOWN = "a board's logic browns out for a time, or its watchdog resets it"
ONE_DOWN = "one of several boards browns out for a time, or its watchdog resets it"
TWO = (2, 2)


class Case(NamedTuple):
    """A fault at 0.3 s of the motion, the row that is documented for it, and the motion's verdict.

    `stood_ms` are the bounds of the time to standstill, beside the documented limit.
    """

    what: str
    fault: str
    verdict: str
    stood_ms: tuple[float, float] | None = None
    when: str = "at_s = 0.3"
    motors: bool = False
    boards: tuple[int, ...] | None = None
    drivers: str | None = None


SHORTED = 'do = "short-circuit"\njoint = "th2"\nshorted = true'
CASES = [
    Case("emergency stop pressed", 'do = "estop"\npressed = true', STOPS, (100, 110)),
    Case("emergency stop pulled out", 'do = "estop"\npressed = false', GOES),
    Case("motor supply below 10.00 V", 'do = "supply"\nsupply_v = 9.99', STOPS, (0, 0.25)),
    Case("motor supply from 10.00 to 34.00 V", 'do = "supply"\nsupply_v = 10', GOES),
    Case("motor supply from 10.00 to 34.00 V", 'do = "supply"\nsupply_v = 34', GOES),
    Case("motor supply above 34.00 V", 'do = "supply"\nsupply_v = 34.01', STOPS, (100, 110)),
    Case("board above 85.0 degC", 'do = "temperature"\ntemperature_degc = 85.1', STOPS, (100, 110)),
    Case("board up to 85.0 degC", 'do = "temperature"\ntemperature_degc = 85', GOES),
    Case("Protect of a driver low", 'do = "protect"\njoint = "th2"\nheld = true', STOPS, (25, 110)),
    Case("Protect of a driver free", 'do = "protect"\njoint = "th2"\nheld = false', GOES),
    Case(
        "motor short-circuited, its driver is on and its fault output wired",
        SHORTED,
        STOPS,
        (25, 110),
        drivers="drv8825",
    ),
    Case(
        "motor short-circuited, its driver is on and its fault output wired",
        SHORTED,
        STOPS,
        (25, 110),
        drivers="tmc2209",
    ),
    Case("motor short-circuited, and nothing tells it", SHORTED, REFUSED),
    Case("motor whole again", SHORTED.replace("true", "false"), GOES, drivers="drv8825"),
    Case(
        "limit switch stuck closed, the axis moves towards it",
        'do = "switch"\njoint = "th1"\nswitch = "-"\nstuck = "closed"',
        STOPS,
        (100, 110),
    ),
    Case(
        "limit switch stuck closed, the axis rests or moves away",
        'do = "switch"\njoint = "th1"\nswitch = "+"\nstuck = "closed"',
        GOES,
    ),
    Case(
        "switch stuck open, or a home switch stuck closed",
        'do = "switch"\njoint = "th4"\nswitch = "home"\nstuck = "closed"',
        GOES,
    ),
    Case(
        "switch stuck open, or a home switch stuck closed",
        'do = "switch"\njoint = "th1"\nswitch = "-"\nstuck = "open"',
        GOES,
    ),
    Case(
        "wire of a limit switch broken, its contact closed at rest, the axis moves towards it",
        'do = "switch-wire"\njoint = "th1"\nswitch = "-"\nbroken = "normally-closed"',
        STOPS,
        (100, 110),
    ),
    Case(
        "wire of a limit switch broken, its contact closed at rest, the axis rests or moves away",
        'do = "switch-wire"\njoint = "th1"\nswitch = "+"\nbroken = "normally-closed"',
        GOES,
    ),
    Case(
        "wire of a switch broken, its contact open at rest",
        'do = "switch-wire"\njoint = "th1"\nswitch = "-"\nbroken = "normally-open"',
        GOES,
    ),
    Case("a switch bounces", 'do = "bounce"\njoint = "th1"\nswitch = "-"\nbounces = 5', GOES),
    Case("a driver in another microstep mode", 'do = "mode"\njoint = "th2"\nmicrosteps = 16', GOES),
    Case("a driver in another microstep mode", 'do = "mode"\njoint = "th4"\nmicrosteps = 8\nfor_s = 0.1', REFUSED),
    Case("another capacitor at OSC", 'do = "osc"\njoint = "th2"\nosc_pf = 330', GOES),
    Case("another capacitor at OSC", 'do = "osc"\njoint = "th2"\nosc_pf = 353', GOES),
    Case("another capacitor at OSC", 'do = "osc"\njoint = "th2"\nosc_pf = 380', REFUSED),
    Case("sensor on or off", 'do = "input"\ninput = "part_ready"\non = true', GOES),
    Case("a motor falls out of step", 'do = "slip"\njoint = "th2"\nfull_steps = -4', REFUSED),
    Case("another payload", 'do = "payload"\npayload_kg = 0.5\nfor_s = 0.1', GOES, motors=True),
    Case("another payload", 'do = "payload"\npayload_kg = 100', GOES, motors=True),
    *(
        Case(
            "wire to a driver broken, shorted or noisy",
            f'do = "wire"\njoint = "th2"\nwire = "{wire}"\ncondition = {condition}\nfor_s = 0.3',
            verdict,
        )
        for wire, condition, verdict in (
            ("step", '"broken"', REFUSED),
            ("step", '"high"', REFUSED),
            ("dir", '"low"', REFUSED),
            ("dir", '"high"', GOES),
            ("enable", '"broken"', REFUSED),
            ("enable", '"high"', GOES),
            ("step", '"noisy"\nrate_hz = 500\nwidth_us = 50', REFUSED),
            ("enable", '"noisy"\nrate_hz = 500\nwidth_us = 50', REFUSED),
        )
    ),
    Case("wire to a driver whole", 'do = "wire"\njoint = "th2"\nwire = "step"\ncondition = "whole"', GOES),
    Case(DOWN, 'do = "watchdog"', STOPS, (0, 0)),
    Case(DOWN, 'do = "brown-out"\nfor_ms = 20', STOPS, (0, 0.25)),
    Case(DOWN, 'do = "watchdog"\njoint = "th1"', STOPS, (0, 0)),
    Case(DOWN, 'do = "watchdog"', STOPS, (0, 0), boards=TWO),
    Case(ONE_DOWN, 'do = "watchdog"\njoint = "th1"', STOPS, (40, 150), boards=TWO),
    Case("Protect of a driver low", 'do = "protect"\njoint = "th1"\nheld = true', STOPS, (25, 140), boards=TWO),
    Case("a board's logic is without supply from now on", 'do = "brown-out"', STOPS, (0, 0.25)),
    Case(
        "one of several boards is without supply from now on",
        'do = "brown-out"\njoint = "th1"',
        STOPS,
        (400, 700),
        boards=TWO,
    ),
    Case("a board without power gets it", 'do = "power-up"', GOES),
    *(
        Case("a rogue node sends frames", fault, verdict)
        for fault, verdict in (
            ('do = "rogue-node"\nid = 0x80\ndata = ""', GOES),
            ('do = "rogue-node"\nid = 0x211\ndata = "02 00 07"', STOPS),
            ('do = "rogue-node"\nid = 0\ndata = "02 11"', STOPS),
            ('do = "babble"\nid = 0\ndata = "00 00 00 00 00 00 00 00"\nperiod_us = 200\ncount = 500', GOES),
            ('do = "babble"\nid = 0\ndata = "00 00 00 00 00 00 00 00"\nperiod_us = 100\ncount = 4000', STOPS),
        )
    ),
    Case(
        "a rogue node sends frames",
        'do = "babble"\nid = 0\ndata = "00 00 00 00 00 00 00 00"\nperiod_us = 100\ncount = 1000000\nfor_s = 0.1',
        GOES,
    ),
    Case("a rogue node stops all nodes (NMT)", 'do = "rogue-node"\nid = 0\ndata = "02 00"', STOPS, (100, 110)),
    Case(
        "a rogue node resets the communication of all nodes (NMT)",
        'do = "rogue-node"\nid = 0\ndata = "82 00"',
        STOPS,
        (100, 110),
    ),
    Case("a rogue node resets all nodes (NMT)", 'do = "rogue-node"\nid = 0\ndata = "81 00"', STOPS, (100, 110)),
    Case("the host's controller leaves the bus", 'do = "bus-off"', GOES),
    Case("a board's controller leaves the bus", 'do = "bus-off"\njoint = "th1"', STOPS, (100, 110)),
    Case("a board's controller leaves the bus", 'do = "bus-off"\njoint = "th1"', STOPS, (100, 150), boards=TWO),
    Case("the host has the bit rate of the boards", 'do = "bit-rate"\nbitrate = 1000000', GOES),
    Case("the host has another bit rate than the boards", 'do = "bit-rate"\nbitrate = 500000', STOPS, (100, 550.25)),
    Case("the host has another bit rate than the boards", 'do = "bit-rate"\nbitrate = 125000', STOPS, boards=TWO),
    Case("the host has another bit rate than the boards", 'do = "bit-rate"\nbitrate = 250000\nfor_s = 0.02', STOPS),
    Case("frames come twice, or make their sender leave the bus", 'do = "duplicate"\nframes = "all"', STOPS),
    Case("frames come twice, or make their sender leave the bus", 'do = "duplicate"\nframes = "records"', GOES),
    Case("heartbeat of the host lost", 'do = "loss"\nframes = "host-heartbeat"', STOPS, (300, 550.25)),
    Case("heartbeat of the host lost", 'do = "loss"\nframes = "host-heartbeat"\ncount = 2', GOES),
    Case("SYNC lost", 'do = "loss"\nframes = "sync"', STOPS, (0, 0), "power_up_s = 0"),
    Case("frames delayed", 'do = "delay"\nframes = "sync"\nby_s = 0.1', GOES, None, "power_up_s = 0"),
    Case("frames delayed", 'do = "delay"\nframes = "sync"\nby_s = 0.4', STOPS, None, "power_up_s = 0"),
    Case("frames lost", 'do = "loss"\nframes = "reports"', STOPS, None, "at_s = 0.2"),
    Case("frames lost", 'do = "loss"\nframes = "records"\nrate = 0.02', GOES, None, "power_up_s = 0"),
    Case("frames lost", 'do = "loss"\nframes = "records"', STOPS, None, "at_s = 0"),
    Case("frames disturbed", 'do = "corruption"\nframes = "all"\nrate = 0.1', GOES),
    Case("frames disturbed", 'do = "corruption"\nframes = "all"\nfor_s = 0.001', GOES),
    Case("frames disturbed", 'do = "corruption"\nframes = "all"\nfor_s = 0.05', STOPS),
    Case("frames delayed", 'do = "delay"\nframes = "of-board"\nby_s = 0.2', STOPS),
    Case("frames delayed", 'do = "delay"\nframes = "records"\nby_s = 0.2\ncount = 1', GOES),
    Case("frames delayed", 'do = "delay"\nframes = "records"\nby_s = 0.5\ncount = 1', STOPS, None, "at_s = 0.1"),
    Case("bus repaired", 'do = "bus-ok"', GOES),
    Case("host hangs, its heartbeat goes on", 'do = "host"\nhow = "hang"\nfor_s = 0.5', GOES, None, "at_s = 0.1"),
    Case("host hangs, its heartbeat goes on", 'do = "host"\nhow = "hang"', STOPS, (600, 850), "at_s = 0.1"),
    Case("host dies", 'do = "host"\nhow = "death"', STOPS, (300, 550.25)),
    Case("host dies and starts again", 'do = "host"\nhow = "restart"\nby_s = 0.1', STOPS, (300, 550.25)),
    Case("host dies and starts again", 'do = "host"\nhow = "restart"\nby_s = 1', STOPS, (300, 550.25)),
    Case("host is late", 'do = "host"\nhow = "late"\nby_s = 0.05', GOES),
    Case("host is late", 'do = "host"\nhow = "late"\nby_s = 0.7', STOPS, None, "at_s = 0"),
    Case(
        "SYNC lost for one of several boards",
        'do = "loss"\nframes = "sync"\nreceiver = 1',
        STOPS,
        (700, 1240),
        "power_up_s = 0",
        boards=TWO,
    ),
    Case("host sends points out of order", 'do = "host"\nhow = "disorder"\nfor_s = 0.1', GOES, None, "at_s = 0.1"),
    Case("host sends points out of order", 'do = "host"\nhow = "disorder"', STOPS, None, "power_up_s = 0"),
]

pytestmark = pytest.mark.usefixtures("impatient")


def test_every_documented_reaction_has_a_case() -> None:
    assert {case.what for case in CASES} == {row.what for row in DOCUMENTED}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.what}: {case.fault}".replace("\n", ", "))
def test_the_machine_answers_as_documented(fast_kernel: Kernel, case: Case) -> None:
    text = f"[[fault]]\n{case.when}\n{case.fault}\n"
    outcome, report = played(fast_kernel, text, motors=case.motors, boards=case.boards, drivers=case.drivers)
    assert report.passed, report.reasons
    (fault,) = report.faults
    assert fault.what == case.what
    right = outcome.report.reasons == outcome.late_reasons  # a rotor that slips shows in no count of a driver
    verdict = STOPS if outcome.fault else (GOES if right else REFUSED)
    assert verdict == case.verdict
    if case.stood_ms is not None:
        low, high = case.stood_ms
        assert fault.standstill_ms is not None
        assert low <= fault.standstill_ms <= high


@pytest.mark.parametrize("at_s", [0.05, 0.2, 0.5, 0.85])
def test_the_limit_of_a_ramp_is_tight(fast_kernel: Kernel, at_s: float) -> None:
    """The last step comes at the ramp's end, but for the slow steps there."""
    _, report = played(fast_kernel, f'[[fault]]\nat_s = {at_s}\ndo = "estop"\npressed = true\n')
    (fault,) = report.faults
    assert report.passed, report.reasons
    assert fault.limit_ms is not None
    assert fault.standstill_ms is not None
    assert 0 <= fault.limit_ms - fault.standstill_ms < RAMP_END_MS
    assert fault.limit_ms <= longest_ramp_ms(ROBOT) + 0.25


@pytest.mark.parametrize(
    ("fault", "code", "first_ms", "last_ms"),
    [
        ('do = "host"\nhow = "death"', ErrorCode.HEARTBEAT_LOST, 250, 350.25),
        ('do = "host"\nhow = "hang"', ErrorCode.PVT_UNDERRUN, 550, 650.25),
    ],
)
@pytest.mark.parametrize("at_s", [0.1, 0.125, 0.15, 0.175])
def test_a_lost_host_is_noticed_in_time(
    fast_kernel: Kernel, at_s: float, fault: str, code: ErrorCode, first_ms: float, last_ms: float
) -> None:
    """At every phase of the heartbeat; an EMCY is on the bus within a millisecond."""
    _, report = played(fast_kernel, f"[[fault]]\nat_s = {at_s}\n{fault}\n")
    first = next(told for told in report.faults[0].emcys if told.code == code)
    assert first_ms <= first.after_ms <= last_ms + 1


def test_a_repair_ends_the_faults_of_the_bus(fast_kernel: Kernel) -> None:
    """The same heartbeat is lost as in the case that stops the machine, but for 0.2 s."""
    loss = '[[fault]]\nat_s = 0.3\ndo = "loss"\nframes = "host-heartbeat"\n'
    outcome, report = played(fast_kernel, f'{loss}[[fault]]\nat_s = 0.5\ndo = "bus-ok"\n')
    assert outcome.passed
    assert report.passed, report.reasons
    assert report.faults[0].strikes == 2


@pytest.mark.parametrize("end", ['do = "bit-rate"\nbitrate = 1000000', 'do = "bus-ok"'])
def test_a_wrong_bit_rate_that_ends_lets_the_errors_come_through(fast_kernel: Kernel, end: str) -> None:
    wrong = '[[fault]]\nat_s = 0.3\ndo = "bit-rate"\nbitrate = 500000\n'
    outcome, report = played(fast_kernel, f"{wrong}[[fault]]\nat_s = 0.4\n{end}\n")
    assert outcome.fault is not None
    assert report.passed, report.reasons
    assert {each.code for fault in report.faults for each in fault.emcys} >= {0x8140}


def expecting(kernel: Kernel, text: str, reaction: Reaction) -> tuple[FaultReport, ScenarioReport]:
    """Carry while one fault happens for which this reaction is expected instead of the documented one."""
    read = scenario(f"[[fault]]\nat_s = 0.3\n{text}\n")
    wanted = Scenario(read.name, (replace(read.faults[0], name="it", expected=reaction),))
    report = report_in(execute(carry(), "carry", kernel, extras=[FaultOptions(scenario=wanted)]).verdicts)
    assert report is not None
    return report.faults[0], report


STOPPED = Reaction(MotionEffect.RAMP, (ErrorCode.ESTOP,), State.FAULT, 0.25)


@pytest.mark.parametrize(
    ("text", "reaction", "reasons"),
    [
        ('do = "estop"\npressed = true', GOES_ON, ["it: EMCY 0x9000 is not documented"]),
        ('do = "estop"\npressed = false', STOPPED, ["it: the motion did not stop"]),
        (
            'do = "estop"\npressed = true',
            replace(STOPPED, motion=MotionEffect.CUT),
            [
                "it: th1: was cut off in motion and claims to know its position",
                "it: th2: was cut off in motion and claims to know its position",
                "it: th4: was cut off in motion and claims to know its position",
                "it: stood after 103.16 ms, later than 0.25 ms",
            ],
        ),
        (
            'do = "temperature"\ntemperature_degc = 90',
            STOPPED,
            [
                "it: EMCY 0x4310 is not documented",
                *(f"it: {joint}: no EMCY 0x9000" for joint in ROBOT.joint_names),
            ],
        ),
        (
            'do = "temperature"\ntemperature_degc = 60',
            replace(GOES_ON, codes=(ErrorCode.TEMPERATURE,)),
            [f"it: {joint}: no EMCY 0x4310" for joint in ROBOT.joint_names],
        ),
        (
            'do = "estop"\npressed = true',
            replace(STOPPED, motion=MotionEffect.NOT_BEGUN, begins_ms=200.0),
            ["it: the motion began"],
        ),
        (
            'do = "host"\nhow = "restart"\nby_s = 1',
            Reaction(MotionEffect.RAMP, (ErrorCode.HEARTBEAT_LOST,), State.FAULT, 350.25),
            [f"it: {joint}: in OPERATION ENABLED, not in FAULT" for joint in ROBOT.joint_names],
        ),
        (
            'do = "slip"\njoint = "th2"\nfull_steps = 4',
            GOES_ON,
            ["it: th2: -64 steps lost in silence", "th2: "],
        ),
    ],
    ids=lambda value: value.replace("\n", ", ") if isinstance(value, str) else "",
)
def test_another_answer_fails_the_scenario(
    fast_kernel: Kernel, text: str, reaction: Reaction, reasons: list[str]
) -> None:
    fault, report = expecting(fast_kernel, text, reaction)
    assert not report.passed
    assert not fault.as_documented
    assert len(report.reasons) >= len(reasons)
    for found, wanted in zip(report.reasons, reasons, strict=False):
        assert found.startswith(wanted)
    unexplained = "the motion stopped, and no fault of the scenario may stop it"
    assert {line.partition(":")[0] for line in report.reasons} <= {"it", "th2", unexplained}


def test_a_stop_that_no_fault_explains_fails_the_scenario(fast_kernel: Kernel) -> None:
    """The stream is cut, which the scenario does not know of."""
    read = scenario('[[fault]]\nat_s = 0.05\ndo = "temperature"\ntemperature_degc = 50\n')
    outcome = execute(carry(), "carry", fast_kernel, cut_stream_s=0.4, extras=[FaultOptions(scenario=read)])
    report = report_in(outcome.verdicts)
    assert report is not None
    assert outcome.fault is not None
    assert report.reasons[-1] == "the motion stopped, and no fault of the scenario may stop it"


def test_what_a_motion_that_never_begins_has_met(
    fast_kernel: Kernel, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A start that is held back for longer than the host waits, and a drive in fault before the motion."""
    late = '[[fault]]\nname = "it"\npower_up_s = 0\ndo = "delay"\nframes = "sync"\nby_s = 2\n'
    with refusing(BusError) as caught:
        played(fast_kernel, late)
    assert isinstance(caught.value, NotBegunError)
    report = report_in(caught.value.verdicts)
    assert report is not None
    (fault,) = report.faults
    assert (fault.strikes, fault.what, fault.as_documented) == (1, "frames delayed", True)
    assert report.reasons[-1].startswith("no motion began: a frame has waited 1 s for the bus: ")
    path = tmp_path / "pressed.toml"
    path.write_text('name = "early"\n[[fault]]\npower_up_s = 0.001\ndo = "estop"\npressed = true\n')
    assert run(["run", "teaching-scara", "carry", "--machine", f"faults={path}"]) == 3
    out, err = capsys.readouterr()
    assert err == "steptwin: th1: cannot be enabled, the drive is in FAULT\n"
    assert "at 0.001 s" in out
    assert "\nscenario early: FAILED, 1 of 1 faults struck, seed 0\n  no motion began: " in out
    assert run(["run", "teaching-scara", "carry", "--machine", f"faults={path}", "--json"]) == 3
    document = json.loads(capsys.readouterr().out)
    assert (document["passed"], document["scenario"]["passed"], document["faults"][0]["strikes"]) == (False, False, 1)


def test_nobody_knows_what_was_lost_over_a_reset(fast_kernel: Kernel, capsys: pytest.CaptureFixture[str]) -> None:
    """Neither by the fault that was the reset nor by one before it; a fault after it knows."""
    outcome, report = played(
        fast_kernel,
        '[[fault]]\nat_s = 0.2\ndo = "temperature"\ntemperature_degc = 30\n'
        '[[fault]]\nat_s = 0.3\ndo = "watchdog"\n'
        '[[fault]]\nat_s = 0.306\ndo = "temperature"\ntemperature_degc = 35\n',
    )
    lost = [{joint.lost_steps for joint in fault.joints.values()} for fault in report.faults]
    assert lost == [{None}, {None}, {0}]
    assert outcome.fault is not None
    told = "th1 (node 0x10) has restarted (boot-up message); its position is unknown: home it"
    assert outcome.fault.message == told
    assert report.passed, report.reasons
    print_run(outcome.to_dict())
    assert capsys.readouterr().out.count("unknown after a reset") == 2


def test_what_the_axes_of_another_board_have_lost_is_known(fast_kernel: Kernel) -> None:
    _, report = played(fast_kernel, '[[fault]]\nat_s = 0.3\ndo = "watchdog"\njoint = "th4"\n', boards=TWO)
    assert report.passed, report.reasons
    lost = {name: joint.lost_steps for name, joint in report.faults[0].joints.items()}
    assert lost == {"th1": 0, "th2": 0, "d3": None, "th4": None}


def test_what_is_done_to_a_board_concerns_its_axes() -> None:
    boards = (0, 0, 1, 1)
    for of_one in (BrownOut(axis=2), WatchdogReset(axis=3), PowerUp(2), BusOff(3)):
        assert of_one.concerned(boards) == [2, 3]
    for of_all in (BrownOut(), WatchdogReset(), PowerUp(), BusOff(None), EmergencyStop(pressed=True)):
        assert of_all.concerned(boards) == [0, 1, 2, 3]
    assert DriverProtect(1, active=True).concerned(boards) == [1]


def test_a_receiver_that_is_not_there_is_refused(fast_kernel: Kernel) -> None:
    with refusing(InputError):
        played(fast_kernel, '[[fault]]\nat_s = 0\ndo = "loss"\nframes = "all"\nreceiver = 2\n')


def test_another_payload_needs_motors(fast_kernel: Kernel) -> None:
    with refusing(InputError):
        played(fast_kernel, '[[fault]]\nat_s = 0\ndo = "payload"\npayload_kg = 2.5\n')


@pytest.mark.parametrize(
    ("driver", "fault", "told"),
    [
        ("a4988", OscCapacitor(0, 330), "A4988 has no capacitor at OSC"),
        ("drv8825", OscCapacitor(0, 330), "DRV8825 has no capacitor at OSC"),
        ("3a-module", OscCapacitor(0, 330), None),
        ("a4988", DriverProtect(0, active=True), "A4988 has no pin that tells of a fault"),
        ("drv8825", DriverProtect(0, active=False), None),
        ("a4988", DriverMode(0, 32), "microsteps: 32 is not one of A4988's 1, 2, 4, 8, 16: the nearest is 16"),
        ("drv8825", DriverMode(0, 32), None),
        ("3a-module", DriverMode(0, 4), "microsteps: 4 is not one of TB6560AHQ's 1, 2, 8, 16: the nearest are 2 and 8"),
    ],
)
def test_a_fault_of_a_part_that_the_chip_lacks_is_refused(
    fast_kernel: Kernel, driver: str, fault: Fault, told: str | None
) -> None:
    def play() -> None:
        execute(carry(), "carry", fast_kernel, driver_profile=driver, extras=[FaultOptions(scenario=[fault])])

    if told is None:
        play()
    else:
        with refusing(InputError):
            play()


def test_a_motion_that_fails_without_a_reason_fails_the_scenario(fast_kernel: Kernel) -> None:
    """The drivers are in another mode than planned, which no fault of the scenario explains."""
    read = scenario('[[fault]]\nat_s = 0.3\ndo = "temperature"\ntemperature_degc = 50\n')
    outcome = execute(
        carry(),
        "carry",
        fast_kernel,
        driver_profile="3a-module",
        dip_microsteps={"th1": 8},
        extras=[FaultOptions(scenario=read)],
    )
    report = report_in(outcome.verdicts)
    assert report is not None
    assert outcome.fault is None
    reasons, silent = outcome.report.reasons, "1 temperature: th1: 834 steps lost in silence"
    assert reasons
    assert report.reasons == (silent, *reasons)
