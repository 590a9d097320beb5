"""Marks of violations and of the bus log, from values made by hand."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from steptwin.features.view.marks import (
    TOGETHER_COUNTS,
    MarkKind,
    RunMark,
    bus_marks,
    output_marks,
    time_words,
    violation_marks,
)
from steptwin.host.record.bus_log import log_line
from steptwin.host.verify import DriverLimit, DriverViolations, OutputEdge
from steptwin.protocol.frame import Frame
from steptwin.protocol.timer import COUNTS_PER_MS
from tests.host.record.folder.stored import EVIDENCE

LIMITS = (DriverLimit("clk_high", "CLK too short", 30.0, "us", ""), DriverLimit("hot", "too hot", 170.0, "degC", ""))
ENABLED, FAULT = (word.to_bytes(2, "little") + bytes(5) for word in (0x0027, 0x0008))
MS = COUNTS_PER_MS


def test_violations_shortly_after_each_other_are_one_mark() -> None:
    counts = 1000 + np.array([0, TOGETHER_COUNTS, 2 * TOGETHER_COUNTS + 1, 2 * TOGETHER_COUNTS + 1])
    which = np.array([0, 0, 0, 1], np.int8)
    violations = DriverViolations(LIMITS, counts, which, np.array([29.0, 20.0, 28.0, 171.5]))
    marks = list(violation_marks(replace(EVIDENCE.axes[0], violations=violations)))
    assert marks == [
        RunMark(MarkKind.VIOLATION, 1000, counts[1], "a", "CLK too short: limit 30 us, 2 times, at worst 20 us"),
        RunMark(MarkKind.VIOLATION, counts[2], counts[2], "a", "CLK too short: limit 30 us, it was 28 us"),
        RunMark(MarkKind.VIOLATION, counts[3], counts[3], "a", "too hot: limit 170 degC, it was 171.5 degC"),
    ]


def test_states_and_errors_in_the_bus_log(tmp_path: Path) -> None:
    frames = [
        (1 * MS, Frame(0x190, ENABLED)),
        (2 * MS, Frame(0x191, ENABLED)),
        (3 * MS, Frame(0x190, ENABLED)),
        (4 * MS, Frame(0x091, bytes.fromhex("01FF010000000000"))),
        (5 * MS, Frame(0x191, FAULT)),
        (6 * MS, Frame(0x091, bytes(8))),
        (60 * MS, Frame(0x190, FAULT)),
        (61 * MS, Frame(0x192, FAULT)),  # an axis that the robot has not
        (62 * MS, Frame(0x190, b"\xff")),
        (63 * MS, Frame(0x090, b"\x01")),
    ]
    log = tmp_path / "bus.log"
    log.write_text("".join(log_line(*each) for each in frames))
    marks = bus_marks(log, ("th1", "th2"))
    assert [(mark.kind, mark.counts // MS, mark.until_counts // MS, mark.who, mark.text) for mark in marks] == [
        ("state", 1, 2, "th1, th2", "enabled"),
        ("error", 4, 4, "th2", "the motion came too late"),
        ("state", 5, 5, "th2", "fault, off"),
        ("state", 60, 60, "th1", "fault, off"),
    ]
    assert bus_marks(log, ("th1", "th2"), frames=1) == [RunMark(MarkKind.STATE, 1 * MS, 1 * MS, "th1", "enabled")]


def test_outputs_and_times_in_words() -> None:
    marks = list(output_marks((OutputEdge("lock", 72 * MS, 1), OutputEdge("lock", 144 * MS, 0))))
    assert [(mark.who, mark.text) for mark in marks] == [("lock", "on"), ("lock", "off")]
    assert time_words(marks[0], 71 * MS) == "0.001000 s"
    assert time_words(replace(marks[0], until_counts=73 * MS), 71 * MS) == "0.001000 to 0.002000 s"
