"""Sequences: nothing jumps where motions meet, and times count from the start of the whole."""

import numpy as np
import pytest

from steptwin.host.planning.laws import Cubic, SCurve, Trapezoid
from steptwin.host.planning.motion import JointFunctions, Motion, OutputChange
from steptwin.host.planning.motions.composer import Sequence, sequence, standstill
from steptwin.host.planning.motions.joint_move import joint_move
from tests.host.verify.motions import motion, still
from tests.laws import law_of

NAMES = ("a", "b")
A, B, C = (0.0, 5.0), (10.0, -5.0), (10.0, 0.5)

PARTS: tuple[Motion, ...] = (
    joint_move(NAMES, A, B, Trapezoid(1.0, 1.0, 0.3)),
    standstill(NAMES, B, 0.25),
    joint_move(NAMES, B, C, Cubic(1.0, 0.5)),
    joint_move(NAMES, C, A, SCurve(1.0, 0.8, 0.2, 0.1)),
)
SWITCHINGS = (OutputChange("gripper", True, 1.0, 1.25),)
ALL = sequence(NAMES, PARTS, SWITCHINGS)
STARTS_MS = law_of(ALL, Sequence).starts_ms


def test_duration_breakpoints_and_switchings() -> None:
    """The breakpoints are the parts', shifted by their starts, and the times at which one part follows another."""
    assert STARTS_MS == (0, 1000, 1250, 1750, 2550)
    assert ALL.duration_s == 2.55
    assert ALL.breakpoints_s == (0.3, 0.7, 1.0, 1.25, 1.75, 1.85, 1.95, 2.35, 2.45)
    assert ALL.output_changes == SWITCHINGS


def test_each_part_moves_in_its_time() -> None:
    for part, start_ms in zip(PARTS, STARTS_MS, strict=False):
        own_s = np.linspace(0.0, part.duration_s, 57)[1:-1]
        assert ALL.positions(own_s + start_ms / 1000) == pytest.approx(part.positions(own_s), abs=1e-12)
        assert ALL.velocities(own_s + start_ms / 1000) == pytest.approx(part.velocities(own_s), abs=1e-9)


def test_nothing_jumps_where_parts_meet() -> None:
    meets_s = np.array(STARTS_MS[1:-1]) / 1000
    around_s = meets_s + np.array([[-1e-9], [0.0], [1e-9]])
    for t_s in around_s:
        assert ALL.positions(t_s) == pytest.approx(np.array([B, B, C]), abs=1e-12)
        assert ALL.velocities(t_s) == pytest.approx(np.zeros((3, 2)), abs=1e-6)
    assert np.abs(ALL.velocities(meets_s)).max() == 0.0


def test_it_stands_still_before_and_after() -> None:
    """Times may be slightly outside by rounding; the end is exactly the last part's end."""
    outside_s = np.array([-1.0, -1e-12, 0.0, 2.55, 2.55 + 1e-12, 9.0])
    assert ALL.positions(outside_s).tolist() == [list(A)] * 6
    assert np.abs(ALL.velocities(outside_s)).max() < 1e-12


def test_times_in_any_order_and_no_times() -> None:
    t_s = np.linspace(0.0, 2.55, 301)
    order = np.random.default_rng(1).permutation(301)
    assert ALL.positions(t_s[order]).tolist() == ALL.positions(t_s)[order].tolist()
    assert ALL.positions(np.zeros(0)).shape == ALL.velocities(np.zeros(0)).shape == (0, 2)


ASKED = Motion(("a",), 0.1, JointFunctions(lambda t_s: t_s[:, np.newaxis], lambda t_s: t_s[:, np.newaxis]))
"""A part that returns the times for which it is evaluated."""


def test_parts_are_evaluated_within_their_own_times() -> None:
    """Their times are within 0 and their duration to the last bit, although 0.3 - 0.2 is less than 0.1 in floats."""
    many = sequence(("a",), [ASKED] * 40)
    asked_s = many.positions(np.arange(4001) / 1000)[:, 0]
    assert asked_s.min() == 0.0
    assert asked_s.max() <= 0.1
    assert asked_s[:-1:100].tolist() == [0.0] * 40
    assert asked_s == pytest.approx(np.append(np.tile(np.arange(100), 40), 100) / 1000, abs=1e-12)


def test_sequences_within_sequences() -> None:
    outer = sequence(("a",), [motion(0.5, still(1.0)), sequence(("a",), [ASKED, ASKED])])
    assert outer.breakpoints_s == (0.5, 0.6)
    assert outer.positions(np.array([0.25, 0.55, 0.65]))[:, 0] == pytest.approx([1.0, 0.05, 0.05])


def test_a_pause() -> None:
    pause, t_s = standstill(NAMES, B, 0.25), np.linspace(0.0, 0.25, 9)
    assert pause.positions(t_s).tolist() == [list(B)] * 9
    assert pause.velocities(t_s).tolist() == [[0.0, 0.0]] * 9
    assert (pause.breakpoints_s, pause.output_changes) == ((), ())
