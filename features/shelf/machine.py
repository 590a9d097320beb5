"""Connect a robot's shelf to the emulator, update it with the boards, and convert its events into evidence.

The shelf looks after each change of its outputs. While the hand holds a drawer and axes move, and once when they have
stopped, it also looks every LOOK_COUNTS, which is the largest delay of a sensor at a drawer's end. Without sensors it
looks less often, only to check that the drawer can follow.
"""

from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from steptwin.emulator.operations import InputOperation
from steptwin.emulator.simulation import Simulation
from steptwin.emulator.world.wires import InputWire, OutputWire
from steptwin.features.shelf import shelf_of
from steptwin.features.shelf.evidence import ShelfEvent, ShelfEvidence
from steptwin.features.shelf.moving_shelf import MovingShelf, Point, Sensed, ShelfConfig, SpotConfig
from steptwin.features.shelf.options import ShelfOptions
from steptwin.features.shelf.section import Shelf
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import MachinePart
from steptwin.host.operate.inputs_outputs import wired_inputs
from steptwin.host.robots.kinematics import make_kinematics
from steptwin.host.robots.kinematics.chain import actual_chain
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.boards import steps_at_joints
from steptwin.host.twin.machine.input_changes import Wires
from steptwin.protocol.timer import COUNTS_PER_SECOND

LOOK_COUNTS: Final = COUNTS_PER_SECOND // 100
"""10 ms: a drawer pulled with 30 mm/s moves by 0.3 mm between two looks."""
IDLE_LOOK_COUNTS: Final = COUNTS_PER_SECOND // 10
"""Period of looks without sensors."""


@dataclass(frozen=True, slots=True)
class ShelfWiring:
    """Connections of a shelf to boards.

    Attributes:
        shelf: the shelf.
        tip_at: returns the position of the tool's tip in mm for the positions of all rotors since power-up, board by
            board, in full steps.
        lock: output of the hand's lock; None without drawers.
        magnet: output of its magnet.
        sensors: inputs of the connected sensors, by the fields of Sensed.
    """

    shelf: ShelfConfig
    tip_at: Callable[[Sequence[float]], Point]
    lock: OutputWire | None
    magnet: OutputWire
    sensors: dict[str, InputWire]


class ShelfWatch:
    """A shelf beside the boards of a simulation."""

    def __init__(self, wiring: ShelfWiring, simulation: Simulation) -> None:
        """Connect to the boards of a simulation."""
        self.shelf: MovingShelf = MovingShelf(wiring.shelf)
        self._wiring = wiring
        self._simulation = simulation
        self._boards = simulation.boards
        self._seen_changes = 0
        """Number of output changes up to the last look."""
        self._looked_counts = 0
        self._rested = True
        """True if nothing has moved since the last look."""
        self._seen = Sensed()
        for board in self._boards:
            board.watch_outputs()

    @property
    def next_due_counts(self) -> int | None:
        """Instant of the next periodic look; None while no drawer moves."""
        if not self.shelf.held or (self._rested and not self._moving):
            return None
        every_counts = LOOK_COUNTS if self._wiring.sensors else IDLE_LOOK_COUNTS
        return (self._looked_counts // every_counts + 1) * every_counts

    @property
    def _moving(self) -> bool:
        return any(board.moving for board in self._boards)

    def step(self, now_counts: int) -> None:
        """Look after a change of an output or when a periodic look is due; set the sensors' inputs."""
        changes = 0
        for board in self._boards:  # runs at each event: `sum` would take three times as long
            changes += board.output_change_count
        if changes == self._seen_changes:
            if not self.shelf.held:
                return
            due_counts = self.next_due_counts
            if due_counts is None or due_counts > now_counts:
                return
        self._seen_changes = changes
        self.look_now()
        for number, change in list(self._sensor_changes()):
            self._simulation.apply(change, number)

    def look_now(self) -> None:
        """Look at the end of a run, whatever has changed; inputs stay."""
        now_counts = self._simulation.now_counts
        self._rested, self._looked_counts = not self._moving, now_counts
        wiring, rotors = self._wiring, self._simulation.rotors_full_steps()
        self.shelf.look(now_counts, wiring.tip_at(rotors), lock=self._on(wiring.lock), magnet=self._on(wiring.magnet))

    def _on(self, wire: OutputWire | None) -> bool:
        return wire is not None and bool(self._boards[wire.board].output_level(wire.axis, wire.pin))

    def _sensor_changes(self) -> Iterator[tuple[int, InputOperation]]:
        before, self._seen = self._seen, self.shelf.sensed
        for name, wire in self._wiring.sensors.items():
            level = getattr(self._seen, name)
            if level != getattr(before, name):
                yield wire.board, InputOperation(wire.axis, wire.input, level)


EVENTS_MAX: Final = 1000
"""Number of events that a served board's shelf keeps."""
SHUT_MM: Final = 1.0
"""Largest opening of a drawer that counts as shut: its catch closes it."""


def shelf_part(
    robot: Robot,
    start_joints: Sequence[float],
    axes_per_board: Sequence[int],
    options: ShelfOptions | None,
    waits_for: Collection[str] | None,
) -> "ShelfPart | None":
    """Return a robot's emulated shelf; None if the robot has none.

    Args:
        robot: the machine.
        start_joints: joint positions at power-up, mm and degrees.
        axes_per_board: number of axes on each board.
        options: differences from the usual shelf.
        waits_for: inputs for which the motion waits. Without a sensor among them no sensor is connected, and the bus is
            as without sensors. None: unknown.

    Raises:
        InputError: stock or locked drawers are in places that the shelf does not have.
    """
    options = options or ShelfOptions()
    shelf, stock, locked = shelf_of(robot), options.boxes, options.locked_drawers
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
    sensors = waits_for is None or any(name in waits_for for name in shelf.sensors.values())
    wires = Wires(robot, axes_per_board)
    inputs = wired_inputs(robot)
    wiring = ShelfWiring(
        shelf=config,
        tip_at=_TipAt(robot, start_joints),
        lock=wires.output(shelf.lock) if shelf.slots else None,
        magnet=wires.output(shelf.magnet),
        sensors={key: wires.input(*inputs[name]) for key, name in shelf.sensors.items()} if sensors else {},
    )
    return ShelfPart(wiring)


class ShelfPart(MachinePart):
    """Shelf of one machine from power-up on."""

    def __init__(self, wiring: ShelfWiring) -> None:
        self._wiring = wiring
        self._watch: ShelfWatch | None = None
        self._past: deque[ShelfEvent] = deque(maxlen=EVENTS_MAX)
        """Events of earlier rounds."""

    @property
    def _joined(self) -> ShelfWatch:
        assert self._watch is not None, "the machine is not switched on"
        return self._watch

    def join(self, simulation: Simulation) -> ShelfWatch:
        """Return the participant of a simulation that runs the shelf."""
        self._watch = ShelfWatch(self._wiring, simulation)
        return self._watch

    def evidence(self) -> ShelfEvidence:
        """Update the shelf; return its events since power-up."""
        self._joined.look_now()
        return self.seen()

    def seen(self) -> ShelfEvidence:
        """Return the events up to the last update."""
        now = shelf_evidence(self._joined.shelf, dict(self._wiring.shelf.stock))
        return replace(now, events=(*self._past, *now.events))

    def end_round(self) -> None:
        """Drop all events but the last ones."""
        self._past.extend(shelf_evidence(self._joined.shelf, {}).events)
        self._joined.shelf.events.clear()


def usual_stock(shelf: Shelf) -> dict[str, str]:
    """Return the default boxes of a shelf: one at each feeding spot."""
    return {name: f"{name}-box" for name, spot in shelf.spots.items() if not spot.clears and not spot.feeds}


def shelf_evidence(shelf: MovingShelf, start: Mapping[str, str]) -> ShelfEvidence:
    """Return the evidence of an emulated shelf; `start` is the stock at power-up."""
    events = tuple(
        ShelfEvent(event.counts, event.kind.value, event.where, event.box, event.kind.is_fault, event.tip_mm)
        for event in shelf.events
    )
    open_mm = {slot: out_mm for slot, out_mm in shelf.out_mm.items() if out_mm > SHUT_MM}
    cells_out = {slot: shelf.cells_out(out_mm) for slot, out_mm in open_mm.items()}
    return ShelfEvidence(events, start, dict(shelf.stock), open_mm, cells_out)


class _TipAt:
    """Calculates the position of the tool's tip from the positions of all rotors since power-up."""

    def __init__(self, robot: Robot, start_joints: Sequence[float]) -> None:
        self._start_steps = np.array(steps_at_joints(robot, start_joints))
        self._microsteps = np.array([joint.transmission.microsteps for joint in robot.axes])
        self._robot = robot
        actual = actual_chain(robot)
        self._forward = actual.poses if actual else make_kinematics(robot).forward

    def __call__(self, full_steps: Sequence[float]) -> Point:
        joints = self._robot.from_steps(self._start_steps + np.array(full_steps) * self._microsteps)
        x_mm, y_mm, z_mm, _ = self._forward(joints[np.newaxis])[0].tolist()
        return x_mm, y_mm, z_mm
