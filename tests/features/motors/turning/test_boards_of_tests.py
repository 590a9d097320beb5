"""What the boards of tests say of motors that turn: rotors that have slipped, homings that stall."""

from dataclasses import replace

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.motors.options import MotorOptions
from steptwin.host.client.monitor import Decoder
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.plan import Plan
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.twin.board_under_test import BoardUnderTest
from tests.host.twin.embedded.test_excitation import Master

pytest_plugins = ["pytester"]

TEACHING = load_robot("teaching-scara")


@pytest.fixture(scope="module")
def standing() -> Plan:
    """A motion whose verdict says nothing of the first joint's speed: only what stands beside the steps is asked."""
    return plan(TEACHING, make_job(TEACHING, "carry", {}))


def test_a_rotor_that_slips_is_named(standing: Plan, fast_kernel: Kernel) -> None:
    """A payload of 200 kg is too heavy for a turn by 5 degrees; the drivers' counts alone show nothing."""
    assert TEACHING.dynamics is not None
    robot = replace(TEACHING, dynamics=replace(TEACHING.dynamics, payload_kg=200.0))
    board = BoardUnderTest(robot, kernel=fast_kernel, extras=[MotorOptions(motors=True)])
    master = Master(board, "th1")
    master.enable()
    assert not any("slips" in reason for reason in board.verify(standing.motion).reasons)
    master.move_to(5.0, 0.3)
    assert board.slipped()["th1"] != 0
    (said,) = [reason for reason in board.verify(standing.motion).reasons if "slips" in reason]
    assert said.startswith("th1: ")
    assert said.endswith(f"ends {abs(board.slipped()['th1'])} full steps away")


@pytest.mark.slow
def test_a_failure_with_motors_names_the_homings_that_stall(pytester: pytest.Pytester, fast_kernel: Kernel) -> None:
    steep = load_robot("lab-scara").toml.replace("acceleration = 45.0", "acceleration = 720.0")
    pytester.path.joinpath("steep.toml").write_text(steep)
    code = """
        import pytest
        from steptwin.features.motors.options import MotorOptions

        @pytest.mark.steptwin("steep.toml", extras=[MotorOptions(motors=True)])
        def test_board(steptwin_board):
            assert not steptwin_board
        """
    Decoder({})  # pytester forgets a test's first imports, and numba cannot be imported twice
    BoardUnderTest(load_robot("lab-scara"), kernel=fast_kernel)
    pytester.makepyfile(code)
    result = pytester.runpytest("-p", "no:cacheprovider")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*Captured steptwin motors (SIMULATED) teardown*", "th2: homing * at 720*"])
