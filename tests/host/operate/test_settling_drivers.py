"""The host tells the firmware how long drivers take after ENABLE: then runs lose no step, and without it they do."""

from dataclasses import replace

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.operate.setting_up import axis_settings
from steptwin.host.planning.motions.composer import Composer
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.embedded.outcome import Outcome
from steptwin.protocol import od
from steptwin.protocol.drivers import DriverFigures

ROBOT = load_robot("lab-scara")
FIGURES = DriverFigures(
    microsteps=(1, 2, 8, 16), steplen_ns=4_000, stepspace_ns=4_000, dirsetup_ns=1_000, dirhold_ns=1_000
)


def with_drivers(name: str, figures: DriverFigures | None = None) -> Robot:
    return replace(ROBOT, board=replace(ROBOT.board, osc_pf=None, driver_profile=name, driver=figures))


def settling_us(robot: Robot) -> int:
    return axis_settings(robot.joints[0], robot.board).settling_us


@pytest.mark.parametrize(
    ("driver", "us"),
    [
        ("chip-330pf", 0),
        ("3a-module", 0),
        ("dm542", 0),  # 10 us: the frame that starts a motion comes later
        ("tb6600", 0),
        ("a4988", 1_000),
        ("drv8825", 1_700),
        ("dm542t", 200_000),
    ],
)
def test_drivers_ask_for(driver: str, us: int) -> None:
    robot = with_drivers(driver)
    assert settling_us(robot) == us
    objects = axis_settings(robot.joints[0], robot.board).objects()
    assert [value for address, value in objects if address == od.SETTLING_US] == [us] * bool(us)


@pytest.mark.parametrize(("enable_ns", "us"), [(44_000, 0), (44_001, 45), (1_000_000, 1_000), (1_000_001, 1_001)])
def test_a_time_by_hand_is_rounded_up(enable_ns: int, us: int) -> None:
    assert settling_us(with_drivers("generic", replace(FIGURES, enable_ns=enable_ns))) == us
    assert settling_us(with_drivers("generic", replace(FIGURES, wake_ns=enable_ns))) == us


def turned(robot: Robot, kernel: Kernel, drivers: str | None = None) -> Outcome:
    """Turn the upper arm a little as soon as the drives are on."""
    moves = Composer(robot, np.array(robot.home))
    moves.go_some({"th2": robot.home[1] + 2.0})
    return execute(plan(robot, moves.sequence()), "turn", kernel, driver_profile=drivers)


SLOW_NS = 3_000_000_000
"""Longer than the client waits for a state that comes at once."""


@pytest.mark.parametrize("name", ["dm542t", "generic"])
def test_a_run_waits_for_the_drivers_that_its_file_names(name: str, fast_kernel: Kernel) -> None:
    figures = replace(FIGURES, enable_ns=SLOW_NS) if name == "generic" else None
    outcome = turned(with_drivers(name, figures), fast_kernel)
    assert outcome.report.passed, outcome.report.reasons


@pytest.mark.slow
def test_drivers_that_are_slower_than_the_file_says_lose_steps(
    fast_kernel: Kernel, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A host that does not tell the firmware of the time: the driver's own limit is broken, and the run says so."""
    figures = replace(FIGURES, enable_ns=SLOW_NS)
    told = with_drivers("generic", figures)
    assert turned(told, fast_kernel).report.passed
    monkeypatch.setattr("steptwin.host.operate.setting_up._FRAME_NS", SLOW_NS)
    outcome = turned(told, fast_kernel)
    assert not outcome.report.passed
    assert {group.rule for group in outcome.report.violations} == {"enable_setup"}
