"""What a computer has recorded by its own clock: the same steps, whatever the jitter, and what differs is told."""

import random
import re
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import can
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.replay.power_up import stored_machine
from steptwin.features.replay.replaying import Replayed, replay
from steptwin.host.record.folder import BUS_LOG, read_robot
from steptwin.host.record.recorded_bus import read_bus

EPOCH_S = 1_700_000_000.0
_LINE = re.compile(r"\((\d+\.\d+)\) \S+ (\w+)#(\w*)")


def seen(log: Path, late_s: Callable[[], float]) -> list[can.Message]:
    """Return the frames of a log as another program sees them, each later by so much, in their order."""
    found = (_LINE.match(line) for line in log.read_text().splitlines())
    messages = [
        can.Message(
            EPOCH_S + float(frame[1]) + late_s(),
            int(frame[2], 16),
            is_extended_id=False,
            data=bytes.fromhex(frame[3]),
            channel="can0",
        )
        for frame in found
        if frame
    ]
    for before, message in pairwise(messages):
        message.timestamp = max(message.timestamp, before.timestamp)
    return messages


def replayed(carry_run: Path, messages: list[can.Message], log: Path, kernel: Kernel) -> Replayed:
    with can.Logger(log) as logger:
        for message in messages:
            logger(message)
    robot = read_robot(carry_run)
    stored = stored_machine(carry_run, robot)
    return replay(read_bus(log), robot, stored.power_up, kernel, stored)


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf", ".trc"])
@pytest.mark.parametrize("late_ms", [0.0, 3.0])
def test_the_same_steps(suffix: str, late_ms: float, carry_run: Path, fast_kernel: Kernel, tmp_path: Path) -> None:
    draw = random.Random(17)
    messages = seen(carry_run / BUS_LOG, lambda: draw.uniform(0, late_ms / 1000))
    result = replayed(carry_run, messages, tmp_path / f"bus{suffix}", fast_kernel)
    assert not result.bus.on_board_clock
    assert result.frames is None
    assert result.edges is None
    assert result.shift_us is not None
    assert result.shift_us < 1


def test_a_recording_that_began_after_power_up(carry_run: Path, fast_kernel: Kernel, tmp_path: Path) -> None:
    """Its first frames, the boot-ups, are missing; other nodes and broken frames are among the rest."""
    messages = seen(carry_run / BUS_LOG, lambda: 0.0)[4:]
    rogue = can.Message(messages[9].timestamp, 0x1A5, is_extended_id=False, data=[1], channel="can0")
    broken = can.Message(messages[9].timestamp, is_error_frame=True, channel="can0")
    request = can.Message(messages[20].timestamp, 0x625, is_extended_id=False, data=bytes(8), channel="can0")
    result = replayed(
        carry_run,
        [*messages[:10], rogue, broken, *messages[10:21], request, *messages[21:]],
        tmp_path / "bus.asc",
        fast_kernel,
    )
    assert result.equal
    assert result.left_out == {"error frames": 1, "of node 0x25": 2}


def test_stamps_that_are_all_equal_until_the_motion(carry_run: Path, fast_kernel: Kernel, tmp_path: Path) -> None:
    """As of a program that reads its interface once in a while: each request waits for the answers before it."""
    messages = seen(carry_run / BUS_LOG, lambda: 0.0)
    first = next(i for i, message in enumerate(messages) if message.arbitration_id in range(0x510, 0x514))
    for message in messages[:first]:
        message.timestamp = messages[0].timestamp
    assert replayed(carry_run, messages, tmp_path / "bus.log", fast_kernel).equal


def changed(messages: list[can.Message], cob_id: int, start: str, data: str | None) -> list[can.Message]:
    """Give the last frame of an identifier that begins so other bytes, or leave it out."""
    index = max(
        i
        for i, message in enumerate(messages)
        if message.arbitration_id == cob_id and bytes(message.data).hex().startswith(start)
    )
    if data is None:
        return messages[:index] + messages[index + 1 :]
    messages[index].data = bytearray.fromhex(data)
    messages[index].dlc = len(messages[index].data)
    return messages


@pytest.mark.parametrize(
    ("cob_id", "start", "data", "words"),
    [
        (
            0x591,
            "430010",
            "4300100093010400",
            "answers: recorded SDO th2 1000:00 Device type is 0x40193, replayed SDO th2",
        ),
        (0x591, "430010", None, "answers: recorded SDO th2 "),
        (0x192, "3", "180000000000ff", "states of the drive: recorded TPDO1 d3 Statusword 0x0018 FAULT"),
    ],
)
def test_what_a_node_says_otherwise(
    cob_id: int, start: str, data: str | None, words: str, carry_run: Path, fast_kernel: Kernel, tmp_path: Path
) -> None:
    messages = changed(seen(carry_run / BUS_LOG, lambda: 0.0), cob_id, start, data)
    result = replayed(carry_run, messages, tmp_path / "bus.log", fast_kernel)
    assert not result.equal
    assert result.frames
    assert words in str(result.frames)
    assert str(result.frames).startswith("at ")
    assert result.frames.counts is not None
    assert 0 < result.frames.counts < 1.2 * 72_000_000
    assert result.edges is None


def test_a_record_that_is_missing(carry_run: Path, fast_kernel: Kernel, tmp_path: Path) -> None:
    """The queue has a gap, so the motion stops."""
    messages = seen(carry_run / BUS_LOG, lambda: 0.0)
    index = max(i for i, message in enumerate(messages) if message.arbitration_id == 0x510)
    del messages[index - 40]
    result = replayed(carry_run, messages, tmp_path / "bus.log", fast_kernel)
    assert not result.equal
