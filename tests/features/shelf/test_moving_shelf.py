"""The emulated shelf: drawers, boxes and sensors, at both sides of every limit."""

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from steptwin.features.shelf.moving_shelf import MovingShelf, Point, Sensed, ShelfConfig, ShelfEventKind, SpotConfig
from tests.one_example import one_example

STRIKER: Point = (675.0, 170.0, 160.0)
OTHER: Point = (1075.0, 170.0, 160.0)
TABLE: Point = (390.0, -173.0, 130.0)
FEEDER: Point = (1690.0, -173.0, 130.0)
EXIT: Point = (1990.0, -173.0, 130.0)
PART: Point = (195.0, 0.0, -42.0)
BENCH: Point = (138.0, 36.0, -42.0)
"""Two spots for a part that a gripper takes up to 58 mm below its upper side."""
NOWHERE: Point = (0.0, 0.0, 0.0)


def moved(point: Point, x_mm: float = 0.0, y_mm: float = 0.0, z_mm: float = 0.0) -> Point:
    return point[0] + x_mm, point[1] + y_mm, point[2] + z_mm


class Hand:
    """A hand at a shelf with a box on the table and one in B1; every action is a look, 10 counts after the last."""

    def __init__(self, *locked: str) -> None:
        self.shelf = MovingShelf(
            ShelfConfig(
                strikers_mm={"A1": STRIKER, "B1": OTHER},
                spots={
                    "table": SpotConfig(TABLE),
                    "feeder": SpotConfig(FEEDER, feeds=True),
                    "exit": SpotConfig(EXIT, clears=True),
                    "part": SpotConfig(PART, grip_mm=58.0),
                    "bench": SpotConfig(BENCH, grip_mm=58.0),
                },
                travel_mm=180.0,
                opening_mm=60.0,
                capture_mm=2.0,
                stock={"table": "screws", "B1": "nuts", "part": "gear"},
                locked=frozenset(locked),
            )
        )
        self.lock = self.magnet = False
        self.tip = NOWHERE
        self.counts = 0

    def at(self, tip: Point, *, lock: bool | None = None, magnet: bool | None = None) -> "Hand":
        self.tip = tip
        self.lock = self.lock if lock is None else lock
        self.magnet = self.magnet if magnet is None else magnet
        self.counts += 10
        self.shelf.look(self.counts, tip, lock=self.lock, magnet=self.magnet)
        return self

    def holding_drawer(self, slot: Point = STRIKER) -> "Hand":
        return self.at(slot, lock=True)

    def carrying(self) -> "Hand":
        return self.at(TABLE, magnet=True)

    def gripping(self, depth_mm: float) -> "Hand":
        return self.at(moved(PART, z_mm=-depth_mm), magnet=True)

    @property
    def kinds(self) -> list[ShelfEventKind]:
        return [event.kind for event in self.shelf.events]

    @property
    def last(self) -> tuple[ShelfEventKind, str, str]:
        event = self.shelf.events[-1]
        return event.kind, event.where, event.box


def test_a_box_is_stored_and_the_sensors_see_each_step() -> None:
    hand = Hand()
    assert hand.shelf.sensed == Sensed()
    assert hand.carrying().shelf.sensed == Sensed(box_present=True)
    assert hand.holding_drawer().shelf.sensed == Sensed(lock_engaged=True, box_present=True)
    pulled = moved(STRIKER, y_mm=-180.0)
    assert hand.at(pulled).shelf.sensed == Sensed(lock_engaged=True, box_present=True, drawer_end=True)
    assert hand.at(pulled, magnet=False).shelf.sensed == Sensed(lock_engaged=True, drawer_end=True)
    assert hand.at(STRIKER).shelf.sensed == Sensed(lock_engaged=True)
    assert hand.at(STRIKER, lock=False).shelf.sensed == Sensed()
    assert hand.kinds == [
        ShelfEventKind.TAKEN,
        ShelfEventKind.LOCKED_ON,
        ShelfEventKind.PUT,
        ShelfEventKind.UNLOCKED,
    ]
    assert [event.counts for event in hand.shelf.events] == [10, 20, 40, 60]
    assert hand.shelf.stock == {"B1": "nuts", "A1": "screws", "feeder": "feeder-1", "part": "gear"}
    assert hand.shelf.out_mm == {"A1": 0.0, "B1": 0.0}


@pytest.mark.parametrize(
    ("what", "right", "wrong", "kinds"),
    [
        pytest.param(
            lambda hand, x_mm: hand.at(moved(STRIKER, x_mm=x_mm), lock=True),
            2.0,
            2.01,
            (ShelfEventKind.LOCKED_ON, ShelfEventKind.LOCK_MISSED),
            id="reach of the lock",
        ),
        pytest.param(
            lambda hand, z_mm: hand.at(moved(TABLE, z_mm=z_mm), magnet=True),
            -2.0,
            -2.01,
            (ShelfEventKind.TAKEN, ShelfEventKind.NOTHING_TAKEN),
            id="reach of the magnet",
        ),
        pytest.param(
            lambda hand, out_mm: hand.carrying().holding_drawer().at(moved(STRIKER, y_mm=-out_mm), magnet=False),
            60.0,
            59.99,
            (ShelfEventKind.PUT, ShelfEventKind.DROPPED),
            id="opening for a box that is put in",
        ),
        pytest.param(
            lambda hand, out_mm: hand.holding_drawer(OTHER).at(moved(OTHER, y_mm=-out_mm), magnet=True),
            60.0,
            59.99,
            (ShelfEventKind.TAKEN, ShelfEventKind.NOTHING_TAKEN),
            id="opening for a box that is taken out",
        ),
        pytest.param(
            lambda hand, out_mm: hand.holding_drawer().at(moved(STRIKER, y_mm=-out_mm)),
            182.0,
            182.01,
            (ShelfEventKind.LOCKED_ON, ShelfEventKind.PULLED_TOO_FAR),
            id="end stop",
        ),
        pytest.param(
            lambda hand, in_mm: hand.holding_drawer().at(moved(STRIKER, y_mm=in_mm)),
            2.0,
            2.01,
            (ShelfEventKind.LOCKED_ON, ShelfEventKind.PUSHED_TOO_FAR),
            id="shut",
        ),
        pytest.param(
            lambda hand, x_mm: hand.holding_drawer().at(moved(STRIKER, x_mm=x_mm, y_mm=-90.0, z_mm=1.0)),
            1.73,
            1.74,
            (ShelfEventKind.LOCKED_ON, ShelfEventKind.FORCED_ASIDE),
            id="sideways and upwards at once",
        ),
        pytest.param(
            lambda hand, z_mm: hand.at(moved(PART, z_mm=z_mm), magnet=True),
            2.0,
            2.01,
            (ShelfEventKind.TAKEN, ShelfEventKind.NOTHING_TAKEN),
            id="gripper above a part",
        ),
        pytest.param(
            lambda hand, z_mm: hand.at(moved(PART, z_mm=z_mm), magnet=True),
            -60.0,
            -60.01,
            (ShelfEventKind.TAKEN, ShelfEventKind.NOTHING_TAKEN),
            id="gripper below a part's grip",
        ),
        pytest.param(
            lambda hand, x_mm: hand.at(moved(PART, x_mm=x_mm, z_mm=-30.0), magnet=True),
            2.0,
            2.01,
            (ShelfEventKind.TAKEN, ShelfEventKind.NOTHING_TAKEN),
            id="gripper beside a part",
        ),
        pytest.param(
            lambda hand, z_mm: hand.gripping(30.0).at(moved(BENCH, z_mm=z_mm), magnet=False),
            -28.0,
            -27.99,
            (ShelfEventKind.PUT, ShelfEventKind.DROPPED),
            id="a part is let go above its spot",
        ),
        pytest.param(
            lambda hand, z_mm: hand.gripping(30.0).at(moved(BENCH, z_mm=z_mm), magnet=False),
            -32.0,
            -32.01,
            (ShelfEventKind.PUT, ShelfEventKind.DROPPED),
            id="a part is pressed into its spot",
        ),
    ],
)
def test_both_sides_of_each_limit(
    what: Callable[[Hand, float], Hand], right: float, wrong: float, kinds: tuple[ShelfEventKind, ShelfEventKind]
) -> None:
    assert (what(Hand(), right).last[0], what(Hand(), wrong).last[0]) == kinds


@pytest.mark.parametrize("out_mm", [178.99, 179.0])
def test_the_end_is_seen_a_millimetre_before_it(out_mm: float) -> None:
    hand = Hand().holding_drawer().at(moved(STRIKER, y_mm=-out_mm))
    assert hand.shelf.sensed.drawer_end == (out_mm >= 179.0)


def test_play_is_counted_from_where_the_lock_went_in() -> None:
    hand = Hand().at(moved(STRIKER, x_mm=2.0), lock=True).at(moved(STRIKER, x_mm=4.0, y_mm=-90.0))
    assert hand.kinds == [ShelfEventKind.LOCKED_ON]
    assert hand.at(moved(STRIKER, x_mm=-0.01, y_mm=-90.0)).last[0] is ShelfEventKind.FORCED_ASIDE


@pytest.mark.parametrize("out_mm", [2.0, 2.01])
def test_a_pull_on_a_locked_drawer(out_mm: float) -> None:
    """Within its play the lock holds; beyond it the hand tears off, the drawer stays shut, and a box falls."""
    hand = Hand("A1").carrying().holding_drawer().at(moved(STRIKER, y_mm=-out_mm))
    assert hand.shelf.out_mm["A1"] == 0.0
    assert hand.shelf.sensed.lock_engaged == (out_mm <= 2.0)
    hand.at(moved(STRIKER, y_mm=-180.0), magnet=False)
    assert hand.kinds[2:] == [ShelfEventKind.PULLED_LOCKED, ShelfEventKind.DROPPED]
    assert all(kind.is_fault for kind in hand.kinds[2:])
    assert hand.shelf.stock == {"B1": "nuts", "feeder": "feeder-1", "part": "gear"}


def test_only_a_locked_drawer_is_locked() -> None:
    hand = Hand("B1").holding_drawer().at(moved(STRIKER, y_mm=-100.0))
    assert hand.shelf.out_mm == {"A1": 100.0, "B1": 0.0}


@pytest.mark.parametrize("slot", [OTHER, TABLE])
def test_a_place_filled_twice(slot: Point) -> None:
    """The box that was there stays there; the second one is lost."""
    hand = Hand().at(FEEDER, magnet=True)
    if slot == OTHER:
        hand.holding_drawer(OTHER)
        slot = moved(OTHER, y_mm=-180.0)
    before = dict(hand.shelf.stock)
    hand.at(slot, magnet=False)
    assert hand.last == (ShelfEventKind.FILLED_TWICE, "table" if slot == TABLE else "B1", "feeder-1")
    assert hand.shelf.stock == before


def test_a_feeding_spot_brings_the_next_box_and_a_clearing_one_carries_it_away() -> None:
    hand = Hand()
    for number in (1, 2):
        hand.at(FEEDER, magnet=True)
        assert hand.last == (ShelfEventKind.TAKEN, "feeder", f"feeder-{number}")
        hand.at(EXIT, magnet=False)
        assert hand.last == (ShelfEventKind.PUT, "exit", f"feeder-{number}")
    assert "exit" not in hand.shelf.stock


def test_a_drawer_left_open_stays_so_and_can_be_taken_again_there() -> None:
    hand = Hand().holding_drawer()
    out = moved(STRIKER, y_mm=-100.0)
    hand.at(out).at(out, lock=False).at(NOWHERE)
    assert hand.shelf.out_mm["A1"] == 100.0
    hand.at(STRIKER, lock=True)
    assert hand.last[0] is ShelfEventKind.LOCK_MISSED
    hand.at(STRIKER, lock=False).at(out, lock=True).at(STRIKER)
    assert hand.shelf.out_mm["A1"] == 0.0


PLACES = st.sampled_from(
    [
        NOWHERE,
        TABLE,
        FEEDER,
        EXIT,
        PART,
        moved(PART, z_mm=-30.0),
        moved(BENCH, z_mm=-29.0),
        *(moved(striker, y_mm=-out) for striker in (STRIKER, OTHER) for out in (0.0, 59.0, 61.0, 181.0)),
    ]
)


@pytest.mark.slow
@given(st.lists(st.tuples(PLACES, st.booleans(), st.booleans()), max_size=60), st.sampled_from([(), ("A1",), ("B1",)]))
def test_no_box_comes_from_nothing(steps: list[tuple[Point, bool, bool]], locked: tuple[str, ...]) -> None:
    """Whatever the hand does: each box is in one place or lost by a fault, and drawers stay within their ways."""
    hand = Hand(*locked)
    for tip, lock, magnet in steps:
        hand.at(tip, lock=lock, magnet=magnet)
        shelf = hand.shelf
        assert all(0.0 <= out_mm <= 180.0 for out_mm in shelf.out_mm.values())
        assert all(shelf.out_mm[slot] == 0.0 for slot in locked)
        there = [*shelf.stock.values(), *filter(None, [shelf.carried])]
        lost = [event.box for event in shelf.events if event.box and event.kind.is_fault]
        left = [event.box for event in shelf.events if event.where == "exit" and event.kind is ShelfEventKind.PUT]
        fed = sum(event.where == "feeder" and event.kind is ShelfEventKind.TAKEN for event in shelf.events) + 1
        all_boxes = ["screws", "nuts", "gear", *(f"feeder-{number}" for number in range(1, fed + 1))]
        assert sorted(there + lost + left) == sorted(all_boxes)


def test_no_box_comes_from_nothing_on_some_ways() -> None:
    ways = [(NOWHERE, False, False), (FEEDER, False, True), (TABLE, False, True), (TABLE, False, False)]
    there = [(point, False, magnet) for point, _, magnet in reversed(ways)]
    for locked in ((), ("B1",)):
        one_example(test_no_box_comes_from_nothing, [*ways, *there, *ways], locked)
