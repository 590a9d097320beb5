"""A robot file that names its drivers has pulses that they count: both sides of each limit, as documents have them."""

from dataclasses import replace
from typing import Any

import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.robots import load_robot
from steptwin.host.robots.board_settings import BoardSettings
from steptwin.protocol.drivers import ActiveEdge
from tests.messages import refusing

BOARD = replace(
    load_robot("lab-scara").board, osc_pf=None, driver_profile="dm542", dirsetup_ns=50_000, dirhold_ns=50_000
)


@pytest.mark.parametrize(
    ("driver", "key", "least_ns"),
    [
        ("chip-330pf", "steplen_ns", 30_000),
        ("3a-module", "steplen_ns", 30_000),
        ("tb6600", "steplen_ns", 5_000),
        ("tb6600", "stepspace_ns", 5_000),
        ("tb6600", "dirsetup_ns", 5_000),
        ("tb6600", "dirhold_ns", 5_000),
        ("dm542", "dirsetup_ns", 5_000),
        ("dm542t", "dirhold_ns", 10_000),
        ("a4988", "dirsetup_ns", 200),
        ("drv8825", "dirhold_ns", 650),
        ("tmc2209", "dirsetup_ns", 20),
    ],
)
def test_pulses_too_short_for_the_chip_are_refused(driver: str, key: str, least_ns: int) -> None:
    def board(time_ns: int) -> BoardSettings:
        changed: dict[str, Any] = {key: time_ns}
        return replace(BOARD, driver_profile=driver, **changed)

    assert getattr(board(least_ns), key) == least_ns
    with refusing(InputError):
        board(least_ns - 1)


def test_a_falling_edge_holds_dir_from_the_rise_on() -> None:
    falling = replace(BOARD, active_edge=ActiveEdge.FALLING, steplen_ns=20_000)
    assert replace(falling, dirhold_ns=30_000).dirhold_ns == 30_000
    with refusing(InputError):
        replace(falling, dirhold_ns=29_999)


def test_more_steps_than_the_chip_counts_are_refused() -> None:
    assert replace(BOARD, driver_profile="chip-330pf", step_rate_max_hz=15_000).step_rate_max_hz == 15_000
    with refusing(InputError):
        replace(BOARD, driver_profile="chip-330pf", step_rate_max_hz=15_001, stepspace_ns=30_000)
