"""Keep what the boards of a failed test leave, and tell it in the test's report: frames, faults, a run's folder."""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import MISSING, Field, fields
from itertools import count
from pathlib import Path
from typing import Any, Final

from steptwin.emulator.faults.bus_faults import BusFault
from steptwin.host.client.monitor import Decoder
from steptwin.host.common.errors import StepTwinError
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.board_under_test import BoardUnderTest
from steptwin.protocol.frame import FIRST_NODE_ID, Frame
from steptwin.protocol.timer import COUNTS_PER_SECOND

_FRAMES_SHOWN: Final = 20
_STRIKES_SHOWN: Final = 20
_NAME_CHARS_MAX: Final = 100
_OTHERS: Final = re.compile(r"[^\w.-]+")


def last_frames(robot: Robot, log: Iterable[tuple[int, Frame]]) -> str:
    """Return the last frames on a bus in CANopen's words."""
    decoder = Decoder(dict(enumerate(robot.joint_names, start=FIRST_NODE_ID)))
    return "\n".join(_line(counts, frame, decoder) for counts, frame in list(log)[-_FRAMES_SHOWN:])


def strikes(board: BoardUnderTest) -> str:
    """Return in words how the faults of a board's bus have struck, and which never did; empty if there are none."""
    decoder = Decoder(dict(enumerate(board.robot.joint_names, start=FIRST_NODE_ID)))
    struck = board.struck
    lines = [_line(each.counts, each.frame, decoder, f"{each.fault.kind.value}: ") for each in struck[-_STRIKES_SHOWN:]]
    if len(struck) > _STRIKES_SHOWN:
        lines.insert(0, f"the last {_STRIKES_SHOWN} of {len(struck)} strikes:")
    unused = (fault for fault in board.bus_faults if all(each.fault is not fault for each in struck))
    return "\n".join([*lines, *(f"never struck: {_words(fault)}" for fault in unused)])


def scenario_faults(board: BoardUnderTest) -> str:
    """Return in words what has become of each fault of a board's scenario; empty without one."""
    lines = []
    for fault in board.faults():
        struck = "never struck" if fault["struck_s"] is None else f"struck at {fault['struck_s']:.6f} s"
        codes = " ".join(dict.fromkeys(told["code"] for told in fault["emcys"])) or "no EMCY"
        lines.append(f"{fault['name']}: {fault['due']}: {struck}, {fault['strikes']} times, {codes}")
    return "\n".join(lines)


def stalling_homings(board: BoardUnderTest) -> str:
    """Return in words which motors stall as their joints are homed; empty without motors that turn with the board."""
    if not board.motors_turn:
        return ""
    from steptwin.host.twin.motors.steep_homings import steep_homings

    return "\n".join(steep_homings(board.robot, board.driver_profile))


def _words(fault: BusFault) -> str:
    """Return a fault of the bus in words: its kind, and all else that is not as usual."""
    chosen = (f"{field.name}={getattr(fault, field.name)}" for field in fields(fault) if _differs(fault, field))
    return ", ".join([fault.kind.value, *chosen])


def _differs(fault: BusFault, field: Field[Any]) -> bool:
    return field.default is not MISSING and getattr(fault, field.name) != field.default


def _line(counts: int, frame: Frame, decoder: Decoder, before: str = "") -> str:
    decoded = decoder.decode(frame.cob_id, frame.data)
    return f"{counts / COUNTS_PER_SECOND:10.6f} {before}{decoded.title:9} {decoded.node:8} {decoded.text}"


def kept(save: Callable[[Path], None], folder: Path) -> str:
    """Save a folder; return where it is and what to do with it, or why it could not be saved."""
    try:
        save(folder)
    except (StepTwinError, OSError) as error:
        return f"could not be saved: {error}"
    return f"{folder}\nsteptwin view | plot | verify | replay {folder}"


def folders_of(test: str, artefacts: Path) -> Iterator[Path]:
    """Yield a folder for each board of a test, by the test's name."""
    name = _OTHERS.sub("-", test).strip("-")[-_NAME_CHARS_MAX:]
    for number in count(1):
        yield artefacts / (name if number == 1 else f"{name}-{number}")
