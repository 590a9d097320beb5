"""Replay a recorded bus on emulated boards in virtual time, and compare what they do with what was recorded."""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from steptwin.controller.backend import Kernel, fastest_kernel
from steptwin.host.client.monitor import Decoder
from steptwin.host.common.errors import InputError
from steptwin.host.record.folder.cutting import evidence_until
from steptwin.host.record.recorded_bus import RecordedBus, RecordedFrame, Sender, senders_of
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.replay.difference import Difference
from steptwin.host.twin.replay.edges import (
    first_difference_of_edges,
    first_difference_of_steps,
    greatest_shift_us,
)
from steptwin.host.twin.replay.frames import first_difference_by_wall_clock, first_difference_on_the_board_clock
from steptwin.host.twin.replay.machine import ReplayedMachine
from steptwin.host.twin.replay.playing import LEAD_COUNTS, Player
from steptwin.host.twin.replay.power_up import PowerUp, StoredMachine
from steptwin.protocol.frame import FIRST_NODE_ID, NODE_ID_MAX, Frame
from steptwin.protocol.timer import COUNTS_PER_US


@dataclass(frozen=True, slots=True)
class Replayed:
    """The result of a replay.

    Attributes:
        bus: the recording.
        robot: the machine.
        machine: the boards and what they did; `machine.run.save` writes the folder.
        played: number of frames that were sent to the boards.
        bus_faults: the faults of the bus in the recording, in words, which are not repeated.
        left_out: frames of the recording that were not played, by their kind in words.
        frames: the first frame that differs from the recording; None if there is none.
        edges: the first edge or step that differs from the stored run; None if there is none, or no stored run.
        against: the folder of that run; None if there is none.
        shift_us: by a computer's clock, by how much the steps of the last motion are earlier or later at most, from its
            start; None if this was not compared.
    """

    bus: RecordedBus
    robot: Robot
    machine: ReplayedMachine
    played: int
    bus_faults: tuple[str, ...]
    left_out: Mapping[str, int]
    frames: Difference | None
    edges: Difference | None
    against: Path | None
    shift_us: float | None

    @property
    def equal(self) -> bool:
        """True if nothing that was compared differs."""
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
    power_up: PowerUp,
    kernel: Kernel | None = None,
    against: StoredMachine | None = None,
) -> Replayed:
    """Replay a recording and compare.

    Args:
        bus: the recording.
        robot: the machine.
        power_up: how it stood when the boards were switched on.
        kernel: form of the firmware's kernel; by default the fastest one that is installed.
        against: the stored run whose edges the replay must make.

    Raises:
        InputError: no frame of the recording is for the robot's nodes, or the drivers or a place of the shelf do not
            exist.
    """
    node_ids = range(FIRST_NODE_ID, FIRST_NODE_ID + len(robot.joints))
    senders = senders_of(bus.frames, node_ids)
    _check_nodes(bus, senders, robot, node_ids)
    machine = ReplayedMachine(robot, power_up, kernel or fastest_kernel())
    decoder = Decoder(dict(zip(node_ids, robot.joint_names, strict=True)))
    player = Player(machine.simulation)
    left_out = Counter(bus.left_out)
    others = _others(bus.frames, senders)
    if bus.on_board_clock:
        end_counts = bus.frames[-1].us * COUNTS_PER_US
        if power_up.until_counts is not None and not bus.cut:
            end_counts = max(end_counts, power_up.until_counts)
        player.play_exactly(bus.frames, senders, end_counts)
        played = sum(sender is not Sender.BOARD for sender in senders)
        frames = first_difference_on_the_board_clock(bus.frames, machine.run.bus_log, decoder)
    else:
        player.play_by_wall_clock(bus.frames, senders)
        played = sum(sender is Sender.HOST for sender in senders)
        left_out += others
        heard = _from_the_first_request(bus.frames, senders)
        answered = [(counts - LEAD_COUNTS, frame) for counts, frame in machine.run.bus_log if counts > LEAD_COUNTS]
        frames = first_difference_by_wall_clock(heard, answered, node_ids, decoder)
    edges, shift_us = None, None
    if against:
        edges, shift_us = _compared_edges(bus, machine, against)
    return Replayed(
        bus=bus,
        robot=robot,
        machine=machine,
        played=played,
        bus_faults=power_up.bus_faults,
        left_out=left_out,
        frames=frames,
        edges=edges,
        against=against.folder if against else None,
        shift_us=shift_us,
    )


def _check_nodes(bus: RecordedBus, senders: Sequence[Sender], robot: Robot, node_ids: Collection[int]) -> None:
    """Raise InputError if nothing in the recording concerns the robot's nodes."""
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
    """Return how many frames concern nodes that are not the robot's, by node in words."""
    nodes = Counter(
        frame.cob_id & NODE_ID_MAX
        for (_, frame, _), sender in zip(frames, senders, strict=True)
        if sender is Sender.OTHER
    )
    return Counter({f"of node 0x{node_id:02X}": count for node_id, count in sorted(nodes.items())})


def _from_the_first_request(frames: Sequence[RecordedFrame], senders: Sequence[Sender]) -> list[tuple[int, Frame]]:
    """Return the board's frames after the first one of a host, with instants in counts since the first frame."""
    first = senders.index(Sender.HOST) if Sender.HOST in senders else len(frames)
    first_us = frames[0].us
    return [
        ((us - first_us) * COUNTS_PER_US, frame)
        for (us, frame, _), sender in zip(frames[first:], senders[first:], strict=True)
        if sender is Sender.BOARD
    ]


def _compared_edges(
    bus: RecordedBus, machine: ReplayedMachine, against: StoredMachine
) -> tuple[Difference | None, float | None]:
    """Return the first difference of the edges, and by a computer's clock the greatest shift of equal steps."""
    recorded, replayed = against.evidence, machine.run.evidence()
    if not bus.on_board_clock:
        difference = first_difference_of_steps(recorded, replayed)
        return difference, None if difference else greatest_shift_us(recorded, replayed)
    until_counts = machine.simulation.now_counts if bus.cut else against.power_up.until_counts
    if until_counts is not None:
        recorded, replayed = (evidence_until(each, until_counts + 1) for each in (recorded, replayed))
    return first_difference_of_edges(recorded, replayed), None
