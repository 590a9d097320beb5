"""A recovered machine homes when its rotors stand; one that never stands is homed all the same."""

from contextlib import nullcontext
from math import cos, exp, pi
from types import SimpleNamespace
from typing import Any

import pytest

from steptwin.features.campaigns.recovery import _let_settle
from steptwin.host.robots.robot import Robot


class Swinging:
    """A board of which one rotor swings by a full step and 8 Hz, less and less."""

    def __init__(self, robot: Robot, damping_per_s: float) -> None:
        self.robot = robot
        self._damping_per_s = damping_per_s
        self._now_s = 0.0

    def now_s(self) -> float:
        return self._now_s

    def wait(self, dt_s: float) -> None:
        self._now_s += dt_s

    def rotor_positions(self) -> list[float]:
        steps = self.robot.joints[1].transmission.microsteps
        swing = steps * exp(-self._damping_per_s * self._now_s) * cos(2 * pi * 8 * self._now_s)
        return [0.0, 100.0 + swing, *(0.0 for _ in self.robot.joints[2:])]


@pytest.mark.parametrize(
    ("damping_per_s", "least_s", "most_s"), [(1000.0, 0.1, 0.3), (2.0, 1.4, 1.8), (0.0, 10.0, 10.2)]
)
def test_a_recovery_waits_until_a_rotor_swings_by_less_than_a_tenth_of_a_full_step(
    damping_per_s: float, least_s: float, most_s: float, teaching: Robot
) -> None:
    """By up to 0.05 of a full step to either side: with 2/s after ln(20) / 2 = 1.5 s."""
    board: Any = Swinging(teaching, damping_per_s)
    charge = SimpleNamespace(enable=lambda: None)
    session: Any = SimpleNamespace(charge=lambda *_, **__: nullcontext(charge))
    _let_settle(session, board)
    assert least_s - 1e-9 <= board.now_s() <= most_s
