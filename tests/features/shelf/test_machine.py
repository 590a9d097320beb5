"""The shelf beside an emulated board: sensors on the bus, virtual and live boards alike, and every slot in one run."""

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.shelf.errand import Errand, PlannedStock, job_carries
from steptwin.features.shelf.options import ShelfOptions
from steptwin.features.shelf.verdict import contradictions, reasons
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.laws import Trapezoid
from steptwin.host.planning.motions.composer import Composer
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan, plan_stretched
from steptwin.host.planning.programs import compile_program
from steptwin.host.planning.programs.program_file import parse_program
from steptwin.host.record.folder.reading import read_run
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.embedded.outcome import Outcome
from steptwin.host.twin.live.live_board import LiveBoard
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.protocol.cia402 import DigitalInput
from steptwin.protocol.timer import COUNTS_PER_SECOND
from tests.features.shelf.shelves import shelf_evidence_of, shelf_of, with_shelf
from tests.messages import refusing

ROBOT = load_robot("warehouse-scara")
LOCKED = np.array([400.0, 100.0, 100.0, 0.0, 60.0, 30.0])
"""The joints with the hand at the striker of A1."""
WALK = [
    "hand locked onto the drawer",
    "box taken",
    "hand unlocked from the drawer",
]
NS_PER_S = 1_000_000_000


def at_drawer(*, waiting: bool) -> Plan:
    """Return a quick motion: lock onto A1's drawer, pull it out, take the box, push it shut, unlock."""
    pose = make_kinematics(ROBOT).forward(LOCKED[np.newaxis]) - np.array([0.0, 30.0, 0.0, 0.0])
    moves = Composer(ROBOT, make_kinematics(ROBOT).solve(pose, "right", LOCKED).joints[0])

    def wait(sensor: str, *, on: bool) -> None:
        if waiting:
            moves.wait(sensor, on=on, timeout_s=1.0)

    def line(way_mm: float) -> None:
        moves.line("right", (0.0, way_mm, 0.0), Trapezoid.fastest(abs(way_mm), speed_max=200.0, acceleration_max=400.0))

    line(30.0)
    moves.switch("lock", on=True)
    wait("lock_engaged", on=True)
    line(-180.0)
    wait("drawer_end", on=True)
    moves.switch("magnet", on=True)
    wait("box_present", on=True)
    line(180.0)
    wait("drawer_end", on=False)
    moves.switch("lock", on=False)
    wait("lock_engaged", on=False)
    line(-30.0)
    return plan(ROBOT, moves.sequence())


@pytest.fixture(scope="module")
def waited(fast_kernel: Kernel) -> Outcome:
    return execute(at_drawer(waiting=True), "waits", fast_kernel, extras=[ShelfOptions(stock={"A1": "screws"})])


def test_a_motion_that_waits_for_each_sensor_passes(waited: Outcome) -> None:
    assert waited.passed, waited.report.reasons
    shelf = shelf_evidence_of(waited.comparison.evidence)
    assert shelf is not None
    assert [event.what for event in shelf.events] == WALK
    assert (shelf.start, shelf.end, shelf.open_mm) == ({"A1": "screws"}, {"pick-up": "pick-up-1"}, {})
    assert list(contradictions(shelf, waited.comparison)) == []
    assert [(each.input, each.on) for each in waited.waits] == [
        ("lock_engaged", True),
        ("drawer_end", True),
        ("box_present", True),
        ("drawer_end", False),
        ("lock_engaged", False),
    ]


def reported(outcome: Outcome, joint: str, bit: DigitalInput) -> list[tuple[float, bool]]:
    """Return the instants, in s, and levels at which a joint's node reports a change of an input."""
    cob_id = 0x480 + 0x10 + ROBOT.index_of(joint)
    levels = [
        (counts / COUNTS_PER_SECOND, bool(int.from_bytes(frame.data[:4], "little") & bit))
        for counts, frame in outcome.bus_log
        if frame.cob_id == cob_id
    ]
    return [after for before, after in pairwise([(0.0, False), *levels]) if before[1] != after[1]]


def test_the_sensors_are_digital_inputs_on_the_bus(waited: Outcome) -> None:
    shelf = shelf_evidence_of(waited.comparison.evidence)
    assert shelf is not None
    lock, take, unlock = (event.counts / COUNTS_PER_SECOND for event in shelf.events)
    engaged, present = (reported(waited, "th3", bit) for bit in (DigitalInput.IN1, DigitalInput.IN2))
    at_end = reported(waited, "th2", DigitalInput.IN1)
    assert [level for _, level in engaged] == [True, False]
    assert [level for _, level in present] == [True]
    assert [level for _, level in at_end] == [True, False]
    heard = [*(at for at, _ in engaged), present[0][0]]
    assert heard == pytest.approx([lock, unlock, take], abs=0.001)  # a tick and a frame later
    assert lock < at_end[0][0] < take < at_end[1][0] < unlock


@pytest.mark.slow
def test_without_waits_the_bus_and_the_edges_stay_as_they_are(fast_kernel: Kernel) -> None:
    """A motion that does not look at the sensors leaves them unplugged: the shelf only watches."""
    motion = at_drawer(waiting=False)
    outcome = execute(motion, "quick", fast_kernel, extras=[ShelfOptions(stock={"A1": "screws"})])
    empty = execute(motion, "quick", fast_kernel, extras=[ShelfOptions(stock={})])
    assert outcome.passed
    assert outcome.bus_log == empty.bus_log
    for one, other in zip(outcome.comparison.evidence.axes, empty.comparison.evidence.axes, strict=True):
        assert np.array_equal(one.step_counts, other.step_counts)
    found = [shelf_evidence_of(outcome.comparison.evidence), shelf_evidence_of(empty.comparison.evidence)]
    assert [[event.what for event in each.events] for each in found if each] == [
        WALK,
        [WALK[0], "magnet switched on where no box is", WALK[2]],
    ]


@pytest.mark.slow
def test_a_wait_for_a_drawer_that_is_locked_ends_the_motion(fast_kernel: Kernel) -> None:
    outcome = execute(at_drawer(waiting=True), "waits", fast_kernel, extras=[ShelfOptions(locked_drawers=["A1"])])
    assert not outcome.passed
    assert outcome.fault is not None
    assert outcome.fault.message.startswith("the input drawer_end was not on within 1 s")
    (pull,) = [reason for reason in outcome.report.reasons if "locked" in reason]
    assert "A1: pull on a locked drawer at x 675.0" in pull


@pytest.mark.parametrize(
    ("stock", "locked"),
    [
        ({"C9": "x"}, []),
        ({}, ["hand-over"]),
    ],
)
def test_places_that_the_shelf_does_not_have(fast_kernel: Kernel, stock: dict[str, str], locked: list[str]) -> None:
    with refusing(InputError):
        execute(
            at_drawer(waiting=False), "quick", fast_kernel, extras=[ShelfOptions(stock=stock, locked_drawers=locked)]
        )


@pytest.mark.slow
def test_a_live_board_has_the_same_shelf(waited: Outcome, fast_kernel: Kernel) -> None:
    """The host's frames of the run in virtual time, sent to a live board at their instants, do the same there."""
    board = LiveBoard(
        ROBOT,
        fast_kernel,
        MachineOptions(
            stand_at=waited.plan.start_joints, extras=[ShelfOptions(stock={"A1": "screws"})], bitrate=1_000_000
        ),
    )
    board.live.start(0, 0)
    now_ns = 0
    for counts, frame in waited.bus_log:
        if frame.cob_id not in FROM_BOARDS:
            now_ns = max(now_ns, counts * NS_PER_S // COUNTS_PER_SECOND)
            board.live.send(frame, "host", now_ns)
    step_ns = NS_PER_S // 200
    for at_ns in range(step_ns, now_ns + NS_PER_S, step_ns):
        board.live.advance(at_ns)
    board.record()
    report = board.report()["shelf"]
    assert [event["what"] for event in report["events"]] == WALK
    assert (report["start"], report["end"], report["open_mm"]) == ({"A1": "screws"}, {"pick-up": "pick-up-1"}, {})


FROM_BOARDS = {cob + node for cob in (0x080, 0x180, 0x280, 0x380, 0x480, 0x580, 0x700) for node in range(0x10, 0x16)}
"""COB-IDs of the boards' own frames."""


@pytest.mark.slow
def test_every_slot_is_stored_and_fetched_in_one_run(fast_kernel: Kernel) -> None:
    """Points every 40 ms are enough for these slow motions, and make the run cheaper."""
    errand, options = Errand.alone(job_carries(ROBOT, "every-slot", {}), "screws"), {"pull_s": "1", "approach_mm": "10"}
    motion = plan(ROBOT, make_job(ROBOT, "every-slot", options), point_ms=40)
    outcome = execute(motion, "every-slot", fast_kernel, extras=[ShelfOptions(errand=errand)])
    assert outcome.passed, outcome.report.reasons
    shelf = shelf_evidence_of(outcome.comparison.evidence)
    assert shelf is not None
    taken, put = ([e.where for e in shelf.events if e.what == what] for what in ("box taken", "box put down"))
    slots = ["A1", "A2", "B1", "B2"]
    assert put == [place for slot in slots for place in (slot, "hand-over")]
    assert taken == [place for slot in slots for place in ("hand-over", slot)]
    assert shelf.end["hand-over"] == "screws"
    assert list(contradictions(shelf, outcome.comparison)) == []


class TestDrawerPull:
    """The paper's experiment, section 3: the drawer is pulled 180 mm out, and stays so."""

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("options", "slot", "open_mm", "cells"),
        [({"pull_s": "2"}, "A1", 180.0, 3), ({"pull_s": "2", "compartments": "2", "slot": "B2"}, "B2", 120.0, 2),
         ({"pull_s": "2", "compartments": "1", "elbow": "left", "sensors": "wait"}, "A1", 60.0, 1)],
    )  # fmt: skip
    def test_it_passes(
        self, options: dict[str, str], slot: str, open_mm: float, cells: int, fast_kernel: Kernel, tmp_path: Path
    ) -> None:
        outcome = execute(plan(ROBOT, make_job(ROBOT, "drawer-pull", options)), "drawer-pull", fast_kernel)
        assert outcome.passed, outcome.report.reasons
        shelf = shelf_evidence_of(outcome.comparison.evidence)
        assert shelf is not None
        assert [(event.what, event.where) for event in shelf.events] == [("hand locked onto the drawer", slot)]
        assert shelf.open_mm == {slot: pytest.approx(open_mm, abs=0.1)}
        assert shelf.cells_out == {slot: cells}
        outcome.save(tmp_path / "run")
        assert json.loads((tmp_path / "run" / "shelf.json").read_text())["leaves_open"] == [slot]
        stored = read_run(tmp_path / "run")
        assert stored.comparison.expected.features["shelf"] == PlannedStock(leaves_open=(slot,))
        assert reasons(shelf, stored.comparison.expected.features["shelf"], 0) == []

    @pytest.mark.slow
    def test_a_locked_drawer_fails_it(self, fast_kernel: Kernel) -> None:
        motion = plan(ROBOT, make_job(ROBOT, "drawer-pull", {"pull_s": "2"}))
        outcome = execute(motion, "drawer-pull", fast_kernel, extras=[ShelfOptions(locked_drawers=("A1",))])
        assert "shelf: A1: the drawer is shut at the end (planned open)" in outcome.report.reasons

    @pytest.mark.slow
    def test_a_program_says_which_drawers_stay_open(self, fast_kernel: Kernel) -> None:
        """The same by hand: without `leaves_open` the open drawer fails the run; a drawer that is not there is told."""
        text = """
        {leaves_open}
        start = {{ sx = 400, sz = 100, L1 = 100, th1 = 0, th2 = 60, th3 = 30 }}
        [[step]]
        output = "lock"
        on = true
        [[step]]
        by = {{ y = -180 }}
        speed_mm_s = 90
        """
        for line, failed in (
            ('leaves_open = ["A1"]', []),
            ("", ["shelf: A1: the drawer is left 180.0 mm out"]),
            ('leaves_open = ["A1", "B1"]', ["shelf: B1: the drawer is shut at the end (planned open)"]),
        ):
            program = parse_program(text.format(leaves_open=line), Findings())
            outcome = execute(plan_stretched(ROBOT, compile_program(program, ROBOT).motion), "x", fast_kernel)
            assert list(outcome.report.reasons) == failed
        for line, told in (
            ('leaves_open = ["A3"]', "leaves_open: slot 'A3' is unknown: there are A1, A2, B1, B2"),
            ("leaves_open = [1]", "leaves_open[0]: 1 is not a text"),
            ("leaves_open = 1", "leaves_open: 1 is not a list"),
        ):
            findings = Findings()
            compile_program(parse_program(text.format(leaves_open=line), findings), ROBOT, findings)
            assert findings.messages == [told]


class TestPart:
    """The part that the classroom arm grips at qa, carries and puts down at qb."""

    OPTIONS: ClassVar = {"depth_mm": "20", "repetitions": "2"}

    def carried(
        self,
        kernel: Kernel,
        options: dict[str, str] = OPTIONS,
        *,
        feeds: bool = True,
        stock: dict[str, str] | None = None,
    ) -> Outcome:
        robot = load_robot("teaching-scara")
        shelf = shelf_of(robot)
        spots = {**shelf.spots, "qa": replace(shelf.spots["qa"], feeds=feeds)}
        robot = with_shelf(robot, replace(shelf, spots=spots))
        errand = Errand.alone(job_carries(robot, "carry", options), "gear")
        return execute(
            plan(robot, make_job(robot, "carry", options)),
            "carry",
            kernel,
            extras=[ShelfOptions(errand=errand, stock=stock)],
        )

    @pytest.mark.slow
    def test_it_is_carried(self, fast_kernel: Kernel, tmp_path: Path) -> None:
        outcome = self.carried(fast_kernel)
        assert outcome.passed, outcome.report.reasons
        shelf = shelf_evidence_of(outcome.comparison.evidence)
        assert shelf is not None
        assert [(event.what, event.where, event.box) for event in shelf.events] == [
            ("box taken", "qa", "gear"),
            ("box put down", "qb", "gear"),
            ("box taken", "qa", "qa-1"),
            ("box put down", "qb", "qa-1"),
        ]
        assert [event.tip_mm[2] for event in shelf.events] == [-60.0] * 4
        assert list(contradictions(shelf, outcome.comparison)) == []
        outcome.save(tmp_path / "run")
        assert json.loads((tmp_path / "run" / "shelf.json").read_text())["cleared"] == {"qb": 2}
        stored = read_run(tmp_path / "run")
        assert stored.comparison.expected.features["shelf"] == PlannedStock(cleared={"qb": 2})
        assert reasons(shelf, stored.comparison.expected.features["shelf"], 0) == []

    @pytest.mark.slow
    def test_without_a_part_or_with_one_in_its_place_the_run_fails(self, fast_kernel: Kernel) -> None:
        outcome = self.carried(fast_kernel, {"depth_mm": "20"}, feeds=False, stock={})
        assert list(outcome.report.reasons) == ["shelf: qb: boxes put down: 0 (planned 1)"]
        full = self.carried(fast_kernel, {"depth_mm": "20"}, stock={"qb": "gear"}).report.reasons
        assert "qb: filled twice (qa-1) at x 137.9, y 35.8, z -60.0 mm" in full[0]
        assert full[1:] == ("shelf: qb: boxes put down: 0 (planned 1)",)

    @pytest.mark.parametrize(("d3_mm", "what"), [(18, ""), (17, "box dropped")])
    def test_a_part_that_is_let_go_too_high_falls(self, d3_mm: int, what: str, fast_kernel: Kernel) -> None:
        robot = load_robot("teaching-scara")
        text = f"""
        start = {{ th1 = 0, th2 = 0, d3 = 20, th4 = 0 }}
        [[step]]
        output = "gripper"
        on = true
        [[step]]
        go = {{ d3 = {d3_mm} }}
        [[step]]
        output = "gripper"
        on = false
        """
        program = parse_program(text, Findings())
        outcome = execute(plan_stretched(robot, compile_program(program, robot).motion), "x", fast_kernel)
        (told,) = outcome.report.reasons or ("",)
        assert what in told
