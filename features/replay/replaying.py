"""Replay a recorded bus on emulated boards in virtual time, and compare frames and edges with the recording.

On the board's clock the instant when a frame became valid is exact. Its start on the wire was earlier by the length of
the frame, and the frame enters arbitration then. A frame that began right after another one had waited for it, and
waits again.

By a computer's clock, time stamps tell when a program received the frames. A host's frame is sent at its stamp, but a
request waits for the answers that its host had already received.
"""

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from steptwin.controller.motion.backend import Kernel, fastest_kernel
from steptwin.emulator.bus.can_bus import Log
from steptwin.emulator.bus.can_timing import VALID_BEFORE_END_BITS, frame_bits
from steptwin.emulator.operations import Scheduled
from steptwin.emulator.simulation import Simulation
from steptwin.features.replay.differences import (
    Difference,
    first_difference_by_wall_clock,
    first_difference_of_edges,
    first_difference_of_steps,
    first_difference_on_the_board_clock,
    greatest_shift_us,
)
from steptwin.features.replay.power_up import MachineAtPowerUp, StoredMachine
from steptwin.host.client.monitor import Decoder
from steptwin.host.common.errors import InputError
from steptwin.host.record.folder import REPLAY_JOB
from steptwin.host.record.folder.edges_file import evidence_until
from steptwin.host.record.recorded_bus import RecordedBus, RecordedFrame, Sender, senders_of
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.live.recording_report import UnplannedRun
from steptwin.host.twin.machine.emulated_machine import EmulatedMachine, MachineParts
from steptwin.host.twin.machine.robot_boards import Places
from steptwin.protocol.frame import COB_SDO_REQUEST, COB_SDO_RESPONSE, FIRST_NODE_ID, NODE_ID_MAX, Frame
from steptwin.protocol.timer import COUNTS_PER_MS, COUNTS_PER_SECOND, COUNTS_PER_US

LEAD_COUNTS: Final = 10 * COUNTS_PER_MS
"""Time from power-up to the first frame if the recording does not give it: after the boot-ups."""
_ANSWER_COUNTS: Final = 100 * COUNTS_PER_MS
"""Longest wait of a request for the answers before it; the board takes less than 2 ms."""
_REST_COUNTS: Final = COUNTS_PER_SECOND // 10
"""Time after the last frame, and after the last motion, in which answers may come."""
_MOTION_S_MAX: Final = 3600
"""Longest time after the recording for which a motion is continued."""


class HostPlayer:
    """Sends the hosts' frames of a recording in order, from one interface of the hosts."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation

    def play_exactly(self, frames: Sequence[RecordedFrame], senders: Sequence[Sender], until_counts: int) -> None:
        """Play a recording on the board's clock, and continue to an instant."""
        for recorded, sender in zip(frames, senders, strict=True):
            if sender is not Sender.BOARD:  # other nodes occupy the bus, too
                self._send_as_recorded(recorded.us * COUNTS_PER_US, recorded.frame)
        self._simulation.run_until(until_counts)

    def _send_as_recorded(self, valid_counts: int, frame: Frame) -> None:
        """Send a frame so that it becomes valid at an instant."""
        begin_counts = valid_counts - _length_counts(self._simulation, frame)
        _go_on(self._simulation, lambda: self._simulation.bus.free_counts >= begin_counts, begin_counts)
        self._simulation.host.send(frame, self._simulation.now_counts)

    def play_by_wall_clock(self, frames: Sequence[RecordedFrame], senders: Sequence[Sender]) -> None:
        """Play a recording by a computer's clock, and continue until the machine is at standstill."""
        first_counts = LEAD_COUNTS - frames[0].us * COUNTS_PER_US
        player = WallClockPlayer(self._simulation, first_counts)
        for (us, frame, _), sender in zip(frames, senders, strict=True):
            player.play(us, frame, sender)
        self._simulation.run_until(player.counts_of(frames[-1].us))
        self._come_to_rest()

    def _come_to_rest(self) -> None:
        simulation = self._simulation
        give_up_counts = simulation.now_counts + _MOTION_S_MAX * COUNTS_PER_SECOND
        simulation.run_until(simulation.now_counts + _REST_COUNTS)
        while self._moving and simulation.now_counts < give_up_counts:
            simulation.run_until(simulation.now_counts + _REST_COUNTS)

    @property
    def _moving(self) -> bool:
        return any(board.moving for board in self._simulation.boards)


class WallClockPlayer:
    """Sends hosts' frames by a computer's clock, one by one.

    A request that waits for an answer delays the frames after it, but never while the machine moves.
    """

    def __init__(self, simulation: Simulation, first_counts: int) -> None:
        """Start the player; `first_counts` is the boards' instant at that clock's 0, which may be before power-up."""
        self._simulation = simulation
        self.first_counts: int = first_counts
        self._answered: Counter[int] = Counter()
        self._seen: Counter[int] = Counter()
        simulation.bus.listen(self._count)

    def _count(self, frame: Frame, _: int) -> None:
        self._answered[frame.cob_id] += 1

    def counts_of(self, us: int) -> int:
        """Return the boards' instant at a time of the computer's clock."""
        return self.first_counts + us * COUNTS_PER_US

    def play(self, us: int, frame: Frame, sender: Sender) -> None:
        """Send a host's frame that became valid at this time; register a board's frame as received by the hosts."""
        if sender is Sender.BOARD:
            self._seen[frame.cob_id] += 1
        if sender is not Sender.HOST:
            return
        simulation = self._simulation
        due_counts = self.counts_of(us) - _length_counts(simulation, frame)
        simulation.run_until(due_counts)
        if frame.cob_id & ~NODE_ID_MAX == COB_SDO_REQUEST:
            cob_id = COB_SDO_RESPONSE + (frame.cob_id & NODE_ID_MAX)
            give_up_counts = simulation.now_counts + _ANSWER_COUNTS
            _go_on(simulation, lambda: self._answered[cob_id] >= self._seen[cob_id], give_up_counts)
            if not any(board.moving for board in simulation.boards):
                self.first_counts += max(simulation.now_counts - due_counts, 0)
        simulation.host.send(frame, simulation.now_counts)


def _length_counts(simulation: Simulation, frame: Frame) -> int:
    """Return the duration of a frame until it is valid."""
    return (frame_bits(frame) - VALID_BEFORE_END_BITS) * simulation.bus.bit_counts


def _go_on(simulation: Simulation, until: Callable[[], bool], until_counts: int) -> None:
    """Advance event by event until a condition is met, or to an instant."""
    while not until() and simulation.now_counts < until_counts:
        event_counts = max(simulation.next_event_counts(until_counts), simulation.now_counts + COUNTS_PER_US)
        simulation.run_until(min(event_counts, until_counts))


def machine_at(robot: Robot, power_up: MachineAtPowerUp, kernel: Kernel, log: Log | None = None) -> EmulatedMachine:
    """Return a robot's machine in its state at power-up, on a bus of its own; raise InputError as `MachineParts.of`.

    The stored operations are scheduled; the host's interface is free. `log` is called with each frame; by default the
    bus keeps all frames.
    """
    parts = MachineParts.of(
        robot,
        kernel,
        power_up.options,
        commissioned=power_up.commissioned,
        waits_for=power_up.waits_for,
    )
    places = Places(power_up.options.boards_of(robot))
    return EmulatedMachine(
        parts,
        [
            Scheduled(counts, each, number)
            for counts, operation in power_up.operations
            for number, each in places.on_boards(operation)
        ],
        log=log,
    )


@dataclass(frozen=True, slots=True)
class Replayed:
    """The result of a replay.

    Attributes:
        bus: the recording.
        robot: the machine.
        machine: the boards.
        run: the run on these boards; its `save` writes the folder.
        played: number of frames that were sent to the boards.
        bus_faults: faults of the bus in the recording, as text; they are not repeated.
        left_out: number of frames of the recording that were not played, by kind.
        frames: first frame that differs from the recording; None if there is none.
        edges: first edge or step that differs from the stored run; None if there is none, or no stored run.
        against: folder of that run; None if there is none.
        shift_us: largest shift of the steps of the last motion by a computer's clock, counted from its start; None if
            not compared.
    """

    bus: RecordedBus
    robot: Robot
    machine: EmulatedMachine
    run: UnplannedRun
    played: int
    bus_faults: tuple[str, ...]
    left_out: Mapping[str, int]
    frames: Difference | None
    edges: Difference | None
    against: Path | None
    shift_us: float | None

    @property
    def equal(self) -> bool:
        """True if no compared item differs."""
        return self.frames is None and self.edges is None

    def to_dict(self) -> dict[str, Any]:
        """Return the document that `steptwin replay --json` prints."""
        simulation = self.machine.simulation
        return {
            "log": str(self.bus.path),
            "robot": self.robot.name,
            "clock": "board" if self.bus.on_board_clock else "wall",
            "recorded_frames": len(self.bus.frames),
            "played_frames": self.played,
            "replayed_frames": simulation.bus.frames,
            "left_out": dict(self.left_out),
            "cut": self.bus.cut,
            "clock_steps_back": self.bus.steps_back,
            "bus_faults_not_repeated": len(self.bus_faults),
            "bus_faults": list(self.bus_faults),
            "equal": self.equal,
            "frames": None if self.frames is None else self.frames.to_dict(),
            "against": None if self.against is None else str(self.against),
            "edges": None if self.edges is None else self.edges.to_dict(),
            "step_shift_us_max": self.shift_us,
            "simulated_s": round(simulation.now_s, 6),
        }


def replay(
    bus: RecordedBus,
    robot: Robot,
    power_up: MachineAtPowerUp,
    kernel: Kernel | None = None,
    against: StoredMachine | None = None,
) -> Replayed:
    """Replay a recording and compare.

    Args:
        bus: the recording.
        robot: the machine.
        power_up: its state when the boards were switched on.
        kernel: form of the firmware's kernel; by default the fastest one that is installed.
        against: stored run to compare edges with.

    Raises:
        InputError: the recording has no frame for the robot's nodes, or the drivers do not exist.
    """
    node_ids = range(FIRST_NODE_ID, FIRST_NODE_ID + len(robot.axes))
    senders = senders_of(bus.frames, node_ids)
    _check_nodes(bus, senders, robot, node_ids)
    machine = machine_at(robot, power_up, kernel or fastest_kernel())
    run = UnplannedRun(machine, REPLAY_JOB)
    decoder = Decoder(dict(zip(node_ids, robot.axis_names, strict=True)))
    player = HostPlayer(machine.simulation)
    left_out = Counter(bus.left_out)
    others = _others(bus.frames, senders)
    if bus.on_board_clock:
        end_counts = bus.frames[-1].us * COUNTS_PER_US
        if power_up.until_counts is not None and not bus.cut:
            end_counts = max(end_counts, power_up.until_counts)
        player.play_exactly(bus.frames, senders, end_counts)
        played = sum(sender is not Sender.BOARD for sender in senders)
        frames = first_difference_on_the_board_clock(bus.frames, machine.bus_log, decoder)
    else:
        player.play_by_wall_clock(bus.frames, senders)
        played = sum(sender is Sender.HOST for sender in senders)
        left_out += others
        heard = _from_the_first_request(bus.frames, senders)
        answered = [(counts - LEAD_COUNTS, frame) for counts, frame in machine.bus_log if counts > LEAD_COUNTS]
        frames = first_difference_by_wall_clock(heard, answered, node_ids, decoder)
    edges, shift_us = None, None
    if against:
        edges, shift_us = _compared_edges(bus, run, machine.simulation.now_counts, against)
    return Replayed(
        bus=bus,
        robot=robot,
        machine=machine,
        run=run,
        played=played,
        bus_faults=power_up.bus_faults,
        left_out=left_out,
        frames=frames,
        edges=edges,
        against=against.folder if against else None,
        shift_us=shift_us,
    )


def _check_nodes(bus: RecordedBus, senders: Sequence[Sender], robot: Robot, node_ids: Collection[int]) -> None:
    """Raise InputError if the recording has no frame for or from the robot's nodes."""
    if Sender.BOARD in senders:
        return
    if any(frame.cob_id & NODE_ID_MAX in node_ids for _, frame, _ in bus.frames):
        return
    ids = sorted({frame.cob_id & NODE_ID_MAX for _, frame, _ in bus.frames} - {0})
    has = ", ".join(f"0x{each:02X}" for each in ids[:_NODES_LISTED]) or "no node's"
    own = f"0x{min(node_ids):02X} to 0x{max(node_ids):02X}"
    raise InputError(f"{bus.path}: is of nodes {has}; {robot.name} has {own}")


_NODES_LISTED = 8


def _others(frames: Sequence[RecordedFrame], senders: Sequence[Sender]) -> Counter[str]:
    """Return the number of frames of nodes that are not the robot's, by node as text."""
    nodes = Counter(
        frame.cob_id & NODE_ID_MAX
        for (_, frame, _), sender in zip(frames, senders, strict=True)
        if sender is Sender.OTHER
    )
    return Counter({f"of node 0x{node_id:02X}": count for node_id, count in sorted(nodes.items())})


def _from_the_first_request(frames: Sequence[RecordedFrame], senders: Sequence[Sender]) -> list[tuple[int, Frame]]:
    """Return the board's frames after a host's first one, with instants in counts since the first frame."""
    first = senders.index(Sender.HOST) if Sender.HOST in senders else len(frames)
    first_us = frames[0].us
    return [
        ((us - first_us) * COUNTS_PER_US, frame)
        for (us, frame, _), sender in zip(frames[first:], senders[first:], strict=True)
        if sender is Sender.BOARD
    ]


def _compared_edges(
    bus: RecordedBus, run: UnplannedRun, end_counts: int, against: StoredMachine
) -> tuple[Difference | None, float | None]:
    """Return the first difference of the edges and, by a computer's clock, the largest shift of equal steps.

    `end_counts` is the end of the replay.
    """
    recorded, replayed = against.evidence, run.evidence()
    if not bus.on_board_clock:
        difference = first_difference_of_steps(recorded, replayed)
        return difference, None if difference else greatest_shift_us(recorded, replayed)
    until_counts = end_counts if bus.cut else against.power_up.until_counts
    if until_counts is not None:
        recorded, replayed = (evidence_until(each, until_counts + 1) for each in (recorded, replayed))
    return first_difference_of_edges(recorded, replayed), None
