"""A robot file names its drivers and leaves their times out, or describes drivers of its own in [board.driver]."""

import re

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.common.errors import InputError
from steptwin.host.planning.motions.sampled import c2_spline
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot, read_robot
from steptwin.host.robots.board_settings import pulses_for
from steptwin.host.robots.new_file import robot_text, with_settings
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.machine.drivers import driver_profile, fitted_module
from steptwin.protocol.drivers import GENERIC, PROFILES, ActiveEdge, driver_names
from tests.messages import refusing

TOML = load_robot("lab-scara").toml
BOARD = re.search(r"\[board\]\n(?:.+\n)+", TOML)
TIMES = ("steplen_ns", "stepspace_ns", "dirsetup_ns", "dirhold_ns", "step_rate_max_hz")
TABLE = """
[board.driver]
microsteps = [1, 2, 8, 16]
steplen_ns = 5_000
stepspace_ns = 6_000
dirsetup_ns = 7_000
dirhold_ns = 20_000
"""


def with_board(lines: str) -> Robot:
    """Return the laboratory arm with these lines in place of its drivers and their times."""
    assert BOARD is not None
    return read_robot(TOML.replace(BOARD.group(0), f"[board]\nbitrate = 1_000_000\n{lines}\n"))


def wrong(lines: str) -> list[str]:
    with pytest.raises(InputError) as raised:
        with_board(lines)
    return list(raised.value.messages)


def passes(robot: Robot, kernel: Kernel) -> None:
    """Run a motion of a second in which every joint goes up, down and back."""
    there = np.array(robot.home) + np.outer([0.0, 2.0, -2.0, 0.0], np.ones(len(robot.home)))
    motion = c2_spline(robot.joint_names, np.array([0.0, 0.3, 0.7, 1.0]), there)
    outcome = execute(plan(robot, motion), "up-and-down", kernel)
    assert outcome.report.passed, outcome.report.reasons
    assert outcome.comparison.evidence.axes[0].violations.counts.size == 0


@pytest.mark.parametrize(
    ("driver", "times"),
    [
        ("chip-330pf", (30_000, 36_667, 0, 0, 14_999)),
        ("3a-module", (30_000, 36_667, 23_925, 0, 14_999)),
        ("a4988", (4_000, 4_000, 200, 200, 125_000)),
        ("drv8825", (4_000, 4_000, 650, 650, 125_000)),
        ("tmc2209", (4_000, 4_000, 20, 20, 125_000)),
        ("dm542", (4_000, 4_000, 5_000, 10_000, 125_000)),
        ("tb6600", (5_000, 5_000, 5_000, 5_000, 100_000)),
    ],
)
def test_times_left_out_are_the_drivers_and_lose_no_step(
    driver: str, times: tuple[int, ...], fast_kernel: Kernel
) -> None:
    """At least what firmware can make, 4 us."""
    robot = with_board(f'driver_profile = "{driver}"')
    assert tuple(getattr(robot.board, key) for key in TIMES) == times
    passes(robot, fast_kernel)


def test_a_falling_edges_dir_holds_from_the_rise_on() -> None:
    assert tuple(pulses_for(PROFILES["slow-blue-board"]).values()) == (150_000, 150_000, 150_000, 300_000, 3_333)


def test_times_that_are_given_count_and_are_checked() -> None:
    board = with_board('driver_profile = "tb6600"\ndirsetup_ns = 9_000').board
    assert (board.dirsetup_ns, board.dirhold_ns) == (9_000, 5_000)
    (told,) = wrong('driver_profile = "tb6600"\ndirsetup_ns = 4_999')
    assert told == "board.dirsetup_ns: 4999 ns is too short for tb6600: at least 5000 ns"


def test_without_a_profile_they_are_needed() -> None:
    missing = [f"board.{key}: is missing" for key in TIMES]
    assert wrong("osc_pf = 330") == missing


def test_an_unknown_profile_is_one_mistake() -> None:
    assert wrong('driver_profile = "genric"') == ["board.driver_profile: 'genric' is unknown: did you mean generic?"]


@pytest.mark.parametrize("edge", list(ActiveEdge))
def test_a_generic_driver_of_either_edge_runs(edge: ActiveEdge, fast_kernel: Kernel) -> None:
    robot = with_board(f'driver_profile = "generic"\nactive_edge = "{edge}"{TABLE}')
    falling = edge is ActiveEdge.FALLING
    times = (6_000, 5_000, 7_000, 26_000, 90_909) if falling else (5_000, 6_000, 7_000, 20_000, 90_909)
    assert tuple(getattr(robot.board, key) for key in TIMES) == times
    passes(robot, fast_kernel)


def test_a_falling_edges_phases_are_the_other_way_round() -> None:
    lines = f'driver_profile = "generic"\nactive_edge = "falling"\nstepspace_ns = 4_999{TABLE}'
    assert wrong(lines) == ["board.stepspace_ns: 4999 ns is too short for generic: at least 5000 ns"]
    assert with_board(lines.replace("4_999", "5_000")).board.stepspace_ns == 5_000


def test_figures_that_are_none_are_told_together() -> None:
    table = """
[board.driver]
microsteps = [1, 3]
steplen_ns = 5_000
stepspace_ns = 500_001
dirsetup_ns = -1
enable_ns = 10_000_000_001
step_rate_max_hz = 0
input_high_v = 101
"""
    assert wrong(f'driver_profile = "generic"{table}') == [
        "board.driver.microsteps[1]: 3 is not one of 1, 2, 4, 5, 8, 10, 16, 20, 25, 32, 40, 50, 64, 100, 125, 128, 256",
        "board.driver.stepspace_ns: 500001 ns is outside 0..500000 ns",
        "board.driver.dirsetup_ns: -1 ns is outside 0..500000 ns",
        "board.driver.dirhold_ns: is missing",
        "board.driver.enable_ns: 10000000001 ns is outside 0..10000000000 ns",
        "board.driver.step_rate_max_hz: 0 is below 1",
        "board.driver.input_high_v: 101.0 V is outside 0..100 V; the nearest is 100 V",
    ]
    assert wrong('driver_profile = "generic"\n[board.driver]\nmicrosteps = []')[0] == (
        "board.driver.microsteps: is empty; it lists the microsteps that the driver has"
    )


def test_table_and_name_belong_together() -> None:
    assert wrong('driver_profile = "generic"') == [
        "board.driver: is missing; driver_profile generic needs this table (docs/driver.md)"
    ]
    assert wrong(f'driver_profile = "tb6600"{TABLE}') == [
        'board.driver: tb6600 has its own; driver_profile = "generic" takes these'
    ]


def test_the_option_needs_the_files_figures() -> None:
    board = load_robot("lab-scara").board
    with refusing(InputError):
        driver_profile(board, GENERIC)
    own = with_board(f'driver_profile = "generic"{TABLE}').board
    assert driver_profile(own, GENERIC) == driver_profile(own) == own.profile
    assert driver_profile(own, "a4988").name == "a4988"
    with refusing(InputError):
        driver_profile(board, "generics")
    assert driver_names()[-1] == GENERIC


def test_microsteps_that_a_generic_driver_lacks() -> None:
    told = wrong(f'driver_profile = "generic"{TABLE.replace("1, 2, 8, 16", "1, 16")}')
    assert told[0] == "joints.d1.microsteps: 8 is not one of generic's 1, 16: the nearest are 1 and 16"


@pytest.mark.parametrize("driver", ["drv8825", "tmc2209", "tmc5160"])
def test_a_fault_output_is_wired_where_there_is_one(driver: str) -> None:
    lines = f'driver_profile = "{driver}"\nfault_wired = '
    for wired in (True, False):
        board = with_board(lines + str(wired).lower()).board
        assert fitted_module(board, board.profile, 8).fault_wired == wired
    assert not fitted_module(board, driver_profile(board, "drv8825"), 8).fault_wired


@pytest.mark.parametrize("drivers", ["osc_pf = 330", 'driver_profile = "a4988"', 'driver_profile = "3a-module"'])
def test_drivers_without_a_terminal_for_it_are_refused(drivers: str) -> None:
    times = "".join(f"{key} = 30_000\n" for key in TIMES[:4])
    told = wrong(f"{drivers}\nfault_wired = true\n{times}step_rate_max_hz = 15_000")
    assert [line.partition(" has no terminal ")[2] for line in told] == [
        "that tells of a fault; drv8825, tmc2209, tmc5160 have"
    ]


@pytest.mark.parametrize("driver", ["a4988", "drv8825", "tmc2209", "dm542", "tb6600", "3a-module"])
def test_the_note_of_a_new_file_is_a_recipe(driver: str) -> None:
    """One line in place of six, as it says, and the file is one of these drivers."""
    text = robot_text("mine", "cartesian", *with_settings("cartesian", {}))
    assert text.count('# For drivers other than TB6560s on the board: driver_profile = "a4988" or another') == 1
    six = re.search(r"osc_pf = 330(?:.+\n){6}", text)
    assert six is not None
    board = read_robot(text.replace(six.group(0), f'driver_profile = "{driver}"\n')).board
    assert board.profile is PROFILES[driver]
