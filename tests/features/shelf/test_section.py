"""The shelf in a robot file: what is read, and one line for each mistake."""

import pytest

from steptwin.features.shelf.section import Shelf, Spot
from steptwin.host.common.errors import InputError
from steptwin.host.robots import brought_text, load_robot
from steptwin.host.robots.reader import read_robot
from tests.features.shelf.shelves import shelf_of
from tests.messages import refusing

TEXT = brought_text("warehouse-scara")


def test_the_shelf_of_the_paper() -> None:
    robot = load_robot("warehouse-scara")
    shelf = shelf_of(robot)
    assert shelf.travel_mm == 180.0
    assert {slot: shelf.striker_mm(slot, robot.boxes) for slot in shelf.slots} == {
        "A1": (675.0, 170.0, 160.0),
        "A2": (1075.0, 170.0, 160.0),
        "B1": (675.0, 170.0, 360.0),
        "B2": (1075.0, 170.0, 360.0),
    }
    assert shelf.sensors == {name: name for name in ("lock_engaged", "box_present", "drawer_end")}
    assert shelf.spots["pick-up"] == Spot((690.0, -173.2, 130.0), feeds=True)


@pytest.mark.parametrize(
    ("old", "new", "complaints"),
    [
        ('lock = "lock"  ', '# "lock"', ["shelf.lock: is missing"]),
        ('lock = "lock"  ', 'lock = "look"', ["shelf.lock: output 'look' is unknown: did you mean lock?"]),
        ('magnet = "magnet"  ', "magnet = 1  ", ["shelf.magnet: 1 is not a text"]),
        ("opening_mm = 60.0", "opening_mm = 180.0", []),
        (
            "opening_mm = 60.0",
            "opening_mm = 180.1",
            ["shelf.opening_mm: 180.1 mm is more than a drawer's way, 180 mm"],
        ),
        ("capture_mm = 2.0", "capture_mm = 0.0", ["shelf.capture_mm: 0 is not above 0"]),
        ('A2 = "drawer-A2"', 'A2 = "drawer-A1"', ["shelf.slots.A2: drawer-A1 is the drawer of A1 already"]),
        ('A2 = "drawer-A2"', 'A3 = "drawer-A2"', ["shelf.slots.A3: place 'A3' is unknown: there are "]),
        ('A2 = "drawer-A2"', 'A2 = "drawer"', ["shelf.slots.A2: box 'drawer' is unknown: did you mean drawer-A1 or "]),
        ('A2 = "drawer-A2"', 'output = "drawer-A2"', ["shelf.slots.output: is the name of a spot as well"]),
        ("feeds = true", "feeds = true\nclears = true", ["shelf.spots.pick-up.clears: a spot that feeds boxes cannot"]),
        ("feeds = true", "grip_mm = -0.1", ["shelf.spots.pick-up.grip_mm: -0.1 mm is negative"]),
        ("lid_mm = [390.0, -173.2, 130.0]", "lid_mm = [390.0]", ["shelf.spots.hand-over.lid_mm: has 1 values, but a"]),
        ('obstacles = ["shelf", ', 'obstacles = ["self", 3, ', ["shelf.obstacles[1]: 3 is not a text"]),
        (
            'obstacles = ["shelf", ',
            'obstacles = ["self", ',
            ["shelf.obstacles[0]: box 'self' is unknown: did you mean"],
        ),
        ('drawer_end = "drawer_end" ', 'drawer_end = "end" ', ["shelf.drawer_end: input 'end' is unknown: there are "]),
        ("[shelf.spots.output]", "[shelf.spots.outputs]", ["shelf.spots.outputs: place 'outputs' is unknown: did you"]),
    ],
)
def test_mistakes(old: str, new: str, complaints: list[str]) -> None:
    check_change(TEXT, old, new, complaints)


SPOTS = """[shelf.spots.qa] # [A] the middle of the part's upper side; the next part comes when one has been taken
"""


@pytest.mark.parametrize(
    ("old", "new", "complaints"),
    [
        ("capture_mm = 2.0 ", "# ", ["shelf.capture_mm: is missing"]),
        ('magnet = "gripper"', 'magnet = "griper"', ["shelf.magnet: output 'griper' is unknown: did you mean gripper"]),
        (SPOTS, f"[shelf.slots]\n{SPOTS}", ["shelf.lock: is missing", *(
            f"shelf.{key}: is missing" for key in ("travel_mm", "opening_mm", "arm_radius_mm"))]),
        ("capture_mm = 2.0 ", "capture_mm = 2.0\nspots = {}\n# ", ["is not TOML: "]),
        ("clears = true", "", []),
    ],
)  # fmt: skip
def test_spots_without_drawers(old: str, new: str, complaints: list[str]) -> None:
    """A shelf has all that drawers need, or only spots, whose names need no place."""
    check_change(brought_text("teaching-scara"), old, new, complaints)


def test_a_shelf_of_nothing() -> None:
    with refusing(InputError):
        Shelf("gripper", 2.0)


def check_change(text: str, old: str, new: str, complaints: list[str]) -> None:
    assert text.count(old) == 1
    text = text.replace(old, new)
    if not complaints:
        assert read_robot(text).sections
        return
    with pytest.raises(InputError) as error:
        read_robot(text)
    told = error.value.messages
    assert [line[: len(start)] for line, start in zip(told, complaints, strict=True)] == complaints, told
