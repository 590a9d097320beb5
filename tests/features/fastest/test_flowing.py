"""Programs whose steps flow into each other: times, corners, outputs on the way, and what is refused."""

import numpy as np
import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.planning.planner import plan
from steptwin.host.planning.programs import CompiledProgram, compile_program, parse_program
from steptwin.host.robots import load_robot
from tests.host.planning.programs.test_compiling import tool
from tests.messages import refusing

ROBOT = load_robot("teaching-scara")
START = "start = { th1 = 20, th2 = 80, d3 = 20, th4 = 0 }\n"
LINE = "[[step]]\nby = {{ x = {x}, y = {y} }}\nspeed_mm_s = 60\n{more}\n"


def compiled(steps: str, head: str = "") -> CompiledProgram:
    found = Findings()
    program = parse_program(f"{head}{START}{steps}", found)
    found.raise_first()
    return compile_program(program, ROBOT)


def complaints(steps: str, head: str = "") -> list[str]:
    found = Findings()
    program = parse_program(f"{head}{START}{steps}", found)
    if not found.messages:
        compile_program(program, ROBOT, found)
    return found.messages


def line(x: float = 0.0, y: float = 0.0, more: str = "") -> str:
    return LINE.format(x=x, y=y, more=more)


CORNER = line(x=-40, more="blend_mm = 4.0") + line(y=-30)


def test_the_corner_is_rounded_and_passed_as_the_table_says() -> None:
    program = compiled(CORNER)
    assert program.steps[0].notes == ("passes the corner at 1.061 mm",)  # 3/16 x 4 mm x sqrt 2
    assert program.steps[1].notes == ()
    t_s = np.arange(0.0, program.motion.duration_s, 5e-4)
    places = tool(program.motion.positions(t_s))[:, :3]
    corner = places[0] + [-40.0, 0.0, 0.0]
    away = np.linalg.norm(places - corner, axis=1)
    assert away.min() == pytest.approx(3 / 16 * 4.0 * np.sqrt(2.0), abs=0.01)
    on_first = away[: int(np.argmin(away))]
    outside = places[: len(on_first)][on_first > 4.0]
    assert np.abs(outside[:, 1] - places[0, 1]).max() < 0.005
    assert program.steps[0].from_s + program.steps[0].duration_s == program.steps[1].from_s
    assert t_s[int(np.argmin(away))] == pytest.approx(program.steps[1].from_s, abs=0.002)


def test_flowing_is_faster_than_stopping_and_keeps_the_limits() -> None:
    flowing, stopping = compiled(CORNER), compiled(line(x=-40) + line(y=-30))
    assert flowing.motion.duration_s < stopping.motion.duration_s - 0.3
    plan(ROBOT, flowing.motion)


def test_a_program_s_law_holds_for_every_step_that_names_no_other() -> None:
    steps = "[[step]]\ngo = { th1 = -40, d3 = 5 }\n"
    usual, fastest = compiled(steps), compiled(steps, 'law = "fastest"\n')
    assert fastest.motion.duration_s < usual.motion.duration_s - 0.03
    own = compiled(steps + 'law = "s-curve"\n', 'law = "fastest"\n')
    assert own.motion.duration_s == usual.motion.duration_s
    timed = compiled(steps + "duration_s = 3.0\n", 'law = "fastest"\n')
    assert timed.motion.duration_s == 3.0


@pytest.mark.slow
def test_a_repetition_and_a_sequence_flow_as_written_out() -> None:
    there_and_back = (
        "{ by = { x = -20 }, speed_mm_s = 60, blend_mm = 3 }, { by = { y = -20 }, speed_mm_s = 60, blend_mm = 3 },"
        " { by = { x = 20 }, speed_mm_s = 60, blend_mm = 3 }, { by = { y = 20 }, speed_mm_s = 60, blend_mm = 3 }"
    )
    program = compiled(f"[[step]]\nrepeat = 2\nsteps = [{there_and_back}]\n")
    assert [row.place.pass_text for row in program.steps] == ["1"] * 4 + ["2"] * 4
    assert [bool(row.notes) for row in program.steps] == [True] * 7 + [False]  # the last one has no next one
    speed = np.abs(program.motion.velocities(np.arange(0.2, program.motion.duration_s - 0.2, 0.01))).max(axis=1)
    assert speed.min() > 1.0  # deg/s or mm/s: it never stops


def test_a_step_that_stands_ends_the_flow() -> None:
    program = compiled(line(x=-40, more="blend_mm = 4") + "[[step]]\npause = 0.5\n" + line(y=-30))
    assert program.steps[0].notes == ()
    assert program.steps[1].duration_s == 0.5
    assert program.motion.velocities(np.array([program.steps[1].from_s]))[0] == pytest.approx(np.zeros(4))


class TestOutputs:
    def test_change_at_their_places(self) -> None:
        outputs = "outputs = [{ gripper = true, at_mm = 3.0 }, { gripper = false, at_mm = -5.0, ahead_s = 0.02 }]"
        for law in ('law = "s-curve"', 'law = "fastest"'):
            program = compiled(line(x=-40, more=f"{outputs}\n{law}"))
            start = tool(program.motion.positions(np.zeros(1)))[0, 0]
            on, off = program.motion.output_changes
            assert (on.on, off.on, on.on_the_way, off.on_the_way) == (True, False, True, True)
            places = tool(program.motion.positions(np.array([on.from_s, off.from_s + 0.02])))[:, 0]
            assert start - places == pytest.approx([3.0, 35.0], abs=0.07)  # up to a millisecond later, at 60 mm/s
            assert (start - places >= np.array([3.0, 35.0]) - 1e-6).all()
            assert {on.from_s, off.from_s} <= set(program.motion.breakpoints_s)
            assert [round(change.until_s - change.from_s, 6) for change in (on, off)] == [0.01, 0.01]
            assert program.steps[0].notes == (f"gripper on at {on.from_s:.3f} s", f"gripper off at {off.from_s:.3f} s")

    def test_count_from_the_corner_in_a_flow(self) -> None:
        program = compiled(
            line(x=-40, more="blend_mm = 4") + line(y=-30, more="outputs = [{ gripper = true, at_mm = 10 }]")
        )
        (on,) = program.motion.output_changes
        places = tool(program.motion.positions(np.array([0.0, on.from_s])))
        assert places[1, :2] - places[0, :2] == pytest.approx([-40.0, -10.0], abs=0.07)


@pytest.mark.parametrize(
    ("steps", "says"),
    [
        (line(x=-40, more="blend_mm = -1"), "step 1: blend_mm: -1 is negative"),
        (
            line(x=-40, more="blend_mm = 31") + line(y=-30),
            "step 1 (by x -40, y 0): blend_mm: 31 mm is more than the leg has: 30 mm; 30 passes",
        ),
        (
            line(x=-40, more="blend_mm = 0") + line(y=-30),
            "step 1 (by x -40, y 0): blend_mm: 0 mm flows on where the joints keep their direction to 0.1 deg; here"
            " they turn by",
        ),
        (
            line(x=-40, more="blend_mm = 2\nramp_s = 0.5") + line(y=-30),
            "step 1 (by x -40, y 0): ramp_s: a motion that is timed as a whole has none of a step's own",
        ),
        (
            line(x=-40, more="blend_mm = 2") + line(y=-30, more="ramp_s = 0.5"),
            "step 2 (by x 0, y -30): ramp_s: a motion that is timed as a whole has none of a step's own",
        ),
        (
            "[[step]]\ngo = { th1 = 0 }\nblend_mm = 2\nduration_s = 2.0\n" + line(y=-10),
            "step 1 (go to th1 0): duration_s: a motion that is timed as a whole has none",
        ),
        (
            '[[step]]\ngo = { th1 = 0 }\nblend_mm = 2\nlaw = "quintic"\n' + line(y=-10),
            "step 1: law: 'quintic' beside blend_mm; a motion that flows on is timed as a whole, 'fastest'",
        ),
        (
            line(x=-40, more="blend_mm = 2") + "[[step]]\nby = { phi = 20 }\nspeed_mm_s = 60\n",
            "step 2 (by phi 20): a turn on the spot begins at rest, but the step before flows on: leave its blend_mm"
            " out",
        ),
        (
            line(x=-40, more='law = "cubic"'),
            "step 1: law: 'cubic': the tool's path has 's-curve' or 'fastest'",
        ),
        (
            line(x=-40, more="outputs = [{ gripper = true, at_mm = 41 }]"),
            "step 1 (by x -40, y 0): outputs.gripper: at_mm: 41 mm is beyond the path, which is 40 mm long",
        ),
        (
            line(x=-40, more="outputs = [{ gripper = true, at_mm = 1, ahead_s = 2.0 }]"),
            "step 1 (by x -40, y 0): outputs.gripper: ahead_s: 2 s is 1.",
        ),
        (
            line(x=-40, more="outputs = [{ griper = true, at_mm = 1 }]"),
            "step 1 (by x -40, y 0): outputs: 'griper' is unknown: did you mean gripper?",
        ),
        (line(x=-40, more="outputs = [{ at_mm = 1 }]"), "step 1: outputs[0]: names 0 outputs"),
    ],
)
def test_one_line_says_what_is_wrong(steps: str, says: str) -> None:
    found = complaints(steps)
    assert len(found) == 1, found
    assert found[0].startswith(says)


def test_an_unknown_law_of_the_program_is_refused() -> None:
    with refusing(InputError):
        compiled(CORNER, 'law = "cubic"\n')
