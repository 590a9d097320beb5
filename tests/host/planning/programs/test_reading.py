"""Programs from TOML: everything that is wrong is found at once, each with its place."""

import pytest

from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.planning.programs import parse_program, read_program
from steptwin.host.planning.programs.paces import LawName
from steptwin.host.planning.programs.positions import JointPosition, ToolPosition
from steptwin.host.planning.programs.program import Call, Program, Repeat
from steptwin.host.planning.programs.steps import Centre, CircleStep, GoStep, LineStep, OutputStep, PauseStep
from tests.messages import refusing

GOOD = """
title = "all sorts"
robot = "teaching-scara"
start = "a"
[positions]
a = { th1 = 10, th2 = 20.5 }
b = { x = 100, y = 50, branch = "left" }
[[sequences.blink]]
output = "gripper"
on = true
[[step]]
go = "b"
law = "quintic"
duration_s = 2
[[step]]
repeat = 2
steps = [{ call = "blink" }, { line = { z = -50 }, speed_mm_s = 20 }]
[[step]]
circle = { x = 90, y = 50 }
speed_mm_s = 5
turned = true
[[step]]
pause = 0.25
"""


def found_in(text: str) -> list[str]:
    findings = Findings()
    parse_program(text, findings)
    return findings.messages


def parsed(text: str) -> Program:
    findings = Findings()
    program = parse_program(text, findings)
    assert not findings.messages
    return program


def test_a_program_is_read_as_it_is_written() -> None:
    program = parsed(GOOD)
    assert (program.title, program.robot, program.start) == ("all sorts", "teaching-scara", "a")
    assert program.positions == {
        "a": JointPosition({"th1": 10.0, "th2": 20.5}),
        "b": ToolPosition({"x": 100.0, "y": 50.0}, "left"),
    }
    assert program.sequences == {"blink": (OutputStep("gripper", on=True),)}
    line = LineStep(ToolPosition({"z": -50.0}), speed_mm_s=20.0)
    assert program.steps == (
        GoStep("b", law=LawName.QUINTIC, duration_s=2.0),
        Repeat(2, (Call("blink"), line)),
        CircleStep(Centre(90.0, 50.0), turned=True, speed_mm_s=5.0),
        PauseStep(0.25),
    )


def test_everything_that_is_wrong_is_found_at_once() -> None:
    assert found_in(
        """
        titel = "?"
        [positions]
        a = { th1 = 1, x = 3 }
        b = {}
        [[step]]
        go = "a"
        speed = 3
        [[step]]
        line = { x = 120 }
        [[step]]
        fly = 3
        [[step]]
        repeat = 2
        steps = [{ pause = 1 }, { line = { x = 3 }, speed_mm_s = -4 }]
        [[step]]
        by = { x = 3, branch = "left" }
        speed_mm_s = 1
        """
    ) == [
        "titel: key 'titel' is unknown: did you mean title?",
        "positions.a: th1: beside x; a position is either of joints or of the tool",
        "positions.b: names neither a joint nor one of the tool's coordinates x, y, z, phi nor an orientation",
        "step 1: speed: key 'speed' is unknown: did you mean speed_percent?",
        "step 2: speed_mm_s: is missing",
        "step 3: a step has exactly one of "
        "go, line, arc, circle, through, by, output, wait, pause, call, gcode, repeat, each, not none",
        "step 4.2: speed_mm_s: -4 is not above 0",
        "step 5: by.branch: a relative move keeps the branch",
    ]


@pytest.mark.parametrize(
    ("step", "message"),
    [
        ("go = 3", "go: 3 is not a name or table"),
        ('goto = "a"', "'goto' is unknown: did you mean go?"),
        ('goto = "a"\npause = 1', "goto: key 'goto' is unknown: "),
        ('go = "a"\nline = "a"', "a step has exactly one of "),
        ('go = { at = "a", offset = { zed = 1 } }', "go.offset: 'zed' is unknown: there are x, y, z, phi"),
        ('go = { at = "a", cell = "b" }', "go.at: beside cell; a position is beside one of them"),
        ("line = { cell = 3 }\nspeed_mm_s = 3", "line.cell: 3 is not a text"),
        ('through = ["a", 3]\nspeed_mm_s = 3', "through[1]: 3 is not a name or table"),
        ('line = "a"\nspeed_mm_s = 3\noutputs = [{ at_mm = 1 }]', "outputs[0]: names 0 outputs; one change is such"),
        ('go = "a"\nblend_mm = 1\nlaw = "cubic"', "law: 'cubic' beside blend_mm; a motion that flows on is timed as"),
        ('go = "a"\nspeed_percent = 0', "speed_percent: 0 is not above 0 and up to 100"),
        ('go = "a"\nspeed_percent = 100.1', "speed_percent: 100.1 is not above 0 and up to 100"),
        ('go = "a"\nspeed_percent = 5\nduration_s = 1', "speed_percent: beside duration_s; a joint move takes one"),
        ('go = "a"\nduration_s = 0', "duration_s: 0 s is not at least 0.001 s"),
        ('go = "a"\nduration_s = 0.0005', "duration_s: 0.0005 s is not a whole number of milliseconds"),
        ('go = "a"\nlaw = "linear"', "law: 'linear' is not one of s-curve, trapezoid, cubic, quintic"),
        ("go = { x = 1, rpy_deg = [1, 2] }", "go: rpy_deg: has 2 numbers, it takes 3"),
        ("go = { x = 1, rpy_deg = 30 }", "go: rpy_deg: 30 is not a list"),
        ('go = { rpy_deg = [1, "a", 3] }', "go: rpy_deg[1]: 'a' is not a number"),
        (
            "go = { rpy_deg = [1, 2, 3], abc_deg = [1, 2, 3] }",
            "go: abc_deg: beside rpy_deg; a pose has one orientation",
        ),
        ("go = { quaternion_wxyz = [1, 0, 0, 0] }", "go: orientation 'quaternion_wxyz' is unknown: did you mean"),
        ("go = { quaternion_xyzw = [0.9, 0, 0, 0] }", "go: quaternion_xyzw: has the length 0.9, a rotation has 1, x y"),
        ("go = { th1 = 1, rpy_deg = [1, 2, 3] }", "go: th1: beside rpy_deg; a position is either of joints or of the"),
        ("by = { rpy_deg = [1, 2, 3] }\nspeed_mm_s = 3", "by.rpy_deg: a relative move turns by rx, ry, rz, in degrees"),
        ("by = { th1 = 1 }\nspeed_mm_s = 3", "speed_mm_s: key 'speed_mm_s' is unknown: there are by, law,"),
        ('arc = { via = "a" }\nspeed_mm_s = 3', "arc.to: is missing"),
        ('arc = { via = "a", too = "b" }\nspeed_mm_s = 3', "arc.too: key 'too' is unknown: did you mean to?"),
        ("circle = { x = 1 }\nspeed_mm_s = 3", "circle.y: is missing"),
        ('through = "a"\nspeed_mm_s = 3', "through: 'a' is not a list"),
        ("repeat = 0\nsteps = [{ pause = 1 }]", "repeat: 0 is not from 1 to 10000"),
        ("repeat = 10001\nsteps = [{ pause = 1 }]", "repeat: 10001 is not from 1 to 10000"),
        ("repeat = 2", "steps: is missing"),
        ('output = "gripper"', "on: is missing"),
        ('wait = "part_ready"\ntimeout_s = 3', "on: is missing"),
        ('wait = "part_ready"\non = true', "timeout_s: is missing"),
        ('wait = "part_ready"\non = true\ntimeout = 3', "timeout: key 'timeout' is unknown: did you mean timeout_s?"),
        ("pause = 0", "pause: 0 s is not at least 0.001 s"),
        ("circle = { x = 1, y = 1 }\nspeed_mm_s = 1\nsweep_deg = 0", "sweep_deg: 0 deg is not a sweep of up to 36000"),
        ('wait = "part_ready"\non = true\ntimeout_s = 3601', "timeout_s: 3601 s is not above 0 and up to 3600 s"),
        ("repeat = 2\nsteps = []", "steps: has no steps"),
        ("wait_s = 0.5", "'wait_s' is unknown: did you mean pause?"),
        ("wait = 0.5", "wait: 0.5 names no input; a time to stand is `pause = 0.5`, in seconds"),
        ("pause = nan", "pause: nan is not a finite number up to 1e+09"),
    ],
)
def test_a_wrong_step_is_named_with_its_number(step: str, message: str) -> None:
    (found,) = found_in(f"[[step]]\npause = 1\n[[step]]\n{step}\n")
    assert found.startswith(f"step 2: {message}")


def test_one_pair_of_brackets_begins_no_list() -> None:
    told = "is a table, not a list: begin each step with [[{0}]], in two pairs of brackets"
    found = found_in("[step]\ngo = 'a'\n[sequences.grip]\npause = 1")
    assert found == [f"sequences.grip: {told.format('sequences.grip')}", f"step: {told.format('step')}"]


def test_a_program_has_steps() -> None:
    assert found_in("title = 'x'") == ["step: is missing: a program has at least one [[step]]"]
    assert found_in("step = 3") == ["step: 3 is not a list"]


def test_a_text_that_is_not_toml_is_refused() -> None:
    with refusing(InputError):
        found_in("go to x")


def test_a_missing_file_is_named() -> None:
    with refusing(InputError):
        read_program("no/such.toml")
