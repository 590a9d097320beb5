"""Personalities of a user's own, what is wrong in their files, and where they are named."""

from pathlib import Path

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.personalities.options import PersonalityOptions
from steptwin.features.personalities.personality import load_personality
from steptwin.host.common.errors import InputError
from steptwin.host.robots import brought_text, load_robot, load_robot_file
from steptwin.host.twin.board_under_test import BoardUnderTest
from tests.messages import refusing

OWN = """
base = "epos4"
device = "My EPOS4"
increments_per_revolution = 4000

[sources]
MINE = "read from my drive"

[objects]
6081 = { default = 3000, source = "MINE" }
2100 = { behind = "store", name = "My number", type = "u16", access = "rw", default = 7, source = "MINE" }
"""


def own(folder: Path, text: str = OWN) -> str:
    (folder / "mine.toml").write_text(text, encoding="utf-8")
    return str(folder / "mine.toml")


def test_a_file_adds_to_its_base(tmp_path: Path) -> None:
    made, base = load_personality(own(tmp_path)), load_personality("epos4")
    assert (made.name, made.device) == ("mine", "My EPOS4")
    assert made.entries[0x6081_00].default == 3000
    assert made.entries[0x2100_00].default == 7
    assert made.entries[0x6083_00] == base.entries[0x6083_00]
    assert len(made.entries) == len(base.entries) + 1


def test_a_robot_file_names_it(fast_kernel: Kernel, tmp_path: Path) -> None:
    text = brought_text("teaching-scara").replace("[board]", '[board]\npersonality = "epos4"', 1)
    file = tmp_path / "mine.toml"
    file.write_text(text, encoding="utf-8")
    board = BoardUnderTest(load_robot_file(file), kernel=fast_kernel)
    assert board.network.add_node(0x10).sdo.upload(0x1018, 1) == bytes((0xFB, 0, 0, 0))
    options = PersonalityOptions(personality="nanotec-cl3")
    other = BoardUnderTest(load_robot_file(file), kernel=fast_kernel, extras=[options])
    assert other.network.add_node(0x10).sdo.upload(0x1018, 1) == bytes((0x6C, 2, 0, 0))


def test_the_axes_of_a_board_have_objects_of_their_own(fast_kernel: Kernel) -> None:
    options = PersonalityOptions(personality="epos4")
    board = BoardUnderTest(load_robot("teaching-scara"), kernel=fast_kernel, extras=[options])
    first, second = (board.network.add_node(node_id).sdo for node_id in (0x10, 0x11))
    first.download(0x6081, 0, (777).to_bytes(4, "little"))
    assert second.upload(0x6081, 0) == (1000).to_bytes(4, "little")
    assert second.upload(0x1200, 1) == (0x611).to_bytes(4, "little")


PDOS = """
[pdos]
source = "MINE"
receive = [{}, {}, {}, {}]
transmit = [{}, {}, {}, {}]
"""
WRONG = {
    "unknown-key": OWN.replace("default = 3000", "defualt = 3000"),
    "no-source": OWN.replace(', source = "MINE" }\n2100', " }\n2100"),
    "unknown-source": OWN.replace('source = "MINE" }\n2100', 'source = "MIEN" }\n2100'),
    "no-object": OWN.replace("2100 =", "210 ="),
    "no-firmware-object": OWN.replace('behind = "store", ', ""),
    "no-type": OWN.replace('type = "u16", ', ""),
    "beyond-limits": OWN.replace("default = 7", "default = 70000"),
    "no-default": OWN.replace("default = 3000, ", ""),
    "a-unit-of-length": OWN
    + '60A9 = { behind = "store", type = "u32", access = "rw", name = "a", default = 0x0001_0300, source = "MINE" }\n',
    "hidden-and-shown": OWN.replace("[objects]", "[hidden]\n6081 = 5\n\n[objects]"),
    "no-base": OWN.replace('base = "epos4"', ""),
    "unmappable": OWN
    + '\n[pdos]\nsource = "MINE"\nreceive = [{ map = ["6041"] }, {}, {}, {}]\ntransmit = [{}, {}, {}, {}]\n',
    "three-pdos": OWN + '\n[pdos]\nsource = "MINE"\nreceive = [{}, {}, {}]\ntransmit = [{}, {}, {}, {}]\n',
    "itself": OWN.replace('base = "epos4"', 'base = "mine.toml"'),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_wrong_is_told_with_its_place(wrong: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    own(tmp_path, WRONG[wrong])
    with refusing(InputError):
        load_personality("mine.toml")


def test_an_unknown_name_is_told_with_the_nearest() -> None:
    with refusing(InputError):
        load_personality("epso4")
