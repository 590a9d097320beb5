"""Arms search their switches as their makers have it: J1 to J6 one after the other, each on its own side."""

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.operate.homing import home_robot
from steptwin.host.operate.session import Session
from steptwin.host.operate.status import read_status
from steptwin.host.robots import load_robot
from steptwin.host.twin.board_under_test import BoardUnderTest
from tests.host.client.test_homing import how, machine_of, reported_steps

AR4 = load_robot("ar4-mk3")
METHODS = (18, 17, 18, 17, 17, 18)
"""The sketch's CalDir 1 0 1 0 0 1: to the positive limit switch for 1, to the negative one for 0."""
EDGES_DEG = (172.0, -44.0, 54.0, -182.0, -107.0, 182.0)
"""Where the switches close."""


def test_the_methods_and_sides_of_the_file() -> None:
    assert tuple(joint.homing.method for joint in AR4.joints if joint.homing) == METHODS
    sides = [(joint.switches.negative_limit, joint.switches.positive_limit) for joint in AR4.joints]
    assert sides == [(None, at) if at > 0 else (at, None) for at in EDGES_DEG]


@pytest.mark.slow
def test_one_after_the_other_each_to_its_side(fast_kernel: Kernel) -> None:
    """After each search its joint stands within half a degree of its switch, and the later ones where they stood."""
    board, machine = machine_of(AR4, list(AR4.home), fast_kernel)
    stood = board.driver_positions()
    seen: list[list[int]] = []
    machine.home_axes(how(AR4), lambda _: seen.append(board.driver_positions()))
    assert len(seen) == 6
    for i, positions in enumerate(seen):
        reached_deg = np.divide(positions, AR4.steps_per_unit)[: i + 1]
        assert reached_deg == pytest.approx(EDGES_DEG[: i + 1], abs=0.5)
        assert positions[i + 1 :] == stood[i + 1 :]
    assert reported_steps(AR4, machine) == board.driver_positions()


PAROL6 = load_robot("parol6")
PAROL6_STEPS = (10240 - 13500, -32000 - 19588, 57905 - 23020, 0 + 10200, 0 - 8900, 32000)
"""Where the firmware's switches are: its stand-by position less its way from the switch. J6's is stand-by itself."""


def test_the_parol6s_switches_are_those_of_its_firmware() -> None:
    """They close as J4 comes from below and the others from above; the firmware's microstep is 0.05625 deg."""
    assert [joint.homing.method for joint in PAROL6.joints if joint.homing] == [22, 22, 22, 20, 22, 22]
    for joint, steps in zip(PAROL6.joints, PAROL6_STEPS, strict=True):
        at = joint.switches.home_from if joint.name == "J4" else joint.switches.home_to
        assert at == pytest.approx(0.05625 * steps / joint.transmission.ratio, abs=6e-4)


@pytest.mark.slow
@pytest.mark.parametrize("start", [(90, -90, 180, 0, 0, 180), (-100, -20, 280, -100, 80, 10)])
def test_the_parol6_finds_its_switches(fast_kernel: Kernel, start: tuple[float, ...]) -> None:
    """From stand-by, and from where J1 and J6 stand within their switches and leave them first."""
    board, machine = machine_of(PAROL6, list(start), fast_kernel)
    machine.home_axes(how(PAROL6))
    reached = board.driver_positions()
    assert reported_steps(PAROL6, machine) == reached
    apart_deg = np.divide(np.subtract(reached, PAROL6_STEPS), PAROL6.steps_per_unit)
    assert np.all(np.abs(apart_deg) < 0.7)  # it brakes behind the edge


THOR = load_robot("thor")


@pytest.mark.slow
def test_thor_homes_its_coupled_wrist_and_both_shoulder_motors(fast_kernel: Kernel) -> None:
    """From where it stands askew: all seven axes end where they say that they are, to a step."""
    board = BoardUnderTest(THOR, stand_at=[20.0, -10.0, -70.0, 15.0, -30.0, -25.0], kernel=fast_kernel)
    session = Session(board, THOR)
    home_robot(session)
    status = read_status(session)
    assert [axis.name for axis in status.axes] == [*THOR.joint_names, "J2b"]
    assert all(axis.position_known for axis in status.axes)
    told = [axis.position for axis in status.axes[:6]]
    steps_deg = 2.0 / np.array(THOR.steps_per_unit[:6])
    assert np.all(np.abs(np.subtract(told, THOR.home)) <= steps_deg)
    really = THOR.coupling.to_joints(np.divide(board.motor_positions(), THOR.steps_per_unit))
    assert np.all(np.abs(really - THOR.home) <= steps_deg)
