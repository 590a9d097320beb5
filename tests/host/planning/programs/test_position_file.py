"""Files of positions: what is saved is found again, to the wire unit, and everything else in the file stays."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.host.planning.programs.positions import (
    JointPosition,
    ToolPosition,
    check_saving,
    default_file,
    delete_position,
    read_positions,
    save_position,
)
from steptwin.host.robots import load_robot
from tests.host.complaints import complaint_of

ROBOT = load_robot("teaching-scara")
PICK = [40.0, 30.5, 25.0, -0.0]
BY_HAND = """# mine
title = "bench 3"
robot = "teaching-scara"  # the one at the window

[positions]
# over the tray
tray = { th1 = 40, th2 = 30 }   # two joints
 'the bin' = { x = 150, y = -60, branch = "left" }
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "positions.toml"


def save(file: Path, name: str, joints: list[float], comment: str = "", *, replaced: bool = False) -> None:
    save_position(str(file), ROBOT, name, joints, comment, replace=replaced)


def test_the_first_position_makes_the_file(file: Path) -> None:
    save(file, "pick", PICK, "tool: x 1 mm")
    assert read_positions(str(file), ROBOT) == {
        "pick": JointPosition({"th1": 40.0, "th2": 30.5, "d3": 25.0, "th4": 0.0})
    }
    assert file.read_text().splitlines()[-3:] == [
        "",
        "[positions]",
        "pick = { th1 = 40.0, th2 = 30.5, d3 = 25.0, th4 = 0.0 }  # tool: x 1 mm",
    ]
    assert tomllib.loads(file.read_text())["robot"] == ROBOT.name
    assert default_file(ROBOT) == "teaching-scara-positions.toml"


def test_everything_else_in_the_file_stays(file: Path) -> None:
    file.write_text(BY_HAND)
    save(file, "pick", PICK)
    pick = "pick = { th1 = 40.0, th2 = 30.5, d3 = 25.0, th4 = 0.0 }\n"
    assert file.read_text() == BY_HAND + pick
    assert read_positions(str(file), ROBOT)["the bin"] == ToolPosition({"x": 150.0, "y": -60.0}, "left")
    save(file, "tray", PICK, replaced=True)
    lines = BY_HAND.splitlines(keepends=True)
    assert file.read_text() == "".join([*lines[:6], pick.replace("pick", "tray"), *lines[7:], pick])
    delete_position(str(file), ROBOT, "tray")
    delete_position(str(file), ROBOT, "the bin")
    assert file.read_text() == "".join([*lines[:6], pick])


def test_a_file_without_positions_or_final_line_break(file: Path) -> None:
    file.write_text('title = "none yet"')
    save(file, "pick", PICK)
    assert file.read_text().startswith('title = "none yet"\n\n[positions]\npick = ')
    file.write_text("[positions]\na = { th1 = 1 }")
    save(file, "pick", PICK)
    assert list(read_positions(str(file), ROBOT)) == ["a", "pick"]


@pytest.mark.slow
@given(st.lists(st.integers(-(1 << 21), 1 << 21), min_size=4, max_size=4))
def test_numbers_are_exact_to_the_wire_unit(tmp_path_factory: pytest.TempPathFactory, units: list[int]) -> None:
    file = tmp_path_factory.mktemp("positions") / "positions.toml"
    save(file, "here", ROBOT.to_positions(np.array(units)).tolist())
    found = read_positions(str(file), ROBOT)["here"]
    assert isinstance(found, JointPosition)
    assert ROBOT.to_units(np.array([found.joints[name] for name in ROBOT.joint_names])).tolist() == units


def test_a_name_that_exists_is_not_replaced_unasked(file: Path) -> None:
    save(file, "pick", PICK)
    before = file.read_bytes()
    complaint = f"{file}: holds a position 'pick' already: --replace replaces it"
    assert complaint_of(lambda: save(file, "pick", [0.0] * 4)) == complaint
    assert file.read_bytes() == before
    save(file, "pick", [0.0] * 4, replaced=True)
    assert read_positions(str(file), ROBOT)["pick"] == JointPosition(dict.fromkeys(ROBOT.joint_names, 0.0))


@pytest.mark.parametrize("name", ["p", "Above_the-tray2", "9", "x" * 64])
def test_names(file: Path, name: str) -> None:
    save(file, name, PICK)
    assert list(read_positions(str(file), ROBOT)) == [name]


@pytest.mark.parametrize("name", ["", "a b", "a.b", "x" * 65, "ä", "a\n"])
def test_other_names_are_refused(file: Path, name: str) -> None:
    complaint = complaint_of(lambda: check_saving(str(file), ROBOT, name, replace=False))
    assert complaint == f"{name!r} is not a position's name: up to 64 letters, digits, - and _"


def test_an_unknown_name_is_not_deleted(file: Path) -> None:
    save(file, "pick", PICK)
    complaint = complaint_of(lambda: delete_position(str(file), ROBOT, "pik"))
    assert complaint == f"{file}: position 'pik' is unknown: did you mean pick?"


@pytest.mark.parametrize(
    "text",
    [
        "[positions]\npick = {\n th1 = 1,\n}\n",
        "[positions.pick]\nth1 = 1\n",
        "positions = { pick = { th1 = 1 } }\n",
        "positions.pick.th1 = 1\n",
    ],
)
def test_an_entry_of_several_lines_is_left_to_its_writer(file: Path, text: str) -> None:
    file.write_text(text)
    try:
        tomllib.loads(text)
    except ValueError:  # only later versions of TOML let a table in braces have several lines
        wanted = "is not TOML: "
    else:
        wanted = "pick: does not stand in one line of its own under [positions]: edit it by hand"
    for change in (
        lambda: save(file, "pick", PICK, replaced=True),
        lambda: delete_position(str(file), ROBOT, "pick"),
    ):
        assert complaint_of(change).startswith(f"{file}: {wanted}")
    assert file.read_text() == text


@pytest.mark.parametrize(
    "text",
    [
        'robot = "lab-scara"',
        "position = 1",
        "[positions]\na = 1",
        "[positions]\na = { th1 = 'x' }",
        "[positions]\na = { th1 = 1, x = 2 }",
        "[positions",
    ],
)
def test_a_wrong_file_says_what_is_wrong(file: Path, text: str) -> None:
    file.write_text(text)
    complaint_of(lambda: read_positions(str(file), ROBOT))
    complaint_of(lambda: save(file, "pick", PICK))
    assert file.read_text() == text


def test_names_from_a_robot_file_are_quoted_where_toml_needs_it(file: Path) -> None:
    shoulder = replace(ROBOT.joints[0], name='th"1 \\ a')
    robot = replace(ROBOT, name='my "arm" \\', joints=(shoulder, *ROBOT.joints[1:]), inputs={})
    save_position(str(file), robot, "pick", PICK, "", replace=False)
    assert read_positions(str(file), robot)["pick"] == JointPosition(dict(zip(robot.joint_names, PICK, strict=True)))
