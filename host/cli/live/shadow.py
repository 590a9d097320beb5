"""`steptwin shadow ROBOT --connect ...`: hold a running machine against its twin.

It sends nothing, but for the questions of `--join asking` before it begins.
"""

import json
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from steptwin.host.cli.app import command, end_unless
from steptwin.host.cli.arguments import RobotName, check_standing, naming_machine_options, run_folder
from steptwin.host.cli.live.connection import LiveOptions
from steptwin.host.cli.options import Without, naming_options, option, switch
from steptwin.host.cli.output import say, warn
from steptwin.host.common.errors import InputError
from steptwin.host.twin.machine.machine_options import MachineOptions

if TYPE_CHECKING:
    import can

    from steptwin.host.record.recorded_bus import RecordedFrame
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.replay import MachineAtPowerUp
    from steptwin.host.twin.shadow import Discrepancy, NodeValues, Shadow
    from steptwin.protocol.frame import Frame

_POLL_S: Final = 0.1
_BEHIND_US: Final = 200_000
"""Time by which the twin stays behind this computer's clock while nothing is heard: frames may be on their way."""
ASKING: Final = "asking"
"""The word for `--join` that lets the machine be asked how it stands."""
BOARD_LOG: Final = "board.log"
DISCREPANCIES: Final = "discrepancies.jsonl"


@dataclass(frozen=True, slots=True)
class ShadowOptions:
    """The options that say from where on, how long, and what is kept."""

    join: str | None = option(
        "DIR|asking",
        "Recording of the machine since power-up, such as serve's --out; asking: read by SDO how it stands now.",
    )
    new_board: bool = switch("The board has never stored the robot's settings.")
    until_difference: bool = switch("End at the first discrepancy.")
    seconds: float | None = option("S", "Time to listen; by default until Ctrl-C.")
    out: str | None = option("DIR", "Folder for the twin's run, the real board's frames and the discrepancies.")


@command("lab-scara --connect 127.0.0.1", "lab-scara -i socketcan -c can0 --out out/night")
def shadow(
    wanted: ShadowOptions,
    live: LiveOptions,
    machine: Annotated[MachineOptions, Without(("scenario", "motors", "firmware", "nodes", "bitrate"))],
    robot: RobotName = None,
) -> None:
    """Let a twin hear what the hosts tell a running machine, and say where the real board does otherwise.

    It sends nothing, but SDO uploads with --join asking before it begins. It begins with the boot-up of a node, so
    switch the board on or reset it while the shadow listens; or with --join. It tells errors, states, answers,
    positions, and the steps that a homing finds lost. Exit code 1 if something differed, or if no boot-up came. With
    --json a line for each discrepancy.
    """
    from steptwin.host.client.links.bus_link import open_bus
    from steptwin.host.twin.live.recording_report import UnplannedRun
    from steptwin.host.twin.shadow import Shadow, joints_told

    loaded = live.robot(robot)
    if wanted.seconds is not None and not 0 < wanted.seconds < float("inf"):
        raise InputError(f"--seconds {wanted.seconds:g}: is not above 0 and finite")
    power_up, before = _power_up(loaded, machine, wanted)
    to = None if wanted.out is None else run_folder(wanted.out)
    discrepancies: list[Discrepancy] = []

    def tell(discrepancy: "Discrepancy") -> None:
        discrepancies.append(discrepancy)
        say(json.dumps(discrepancy.to_dict()) if live.as_json else str(discrepancy))

    def twin_at(stood: "MachineAtPowerUp") -> "tuple[Shadow, UnplannedRun | None]":
        with naming_machine_options():
            twin = Shadow(loaded, stood, tell, keep=to is not None)
        return twin, None if to is None else UnplannedRun(twin.machine, "shadow")

    twin, run = twin_at(power_up)
    twin.take_recording(before)
    kept: list[tuple[int, Frame]] = []
    found = live.address.required(loaded)
    with open_bus(found) as bus:
        if wanted.join == ASKING:
            standing, us = _asked(bus, found.title, loaded)
            stood = MachineOptions(stand_at=joints_told(loaded, standing))
            twin, run = twin_at(replace(power_up, options=power_up.options.over(stood)))
            twin.take_standing(standing, us)
        joined = _told_joined(twin)
        try:
            for us, frame in _heard(bus.recv, found.title, wanted.seconds):
                if frame is None:
                    twin.pass_time(us)
                else:
                    twin.hear(us, frame)
                joined = joined or _told_joined(twin)
                if to is not None and frame is not None:
                    kept.append((us, frame))
                if discrepancies and wanted.until_difference:
                    break
        except KeyboardInterrupt:
            if wanted.seconds is not None:
                raise
    if run is not None and to is not None:
        with naming_options("out"):
            run.save(to)
        _keep(to, kept, discrepancies)
        live.add_files("the twin's run, the board's frames and the discrepancies are", to)
    _sum_up(live, twin, discrepancies)
    end_unless(twin.joined and not discrepancies)


def _power_up(
    robot: "Robot", machine: MachineOptions, wanted: ShadowOptions
) -> "tuple[MachineAtPowerUp, tuple[RecordedFrame, ...]]":
    """Return how the machine stood at power-up, and what was on its bus since then, of a recording."""
    from steptwin.host.record.folder import BUS_LOG
    from steptwin.host.record.recorded_bus import read_bus
    from steptwin.host.twin.replay import MachineAtPowerUp, stored_machine

    check_standing(robot, machine)
    folder = None if wanted.join in (None, ASKING) else Path(wanted.join)
    stood = MachineAtPowerUp() if folder is None else stored_machine(folder, robot).power_up
    options = machine.over(stood.options)
    with naming_machine_options():
        options.bits_per_s(robot)
        options.boards_of(robot)
    before = () if folder is None else tuple(read_bus(folder / BUS_LOG, None).frames)
    return replace(stood, options=options, commissioned=stood.commissioned and not wanted.new_board), before


def _asked(bus: "can.BusABC", title: str, robot: "Robot") -> "tuple[Mapping[int, NodeValues], int]":
    """Ask the machine how it stands; return that, and the stamp of the last answer in us.

    Here alone is something sent: what `Questions` returns.
    """
    import can

    from steptwin.host.client.links.bus_link import bus_errors
    from steptwin.host.twin.shadow import Questions
    from steptwin.protocol.frame import FIRST_NODE_ID

    questions = Questions(robot.name, dict(enumerate(robot.axis_names, start=FIRST_NODE_ID)), warn)
    heard = _heard(bus.recv, title, None)
    while True:
        us, frame = next(heard)
        request = questions.hear(time.monotonic(), frame)
        if questions.standing is not None:
            return questions.standing, us
        if request is not None:
            with bus_errors(title):
                bus.send(can.Message(arbitration_id=request.cob_id, data=request.data, is_extended_id=False))


def _heard(
    recv: "Callable[[float], can.Message | None]", title: str, seconds: float | None
) -> "Iterator[tuple[int, Frame | None]]":
    """Yield frames with their stamps in us as they come; None, and the time by their clock, while none comes.

    That is 0 before the first one, which tells their clock.
    """
    from steptwin.host.client.links.bus_link import bus_errors
    from steptwin.protocol.frame import Frame

    until_s = None if seconds is None else time.monotonic() + seconds
    last_us, last_s = None, 0.0
    while until_s is None or time.monotonic() < until_s:
        with bus_errors(title):
            message = recv(_POLL_S)
        if message is None:
            silent_us = round(1e6 * (time.monotonic() - last_s)) - _BEHIND_US
            yield 0 if last_us is None else last_us + silent_us, None
            continue
        if message.is_extended_id or message.is_remote_frame or message.is_error_frame or message.is_fd:
            continue
        last_us, last_s = round(1e6 * message.timestamp), time.monotonic()
        yield last_us, Frame(message.arbitration_id, bytes(message.data))


def _told_joined(twin: "Shadow") -> bool:
    """Say so if the twin knows how the machine stands; return whether it does."""
    if twin.joined:
        say("joined: the twin goes along with the machine", err=True)
    return twin.joined


def _keep(folder: Path, frames: "list[tuple[int, Frame]]", discrepancies: "list[Discrepancy]") -> None:
    """Write what was heard, as candump -L does, and what was told beside the twin's run."""
    lines = [f"({us / 1e6:.6f}) can0 {frame.cob_id:03X}#{frame.data.hex().upper()}\n" for us, frame in frames]
    (folder / BOARD_LOG).write_text("".join(lines), encoding="ascii")
    told = "".join(f"{json.dumps(each.to_dict())}\n" for each in discrepancies)
    (folder / DISCREPANCIES).write_text(told, encoding="utf-8")


def _sum_up(live: LiveOptions, twin: "Shadow", discrepancies: "list[Discrepancy]") -> None:
    """Say what was heard, and how many discrepancies there were."""
    if live.as_json:
        say(json.dumps({"joined": twin.joined, "board_frames": twin.frames, "discrepancies": len(discrepancies)}))
    elif not twin.joined:
        say("no boot-up was heard: switch the board on or reset its nodes while the shadow listens, or give --join")
    else:
        said = f"{len(discrepancies)} discrepancies" if discrepancies else "the board does what its twin does"
        say(f"{twin.frames} frames of the board: {said}")
