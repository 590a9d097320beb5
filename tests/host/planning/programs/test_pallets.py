"""Pallets and frames: where the cells are, in which order they are visited, and what is refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.host.common.findings import Findings
from steptwin.host.planning.programs import CompiledProgram, Program, compile_program, parse_program
from steptwin.host.planning.programs.pallets import Pallet
from steptwin.host.planning.programs.positions import ToolPosition
from steptwin.host.robots import load_robot
from tests.host.planning.programs.test_compiling import tool

ROBOT = load_robot("teaching-scara")
HEAD = "start = { th1 = 40, th2 = 60, d3 = 5, th4 = 0 }\n"
FRAME = "[frames.table]\nx = 60\ny = 100\nphi = 30\n"
BOX = """[pallets.box]
first = { x = 70.0, y = 110.0, z = -95.0, phi = 0.0 }
along = { pitch = { x = 10.0 }, count = 3 }
across = { to = { y = 130.0 }, count = 2 }
up = { pitch = { z = 15.0 }, count = 2 }
"""
VISIT = '[[step]]\neach = "box"\nsteps = [{ go = { cell = "box", offset = { z = 10.0 } } }]\n'


def parsed(text: str) -> Program:
    found = Findings()
    program = parse_program(f"{HEAD}{text}", found)
    assert found.messages == []
    return program


def box(text: str) -> Pallet:
    pallet = parsed(f"{text}[[step]]\npause = 1.0\n").pallets["box"]
    assert pallet is not None
    return pallet


def places(pallet: Pallet) -> list[tuple[float, ...]]:
    return [tuple(round(cell.coordinates[name], 9) for name in ("x", "y", "z", "phi")) for cell in pallet.cells]


def complaints(text: str) -> list[str]:
    found = Findings()
    program = parse_program(f"{HEAD}{text}", found)
    if not found.messages:
        compile_program(program, ROBOT, found)
    return found.messages


def compiled(text: str) -> CompiledProgram:
    return compile_program(parsed(text), ROBOT)


def test_cells_run_along_across_and_up() -> None:
    pallet = box(BOX)
    assert pallet.labels[:4] == ("1,1,1", "2,1,1", "3,1,1", "1,2,1")
    assert places(pallet)[:4] == [(70, 110, -95, 0), (80, 110, -95, 0), (90, 110, -95, 0), (70, 130, -95, 0)]
    assert places(pallet)[-1] == (90, 130, -80, 0)
    assert len(pallet.cells) == 12


def test_another_order_and_a_zigzag() -> None:
    pallet = box(BOX + 'order = ["across", "along", "up"]\nzigzag = true\n')
    assert pallet.labels[:6] == ("1,1,1", "1,2,1", "2,2,1", "2,1,1", "3,1,1", "3,2,1")


def test_a_fourth_corner_bends_the_grid_evenly() -> None:
    """The bilinear rule: the middle of the far edge takes half of what the corner is off."""
    pallet = box(BOX + "fourth = { x = 94.0, y = 132.0 }\n")
    by_label = dict(zip(pallet.labels, places(pallet), strict=True))
    assert by_label["3,2,1"] == (94, 132, -95, 0)
    assert by_label["2,2,1"] == (82, 131, -95, 0)
    assert by_label["2,1,1"] == (80, 110, -95, 0)


@pytest.mark.slow
@settings(max_examples=50)
@given(st.floats(-180, 180), st.floats(-50, 50), st.floats(-50, 50))
def test_a_frame_turns_and_moves_the_cells(phi: float, x: float, y: float) -> None:
    frame = f'[frames.table]\nx = {x!r}\ny = {y!r}\nz = 3.0\nphi = {phi!r}\n{BOX}frame = "table"\n'
    plain, placed = np.array(places(box(BOX))), np.array(places(box(frame)))
    angle = np.deg2rad(phi)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    assert placed[:, :2] == pytest.approx(plain[:, :2] @ turn.T + [x, y], abs=1e-6)
    assert placed[:, 2] == pytest.approx(plain[:, 2] + 3.0, abs=1e-6)
    assert placed[:, 3] == pytest.approx(plain[:, 3] + phi, abs=1e-6)


def test_a_tilted_frame_turns_orientations() -> None:
    text = (
        "[frames.ramp]\nx = 10\nrpy_deg = [0, 90, 0]\n[positions]\n"
        'a = { x = 1, y = 2, z = 3, rpy_deg = [0, 0, 0], frame = "ramp" }\n[[step]]\npause = 1.0\n'
    )
    at = parsed(text).positions["a"]
    assert isinstance(at, ToolPosition)
    assert [at.coordinates[name] for name in "xyz"] == pytest.approx([13.0, 2.0, -1.0])  # x' is -z, z' is x
    assert at.orientation is not None
    assert np.abs(at.orientation.rotation) == pytest.approx([0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)])


def test_each_cell_is_visited_with_its_offset_along_the_frame() -> None:
    offset = "offset = { x = 5.0, z = 10.0 }"
    pallet = FRAME + '[pallets.box]\nframe = "table"\nfirst = { x = 0, y = 0, z = -95, phi = 0 }\n'
    pallet += "along = { pitch = { x = 15.0 }, count = 3 }\n"
    program = compiled(f'{pallet}[[step]]\neach = "box"\nsteps = [{{ go = {{ cell = "box", {offset} }} }}]\n')
    ends = np.array([row.from_s + row.duration_s for row in program.steps])
    poses = tool(program.motion.positions(ends))
    way = np.array([5.0, 20.0, 35.0])
    angle = np.deg2rad(30.0)
    assert poses[:, :2] == pytest.approx(
        np.column_stack([60 + way * np.cos(angle), 100 + way * np.sin(angle)]), abs=1e-6
    )
    assert poses[:, 2] == pytest.approx(np.full(3, -85.0))
    assert poses[:, 3] == pytest.approx(np.full(3, 30.0))
    assert [str(row.place) for row in program.steps] == [f"step 1.1, cell {i},1,1" for i in (1, 2, 3)]


def test_some_cells_alone_two_pallets_at_once_and_a_sequence() -> None:
    tray = BOX.replace("pallets.box", "pallets.tray").replace("x = 70.0", "x = 60.0")
    steps = '[[sequences.visit]]\ngo = { cell = "tray" }\n[[sequences.visit]]\ngo = { cell = "box" }\n'
    each = '[[step]]\neach = ["tray", "box"]\ncells = "2..3"\nsteps = [{ call = "visit" }]\n'
    program = compiled(BOX + tray + steps + each)
    ends = np.array([row.from_s + row.duration_s for row in program.steps])
    assert tool(program.motion.positions(ends))[:, 0] == pytest.approx([70.0, 80.0, 80.0, 90.0])


def test_a_position_beside_a_named_one() -> None:
    at = "[positions]\na = { x = 80.0, y = 120.0, z = -90.0, phi = 5.0 }\n"
    program = compiled(at + '[[step]]\ngo = { at = "a", offset = { z = 30.0, phi = 10.0 } }\n')
    end = tool(program.motion.positions(np.array([program.motion.duration_s])))[0]
    assert end == pytest.approx([80.0, 120.0, -60.0, 15.0])


def test_the_page_s_pallet_has_24_cells_in_few_lines() -> None:
    text = "[pallets.box]\nfirst = { x = 70, y = 100, z = -95, phi = 0 }\n" + (
        "along = { pitch = { x = 10.0 }, count = 3 }\nacross = { pitch = { y = 10.0 }, count = 4 }\n"
        "up = { pitch = { z = 15.0 }, count = 2 }\n"
    )
    program = compiled(text + VISIT)
    assert len(program.steps) == 24


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (BOX + VISIT.replace('each = "box"', 'each = "bocks"'), "step 1: pallet 'bocks' is unknown: there are box"),
        (
            BOX + '[[step]]\ngo = { cell = "box" }\n',
            "step 1 (go to cell of box): cell: 'box' has no present cell: put the step into `each = \"box\"`",
        ),
        (BOX + VISIT + 'cells = "5..13"\n', "step 1: cells: 5..13: the cells of box are 1..12"),
        (BOX + VISIT + 'cells = "a"\n', "step 1: cells: 'a' is not such as 3..7, or 5"),
        (
            BOX
            + BOX.replace("pallets.box", "pallets.tray").replace("count = 3", "count = 4")
            + '[[step]]\neach = ["box", "tray"]\nsteps = [{ pause = 1.0 }]\n',
            "step 1: each: pallets that are visited at once have as many cells: box has 12 and tray has 16",
        ),
        (BOX.replace("count = 3", "count = 0") + VISIT, "pallets.box.along.count: 0 is below 1"),
        (
            BOX.replace("pitch = { x = 10.0 }", "pitch = { x = 10.0 }, to = { x = 90.0 }") + VISIT,
            "pallets.box.along: has exactly one of `to`",
        ),
        (BOX + 'frame = "tabel"\n' + FRAME + VISIT, "pallets.box.frame: 'tabel' is unknown: did you mean table?"),
        (BOX.replace("z = -95.0, ", "") + VISIT, "pallets.box: first: z: is missing: the first cell has x, y and z"),
        (BOX + 'order = ["along", "up"]\n' + VISIT, "pallets.box: order: is not all of along, across, up, each once"),
        (
            BOX.replace("x = 10.0", "x = 60.0") + VISIT,
            "pallets.box: 4 of 12 cells are out of reach, 3,1,1, 3,2,1, 3,1,2, 3,2,2: ",
        ),
        (
            '[positions]\na = { th1 = 5.0 }\n[[step]]\ngo = { at = "a", offset = { z = 3.0 } }\n',
            "step 1 (go to a and z 3): at: 'a' is a position of the joints; an offset is beside one of the tool",
        ),
    ],
)
def test_one_line_says_what_is_wrong(text: str, says: str) -> None:
    found = complaints(text)
    assert found
    assert found[0].startswith(says), found
