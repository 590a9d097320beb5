"""Verdicts by path on made captures: clean ones of each controller pass, each kind of fault is named."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from steptwin.features.captures.channel_map import AxisSignals
from steptwin.features.captures.command import CaptureOptions, _planned
from steptwin.features.captures.path_faults import FaultKind
from steptwin.features.captures.path_verdict import PathVerdict, judge_path
from steptwin.features.captures.step_rules import CONTROLLERS, ESTIMATES
from steptwin.host.robots.coupling import Coupling
from tests.features.captures.controllers import Steps
from tests.features.captures.drawn import (
    CANCELLING,
    CONTROLLERS_MADE,
    FAULTS,
    RULES_MADE,
    Case,
    Drawn,
    Law,
    add,
    arc,
    change,
    lose,
    made_case,
    polygon,
    signals,
)

RULES = {rule.name: rule for rule in (*ESTIMATES, *CONTROLLERS.values())}
SQUARE = polygon([(0, 0), (4, 0), (4, 3), (0, 3), (0.5, 0.5)])
LAW = Law(40.0, 800.0)
PER_MM = 40.0
PLAN = Drawn(SQUARE, Law(20.0, 500.0)).expected(PER_MM)
RATE_HZ = 8e6


def verdict(case: Case, named: bool = True) -> PathVerdict:
    return judge_path(case.signals, case.expected, RULES[case.rule] if named else None, case.resolution_s)


def square(rule: str = "klipper", seed: int = 1) -> list[Steps]:
    """Return the steps of a controller that draws the square."""
    return CONTROLLERS_MADE[rule](Drawn(SQUARE, LAW), PER_MM, np.random.default_rng(seed))


def judged(steps: list[Steps], rule: str | None = "klipper") -> PathVerdict:
    return judge_path(signals(steps, RATE_HZ), PLAN, RULES[rule] if rule else None, 1.0 / RATE_HZ)


# --- clean ones


@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("rule", RULES_MADE)
@pytest.mark.parametrize("seed", [1, 2])
def test_clean_captures_of_each_controller_pass(rule: str, seed: int, named: bool) -> None:
    """At other speeds than planned, at 24, 8 or 1 MHz, with drift and jitter."""
    found = verdict(made_case(seed, rule=rule, size=1.5), named)
    assert (found.passed, found.reasons, found.before) == (True, (), 0)
    assert found.estimated is not named


@pytest.mark.slow
def test_no_clean_capture_is_accused() -> None:
    assert [seed for seed in range(90) if not verdict(made_case(seed), seed % 3 > 0).passed] == []


@pytest.mark.slow
def test_no_faulty_capture_passes_but_those_of_which_no_path_can_tell() -> None:
    """By the rule of whole steps one step more or less may be right where an axis ends between two steps."""
    passed = {
        (fault, seed, found.rule.name)
        for seed in range(500, 560)
        for fault in (FAULTS[seed % len(FAULTS)],)
        if (found := verdict(made_case(seed, fault), seed % 3 > 0)).passed
    }
    assert {rule for _, _, rule in passed} <= {"whole steps"}
    assert len(passed) <= 3


# --- goldens: one sentence for each kind of fault


def test_a_lost_step_is_named_with_its_pulse() -> None:
    steps = square()
    at_s = steps[1].time_s[60] + 0.01
    found = judged(change(steps, 1, lose(steps[1], 60, 1)))
    assert found.faults[0].pulse_s == pytest.approx(at_s, abs=1e-4)
    assert found.reasons == (
        "y has lost 1 step up at 0.222797 s, 5.510 to 5.515 mm along the path, from x 4, y 1.51, z 0 mm:"
        " its count is off by -1 from there on",
    )


def test_extra_steps_are_named() -> None:
    steps = square()
    assert judged(change(steps, 0, add(steps[0], 80, 2))).reasons == (
        "x has made 2 extra steps up between 0.015577 and 0.154389 s, 0.000 to 4.015 mm along the path, from x 0, y 0,"
        " z 0 mm: its count is off by +2 from there on",
    )


def test_a_part_left_out_is_named() -> None:
    shorter = polygon([(0, 0), (4, 0), (0, 3), (0.5, 0.5)])
    found = judged(CONTROLLERS_MADE["klipper"](Drawn(shorter, LAW), PER_MM, np.random.default_rng(1)))
    assert [fault.kind for fault in found.faults] == [FaultKind.LEFT_OUT]
    assert found.reasons == (
        "the path is left out between 0.166240 and 0.328749 s, 3.990 to 10.960 mm along the path, from x 3.99, y 0,"
        " z 0 mm",
    )


@pytest.mark.slow
def test_more_motion_than_planned_is_named() -> None:
    longer = polygon([(0, 0), (4, 0), (4, 3), (2, 4), (4, 3), (0, 3), (0.5, 0.5)])
    found = judged(CONTROLLERS_MADE["klipper"](Drawn(longer, LAW), PER_MM, np.random.default_rng(1)))
    assert found.reasons == (
        "there is motion that the path does not have, between 0.290901 and 0.506482 s, 7.040 mm along the path,"
        " at x 3.96, y 3, z 0 mm",
    )


@pytest.mark.slow
def test_another_path_is_left() -> None:
    other = polygon([(0, 0), (4, 0), (4, 3), (2, 5), (0.5, 0.5)])
    found = judged(CONTROLLERS_MADE["klipper"](Drawn(other, LAW), PER_MM, np.random.default_rng(1)))
    assert found.reasons == (
        "the path is left at 0.279409 s, 7.015 mm along the path, at x 3.985, y 3, z 0 mm, and never reached again",
    )


@pytest.mark.slow
def test_a_path_that_is_not_finished() -> None:
    steps = square()
    until_s = float(steps[1].time_s[20])
    cut = [Steps(own.time_s[own.time_s < until_s], own.signs[own.time_s < until_s]) for own in steps]
    assert judged(cut).reasons == (
        "the path is not finished: the steps end at 0.194910 s, 4.515 mm along the path, at x 4, y 0.515, z 0 mm",
    )


def test_whole_axes_are_named() -> None:
    x, y = square()
    none = lose(y, 0, y.time_s.size)
    assert judged([y, x]).reasons == ("x goes the path of y, and y that of x: swap their channels",)
    assert judged([x, none]).reasons == ("y makes no step, but the path needs some: is its channel the right one?",)
    assert judged([lose(x, 0, x.time_s.size), none]).reasons == ("no step is recorded, but the path needs some",)
    turned = Steps(x.time_s, (-x.signs).astype(np.int8))
    assert judged([turned, y]).reasons == ("x turns the other way: invert its DIR in --map",)
    half = Steps(x.time_s[::2], x.signs[::2])
    assert judged([half, y]).reasons == (
        "x makes 0.5 times the planned steps: its microsteps or steps per unit differ",
    )


def at_both_edges(steps: list[Steps]) -> list[AxisSignals]:
    """Return the signals of a controller that steps at each edge of STEP."""
    made = signals(steps, RATE_HZ)
    return [replace(each, step=each.step._replace(times_s=each.rises_s, level=0)) for each in made]


def test_steps_at_both_edges_are_told_and_counted() -> None:
    made = at_both_edges(square())
    found = judge_path(made, PLAN, RULES["klipper"], 1.0 / RATE_HZ)
    assert found.reasons == (
        "half of the planned steps on all axes, and STEP is as long high as low: the controller steps at both edges,"
        " as Klipper does with TMC drivers; --both-edges counts so",
    )
    assert judge_path(made, PLAN, RULES["klipper"], 1.0 / RATE_HZ, both_edges=True).passed
    found = judge_path(signals(square(), RATE_HZ), PLAN, None, 1.0 / RATE_HZ, both_edges=True)
    assert found.reasons[0] == (
        "x makes 2 times the planned steps: its microsteps or steps per unit differ; each edge was counted: leave out"
        " --both-edges"
    )


def test_the_other_sign_of_corexy_is_told() -> None:
    """Its motors go x + y and y - x here; the second one of Klipper goes x - y."""
    belts = Coupling.of(("x", "y"), {"x": {"y": 1.0}, "y": {"x": -1.0}})
    expected = replace(PLAN, coupling=belts)
    own = Drawn([np.asarray(belts.to_axes(stroke)) for stroke in SQUARE], LAW)
    a, b = CONTROLLERS_MADE["klipper"](own, PER_MM, np.random.default_rng(1))
    assert judge_path(signals([a, b], RATE_HZ), expected, RULES["klipper"], 1.0 / RATE_HZ).passed
    turned = [a, Steps(b.time_s, (-b.signs).astype(np.int8))]
    assert judge_path(signals(turned, RATE_HZ), expected, RULES["klipper"], 1.0 / RATE_HZ).reasons == (
        "y turns the other way: invert its DIR in --map; of CoreXY the second motor goes y - x here, x - y with"
        " Klipper, grbl, Marlin and LinuxCNC",
    )


# --- what comes before, what cannot be told


def test_steps_before_the_motion_are_left_out() -> None:
    """Homing: there and back, and on to where the motion begins."""
    homing = [np.array([[-1.3, -0.7], [-3.0, -0.7]]), np.array([[-3.0, -0.7], [-2.5, -0.7]])]
    homing.append(np.array([[-2.5, -0.7], [0.0, 0.0]]))
    drawn = Drawn([*homing, *SQUARE], LAW, pause_s=0.06)
    steps = CONTROLLERS_MADE["klipper"](drawn, PER_MM, np.random.default_rng(1))
    found = judged(steps)
    assert (found.passed, found.before) == (True, 216)
    lost = judged(change(steps, 0, lose(steps[0], steps[0].time_s.size - 100, 1)))
    assert (lost.before, [(fault.kind, fault.steps) for fault in lost.faults]) == (216, [(FaultKind.LOST, 1)])


@pytest.mark.parametrize("fault", CANCELLING)
def test_pulses_that_cancel_may_pass(fault: str) -> None:
    assert verdict(made_case(3, fault, "klipper", 1.0)).not_shown.startswith("pulses that cancel")


def test_arcs_of_grbl_are_chords() -> None:
    """On a curved path its counts may be further away, by the arc tolerance in steps; on straight lines not."""
    round_path = [arc((0.0, 0.0), 2.0, 0.0, 200.0)]
    steps = CONTROLLERS_MADE["grbl"](Drawn(round_path, LAW), 160.0, np.random.default_rng(1))
    expected = Drawn(round_path, LAW).expected(160.0)
    found = judge_path(signals(steps), expected, RULES["grbl"], 1.0 / RATE_HZ)
    assert found.passed
    assert found.half_steps == pytest.approx(1.20 + 0.002 * 160.0, abs=1e-3)
    assert judged(square("grbl"), "grbl").half_steps == 1.20


def test_chords_of_klipper_are_told() -> None:
    """Chords of 1 mm are farther than a step from an arc: the capture of a right controller fails, with a hint."""
    round_path = [arc((0.0, 0.0), 2.0, 0.0, 200.0)]
    turns = np.linspace(0.0, np.deg2rad(200.0), 8)
    chords = polygon([(2.0 * np.cos(turn), 2.0 * np.sin(turn)) for turn in turns])
    expected = Drawn(round_path, LAW).expected(160.0)
    for drawn, passes in ((round_path, True), (chords, False)):
        steps = CONTROLLERS_MADE["klipper"](Drawn(drawn, LAW), 160.0, np.random.default_rng(1))
        found = judge_path(signals(steps), expected, RULES["klipper"], 1.0 / RATE_HZ)
        assert found.passed is passes
        assert found.hint == (
            "" if passes else "the path has arcs, which klipper goes in chords of about 1 mm: let the file have lines"
        )


def test_gcode_is_followed_to_its_very_corners(tmp_path: Path) -> None:
    """Elsewhere a dialect's corners are rounded; a controller goes to them, and so a clean capture would fail."""
    (tmp_path / "part.gcode").write_text("G28\nG1 X60 Y60 Z200 F6000\nG1 X80 Y60\nG1 X80 Y90\n")
    words = f"corexy-gantry {tmp_path}/part.gcode dialect=klipper"
    nearest_mm = []
    for wanted in (words, f"{words} blend_mm=0.2"):
        _, _, plan = _planned(CaptureOptions(), Path(wanted), "--path")
        assert plan is not None
        t_s = np.arange(0.0, plan.motion.duration_s, 0.001)
        nearest_mm.append(np.abs(plan.motion.positions(t_s)[:, :2] - [80.0, 60.0]).max(axis=1).min())
    assert nearest_mm[0] < 1e-6
    assert nearest_mm[1] > 0.02


def test_the_document_has_axes_faults_and_places() -> None:
    steps = square()
    document = judged(change(steps, 1, lose(steps[1], 60, 1))).to_dict()
    fault = document["faults"][0]
    assert (document["passed"], document["rule"], document["estimated"]) == (False, "klipper", False)
    assert document["axes"][1] == {"name": "y", "start": 0, "end": 19, "planned_end_steps": 20.0, "steps": 219}
    assert (fault["kind"], fault["axis"], fault["steps"]) == ("lost", "y", -1)
    assert fault["from_s"] <= fault["pulse_s"] <= fault["until_s"]
    assert fault["from_joints"]["x"] == pytest.approx(4.0, abs=0.01)
    assert fault["from_mm"] == pytest.approx(5.5, abs=0.02)
