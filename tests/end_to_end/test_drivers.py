"""Runs with drivers that planner and firmware do not know of, and with those that a robot's file names."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.cli.app import run
from steptwin.host.common.errors import InputError
from steptwin.host.planning.jobs import make_job
from steptwin.host.planning.planner import plan
from steptwin.host.robots import load_robot
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.embedded.execution import execute
from steptwin.host.twin.embedded.outcome import Outcome
from steptwin.host.twin.machine.boards import board_configs
from steptwin.host.twin.machine.drivers import phase_currents_a, settings_left_out
from steptwin.host.twin.machine.machine_options import MachineOptions
from steptwin.protocol.drivers import PROFILES
from tests.end_to_end.command_line import refusal, run_json
from tests.messages import refusing

QUICK = {"duration_s": "2", "ramp_s": "0.5"}
"""Options of a drawer pull: the same steps as in the usual 10 s."""
PULL_LINE = [
    "run",
    "warehouse-scara",
    "pull-line",
    *(word for pair in QUICK.items() for word in ("-o", "=".join(pair))),
]
SPIRAL = ["run", "lab-scara", "spiral"]


def with_board(name: str, **settings: object) -> Robot:
    robot = load_robot(name)
    return dataclasses.replace(robot, board=dataclasses.replace(robot.board, **settings))  # type: ignore[arg-type]


def executed(robot: Robot, job: str, kernel: Kernel, **options: str) -> Outcome:
    return execute(plan(robot, make_job(robot, job, options)), job, kernel)


@pytest.mark.slow
def test_by_default_nothing_is_broken(capsys: pytest.CaptureFixture[str]) -> None:
    document = run_json(capsys, *PULL_LINE)
    assert document["driver_profile"] == "chip-330pf"
    assert document["violations"] == []


class TestSlowBlueBoard:
    OPTIONS = ("--machine", "driver-profile=slow-blue-board")

    @pytest.mark.slow
    def test_misses_every_step(self, capsys: pytest.CaptureFixture[str]) -> None:
        """STEP is high for 33 us before the edge that steps; the board needs 150 us."""
        document = run_json(capsys, *PULL_LINE, *self.OPTIONS, exit_code=1)
        assert document["passed"] is False
        assert document["driver_profile"] == "slow-blue-board"
        moved = [axis for axis in document["axes"] if axis["pulses"]]
        assert [axis["name"] for axis in moved] == ["th1", "th2", "th3"]
        for axis, group in zip(moved, document["violations"], strict=True):
            assert axis["violations"] == axis["pulses"] == group["count"]
            assert axis["steps_end"] == axis["steps_start"]
            assert axis["position_error_steps_max"] > 700
            assert (group["axis"], group["rule"], group["unit"]) == (axis["name"], "clk_low", "us")
            assert (group["worst"], group["limit"]) == (33, 150)
            assert 0 < group["first_s"] < 2
            assert "step missed" in group["broken"]
            assert "LinuxCNC" in group["source"]
            assert axis["active_edge"] == "falling"
            assert axis["clk_low_us_min"] == group["worst"]
            assert axis["clk_high_us_min"] > 600
        assert document["tool"]["position_error_mm_max"] > 100

    @pytest.mark.slow
    def test_the_report_for_people_names_the_broken_limit(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert run([*PULL_LINE, *self.OPTIONS]) == 1
        lines = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
        (heading,) = [i for i, line in enumerate(lines) if line.startswith("CLK low too short before its rise")]
        assert "drivers: slow-blue-board" in lines
        assert lines[heading - 1] == "CLK: high at least 671.17 us, low at least 33.00 us, low while STEP is high"
        assert lines[heading].endswith("(LinuxCNC settings passed on for blue TB6560 boards: 150 us, falling edge)")
        assert lines[heading + 1].split() == ["axis", "times", "worst", "us", "limit", "us", "first", "s"]
        assert lines[heading + 3].split()[:4] == ["th1", "1846", "33.00", "150.00"]
        assert lines[heading + 4].split()[0] == "th2"
        assert any("FAILED" in line for line in lines)

    @pytest.mark.slow
    def test_leaves_its_violations_in_the_folder(self, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
        run_json(capsys, *PULL_LINE, *self.OPTIONS, "--out", str(tmp_path), exit_code=1)
        with np.load(tmp_path / "edges.npz") as edges:
            assert edges["th1_violation_counts"].size == edges["th1_clk_rise_counts"].size == 1846
            assert np.array_equal(edges["th1_violation_counts"], edges["th1_clk_fall_counts"])
            assert set(edges["th1_violation_values"]) == {33.0}
            assert set(edges["th1_limit_values"][edges["th1_violation_which"]]) == {150.0}
            assert edges["sx_violation_counts"].size == edges["sx_violation_which"].size == 0
        assert json.loads((tmp_path / "report.json").read_text())["violations"][0]["count"] == 1846

    @pytest.mark.slow
    def test_with_the_times_that_it_asks_for(self, fast_kernel: Kernel) -> None:
        """The falling edge steps, so DIR must hold for 150 us after the pulse."""
        robot = with_board(
            "warehouse-scara",
            osc_pf=None,
            driver_profile="slow-blue-board",
            steplen_ns=160_000,
            stepspace_ns=160_000,
            dirsetup_ns=150_000,
            dirhold_ns=320_000,
            step_rate_max_hz=3_000,
        )
        outcome = executed(robot, "pull-line", fast_kernel, **QUICK)
        assert outcome.report.passed, outcome.report.reasons
        assert outcome.driver_profile == "slow-blue-board"
        assert outcome.report.axes[4].reversals == 1


class TestThreeAmpModule:
    """DIR takes 24 us to fall, STEP hardly any time: the robots' 15 us of setup are too short for some reversals."""

    @pytest.mark.slow
    def test_a_late_dir_steps_the_wrong_way(self, capsys: pytest.CaptureFixture[str]) -> None:
        document = run_json(capsys, *SPIRAL, "--machine", "driver-profile=3a-module", exit_code=1)
        (group,) = document["violations"]
        assert (group["axis"], group["rule"], group["count"], group["worst"]) == ("th2", "dir_setup", 1, 15)
        assert group["limit"] == pytest.approx(23.92, abs=0.01)
        right = {axis["name"]: axis for axis in run_json(capsys, *SPIRAL)["axes"]}
        wrong = {axis["name"]: axis for axis in document["axes"]}
        assert wrong["th2"]["pulses"] == right["th2"]["pulses"]
        assert abs(wrong["th2"]["steps_end"] - right["th2"]["steps_end"]) == 2
        assert wrong["th3"] == right["th3"]

    @pytest.mark.slow
    @pytest.mark.parametrize("name", ["lab-scara", "hybrid-arm"])
    def test_passes_with_enough_setup(self, name: str, fast_kernel: Kernel) -> None:
        jobs: dict[str, tuple[str, dict[str, str]]] = {
            "lab-scara": ("spiral", {}),
            "hybrid-arm": ("five-points", {"turns": "3"}),  # with three turns a slider reverses, too
        }
        job, options = jobs[name]
        robot = with_board(name, osc_pf=None, driver_profile="3a-module", dirsetup_ns=24_000)
        outcome = executed(robot, job, fast_kernel, **options)
        assert outcome.report.passed, outcome.report.reasons
        short = dataclasses.replace(robot, board=dataclasses.replace(robot.board, dirsetup_ns=15_000))
        assert not executed(short, job, fast_kernel, **options).report.passed

    def test_has_no_other_currents_than_its_switches(self) -> None:
        with refusing(InputError):
            with_board("teaching-scara", osc_pf=None, driver_profile="3a-module", current_a=1.3)

    @pytest.mark.parametrize(
        ("own", "named", "full_a", "edge"),
        [
            pytest.param("3a-module", None, 2, "falling", id="the file's"),
            pytest.param("3a-module", "3a-module", 2, "falling", id="the file's by name"),
            pytest.param("3a-module", "slow-blue-board", 1.5, "falling", id="others"),
            pytest.param("3a-module", "chip-330pf", 1.5, "rising", id="other chips"),
            pytest.param(None, "chip-330pf", 2, "falling", id="the file's chips by name"),
            pytest.param(None, "chip-100pf", 1.5, "rising", id="chips with another capacitor"),
        ],
    )
    def test_settings_of_the_file_are_for_the_drivers_of_the_file(
        self, own: str | None, named: str | None, full_a: float, edge: str
    ) -> None:
        """The file's 2 A and falling edge apply exactly where the drivers are the file's, by whatever name."""
        osc_pf = None if own else 330
        robot = with_board("lab-scara", osc_pf=osc_pf, driver_profile=own, current_a=2.0, active_edge="falling")
        for module in board_configs(robot, MachineOptions(driver_profile=named))[0].modules:
            torque = 1.0
            if module.switches is not None:
                torque = (module.chip.torque_percent.value.selected(module.switches.running) or 0) / 100
            assert module.full_a * torque == pytest.approx(full_a, abs=0.1)
            assert module.active_edge == edge

    @pytest.mark.parametrize(("named", "left_out"), [("chip-330pf", False), ("chip-100pf", True)])
    def test_what_is_left_out_is_said(
        self, named: str, left_out: bool, capsys: pytest.CaptureFixture[str], tmp_path: Path
    ) -> None:
        path = tmp_path / "mine.toml"
        path.write_text(load_robot("teaching-scara").toml.replace("osc_pf = 330", "osc_pf = 330\ncurrent_a = 2.0", 1))
        assert run(["run", str(path), "carry", "--machine", f"driver-profile={named}", "--json"]) == 0
        warning = "--machine driver-profile=chip-100pf: has its usual settings, not the robot's current_a"
        assert (f"steptwin: warning: {warning}\n" in capsys.readouterr().err) == left_out

    def test_the_file_does_not_say_how_other_drivers_are_set(self, fast_kernel: Kernel) -> None:
        robot = with_board("teaching-scara", current_a=1.3)
        planned = plan(robot, make_job(robot, "carry", {}))
        outcome = execute(planned, "carry", fast_kernel, driver_profile="3a-module")
        assert outcome.driver_profile == "3a-module"


@pytest.mark.slow
@pytest.mark.parametrize("pf", [100, 1000])
def test_chips_by_their_capacitor(pf: int, capsys: pytest.CaptureFixture[str]) -> None:
    """33 us are enough for 100 pF, which needs 10 us, and too short for 1000 pF, which needs 90 us."""
    document = run_json(capsys, *PULL_LINE, "--machine", f"driver-profile=chip-{pf}pf", exit_code=0 if pf == 100 else 1)
    assert {group["limit"] for group in document["violations"]} == ({90.0} if pf == 1000 else set())


@pytest.mark.slow
def test_a_file_may_turn_the_active_edge(fast_kernel: Kernel) -> None:
    """Then the bare chip counts falling edges, including the last one, which no pulse follows."""
    robot = with_board("warehouse-scara", active_edge="falling")
    assert executed(robot, "pull-line", fast_kernel, **QUICK).report.passed


class TestModulesSwitches:
    def test_in_a_wrong_place(self, capsys: pytest.CaptureFixture[str]) -> None:
        """The run names the joint whose motor went twice as far."""
        words = ("--machine", "driver-profile=3a-module", "--machine", "dip-microsteps=th1=8")
        document = run_json(capsys, "run", "teaching-scara", "carry", *words, exit_code=1)
        told = "th1: the driver made 8 microsteps per full step, planned 16: its steps are 2 times as long"
        assert told in document["reasons"]

    @pytest.mark.parametrize("command", ["run teaching-scara carry", "serve teaching-scara --port 0"])
    @pytest.mark.parametrize(
        "setting",
        [
            "th9=8",
            "th2=8",
            "th2=8.5",
        ],
    )
    def test_that_cannot_be_set(self, command: str, setting: str, capsys: pytest.CaptureFixture[str]) -> None:
        refusal(capsys, *command.split(), "--machine", f"dip-microsteps={setting}")


def test_a_joint_s_driver_has_its_own_current(fast_kernel: Kernel) -> None:
    """The others have the board's; other drivers on the board have their usual one, and the command says so."""
    robot = load_robot("teaching-scara")
    own = dataclasses.replace(
        robot,
        joints=(dataclasses.replace(robot.joints[0], current_a=0.9), *robot.joints[1:]),
        board=dataclasses.replace(robot.board, current_a=1.2),
    )
    assert phase_currents_a(own, own.board.profile) == (0.9, 1.2, 1.2, 1.2)
    outcome = executed(own, "carry", fast_kernel)
    most_ma = [int(np.abs(axis.phases.a_ma).max()) for axis in outcome.comparison.evidence.axes]
    assert most_ma == [900, 1200, 1200, 1200]
    assert phase_currents_a(own, PROFILES["3a-module"]) == (1.5,) * 4
    left_out = settings_left_out(load_robot("ar4-mk3"), "tb6600")
    assert left_out == tuple(f"J{number}.current_a" for number in range(1, 7))
