"""Robots of the campaigns' tests."""

import pytest

from steptwin.host.robots import load_robot
from steptwin.host.robots.robot import Robot


@pytest.fixture(scope="session")
def teaching() -> Robot:
    return load_robot("teaching-scara")
