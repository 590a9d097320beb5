"""Describe a robot's shelf to the emulator, and convert what happened there into evidence."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from steptwin.emulator.world.moving_shelf import MovingShelf, Point, ShelfConfig, SpotConfig
from steptwin.emulator.world.shelf_watch import ShelfWiring
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.operate.inputs_outputs import wired_inputs
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.chain import actual_chain
from steptwin.host.robots.robot import Robot
from steptwin.host.robots.shelf import Shelf
from steptwin.host.twin.machine.boards import standing_steps
from steptwin.host.twin.machine.input_changes import Wires
from steptwin.host.verify import ShelfEvent, ShelfEvidence

SHUT_MM = 1.0
"""Distance by which a drawer may be out and still count as shut: its catch takes it."""


def shelf_wiring(
    robot: Robot,
    start_joints: Sequence[float],
    axes_per_board: Sequence[int],
    *,
    stock: Mapping[str, str] | None = None,
    locked: Collection[str] = (),
    sensors: bool = True,
) -> ShelfWiring | None:
    """Return a robot's shelf as the emulator has it; None if the robot has none.

    Args:
        robot: the machine.
        start_joints: joint positions where it stands at power-up, mm and degrees.
        axes_per_board: number of axes on each board.
        stock: the boxes, by slot or spot; None: a box at each spot that does not clear boxes away, and empty slots.
        locked: slots whose drawers are locked.
        sensors: False if the sensors are not connected.

    Raises:
        InputError: the stock or the locked drawers are in places that the shelf does not have.
    """
    shelf = robot.shelf
    if shelf is None:
        if stock or locked:
            what = f"stock={next(iter(stock))}" if stock else f"locked_drawers={next(iter(locked))}"
            raise InputError(f"{what}: {robot.name} has no shelf")
        return None
    places = [*shelf.slots, *shelf.spots]
    for what, names, known in (("stock", stock or (), places), ("locked_drawers", locked, list(shelf.slots))):
        for name in names:
            if name not in known:
                raise unknown(f"{what}={name}: place", name, known)
    config = ShelfConfig(
        strikers_mm={slot: shelf.striker_mm(slot, robot.boxes) for slot in shelf.slots},
        spots={
            name: SpotConfig(spot.lid_mm, spot.feeds, spot.clears, spot.grip_mm) for name, spot in shelf.spots.items()
        },
        travel_mm=shelf.travel_mm,
        opening_mm=shelf.opening_mm,
        capture_mm=shelf.capture_mm,
        stock=usual_stock(shelf) if stock is None else stock,
        locked=frozenset(locked),
    )
    wires = Wires(robot, axes_per_board)
    inputs = wired_inputs(robot)
    return ShelfWiring(
        shelf=config,
        tip_at=_TipAt(robot, start_joints),
        lock=wires.output(shelf.lock) if shelf.slots else None,
        magnet=wires.output(shelf.magnet),
        sensors={key: wires.input(*inputs[name]) for key, name in shelf.sensors.items()} if sensors else {},
    )


def usual_stock(shelf: Shelf) -> dict[str, str]:
    """Return the boxes of a shelf without --stock: one at each spot from which boxes come."""
    return {name: f"{name}-box" for name, spot in shelf.spots.items() if not spot.clears and not spot.feeds}


def shelf_evidence(shelf: MovingShelf, start: Mapping[str, str]) -> ShelfEvidence:
    """Return what happened at an emulated shelf; `start` is the stock at power-up."""
    events = tuple(
        ShelfEvent(event.counts, event.kind.value, event.where, event.box, event.kind.is_fault, event.tip_mm)
        for event in shelf.events
    )
    open_mm = {slot: out_mm for slot, out_mm in shelf.out_mm.items() if out_mm > SHUT_MM}
    cells_out = {slot: shelf.cells_out(out_mm) for slot, out_mm in open_mm.items()}
    return ShelfEvidence(events, start, dict(shelf.stock), open_mm, cells_out)


class _TipAt:
    """Computes where the tool's tip is, from the positions of all rotors since power-up."""

    def __init__(self, robot: Robot, start_joints: Sequence[float]) -> None:
        self._start_steps = np.array(standing_steps(robot, start_joints))
        self._microsteps = np.array([joint.transmission.microsteps for joint in robot.axes])
        self._robot = robot
        actual = actual_chain(robot)
        self._forward = actual.poses if actual else make_kinematics(robot).forward

    def __call__(self, full_steps: Sequence[float]) -> Point:
        joints = self._robot.from_steps(self._start_steps + np.array(full_steps) * self._microsteps)
        x_mm, y_mm, z_mm, _ = self._forward(joints[np.newaxis])[0].tolist()
        return x_mm, y_mm, z_mm
