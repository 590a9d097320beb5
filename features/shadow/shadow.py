"""Play the hosts' frames of a running machine to a twin, by their time stamps, and compare what both do.

The twin is driven by the stamps, not by this computer's clock: how late frames arrive here does not matter. Where the
stamps' clock steps, the twin goes on from where it is. A shadow has no way to send: it takes frames, and tells
discrepancies.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Final, NamedTuple

from steptwin.controller.motion.backend import Kernel, fastest_kernel
from steptwin.features.replay.power_up import MachineAtPowerUp
from steptwin.features.replay.replaying import WallClockPlayer, machine_at
from steptwin.features.shadow.asking import NodeValues
from steptwin.features.shadow.axes import FOLLOW_S, ComparedAxis, DriveReport, TwinAxis
from steptwin.features.shadow.discrepancy import Discrepancy, DiscrepancyKind, Sayings
from steptwin.features.shadow.stamps import StampClock
from steptwin.features.shadow.standing import PAST, stand
from steptwin.host.client.monitor import Decoder, pdo_fields
from steptwin.host.record.recorded_bus import Identifiers, RecordedFrame, Sender
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.emulated_machine import EmulatedMachine
from steptwin.protocol import od
from steptwin.protocol.cia402 import Control
from steptwin.protocol.dictionary import ObjectDictionary
from steptwin.protocol.frame import (
    COB_HEARTBEAT,
    COB_RPDO,
    COB_SDO_REQUEST,
    COB_TPDO,
    FIRST_NODE_ID,
    NODE_ID_MAX,
    Frame,
)
from steptwin.protocol.nmt import NmtState
from steptwin.protocol.objects import ENTRIES
from steptwin.protocol.sdo_server import DOWNLOAD_INITIATE
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND, COUNTS_PER_US

_BOOT_UP: Final = bytes((NmtState.INITIALISING,))
_LOOK_COUNTS: Final = 10 * COUNTS_PER_MS
"""Longest time between two looks at whether something has differed for long enough."""
_FOLLOW_COUNTS: Final = round(FOLLOW_S * COUNTS_PER_SECOND)
_FRAME_US: Final = 2_000
"""More than a frame lasts: a host's frame begins so long before its stamp at the earliest."""
_BOOTED_COUNTS: Final = COUNTS_PER_SECOND
"""Time within which boards have said their boot-ups after power-up."""
_AHEAD_COUNTS: Final = COUNTS_PER_MS
"""Step by which the twin is let ahead."""
_HEARTBEATS_COUNTS: Final = 50 * COUNTS_PER_MS
"""Time between two heartbeats of a host while the twin is ahead."""
_JITTER_COUNTS: Final = 10 * COUNTS_PER_MS
"""Time that a search may take longer by jitter at its begin and end, and by the PDO's inhibit time."""
_REST_AHEAD_COUNTS: Final = 20 * COUNTS_PER_MS
"""Longest time by which the twin comes to rest later: a segment of a profile, and jitter."""
_AHEAD_MAX_COUNTS: Final = 120 * COUNTS_PER_SECOND
"""Longest time for which a twin searches on that stood farther from its switch."""


class ClockStep(NamedTuple):
    """A step of the stamps' clock.

    Attributes:
        at_s: time after the step by that clock, in s.
        step_s: by how much it has stepped; below 0 if it was put back.
    """

    at_s: float
    step_s: float


class Shadow:
    """A twin beside a running machine; it knows where the machine begins by the boot-up of one of its nodes.

    Attributes:
        joined: True once it has begun.
        frames: number of frames of the real board that were heard since.
        caught_up_s: time by which the twin was let ahead to find its switches.
        clock_steps: number of steps of the stamps' clock since.
    """

    def __init__(
        self,
        robot: Robot,
        power_up: MachineAtPowerUp,
        tell: Callable[[Discrepancy], None],
        kernel: Kernel | None = None,
        *,
        keep: bool = False,
        tell_step: Callable[[ClockStep], None] = lambda _: None,
    ) -> None:
        """Wait for the boot-up.

        Args:
            robot: the machine.
            power_up: how it stands at power-up; where it stands only matters until it is homed.
            tell: called with each discrepancy.
            kernel: form of the firmware's kernel; by default the fastest one that is installed.
            keep: True to keep the twin's frames, for its folder; they take some 100 bytes each.
            tell_step: called with each step of the stamps' clock.

        Raises:
            InputError: as `MachineParts.of`.
        """
        self._node_ids = range(FIRST_NODE_ID, FIRST_NODE_ID + len(robot.axes))
        self._names = dict(zip(self._node_ids, robot.axis_names, strict=True))
        self.machine: EmulatedMachine = machine_at(
            robot, power_up, kernel or fastest_kernel(), None if keep else _forget
        )
        self._tell = tell
        self._identifiers = Identifiers(self._node_ids)
        self._sayings = Sayings(Decoder(self._names))
        self._axes = [ComparedAxis(float(units)) for units in robot.wire_units_per_unit / robot.steps_per_unit]
        self._player: WallClockPlayer | None = None
        self._looked_counts = 0
        self._watched: dict[int, Frame] = {}
        """The last heartbeat of each host."""
        self.frames: int = 0
        self.caught_up_s: float = 0.0
        self.clock_steps: int = 0
        self._tell_step = tell_step
        self._clock = StampClock()
        self._muted = False

    @property
    def joined(self) -> bool:
        """True once the machine's beginning was heard."""
        return self._player is not None

    def take_recording(self, frames: Iterable[RecordedFrame]) -> None:
        """Take what was on the bus up to now, from power-up on; the frames that are heard next follow it closely.

        No discrepancy in it is told.
        """
        self._muted = True
        last_us = 0
        for recorded in frames:
            last_us = recorded.us
            self._hear(last_us, recorded.frame)
        self._pass(last_us)
        self._muted = False
        self._clock.end_recording(last_us)

    def take_standing(self, standing: Mapping[int, NodeValues], us: int, arrived_us: int | None = None) -> None:
        """Begin with a machine at rest that has told how it stands.

        Args:
            standing: how each node stands, by its id.
            us: stamp of the last answer, in microseconds.
            arrived_us: when it came here, as in `hear`.

        Raises:
            InputError: the twin cannot stand so; the value is named.
        """
        simulation = self.machine.simulation
        simulation.run_until(simulation.now_counts + _BOOTED_COUNTS)
        for frame in stand(simulation, self._names, standing):
            self._identifiers.sender_of(frame)  # it may move the identifier of a PDO
        self._sayings.past = PAST
        simulation.bus.listen(self._twin_says)
        self._looked_counts = simulation.now_counts
        self._clock.begin(us, arrived_us)
        self._player = WallClockPlayer(simulation, simulation.now_counts - us * COUNTS_PER_US)

    def hear(self, us: int, frame: Frame, arrived_us: int | None = None) -> None:
        """Take the next frame on the machine's bus.

        A stamp that is out of its time is told and taken for a step of the stamps' clock: back, ahead of what
        `arrived_us` allows, or without that after more silence than a machine has. Call `pass_time` in true silence.

        Args:
            us: its stamp in microseconds, when it became valid.
            frame: the frame.
            arrived_us: when it came here, by a clock that is never set, in microseconds.
        """
        own_us = self._clock.hear(us, arrived_us, moving=self._twin_moves)
        if self._clock.step_us and self._player is not None:
            self.clock_steps += 1
            now_counts = self.machine.simulation.now_counts
            if not all(axis.still(now_counts) for axis in self._axes):
                for axis in self._axes:
                    axis.lose_time()
            self._tell_step(ClockStep(us / 1e6, self._clock.step_us / 1e6))
        self._hear(own_us, frame)

    def _hear(self, us: int, frame: Frame) -> None:
        """Take the next frame at a time that never steps."""
        sender = self._identifiers.sender_of(frame) or Sender.HOST
        if self._player is None:
            if sender is not Sender.BOARD or not _is_boot_up(frame):
                return
            self._player = self._begin(us)
        if sender is Sender.OTHER:
            return
        if sender is Sender.HOST and frame.cob_id & ~NODE_ID_MAX == COB_HEARTBEAT:
            self._watched[frame.cob_id] = frame
        if sender is Sender.HOST and _gives(frame) and (node_id := frame.cob_id & NODE_ID_MAX) in self._node_ids:
            axis = node_id - FIRST_NODE_ID
            self._axes[axis].command(self._dictionaries[axis].get(od.VELOCITY_ACTUAL))
        self._pass_time(self._player, us - _FRAME_US)
        self._player.play(us, frame, sender)
        if sender is Sender.BOARD:
            self._pass_time(self._player, us)
            self.frames += 1
            self._take(self._player.counts_of(us), frame, of_board=True)
        self._look(us)

    def pass_time(self, us: int) -> None:
        """Let time pass up to an instant by the stamps' clock when nothing was heard."""
        own_us = self._clock.pass_time(us)
        if own_us is not None:
            self._pass(own_us)

    def _pass(self, us: int) -> None:
        if self._player is not None:
            self._pass_time(self._player, us)
            self._look(us)

    @property
    def _dictionaries(self) -> list[ObjectDictionary]:
        """The twin's objects, by axis; a reset makes new ones."""
        boards = self.machine.simulation.boards
        return [node.dictionary for board in boards for node in board.own.firmware.nodes]

    def _begin(self, us: int) -> WallClockPlayer:
        """Switch the twin on so that its first boot-up becomes valid at a time by the stamps' clock."""
        simulation = self.machine.simulation
        first_counts: list[int] = []

        def heard(frame: Frame, counts: int) -> None:
            if _is_boot_up(frame):
                first_counts.append(counts)
            self._twin_says(frame, counts)

        simulation.bus.listen(heard)
        while not first_counts and simulation.now_counts < _BOOTED_COUNTS:
            simulation.run_until(simulation.now_counts + COUNTS_PER_US)
        return WallClockPlayer(simulation, first_counts[0] - us * COUNTS_PER_US)

    def _pass_time(self, player: WallClockPlayer, us: int) -> None:
        """Let the twin go on to an instant; look often enough at how fast its axes are."""
        simulation, until_counts = self.machine.simulation, player.counts_of(us)
        while simulation.now_counts + _FOLLOW_COUNTS < until_counts:
            simulation.run_until(simulation.now_counts + _FOLLOW_COUNTS)
            for compared, dictionary in zip(self._axes, self._dictionaries, strict=True):
                compared.follow(simulation.now_counts, _twin_axis(dictionary))
        simulation.run_until(until_counts)

    def _twin_says(self, frame: Frame, counts: int) -> None:
        if frame.cob_id & NODE_ID_MAX in self._node_ids:
            self._take(counts, frame, of_board=False)

    def _take(self, counts: int, frame: Frame, *, of_board: bool) -> None:
        """Take a frame of a node on one of the sides."""
        self._sayings.hear(counts, frame, of_board=of_board)
        axis = (frame.cob_id & NODE_ID_MAX) - FIRST_NODE_ID
        base = frame.cob_id & ~NODE_ID_MAX
        if base not in COB_TPDO:
            return
        dictionary = self._dictionaries[axis]
        told = _told(dictionary, COB_TPDO.index(base), frame.data)
        if told is None:
            return
        compared = self._axes[axis]
        rested = compared.board.rests
        (compared.board if of_board else compared.twin).take(counts, told)
        if of_board and compared.waits_for_the_twin:
            self._catch_up(axis, counts)
        if of_board and not rested and compared.board.rests:
            self._let_rest(counts)
        if of_board and told.position_units is not None:
            for finding in compared.positions(counts, told.position_units, _twin_axis(dictionary)):
                self._say(counts, axis, *finding)

    def _look(self, us: int) -> None:
        """Tell what has differed for long enough; let the twin find a switch that the board has found."""
        assert self._player is not None
        now_counts = self._player.counts_of(us)
        if now_counts - self._looked_counts < _LOOK_COUNTS:
            return
        self._looked_counts = now_counts
        if all(compared.still(now_counts) for compared in self._axes):
            for compared in self._axes:
                compared.find_time()
        for counts, node_id, kind, board, twin in self._sayings.differing(now_counts):
            self._say(counts, node_id - FIRST_NODE_ID, kind, board, twin)
        for axis, (compared, dictionary) in enumerate(zip(self._axes, self._dictionaries, strict=True)):
            now = _twin_axis(dictionary)
            compared.follow(now_counts, now)
            for finding in (*compared.states(now_counts), *compared.homings()):
                self._say(now_counts, axis, *finding)

    @property
    def _twin_moves(self) -> bool:
        return any(board.motion.running_axes for board in self.machine.simulation.boards)

    def _catch_up(self, axis: int, counts: int) -> None:
        """Let the twin search on, while the board waits for its host: it stood nearer to its switch.

        It does before the host's next frame, which might end the search. The stamps' clock, by which the board's frame
        came at `counts`, is then so much later for the twin: else what the host sends in these ms would reach the twin
        too late. Only where jitter makes the difference and another axis of the twin moves, that axis keeps its time
        instead.
        """
        assert self._player is not None
        compared, simulation = self._axes[axis], self.machine.simulation
        self._let_ahead(lambda: compared.twin.homing, simulation.now_counts + _AHEAD_MAX_COUNTS)
        if compared.twin.homing:
            compared.leave()
        ahead_counts = simulation.now_counts - counts
        if ahead_counts <= _JITTER_COUNTS and self._twin_moves:
            return
        self._player.first_counts += ahead_counts
        self.caught_up_s += ahead_counts / COUNTS_PER_SECOND

    def _let_ahead(self, goes_on: Callable[[], bool], until_counts: int) -> None:
        """Let the twin go ahead of the stamps up to an instant, as long as something goes on.

        Hosts' heartbeats go on meanwhile, since the twin watches them.
        """
        simulation = self.machine.simulation
        beaten_counts = simulation.now_counts
        while goes_on() and simulation.now_counts < until_counts:
            if simulation.now_counts - beaten_counts >= _HEARTBEATS_COUNTS:
                beaten_counts = simulation.now_counts
                for heartbeat in self._watched.values():
                    simulation.host.send(heartbeat, beaten_counts)
            simulation.run_until(simulation.now_counts + _AHEAD_COUNTS)
            for compared, dictionary in zip(self._axes, self._dictionaries, strict=True):
                compared.follow(simulation.now_counts, _twin_axis(dictionary))

    def _let_rest(self, counts: int) -> None:
        """Let the twin come to rest, where its profile ends a little later, before the host's next frame.

        That may be for a drive that stands. The whole machine does, so the stamps' clock is so much later. If the twin
        does not come to rest, it moves by what the host has sent since, and keeps its time.
        """
        assert self._player is not None
        later_s = max(compared.later_s for compared in self._axes)
        later_counts = min(_REST_AHEAD_COUNTS + round(later_s * COUNTS_PER_SECOND), _AHEAD_MAX_COUNTS)
        simulation, until_counts = self.machine.simulation, counts + later_counts
        velocities = [dictionary.get(od.VELOCITY_ACTUAL) for dictionary in self._dictionaries]
        if not any(velocities):
            return
        if any(velocity and not each.board.rests for velocity, each in zip(velocities, self._axes, strict=True)):
            return
        self._let_ahead(lambda: self._twin_moves, until_counts)
        if not self._twin_moves:
            self._player.first_counts += simulation.now_counts - counts

    def _say(
        self, counts: int, axis: int, kind: DiscrepancyKind, board: str, twin: str, error_steps: float | None = None
    ) -> None:
        if self._muted:
            return
        assert self._player is not None
        assert self._clock.shift_us is not None
        at_s = (counts - self._player.first_counts) / COUNTS_PER_SECOND - self._clock.shift_us / 1e6
        self._tell(Discrepancy(round(at_s, 6), self._names[FIRST_NODE_ID + axis], kind, board, twin, error_steps))


def _forget(_frame: Frame, _counts: int) -> None:
    """Keep no frame."""


def _gives(frame: Frame) -> bool:
    """Return whether a host's frame gives a node something: process data, or an SDO request that writes."""
    base = frame.cob_id & ~NODE_ID_MAX
    writes = base == COB_SDO_REQUEST and bool(frame.data) and frame.data[0] >> 5 == DOWNLOAD_INITIATE
    return writes or base in COB_RPDO


def _is_boot_up(frame: Frame) -> bool:
    return frame.cob_id & ~NODE_ID_MAX == COB_HEARTBEAT and frame.data == _BOOT_UP


def _told(dictionary: ObjectDictionary, number: int, data: bytes) -> DriveReport | None:
    """Return what a TPDO tells of the drive, by the twin's mapping; None if the data are shorter than that."""
    place = od.TPDO_MAPPING[number]
    words = [dictionary.get(od.address_of(place, i + 1)) for i in range(dictionary.get(od.address_of(place)))]
    mapping = tuple(word >> 8 for word in words)
    if any(address not in ENTRIES for address in mapping):
        return None
    fields = pdo_fields(mapping, data)
    if fields is None:
        return None
    values = {od.address_of(field["index"], field["subindex"]): int(field["value"]) for field in fields}
    position = values.get(od.POSITION_ACTUAL)
    return DriveReport(
        values.get(od.STATUSWORD),
        values.get(od.MODE_OF_OPERATION_DISPLAY),
        None if position is None else dictionary.wire_units(od.POSITION_ACTUAL, position),
    )


def _twin_axis(dictionary: ObjectDictionary) -> TwinAxis:
    get = dictionary.get
    ramp_units_per_s2 = max(get(od.PROFILE_ACCELERATION), get(od.PROFILE_DECELERATION))
    return TwinAxis(
        get(od.POSITION_ACTUAL),
        get(od.VELOCITY_ACTUAL),
        get(od.HOMING_ZERO_SPEED),
        ramp_units_per_s2,
        relative=bool(get(od.CONTROLWORD) & Control.RELATIVE),
    )
