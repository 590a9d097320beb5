"""Errands: what is carried, and what is left where."""

import pytest

from steptwin.features.shelf.errand import Carry, Errand, PlannedStock, job_carries
from steptwin.host.common.errors import InputError
from steptwin.host.robots import load_robot
from tests.features.shelf.shelves import ROBOT, SHELF, shelf_of
from tests.messages import refusing

JUDGED = ("A1", "A2", "B1", "B2", "hand-over")
"""Places at which a box stays until the robot takes it."""


@pytest.mark.parametrize(
    ("job", "options", "stock", "left"),
    [
        ("store", {}, {"hand-over": "box"}, {"A1": "box"}),
        ("store", {"slot": "B2", "pick_up": "pick-up"}, {"pick-up": "box"}, {"B2": "box"}),
        ("fetch", {"slot": "A2"}, {"A2": "box"}, {"hand-over": "box"}),
        ("fetch", {"output": "output"}, {"A1": "box"}, {}),
        ("every-slot", {}, {"hand-over": "box"}, {"hand-over": "box"}),
        ("every-slot", {"pick-up": "pick-up", "output": "output"}, {"pick-up": "box"}, {}),
        ("every-slot", {"pick-up": "pick-up"}, {"pick-up": "box"}, None),
        ("pull-line", {}, {}, {}),
    ],
)
def test_jobs(job: str, options: dict[str, str], stock: dict[str, str], left: dict[str, str] | None) -> None:
    errand = Errand.alone(job_carries(ROBOT, job, options))
    assert errand.stock == stock
    if left is None:  # the boxes from the feeder would pile up at the hand-over
        with refusing(InputError):
            errand.planned(SHELF)
    else:
        cleared = {"output": 4 if job == "every-slot" else 1} if "output" in options else {}
        assert errand.planned(SHELF) == PlannedStock(JUDGED, left, cleared=cleared)


@pytest.mark.parametrize(
    ("options", "parts"),
    [
        ({}, 0),
        ({"depth_mm": "0.5"}, 1),
        ({"depth_mm": "20", "repetitions": "3", "elbow": "left"}, 3),
        ({"depth_mm": "20", "from": "150,60"}, 0),
        ({"depth_mm": "20", "to": "150,60"}, 0),
    ],
)
def test_the_classroom_arm_carries_a_part_between_its_presets(options: dict[str, str], parts: int) -> None:
    robot = load_robot("teaching-scara")
    errand = Errand.alone(job_carries(robot, "carry", options))
    assert errand.carries == (Carry("qa", "qb"),) * parts
    cleared = {"qb": parts} if parts else {}
    assert errand.planned(shelf_of(robot)) == PlannedStock((), dict(errand.stock) if not parts else {}, cleared=cleared)


def test_a_box_that_is_not_there() -> None:
    with refusing(InputError):
        Errand({}, (Carry("A1", "hand-over"),)).stock_after(SHELF)
