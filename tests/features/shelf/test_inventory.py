"""Inventory files: slots allotted, boxes found, and files that are wrong."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from steptwin.features.shelf.inventory import Inventory, assign, read_inventory, write_inventory, written_after
from steptwin.host.common.errors import InputError
from steptwin.host.robots import load_robot
from tests.features.shelf.shelves import ROBOT, SHELF
from tests.host.complaints import complaint_of
from tests.messages import refusing

HEAD = 'robot = "warehouse-scara"\n'
SOME = Inventory("warehouse-scara", {"A1": "screws", "B1": "nuts"})


def read(folder: Path, text: str) -> Inventory:
    path = folder / "stock.toml"
    path.write_text(text, encoding="utf-8")
    return read_inventory(str(path), ROBOT)


@pytest.mark.parametrize(
    ("text", "complaints"),
    [
        ("[slots", ["is not TOML: Expected ']' at the end of a table declaration (at end of document)"]),
        (HEAD, ["slots: is missing"]),
        ("[slots]", ["robot: is missing"]),
        ('robot = "lab-scara"\n[slots]', ["robot: the inventory is for lab-scara, not for warehouse-scara"]),
        (
            'sots = 1\nrobot = "x"\nlocked = ["A3", 4]\n[slots]\nC1 = "a"\nA1 = 1\nA2 = "b"\nB1 = "b"',
            [
                "sots: key 'sots' is unknown: did you mean slots?",
                "robot: the inventory is for x, not for warehouse-scara",
                "slots.C1: slot 'C1' is unknown: there are A1, A2, B1, B2",
                "slots.A1: 1 is not a text",
                "slots.B1: 'b' is in slot A2 already",
                "locked[0]: slot 'A3' is unknown: there are A1, A2, B1, B2",
                "locked[1]: slot '4' is unknown: there are A1, A2, B1, B2",
            ],
        ),
        (HEAD + f'[slots]\nA1 = "{"x" * 65}"', [f"slots.A1: '{'x' * 12}...{'x' * 13}' has 65 characters"]),
        (HEAD + '[slots]\nA1 = "a\\u0007"', ["slots.A1: 'a\\x07' has characters that cannot be printed"]),
        (HEAD + "locked = 1\n[slots]", ["locked: 1 is not a list"]),
    ],
)
def test_wrong_files(text: str, complaints: list[str], tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        read(tmp_path, text)
    told = [message.removeprefix(f"{tmp_path}/stock.toml: ") for message in error.value.messages]
    assert [line.startswith(start) for line, start in zip(told, complaints, strict=True)] == [True] * len(told), told


def test_a_free_slot_may_be_named_with_an_empty_text(tmp_path: Path) -> None:
    assert read(tmp_path, HEAD + 'locked = ["B2"]\n[slots]\nB1 = "nuts"\nA2 = ""\nA1 = "screws"') == replace(
        SOME, locked=("B2",)
    )


def test_a_robot_without_a_shelf() -> None:
    complaint_of(lambda: read_inventory("x.toml", load_robot("lab-scara")))


@pytest.mark.parametrize(
    ("job", "options", "box", "slot"),
    [
        ("store", {}, "bolts", "A2"),
        ("store", {"slot": "B2"}, "bolts", "B2"),
        ("fetch", {}, "nuts", "B1"),
        ("fetch", {"slot": "B1"}, "nuts", "B1"),
        ("fetch", {"slot": "A1"}, None, "A1"),
    ],
)
def test_slots_that_are_found(job: str, options: dict[str, str], box: str | None, slot: str) -> None:
    assigned = assign(ROBOT, job, options, SOME, box)
    assert assigned.options == {**options, "slot": slot}
    after = written_after(SOME, assigned.errand, SHELF)
    if job == "store":
        assert after.boxes == {**SOME.boxes, slot: box}
        assert assigned.errand.stock == {**SOME.boxes, "hand-over": box}
    else:
        assert after.boxes == {other: held for other, held in SOME.boxes.items() if other != slot}


FULL = replace(SOME, boxes={"A1": "a", "A2": "b", "B1": "c"}, locked=("B2",))


@pytest.mark.parametrize(
    ("inventory", "job", "options", "box"),
    [
        (SOME, "store", {}, None),
        (SOME, "store", {}, "nuts"),
        (SOME, "store", {}, ""),
        (SOME, "store", {"slot": "A1"}, "bolts"),
        (FULL, "store", {}, "bolts"),
        (FULL, "store", {"slot": "B2"}, "bolts"),
        (SOME, "fetch", {}, "screw"),
        (SOME, "fetch", {}, None),
        (SOME, "fetch", {"slot": "A2"}, None),
        (SOME, "fetch", {"slot": "A1"}, "nuts"),
        (replace(SOME, locked=("B1",)), "fetch", {}, "nuts"),
        (SOME, "every-slot", {}, "bolts"),
        (Inventory("", {}, ("B2",)), "every-slot", {}, "bolts"),
        (SOME, "pull-line", {}, None),
        (SOME, "stor", {}, None),
    ],
)
def test_errands_that_cannot_be_done(
    inventory: Inventory, job: str, options: Mapping[str, str], box: str | None
) -> None:
    complaint_of(lambda: assign(ROBOT, job, options, inventory, box))


NAMES = st.text(min_size=1, max_size=64).filter(str.isprintable)


@pytest.mark.slow
@settings(max_examples=20)
@given(st.dictionaries(st.sampled_from(list(SHELF.slots)), NAMES), st.sets(st.sampled_from(list(SHELF.slots))))
def test_what_is_written_is_read(
    tmp_path_factory: pytest.TempPathFactory, boxes: dict[str, str], locked: set[str]
) -> None:
    path = str(tmp_path_factory.mktemp("inventory") / "stock.toml")
    unique = {slot: box for box, slot in {box: slot for slot, box in boxes.items()}.items()}
    inventory = Inventory(
        ROBOT.name,
        {slot: unique[slot] for slot in SHELF.slots if slot in unique},
        tuple(slot for slot in SHELF.slots if slot in locked),
    )
    write_inventory(path, Inventory(ROBOT.name), inventory, ROBOT)
    assert read_inventory(path, ROBOT) == inventory


def test_a_file_that_was_changed_meanwhile_stays(tmp_path: Path) -> None:
    before = read(tmp_path, HEAD + '[slots]\nA1 = "screws"')
    path = tmp_path / "stock.toml"
    changed = HEAD + '[slots]\nA1 = "screws"\nB2 = "bolts"'
    path.write_text(changed, encoding="utf-8")
    with refusing(InputError):
        write_inventory(str(path), before, Inventory(ROBOT.name, {"A2": "nuts"}), ROBOT)
    assert path.read_text(encoding="utf-8") == changed
