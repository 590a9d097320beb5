"""`steptwin positions` and `move --to`: positions of a live board by name, in a file."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from steptwin.host.cli.app import run
from steptwin.host.operate.moving import move
from steptwin.host.operate.session import Session
from steptwin.host.planning.programs.positions import read_positions
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from tests.host.operate.sessions import HALF_STEPS, HOME, ROBOT, CommandLine

FILE = "warehouse-scara-positions.toml"
PLACE = [100.0, 20.0, 120.0, 30.0, 40.0, -60.0]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Work in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def offline(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    exit_code = run(["positions", *words])
    out, err = capsys.readouterr()
    return exit_code, out, err


@pytest.mark.slow
def test_save_and_return(steptwin: CommandLine, board: EmbeddedBoard, session: Session) -> None:
    """In the same wire units, from anywhere."""
    move(session, PLACE)
    units = session.demanded_units()
    saved = steptwin.json("positions save pick warehouse-scara")
    assert list(saved) == ["robot", "file", "name", "joints"]
    assert saved["file"] == FILE
    move(session, HOME)
    document = steptwin.json("move warehouse-scara --to pick")
    assert list(document["goal"].values()) == pytest.approx(PLACE, abs=1e-4)
    assert session.demanded_units() == units
    counted = np.array(board.driver_positions()) / ROBOT.steps_per_unit
    assert np.all(np.abs(counted - PLACE) <= HALF_STEPS)
    said = re.findall(r"# tool: x (\S+) mm, y (\S+) mm, z (\S+) mm, (\S+) deg\n$", Path(FILE).read_text())
    assert [float(text) for text in said[0]] == pytest.approx(
        make_kinematics(ROBOT).forward(np.array([PLACE]))[0].tolist(), abs=1e-3
    )


@pytest.mark.usefixtures("session")
def test_an_existing_name_is_replaced_only_if_asked(
    steptwin: CommandLine, board: EmbeddedBoard, session: Session
) -> None:
    assert steptwin.run("positions save pick warehouse-scara")[0] == 0
    before, sent = Path(FILE).read_text(), len(board.bus_log)
    refused = f"steptwin: {FILE}: holds a position 'pick' already: --replace replaces it\n"
    assert steptwin.run("positions save pick warehouse-scara") == (2, "", refused)
    assert Path(FILE).read_text() == before
    assert len(board.bus_log) == sent
    move(session, PLACE)
    assert steptwin.json("positions save pick warehouse-scara --replace")["joints"] == pytest.approx(
        dict(zip(ROBOT.joint_names, PLACE, strict=True)), abs=1e-4
    )
    assert list(read_positions(FILE, ROBOT)) == ["pick"]


def test_an_unhomed_machine_is_refused(steptwin: CommandLine) -> None:
    unknown = "steptwin: sx: the position is unknown: home the machine first, `steptwin home`\n"
    assert steptwin.run("positions save pick warehouse-scara") == (3, "", unknown)
    assert not Path(FILE).exists()


def test_a_moving_machine_is_refused(steptwin: CommandLine, session: Session) -> None:
    seen: list[Any] = []

    def halfway(fraction: float) -> None:
        if fraction > 0.5 and not seen:
            seen.append(steptwin.run("positions save pick warehouse-scara"))

    move(session, PLACE, progress=halfway)
    assert seen[0][:2] == (4, "")
    assert "another program is in charge of the machine" in seen[0][2]
    assert not Path(FILE).exists()


def test_listing_and_deleting_need_no_board(capsys: pytest.CaptureFixture[str]) -> None:
    Path(FILE).write_text("[positions]\na = { sx = 1.5, th1 = -2 }  # mine\nb = { x = 300, branch = 'left' }\n")
    exit_code, out, _ = offline(capsys, "list", ROBOT.name)
    assert exit_code == 0
    assert [line.rstrip().split(None, 1) for line in out.splitlines()[2:]] == [
        ["a", "sx 1.5, th1 -2"],
        ["b", "tool: x 300 (left)"],
    ]
    exit_code, out, _ = offline(capsys, "list", ROBOT.name, "--json")
    assert json.loads(out) == {
        "robot": ROBOT.name,
        "file": FILE,
        "positions": {"a": {"joints": {"sx": 1.5, "th1": -2.0}}, "b": {"tool": {"x": 300.0}, "branch": "left"}},
    }
    assert offline(capsys, "delete", "b", ROBOT.name) == (0, f"{FILE}: b deleted\n", "")
    assert Path(FILE).read_text() == "[positions]\na = { sx = 1.5, th1 = -2 }  # mine\n"
    exit_code, out, _ = offline(capsys, "delete", "a", ROBOT.name, "--json")
    assert json.loads(out) == {"robot": ROBOT.name, "file": FILE, "deleted": "a"}
    assert read_positions(FILE, ROBOT) == {}


@pytest.mark.slow
@pytest.mark.usefixtures("session")
def test_positions_written_by_hand(steptwin: CommandLine, session: Session) -> None:
    """Of some joints, the others stay; of the tool, coordinates that are left out stay."""
    Path("mine.toml").write_text("[positions]\nturned = { th1 = 20 }\nlow = { z = 40, branch = 'right' }\n")
    assert steptwin.json("move warehouse-scara --to turned --file mine.toml")["goal"] == pytest.approx(
        dict(zip(ROBOT.joint_names, [*HOME[:3], 20, *HOME[4:]], strict=True)), abs=1e-4
    )
    before = session.pose(session.positions(session.demanded_units()))
    assert before
    document = steptwin.json("move warehouse-scara --to low --file mine.toml")
    assert document["pose"] == pytest.approx(before | {"z_mm": 40.0}, abs=0.1)


@pytest.mark.usefixtures("session")
@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--to pik", f"{FILE}: position 'pik' is unknown: did you mean pick?"),
        ("--to far", "--to far: sx: 9999.0 mm is outside 0..2000 mm"),
        ("--to other", "--to other: joint 'd3' is unknown: there are sx, sz, L1, th1, th2, th3"),
        ("--to away", "--to away: x 9000, y "),
        ("--to pick sx=3", "where to? either joints, or a tool pose by --x, --y, --z, --phi, or a saved position by"),
        ("--to pick --x 3", "where to? either joints, or a tool pose by --x, --y, --z, --phi, or a saved position by"),
        ("sx=3 --file mine.toml", "--file mine.toml: is for --to NAME"),
        ("--to pick --file none.toml", "none.toml: No such file or directory"),
    ],
)
def test_a_wrong_place_to_move_to(steptwin: CommandLine, board: EmbeddedBoard, words: str, message: str) -> None:
    Path(FILE).write_text(
        "[positions]\npick = { sx = 1 }\nfar = { sx = 9999 }\nother = { d3 = 1 }\naway = { x = 9000 }\n"
    )
    before = board.driver_positions()
    exit_code, out, err = steptwin.run(f"move warehouse-scara {words}")
    assert (exit_code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith(f"steptwin: {message}")
    assert board.driver_positions() == before


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("", "what? save, list, delete"),
        ("keep pick warehouse-scara", "action 'keep' is unknown: there are save, list, delete"),
        ("save", "save: NAME is missing: save NAME ROBOT"),
        ("save pick", "ROBOT is missing: a robot's name, or --robot-file FILE"),
        ("save a.b warehouse-scara", "'a.b' is not a position's name: up to 64 letters, digits, - and _"),
        ("list warehouse-scara pick", "'pick' is one word too many: list ROBOT"),
        ("delete a warehouse-scara b", "'b' is one word too many: delete NAME ROBOT"),
        ("list warehouse-scara --connect 127.0.0.1", "list: needs no board and takes no --replace; they are for save"),
        ("delete a warehouse-scara --replace", "delete: needs no board and takes no --replace; they are for save"),
        ("list warehouse-scara", f"{FILE}: No such file or directory"),
        ("save pick warehouse-scara", "which board? --connect HOST:PORT, or -i INTERFACE -c CHANNEL"),
    ],
)
def test_bad_input(capsys: pytest.CaptureFixture[str], words: str, message: str) -> None:
    assert offline(capsys, *words.split()) == (2, "", f"steptwin: {message}\n")


@pytest.mark.usefixtures("session")
def test_a_full_disk_leaves_the_file_as_it_was(steptwin: CommandLine, monkeypatch: pytest.MonkeyPatch) -> None:
    assert steptwin.run("positions save pick warehouse-scara")[0] == 0
    before = Path(FILE).read_text()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    full_disk = f"steptwin: {FILE}: No space left on device\n"
    assert steptwin.run("positions save place warehouse-scara") == (2, "", full_disk)
    assert Path(FILE).read_text() == before
    assert [path.name for path in Path().iterdir()] == [FILE]
