"""Update a shelf with its boards: when to look at tool and outputs, and the levels of the sensors' inputs.

The shelf looks after each change of its outputs. While the hand holds a drawer and axes move, and once when they have
stopped, it also looks every LOOK_COUNTS, which is the largest delay of a sensor at a drawer's end. Without sensors it
looks less often, only to check that the drawer can follow.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from steptwin.emulator.operations import InputOperation
from steptwin.emulator.simulation import Simulation
from steptwin.emulator.world.wires import InputWire, OutputWire
from steptwin.features.shelf.moving_shelf import MovingShelf, Point, Sensed, ShelfConfig
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
