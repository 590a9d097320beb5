"""Homing finds coupled axes to the step that their switches and the motors before them allow, and campaigns know it."""

from collections.abc import Iterable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from steptwin.features.campaigns.recovery import Recovery, recover, steps_off, steps_off_max
from steptwin.features.campaigns.running import run_seed
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.machine.kernels import fastest_kernel
from tests.features.campaigns.campaigns import campaign_of
from tests.host.robots.coupled import DIRECT, TWO_TO_ONE, coupled_robot, coupled_text

FAULT_FREE = """
runs = 12
robots = ["belt.toml"]

[[motion]]
moves = 1
reach = { uniform = [0.02, 0.1] }

[vary]
microsteps = { choose = [2, 8, 16] }
"""


def _geared(coupling: str, shoulder: float, elbow: float) -> str:
    """Return a coupled arm whose motors turn so often for a turn of their axes, slow enough for all drivers."""
    before, after = coupled_text(coupling).replace("speed_max = 180.0", "speed_max = 90.0").split("[joints.th2]")
    ratio = "ratio = 4.0"
    return f"{before.replace(ratio, f'ratio = {shoulder}')}[joints.th2]{after.replace(ratio, f'ratio = {elbow}')}"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("coupling", "shoulder", "elbow", "seeds"),
    [("th2 = { th1 = 0.7 }", 2.5, 5.18, [0, 2, 8]), ("th2 = { th1 = 1.0 }", 1.0, 7.3, [5, 6])],
)
def test_a_run_without_a_fault_holds_though_the_elbow_s_edge_falls_between_two_of_its_steps(
    coupling: str, shoulder: float, elbow: float, seeds: Iterable[int], tmp_path: Path
) -> None:
    """Each of them ended in "homing found another position (th2: +1.4 steps)", of which 0.4 stood in the demand."""
    (tmp_path / "belt.toml").write_text(_geared(coupling, shoulder, elbow), encoding="utf-8")
    campaign = campaign_of(FAULT_FREE, tmp_path)
    assert [run_seed(campaign, seed).breaches for seed in seeds] == [() for _ in seeds]


def _allowed(robot: Robot, *, motors_turn: bool = False) -> list[float]:
    board: Any = SimpleNamespace(robot=robot, motors_turn=motors_turn)
    return steps_off_max(board)


def test_what_is_allowed_to_the_shoulder_comes_on_top_at_the_elbow_in_its_own_steps(teaching: Robot) -> None:
    """Alike motors: elbow axis = th2 + th1, or th2 + 2 th1. Uncoupled axes stay at a step, as the tool's."""
    assert _allowed(teaching) == [1.0, 1.0, 1.0, 1.0]
    assert _allowed(coupled_robot(DIRECT)) == [1.0, 2.0, 1.0, 1.0]
    assert _allowed(coupled_robot(TWO_TO_ONE)) == [1.0, 3.0, 1.0, 1.0]


def test_axes_pass_it_on_by_the_ratio_of_their_steps() -> None:
    """With 320 steps/mm at the lift and 17.78 steps/deg at the tool, 0.055556 mm/deg are a step for a step."""
    assert _allowed(coupled_robot("d3 = { th4 = 0.055556 }")) == pytest.approx([1.0, 1.0, 2.0, 1.0], abs=1e-4)
    chain = "th2 = { th1 = 1.0 }\nth4 = { th2 = 1.0 }"
    # At th4's edge: axis th4 = edge + th2, and th2 = axis th2 - axis th1; half as many steps a degree as these.
    assert _allowed(coupled_robot(chain)) == pytest.approx([1.0, 2.0, 1.0, 1.0 + 0.5 * 1.0 + 0.5 * 2.0])


def test_rotors_that_turn_may_lag_by_a_full_step_each() -> None:
    """16 microsteps at the arm's axes and at the tool, 8 at the lift."""
    assert _allowed(coupled_robot(DIRECT), motors_turn=True) == [17.0, 34.0, 9.0, 17.0]


@pytest.fixture
def belt_board() -> EmbeddedBoard:
    robot = coupled_robot(TWO_TO_ONE)
    return EmbeddedBoard(robot, fastest_kernel())


@pytest.mark.slow
@pytest.mark.parametrize(("steps", "told"), [(3.0, ""), (-3.0, ""), (3.1, "+3.1"), (-3.1, "-3.1")])
def test_a_recovery_takes_the_elbow_up_to_that_limit_and_no_farther(
    steps: float, told: str, belt_board: EmbeddedBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    def off(board: EmbeddedBoard, units: list[int]) -> list[float]:
        shoulder, _, *others = steps_off(board, units)
        return [shoulder, steps, *others]

    monkeypatch.setattr("steptwin.features.campaigns.recovery.steps_off", off)
    detail = f"th2: its motor stands {told} steps from where its drive reports it; homing may be off by up to 3"
    assert recover(belt_board) == (Recovery("homing found another position", detail) if told else Recovery())
