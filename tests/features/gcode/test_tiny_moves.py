"""Moves to where the tool is, nearly there, and by next to nothing: a motion or one sentence, by every law."""

from pathlib import Path
from typing import Final

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.host.common.errors import InputError
from steptwin.host.common.findings import Findings
from steptwin.host.planning.no_way import NO_WAY
from steptwin.host.planning.planner import plan
from steptwin.host.planning.programs import CompiledProgram, compile_program, parse_program
from steptwin.host.robots import load_robot
from tests.host.complaints import complaint_of

ROBOT = load_robot("teaching-scara")
START = 'start = { x = 130.0, y = 0.0, z = -50.0, phi = 0.0, branch = "right" }\n'
LAWS = ("s-curve", "trapezoid", "cubic", "quintic", "fastest")
GO = "[[step]]\ngo = {{ th1 = 5.0 }}\nlaw = '{0}'\n"


def compiled(text: str, folder: Path = Path()) -> CompiledProgram:
    found = Findings()
    program = parse_program(text, found, folder)
    found.raise_first()
    return compile_program(program, ROBOT)


@pytest.mark.parametrize("law", LAWS)
def test_a_second_move_to_a_place_makes_none(law: str) -> None:
    twice = compiled(2 * GO.format(law))
    assert [row.duration_s for row in twice.steps][1] == 0.0
    assert twice.motion.duration_s == compiled(GO.format(law)).motion.duration_s


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("by_deg", [1e-13, 0.9 * NO_WAY, 1.1 * NO_WAY, 1e-5, 1e-4])
def test_a_move_by_next_to_nothing_is_a_motion_from_the_tolerance_on(law: str, by_deg: float) -> None:
    text = GO.format(law) + f"[[step]]\nby = {{ th1 = {by_deg!r} }}\nlaw = '{law}'\n"
    rows = compiled(text).steps
    assert (rows[1].duration_s > 0.0) is (by_deg > NO_WAY)


def test_a_line_to_where_the_tool_is_ends_what_flows_into_it() -> None:
    there = "line = { x = 140.0, y = 5.0, z = -50.0, phi = 0.0 }\nspeed_mm_s = 20.0\n"
    text = START + f"[[step]]\n{there}blend_mm = 1.0\n[[step]]\n{there}[[step]]\npause = 0.5\n"
    assert len(compiled(text).steps) == 3


def test_outputs_on_no_way_are_refused() -> None:
    text = START + "[[step]]\nline = { x = 130.0, y = 0.0, z = -50.0, phi = 0.0 }\nspeed_mm_s = 20.0\n"
    told = complaint_of(lambda: compiled(text + "outputs = [{ gripper = true, at_mm = 0.0 }]\n"))
    assert "outputs.gripper: the tool is there already, so it has no way" in told


PLATE = START + '[frames.plate]\nx = 130.0\ny = 0.0\nz = -50.0\n[[step]]\ngcode = "a.ngc"\nframe = "plate"\n'


def cutting(folder: Path, gcode: str) -> CompiledProgram:
    (folder / "a.ngc").write_text(gcode, encoding="utf-8")
    return compiled(PLATE, folder)


@pytest.mark.parametrize("again", ["G28\nG28", "G0 X1\nG0 X1", "G1 X1\nX1\nX1.0000000001", "G3 I0.000002"])
def test_gcode_that_repeats_a_place_is_planned(tmp_path: Path, again: str) -> None:
    once = cutting(tmp_path, f"F600\n{again}\n")
    assert plan(ROBOT, once.motion).motion.duration_s > 0.0


def test_tiny_relative_moves_do_not_get_lost(tmp_path: Path) -> None:
    many = cutting(tmp_path, "F6000\nG91 G64 P0.01\n" + 12 * "G1 X0.0000009\n")
    one = cutting(tmp_path, "F6000\nG1 X0.0000108\n")
    ends = [each.motion.positions(each.motion.duration_s * _ONE)[0] for each in (many, one)]
    assert ends[0] == pytest.approx(ends[1], abs=1.5e-6)


_ONE: Final = pytest.importorskip("numpy").ones(1)

TINY = st.sampled_from([0.0, 1e-16, 1e-10, 1e-7, 9e-7, 1.1e-6, 1e-5, 1e-4, 1e-3])
NEAR = st.builds(lambda at, off, sign: at + sign * off, st.sampled_from([0.0, 5.0]), TINY, st.sampled_from([1, -1]))


def _word(letter: str, value: float) -> str:
    return f"{letter}{value:.17f}"


LINES = st.one_of(
    st.builds(lambda code, x, y: f"{code} {_word('X', x)} {_word('Y', y)}", st.sampled_from(["G0", "G1"]), NEAR, NEAR),
    st.builds(
        lambda code, x, y, i: f"{code} {_word('X', x)} {_word('Y', y)} {_word('I', i)}",
        st.sampled_from(["G2", "G3"]),
        NEAR,
        NEAR,
        NEAR,
    ),
    st.builds(
        lambda code, x, r: f"{code} {_word('X', x)} {_word('R', r)}",
        st.sampled_from(["G2", "G3"]),
        NEAR,
        st.sampled_from([5.0, -5.0, 100.0, 1e-5]),
    ),
    st.sampled_from(["G28", "G61", "G64 P0.01", "G64", "G91", "G90"]),
)


@pytest.mark.slow
@given(st.lists(LINES, min_size=1, max_size=6))
@settings(max_examples=150)
def test_any_gcode_of_small_moves_is_a_motion_or_one_sentence(
    tmp_path_factory: pytest.TempPathFactory, lines: list[str]
) -> None:
    complaint = ""
    try:
        plan(ROBOT, cutting(tmp_path_factory.getbasetemp(), "\n".join(["F600", *lines]) + "\n").motion)
    except InputError as error:
        complaint = str(error)
    assert len(complaint.splitlines()) <= 1


def _pose(x: float, y: float) -> str:
    return f"{{ x = {130.0 + x!r}, y = {y!r}, z = -50.0 }}"


STEPS = st.one_of(
    st.builds(lambda x, y: f"go = {_pose(x, y)}", NEAR, NEAR),
    st.builds(lambda x: f"by = {{ th1 = {x!r} }}", NEAR),
    st.builds(lambda x, y: f"line = {_pose(x, y)}\nspeed_mm_s = 20.0", NEAR, NEAR),
    st.builds(lambda x, y, u, v: f"arc = [{_pose(x, y)}, {_pose(u, v)}]\nspeed_mm_s = 20.0", NEAR, NEAR, NEAR, NEAR),
    st.builds(lambda x, y: f"circle = {{ x = {130.0 + x!r}, y = {y!r} }}\nspeed_mm_s = 20.0", NEAR, NEAR),
)
ENDS = st.sampled_from(["", "", 'law = "fastest"', "blend_mm = 0.0", "blend_mm = 1e-6", "blend_mm = 0.5"])


@pytest.mark.slow
@given(st.lists(st.tuples(STEPS, ENDS), min_size=1, max_size=4))
@settings(max_examples=150)
def test_any_program_of_small_moves_is_a_motion_or_one_sentence(steps: list[tuple[str, str]]) -> None:
    complaint = ""
    try:
        plan(ROBOT, compiled(START + "".join(f"[[step]]\n{step}\n{end}\n" for step, end in steps)).motion)
    except InputError as error:
        complaint = str(error)
    assert len(complaint.splitlines()) <= 1


# --- limits of a whole program


def test_the_cells_of_all_pallets_are_bounded_together(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("steptwin.host.planning.programs.pallets.PROGRAM_CELLS_MAX", 20)
    pallet = "[pallets.p{0}]\nfirst = {{ x = 1, y = 1, z = 1 }}\nalong = {{ count = 5, pitch = {{ x = 1 }} }}\n"
    found = Findings()
    parse_program("[[step]]\npause = 1.0\n" + "".join(map(pallet.format, range(6))), found)
    assert found.messages[0] == "pallets.p4: makes 25 cells with the pallets before; a program has at most 20"


def test_the_gcode_of_all_steps_is_bounded_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("steptwin.host.planning.programs.program_file.STEP_FILES_BYTES_MAX", 20)
    (tmp_path / "a.ngc").write_text("G0 X1\n", encoding="utf-8")
    found = Findings()
    parse_program(5 * '[[step]]\ngcode = "a.ngc"\n', found, tmp_path)
    assert found.messages[0].startswith(
        "step 4: a.ngc: the files of the program's steps have more than 20 bytes together"
    )
    assert len(found.messages) == 2


def test_cells_of_thousands_of_digits_are_a_sentence() -> None:
    text = (
        "[pallets.p]\nfirst = { x = 1, y = 1, z = 1 }\nalong = { count = 5, pitch = { x = 1 } }\n"
        f'[[step]]\neach = "p"\ncells = "{"1" * 5000}"\nsteps = [ {{ pause = 1.0 }} ]\n'
    )
    assert "is not such as 3..7, or 5" in complaint_of(lambda: compiled(text))
