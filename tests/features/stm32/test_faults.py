"""Faults of the machine while an image drives it, and a small campaign of them."""

import pickle
from pathlib import Path

import pytest

from steptwin.features.faults.options import FaultOptions
from steptwin.features.stm32.running import ImageRun, RunPlan, run_image
from steptwin.host.common.errors import InputError
from steptwin.host.robots.reader import parse_robot
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.machine_options import MachineOptions, read_extras
from steptwin.protocol.timer import COUNTS_PER_MS
from tests.features.stm32.examples import EXAMPLES, ROBOT, example_board, example_robot


def _run(name: str, scenario: str, tmp_path: Path, for_s: float, robot: Robot | None = None) -> ImageRun:
    (path := tmp_path / "faults.toml").write_text(f'name = "faults"\n{scenario}', encoding="utf-8")
    robot = robot or example_robot()
    machine = MachineOptions(extras=read_extras([FaultOptions(scenario=str(path))], robot))
    plan = RunPlan(for_s=for_s, machine=machine, compiled=False)
    return run_image(EXAMPLES / f"{name}.elf", robot, plan)


def _fault(**keys: object) -> str:
    written = {key: f'"{value}"' if isinstance(value, str) else str(value).lower() for key, value in keys.items()}
    return "[[fault]]\n" + "".join(f"{key} = {value}\n" for key, value in ({"at_s": "0.005"} | written).items())


@pytest.mark.parametrize(
    ("fault", "steps", "reason"),
    [
        (_fault(do="wire", joint="left", wire="step", condition="low"), [2, -6], ""),
        (_fault(do="wire", joint="right", wire="dir", condition="high"), [6, 2], ""),
        (
            _fault(do="wire", joint="left", wire="enable", condition="low"),
            [2, -6],
            "left: STEP while ENABLE was off: step missed: 4 times, first at 0.005014 s",
        ),
        (_fault(do="short-circuit", joint="left", shorted=True), [6, -6], "left: short circuit in the motor"),
        (_fault(do="temperature", temperature_degc=120.0), [6, -6], ""),
    ],
)
def test_what_befalls_the_drivers(fault: str, steps: list[int], reason: str, tmp_path: Path) -> None:
    run = _run("compare_stepper", fault, tmp_path, 0.01)
    assert [axis.steps for axis in run.axes] == steps
    assert all(reason in each for each in run.reasons)
    assert bool(run.reasons) == bool(reason)
    (struck,) = run.happened["faults"]
    assert (struck["struck_s"], struck["strikes"], struck["emcys"]) == (0.005, 1, [])


@pytest.mark.slow  # three images in plain Python
@pytest.mark.parametrize("do", ["watchdog", "brown-out"])
def test_a_board_that_restarts_begins_its_image_again(do: str, tmp_path: Path) -> None:
    run = _run("compare_stepper", _fault(do=do, for_ms=2), tmp_path, 0.01)
    undisturbed = _run("compare_stepper", _fault(do="temperature", temperature_degc=25.0), tmp_path, 0.003)
    before, after = 2, undisturbed.axes[0].steps  # 3 ms after its start at 7 ms
    assert [axis.steps for axis in run.axes] == [before + after, -before - after]
    assert run.sent == {"USART1": "ready\n"}
    with pytest.raises(InputError, match=r"^the board has no power now: its chip has no state; "):
        _run("compare_stepper", _fault(do=do, for_ms=20), tmp_path, 0.01)


def _reading(key: str, switches: str = "") -> Robot:
    """Return the robot with an input at PA5, which ends the motion of the SysTick stepper when it is low."""
    text = ROBOT.read_text(encoding="utf-8").replace('enable = "PA4"', f'enable = "PA4"\n{key} = "!PA5"', 1)
    if key == "protect":
        text = text.replace('"dm542"', '"3a-module"').replace("current_a = 1.91", "current_a = 1.9")
    return parse_robot(text.replace("[home]", f"{switches}[home]"), "arm.toml")


@pytest.mark.slow  # a fortieth of a second of SysTick at 20 kHz in plain Python, five times
@pytest.mark.parametrize(
    ("key", "fault", "hits"),
    [
        ("estop", _fault(do="estop", pressed=True, at_s=0.02), True),
        ("protect", _fault(do="estop", pressed=True, at_s=0.02), False),
        ("protect", _fault(do="protect", joint="left", held=True, at_s=0.02), True),
        ("positive_limit", _fault(do="switch", joint="left", switch="+", stuck="closed", at_s=0.02), True),
        ("positive_limit", _fault(do="switch", joint="left", switch="+", stuck="open", at_s=0.02), False),
    ],
)
def test_inputs_that_the_image_reads(key: str, fault: str, hits: bool, tmp_path: Path) -> None:
    robot = _reading(key, "[joints.left.switches]\npositive_limit = 101.0\n\n")
    run = _run("systick_stepper", fault, tmp_path, 0.025, robot)
    assert run.sent == {"USART1": "ready\nlimit\n" if hits else "ready\n"}
    assert (run.axes[0].pulses > 3) != hits


def test_a_scenario_in_a_test_of_an_image(tmp_path: Path) -> None:
    (path := tmp_path / "faults.toml").write_text(
        _fault(do="wire", joint="left", wire="step", condition="broken", at_s=0.012), encoding="utf-8"
    )
    faults = FaultOptions(scenario=str(path)).read_for(example_robot(), tmp_path)
    board, tools = example_board("compare_stepper", faults)
    tools.wait(0.01)
    assert board.happened()["faults"][0]["struck_s"] == 0.012
    assert board.pins("left").clk_rise_counts[-1] < 12 * COUNTS_PER_MS < tools.pin("PA0").history[-1].t_s * 72e6


def _row(seed: int, tmp_path: Path) -> tuple[object, ...]:
    """Return the row of a campaign's run: a wire breaks at a time that the seed draws."""
    broken = _fault(do="wire", joint="left", wire="step", condition="broken")
    scenario = f"seed = {seed}\n" + broken.replace("at_s = 0.005", "at_random = { from_s = 0.001, to_s = 0.009 }")
    run = _run("compare_stepper", scenario, tmp_path, 0.01)
    assert pickle.loads(pickle.dumps(run)) == run  # as it comes from a worker of Dask
    return (seed, run.happened["faults"][0]["struck_s"], *(axis.steps for axis in run.axes), run.reasons)


@pytest.mark.slow  # eight images in plain Python
def test_the_rows_of_a_campaign_are_those_of_their_seeds(tmp_path: Path) -> None:
    rows = [_row(seed, tmp_path) for seed in range(4)]
    assert rows == [_row(seed, tmp_path) for seed in range(4)]
    assert len({row[1] for row in rows}) == 4
    assert {row[2] for row in rows} > {rows[0][2]}
    assert {row[3] for row in rows} == {-6}
