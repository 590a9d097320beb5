"""Play the hosts' frames of a running machine to a twin, by their time stamps, and compare both.

The stamps drive the twin, not this computer's clock, so late arrival of frames does not matter. After a step of the
stamps' clock, the twin continues from its present state. A shadow cannot send: it receives frames, and reports
discrepancies.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Final, NamedTuple

from steptwin.controller.motion.backend import Kernel, fastest_kernel
from steptwin.features.replay.power_up import MachineAtPowerUp
from steptwin.features.replay.replaying import WallClockPlayer, machine_at
from steptwin.features.shadow.asking import NodeValues
from steptwin.features.shadow.axes import SAMPLE_S, ComparedAxis, DriveReport, TwinAxis
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
"""Longest time between two comparisons."""
_FOLLOW_COUNTS: Final = round(SAMPLE_S * COUNTS_PER_SECOND)
_FRAME_US: Final = 2_000
"""More than the duration of a frame: a host's frame starts at most this long before its time stamp."""
_BOOTED_COUNTS: Final = COUNTS_PER_SECOND
"""Time after power-up within which all boards have sent their boot-up messages."""
_AHEAD_COUNTS: Final = COUNTS_PER_MS
"""Step in which the twin runs ahead of the time stamps."""
_HEARTBEATS_COUNTS: Final = 50 * COUNTS_PER_MS
"""Period of a host's repeated heartbeats while the twin runs ahead."""
_JITTER_COUNTS: Final = 10 * COUNTS_PER_MS
"""Time by which jitter and the PDO's inhibit time may lengthen a homing search."""
_REST_AHEAD_COUNTS: Final = 20 * COUNTS_PER_MS
"""Longest delay of the twin's stop: one segment of a profile, and jitter."""
_AHEAD_MAX_COUNTS: Final = 120 * COUNTS_PER_SECOND
"""Longest time ahead for a twin farther from its switch to find it."""


class ClockStep(NamedTuple):
    """A step of the stamps' clock.

    Attributes:
        at_s: time of that clock after the step, in s.
        step_s: size of the step; negative if the clock was set back.
    """

    at_s: float
    step_s: float


class Shadow:
    """A twin that follows a running machine; it starts at the boot-up of one of the machine's nodes.

    Attributes:
        joined: True after the start.
        frames: number of the real board's frames since the start.
        caught_up_s: time that the twin has run ahead of the time stamps to find its switches.
        clock_steps: number of steps of the time stamps' clock since the start.
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
            power_up: the machine's state at power-up; its position matters only until it is homed.
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
        """Last heartbeat of each host."""
        self.frames: int = 0
        self.caught_up_s: float = 0.0
        self.clock_steps: int = 0
        self._tell_step = tell_step
        self._clock = StampClock()
        self._muted = False

    @property
    def joined(self) -> bool:
        """True once the machine's start was received."""
        return self._player is not None

    def take_recording(self, frames: Iterable[RecordedFrame]) -> None:
        """Process all frames on the bus from power-up until now; the next frame must follow at once.

        Discrepancies in the recording are not reported.
        """
        self._muted = True
        last_us = 0
        for recorded in frames:
            last_us = recorded.us
            self._hear(last_us, recorded.frame)
        self._pass(last_us)
        self._muted = False
        self._clock.end_recording(last_us)

    def set_initial_values(self, standing: Mapping[int, NodeValues], us: int, arrived_us: int | None = None) -> None:
        """Start from the values that the nodes of a machine at rest have reported.

        Args:
            standing: each node's values, by node id.
            us: time stamp of the last answer, in microseconds.
            arrived_us: arrival of the last answer, as in `hear`.

        Raises:
            InputError: the twin does not accept a value, which is named.
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
        """Process the next frame on the machine's bus.

        A stamp counts as a step of the time stamps' clock, which is reported, if it goes back, if it is further ahead
        than `arrived_us` allows, or, without `arrived_us`, if it follows a longer silence than a machine has. Call
        `pass_time` while the bus is really silent.

        Args:
            us: its stamp in microseconds, when it became valid.
            frame: the frame.
            arrived_us: its arrival here in microseconds, by a clock that is never set.
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
        """Process the next frame by a time that never steps."""
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
        """Let time pass up to an instant of the time stamps' clock without a frame."""
        own_us = self._clock.pass_time(us)
        if own_us is not None:
            self._pass(own_us)

    def _pass(self, us: int) -> None:
        if self._player is not None:
            self._pass_time(self._player, us)
            self._look(us)

    @property
    def _dictionaries(self) -> list[ObjectDictionary]:
        """Objects of the twin by axis; a reset creates new ones."""
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
        """Run the twin up to an instant, and sample the velocity of its axes often enough."""
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
        """Process a frame of a node on one of the sides."""
        self._sayings.hear(counts, frame, of_board=of_board)
        axis = (frame.cob_id & NODE_ID_MAX) - FIRST_NODE_ID
        base = frame.cob_id & ~NODE_ID_MAX
        if base not in COB_TPDO:
            return
        dictionary = self._dictionaries[axis]
        told = _drive_report(dictionary, COB_TPDO.index(base), frame.data)
        if told is None:
            return
        compared = self._axes[axis]
        rested = compared.board.rests
        (compared.board if of_board else compared.twin).take(counts, told)
        if of_board and compared.waits_for_the_twin:
            self._catch_up(axis, counts)
        if of_board and not rested and compared.board.rests:
            self._let_stop(counts)
        if of_board and told.position_units is not None:
            for difference in compared.positions(counts, told.position_units, _twin_axis(dictionary)):
                self._say(counts, axis, *difference)

    def _look(self, us: int) -> None:
        """Report lasting differences; let the twin find a switch that the board has found."""
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
            for difference in (*compared.states(now_counts), *compared.homings()):
                self._say(now_counts, axis, *difference)

    @property
    def _twin_moves(self) -> bool:
        return any(board.motion.running_axes for board in self.machine.simulation.boards)

    def _catch_up(self, axis: int, counts: int) -> None:
        """Let the twin finish its homing search while the board, which stood nearer to its switch, waits for the host.

        This happens before the host's next frame, which might end the search. The twin's time is then shifted against
        the time stamps by the length of the search, so that later frames of the host do not reach the twin too late.
        The shift is left out if the difference is only jitter and another axis of the twin moves.
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
        """Run the twin ahead of the time stamps while a condition holds, at most up to an instant.

        The hosts' heartbeats are repeated meanwhile, because the twin monitors them.
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

    def _let_stop(self, counts: int) -> None:
        """Let the twin finish a profile that ends a little later than the board's, before the host's next frame.

        That frame may require a drive at rest. The whole machine is at rest then, so the twin's time is shifted
        against the time stamps. If the twin does not stop, it moves by a newer command and its time is not shifted.
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
    """Do not keep the frame."""


def _gives(frame: Frame) -> bool:
    """Return whether a host's frame writes to a node: process data, or an SDO download request."""
    base = frame.cob_id & ~NODE_ID_MAX
    writes = base == COB_SDO_REQUEST and bool(frame.data) and frame.data[0] >> 5 == DOWNLOAD_INITIATE
    return writes or base in COB_RPDO


def _is_boot_up(frame: Frame) -> bool:
    return frame.cob_id & ~NODE_ID_MAX == COB_HEARTBEAT and frame.data == _BOOT_UP


def _drive_report(dictionary: ObjectDictionary, number: int, data: bytes) -> DriveReport | None:
    """Return the drive's objects of a TPDO by the twin's mapping; None if the data are shorter than the mapping."""
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
