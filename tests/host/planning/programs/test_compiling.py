"""Compiled programs: the tool's path by forward kinematics, the table of steps, and refusals with place and joint."""

import re
from dataclasses import replace

import numpy as np
import pytest

from steptwin.host.common.arrays import FloatArray
from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.planning.motion import Wait
from steptwin.host.planning.programs import CompiledProgram, compile_program, compiling, parse_program
from steptwin.host.robots import load_robot
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.robot import Robot
from tests.messages import refusing

ROBOT = load_robot("teaching-scara")
L1_MM, L2_MM, Z_MM = 95.0, 100.0, -40.0


def compiled(steps: str, findings: Findings | None = None) -> CompiledProgram:
    read = Findings()
    program = parse_program(f"start = {{ th1 = 20, th2 = 60 }}\n{steps}", read)
    assert not read.messages
    return compile_program(program, ROBOT, findings)


def found_for(robot: Robot, steps: str) -> list[str]:
    """Return what is wrong with the steps for another robot."""
    found = Findings()
    compile_program(parse_program(steps, found), robot, found)
    return found.messages


def complaint(steps: str) -> str:
    with pytest.raises(InputError) as caught:
        compiled(steps)
    return str(caught.value)


def tool(joints: FloatArray) -> FloatArray:
    """Return x, y, z and attitude for joints of shape (n, 4), by the textbook's formula for two links."""
    th1, th2, d3, th4 = joints.T
    first, second = np.deg2rad(th1), np.deg2rad(th1 + th2)
    x, y = (L1_MM * f(first) + L2_MM * f(second) for f in (np.cos, np.sin))
    return np.column_stack([x, y, Z_MM - d3, th1 + th2 + th4])


def travelled(program: CompiledProgram, step: int = -1) -> FloatArray:
    """Return the tool's poses in one step, sampled every millisecond."""
    row = program.steps[step]
    t_s = row.from_s + np.arange(0, round(1000 * row.duration_s) + 1) / 1000
    return tool(program.motion.positions(t_s))


def test_a_line_is_straight_and_keeps_the_attitude() -> None:
    poses = travelled(compiled("[[step]]\nline = { x = 120, y = 60, z = -60 }\nspeed_mm_s = 40"))
    start, goal = poses[0, :3], np.array([120.0, 60.0, -60.0])
    way = goal - start
    along = (poses[:, :3] - start) @ way / np.linalg.norm(way)
    off = np.linalg.norm(poses[:, :3] - start - np.outer(along, way / np.linalg.norm(way)), axis=1)
    assert off.max() < 1e-9
    assert np.allclose(poses[-1, :3], goal)
    assert np.allclose(poses[:, 3], poses[0, 3])
    assert np.diff(along).max() * 1000 == pytest.approx(40.0, rel=1e-3)


def test_a_line_with_phi_turns_in_proportion_by_the_shorter_way() -> None:
    poses = travelled(compiled("[[step]]\nline = { x = 120, phi = -250 }\nspeed_mm_s = 20"))
    part = np.linalg.norm(poses[:, :3] - poses[0, :3], axis=1)
    assert np.allclose(poses[:, 3], 80.0 + 30.0 * part / part[-1])


def test_a_circle_keeps_its_distance_and_goes_counter_clockwise() -> None:
    poses = travelled(compiled("[[step]]\ncircle = { x = 107, y = 110 }\nspeed_mm_s = 30\nturned = true"))
    radius = np.hypot(poses[:, 0] - 107, poses[:, 1] - 110)
    assert np.ptp(radius) < 1e-9
    angle = np.unwrap(np.arctan2(poses[:, 1] - 110, poses[:, 0] - 107))
    assert np.rad2deg(angle[-1] - angle[0]) == pytest.approx(360.0)
    assert np.allclose(poses[:, 3] - poses[0, 3], np.rad2deg(angle - angle[0]))


def test_a_negative_sweep_goes_clockwise() -> None:
    poses = travelled(compiled("[[step]]\ncircle = { x = 107, y = 110 }\nspeed_mm_s = 30\nsweep_deg = -90"))
    angle = np.unwrap(np.arctan2(poses[:, 1] - 110, poses[:, 0] - 107))
    assert np.rad2deg(angle[-1] - angle[0]) == pytest.approx(-90.0)
    assert np.allclose(poses[:, 3], poses[0, 3])


def test_an_arc_passes_through_its_point() -> None:
    steps = "[[step]]\narc = { via = { x = 115, y = 110 }, to = { x = 90, y = 110 } }\nspeed_mm_s = 30"
    poses = travelled(compiled(steps))
    assert np.hypot(poses[:, 0] - 115, poses[:, 1] - 110).min() < 0.05
    assert np.allclose(poses[-1, :3], [90.0, 110.0, Z_MM])


def test_a_curve_passes_through_its_points_without_stopping() -> None:
    steps = "[[step]]\nthrough = [{ x = 110, y = 110 }, { x = 90, y = 120 }, { x = 80, y = 100 }]\nspeed_mm_s = 30"
    poses = travelled(compiled(steps))
    for x, y in ((110, 110), (90, 120)):
        assert np.hypot(poses[:, 0] - x, poses[:, 1] - y).min() < 0.05
    speed = np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1) * 1000
    assert speed[400:-400] == pytest.approx(np.full(len(speed) - 800, 30.0), rel=0.01)


def test_relative_moves_add_up() -> None:
    by = "[[step]]\nby = {{ {} }}\n{}\n"
    program = compiled(
        by.format("th1 = 5, th4 = -10", "")
        + by.format("x = 4, z = -3", "speed_mm_s = 9")
        + by.format("phi = 45", "speed_mm_s = 9")
    )
    assert np.allclose(travelled(program, 0)[-1, 3], 80 + 5 - 10)
    before, after = travelled(program, 1)[[0, -1]]
    assert np.allclose(after - before, [4, 0, -3, 0])
    before, after = travelled(program, 2)[[0, -1]]
    assert np.allclose(after - before, [0, 0, 0, 45])


@pytest.mark.parametrize("phi_deg", [40.0, 150.0])
def test_a_turn_on_the_spot_keeps_the_spot(phi_deg: float) -> None:
    """The warehouse robot's gripper is turned by its rotary joint, around which the arm must follow."""
    robot = load_robot("warehouse-scara")
    program = compile_program(
        parse_program(f"[[step]]\nline = {{ phi = {phi_deg} }}\nspeed_mm_s = 1", Findings()), robot
    )
    t_s = np.arange(0, round(1000 * program.motion.duration_s) + 1) / 1000
    poses = make_kinematics(robot).forward(program.motion.positions(t_s))
    assert np.abs(poses[:, :3] - poses[0, :3]).max() < 1e-9
    assert poses[-1, 3] == pytest.approx(phi_deg)
    assert (np.diff(poses[:, 3]) * np.sign(phi_deg - poses[0, 3]) >= 0).all()
    assert 79.0 < max(peak.percent for peak in program.steps[0].peaks if peak.quantity != "step rate") < 80.5


def test_a_lift_moves_straight_where_the_arm_is_stretched() -> None:
    findings = Findings()
    text = (
        "start = { th2 = 0 }\n[[step]]\nby = { z = -20 }\nspeed_mm_s = 30\n[[step]]\nby = { x = -20 }\nspeed_mm_s = 30"
    )
    program = compile_program(parse_program(text, findings), ROBOT, findings)
    poses = travelled(program)
    assert np.ptp(poses[:, [0, 1, 3]], axis=0).max() == 0
    assert np.diff(-poses[:, 2]).max() * 1000 == pytest.approx(30.0, rel=1e-3)
    assert [message.split(" (")[0] for message in findings.messages] == ["step 2"]


def test_go_changes_the_elbow_where_a_line_keeps_it() -> None:
    left = compiled('[[step]]\ngo = { x = 100, y = 100, branch = "left" }\nspeed_percent = 50')
    right = compiled("[[step]]\nline = { x = 100, y = 100 }\nspeed_mm_s = 30")
    end = np.array([left.motion.duration_s]), np.array([right.motion.duration_s])
    joints = left.motion.positions(end[0])[0], right.motion.positions(end[1])[0]
    assert np.sign(joints[0][1]) != np.sign(joints[1][1])
    assert np.allclose(tool(joints[0][np.newaxis])[0, :3], tool(joints[1][np.newaxis])[0, :3])


def test_after_a_whole_turn_of_the_tool_the_arm_is_on_its_branch_and_the_tool_does_not_turn_back() -> None:
    turn = "[[step]]\ncircle = { x = 107, y = 110 }\nspeed_mm_s = 30\nturned = true\nsweep_deg = 250\n"
    steps = (
        "[[step]]\nby = { phi = 10 }\nspeed_mm_s = 30\n",
        "[[step]]\nline = { x = 110, y = 100 }\nspeed_mm_s = 30\n",
        "[[step]]\ngo = { x = 100, y = 90 }\n",
    )
    program = compiled(turn + "".join(steps))
    joints = program.motion.positions(np.array([row.from_s + row.duration_s for row in program.steps]))
    assert joints[0, 3] > 180.0  # beyond what the inverse kinematics returns
    assert joints[1, 3] - joints[0, 3] == pytest.approx(10.0)
    assert np.abs(np.diff(joints, axis=0)[1:]).max() < 90.0
    assert (joints[:, 1] > 0).all()  # the elbow stays on its side


@pytest.mark.parametrize("law", ["s-curve", "trapezoid", "cubic", "quintic"])
def test_the_pace_of_a_joint_move_is_a_part_of_the_limits(law: str) -> None:
    program = compiled(f'[[step]]\ngo = {{ th1 = 100 }}\nlaw = "{law}"\nspeed_percent = 40')
    assert 39.0 < max(peak.percent for peak in program.steps[0].peaks) <= 40.0 + 1e-6
    timed = compiled(f'[[step]]\ngo = {{ th1 = 100 }}\nlaw = "{law}"\nduration_s = 3.1')
    assert timed.motion.duration_s == 3.1


def test_repetitions_and_calls_are_written_out_with_their_numbers() -> None:
    program = compiled(
        "[[sequences.s]]\npause = 0.1\n[[sequences.s]]\npause = 0.2\n"
        "[[step]]\nrepeat = 2\nsteps = [{ pause = 0.3 }, { call = 's' }]\n[[step]]\ncall = 's'"
    )
    assert [(str(row.place), row.from_s, round(row.duration_s, 6)) for row in program.steps] == [
        ("step 1.1, pass 1", 0.0, 0.3), ("step 1.2.1, pass 1", 0.3, 0.1), ("step 1.2.2, pass 1", 0.4, 0.2),
        ("step 1.1, pass 2", 0.6, 0.3), ("step 1.2.1, pass 2", 0.9, 0.1), ("step 1.2.2, pass 2", 1.0, 0.2),
        ("step 2.1", 1.2, 0.1), ("step 2.2", 1.3, 0.2),
    ]  # fmt: skip


def test_outputs_switch_at_their_steps() -> None:
    program = compiled('[[step]]\npause = 1\n[[step]]\noutput = "gripper"\non = true')
    (switching,) = program.motion.output_changes
    assert (switching.output, switching.on, switching.from_s) == ("gripper", True, 1.0)


def test_a_wait_knows_its_step() -> None:
    program = compiled(
        "[[step]]\nrepeat = 2\nsteps = [{ pause = 1 }, { wait = 'part_ready', on = false, timeout_s = 2.5 }]"
    )
    assert program.motion.waits == (
        Wait("part_ready", False, 1.0, 2.5, "step 1.2, pass 1"),
        Wait("part_ready", False, 2.01, 2.5, "step 1.2, pass 2"),
    )
    assert program.steps[1].text == "wait for part_ready off"
    told = complaint("[[step]]\nwait = 'part'\non = true\ntimeout_s = 1")
    assert told == "step 1 (wait for part on): inputs: 'part' is unknown: did you mean part_ready?"
    (told,) = found_for(replace(ROBOT, inputs={}), "[[step]]\nwait = 'part'\non = true\ntimeout_s = 1")
    assert told == (
        "step 1 (wait for part on): inputs: teaching-scara has none;"
        ' its file names them under [inputs], such as part = { joint = "th4", input = 1 }'
    )


def test_refusals_name_step_time_place_and_joint() -> None:
    pause = "[[step]]\npause = 1\n"
    line = f"{pause}[[step]]\nline = {{{{ x = {{}}, y = {{}} }}}}\nspeed_mm_s = 40"
    beyond = complaint(line.format(190, 100))
    assert beyond.startswith("step 2 (line to x 190, y 100): x 190, y 100, z -40 mm, phi 80 deg is out of reach on ")
    passing = re.findall(r"; x (\S+), y (\S+) mm passes$", beyond)[0]
    assert compiled(line.format(*passing)).motion.duration_s > 1.0
    assert "out of reach" in complaint(line.format(*(float(each) + 0.3 for each in passing)))
    around = complaint(f"{pause}[[step]]\ncircle = {{ x = 190, y = 100 }}\nsweep_deg = -90\nspeed_mm_s = 40")
    assert re.match(r"step 2 \(circle .*\): at t = [\d.]+ s the tool's path breaks off: ", around)
    far = complaint(f"{pause}[[step]]\ngo = {{ x = 300, y = 0 }}")
    assert far.startswith(
        "step 2 (go to x 300, y 0): x 300, y 0, z -40 mm, phi 80 deg is out of reach on the branch 'right'"
    )
    wide = complaint(f"{pause}[[step]]\ngo = {{ th1 = 131 }}")
    assert wide.startswith("step 2 (go to th1 131): th1: 130.")


def found_in(steps: str) -> list[str]:
    findings = Findings()
    compiled(steps, findings)
    return findings.messages


class TestFindings:
    def test_steps_beyond_limits_and_unknown_names_are_found_at_once(self) -> None:
        """Names come first, speeds last; the steps of a sequence that nobody calls are looked at."""
        found = found_in(
            "[[sequences.unused]]\noutput = 'gripr'\non = true\n[[sequences.unused]]\ncall = 'unuse'\n"
            "[[step]]\ngo = { th1 = 120 }\nduration_s = 0.4\n[[step]]\ngo = { d3 = 61 }\n"
            "[[step]]\noutput = 'laser'\non = true\n[[step]]\ngo = { th1 = 999 }\n"
            "[[step]]\nwait = 'door'\non = true\ntimeout_s = 1\n[[step]]\ngo = { th8 = 1, th9 = 1 }"
        )
        assert [message.split(":")[0] for message in found] == [
            "step 3 (output laser on)",
            "step 5 (wait for door on)",
            "step 6 (go to th8 1, th9 1)",
            "sequences.unused step 1 (output gripr on)",
            "sequences.unused step 2",
            "step 2 (go to d3 61)",
            "step 4 (go to th1 999)",
            "step 1 (go to th1 120)",
        ]
        assert found[2].endswith("th1?")

    def test_what_only_follows_from_a_mistake_is_not_told(self) -> None:
        """After step 1 the lift is outside, after step 4 nobody knows where the arm is; step 7 says it again."""
        found = found_in(
            "[[step]]\ngo = { d3 = 61 }\n[[step]]\noutput = 'gripper'\non = true\n[[step]]\nby = { th1 = 5 }\n"
            "[[step]]\ngo = { x = 400 }\n[[step]]\nby = { th1 = 150 }\n[[step]]\nline = { x = 500 }\nspeed_mm_s = 9\n"
            "[[step]]\ngo = { th1 = 0, th2 = 60, d3 = 0, th4 = 0 }\n[[step]]\nby = { th1 = 200 }"
        )
        assert [message.split(" (")[0] for message in found] == ["step 1", "step 4", "step 8"]

    def test_after_a_mistake_that_keeps_the_branch_whole_poses_and_joints_are_judged(self) -> None:
        """Step 2 is whole but for its branch, which step 1 keeps; step 5 may have left it, so any branch would do."""
        far, deep = "x = 400, y = 0, z = -40, phi = 0", "x = 100, y = 100, z = -200, phi = 0"
        found = found_in(
            f"[[step]]\ngo = {{ {far} }}\n[[step]]\ngo = {{ {deep} }}\n[[step]]\nline = {{ x = 500 }}\nspeed_mm_s = 9\n"
            "[[step]]\ngo = { th1 = 0, th2 = 60, d3 = -20, th4 = 0 }\n[[step]]\ngo = { x = 401, branch = 'left' }\n"
            f"[[step]]\ngo = {{ {deep} }}\n[[step]]\ngo = {{ x = 100, y = 100, z = -50, phi = 0 }}"
        )
        assert [message.split(" (")[0] for message in found] == ["step 1", "step 2", "step 4", "step 5", "step 6"]
        assert "d3: -20.0 mm is outside 0..60 mm; the nearest is 0 mm" in found[2]

    def test_a_line_that_breaks_off_ends_where_it_should_for_the_steps_after_it(self) -> None:
        found = found_in(
            "[[step]]\ngo = { x = 60, y = 90, z = -40, phi = 0, branch = 'left' }\n"
            "[[step]]\nline = { x = -60, y = -90 }\nspeed_mm_s = 30\n[[step]]\nby = { d3 = 61 }"
        )
        assert [message.split(" (")[0] for message in found] == ["step 2", "step 3"]

    @pytest.mark.parametrize(
        ("steps", "where"),
        [
            ("{ by = { th1 = 300 } }, { by = { th1 = -300 } }", "step 1.1 (by th1 300, in every pass)"),
            ("{ by = { th1 = 50 } }", "step 1.1 (by th1 50, in pass 3)"),
            ("{ repeat = 2, steps = [{ by = { th1 = 28 } }] }", "step 1.1.1 (by th1 28, in pass 2.2)"),
            ("{ by = { d3 = 9 }, duration_s = 0.1 }, { go = { d3 = 0 } }", "step 1.1 (by d3 9, in every pass)"),
        ],
    )
    def test_a_mistake_in_a_repetition_is_told_once(self, steps: str, where: str) -> None:
        (message,) = found_in(f"[[step]]\nrepeat = 3\nsteps = [{steps}]")
        assert message.startswith(f"{where}: ")

    @pytest.mark.parametrize("order", [1, -1])
    def test_sequences_call_one_another_only_so_deep(self, order: int) -> None:
        def chain(length: int) -> str:
            steps = [f"[[sequences.s{i}]]\ncall = 's{i + 1}'\n" for i in range(1, length)]
            return f"{''.join(steps[::order])}[[sequences.s{length}]]\npause = 1\n[[step]]\ncall = 's1'"

        assert found_in(chain(50)) == []
        (message,) = found_in(chain(51))
        assert message.endswith(": call: more than 50 sequences call one another in a row")

    def test_a_position_outside_the_limits_at_the_start(self) -> None:
        findings = Findings()
        compile_program(parse_program("start = { d3 = 61 }\n[[step]]\nby = { th1 = 5 }", findings), ROBOT, findings)
        (message,) = findings.messages
        assert message.startswith("start: d3: 61.0 mm is outside 0..60 mm; the nearest is 60 mm")

    def test_a_wrong_position_is_told_where_it_stands_and_not_where_it_is_named(self) -> None:
        findings = Findings()
        text = "[positions]\na = { th9 = 1 }\nb = {}\n[[step]]\ngo = 'a'\n[[step]]\ngo = 'b'\n[[step]]\ngo = 'c'"
        compile_program(parse_program(text, findings), ROBOT, findings)
        assert [message.split(":")[0] for message in findings.messages] == [
            "positions.b", "position 'a'", "step 3 (go to c)",
        ]  # fmt: skip

    def test_without_its_robot_a_program_is_judged_as_far_as_it_can_be(self) -> None:
        findings = Findings()
        text = "robot = 'lab-scara'\n[[step]]\ngo = 'a'\n[[step]]\ngo = { th9 = 1 }\n[[step]]\ncall = 'b'"
        compile_program(parse_program(text, Findings()), ROBOT, findings)
        assert findings.messages == [
            "robot: the program is for lab-scara, not for teaching-scara",
            "step 1 (go to a): position 'a' is unknown: there are none",
            "step 3: sequence 'b' is unknown: there are none",
        ]


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        ("[[step]]\ngo = 'b'", "step 1 (go to b): position 'b' is unknown: there are none"),
        ("[[step]]\ngo = { th9 = 1 }", "step 1 (go to th9 1): joint 'th9' is unknown: did you mean th4 or th2 or th1?"),
        ("[[step]]\ncall = 's'", "step 1: sequence 's' is unknown: there are none"),
        (
            "[[sequences.s]]\ncall = 's'\n[[step]]\ncall = 's'",
            "sequences.s step 1: call: the sequence 's' calls itself",
        ),
        ("[[step]]\ngo = { x = 100, branch = 'up' }", "step 1 (go to x 100 (up)): branch 'up' is unknown"),
        (
            "[[step]]\nby = { phi = 181 }\nspeed_mm_s = 1",
            "step 1 (by phi 181): phi: 181 deg on the spot is more than half",
        ),
        ("[[step]]\ngo = { th1 = 20 }", "the program does not move, switch or wait"),
    ],
)
def test_what_a_program_cannot_be(steps: str, message: str) -> None:
    assert complaint(steps).startswith(message)


def test_the_number_of_steps_is_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiling, "STEPS_MAX", 20)  # 5000 steps take a while
    step = "[[step]]\nrepeat = {}\nsteps = [{{ repeat = 10, steps = [{{ pause = 0.001 }}] }}]"
    assert len(compiled(step.format(2)).steps) == 20
    assert complaint(step.format(3)) == "step 1.1.1, pass 3.1: a program has at most 20 steps, repetitions written out"


def test_a_program_for_another_robot_is_refused() -> None:
    program = parse_program('robot = "lab-scara"\n[[step]]\npause = 1', Findings())
    with refusing(InputError):
        compile_program(program, ROBOT)


def test_a_first_step_that_cannot_be_made_is_the_only_finding() -> None:
    (message,) = found_in("[[step]]\noutput = 'laser'\non = true")
    assert message.startswith("step 1 (output laser on): ")
