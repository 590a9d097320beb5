"""`steptwin shadow ROBOT --connect ...`: compare a running machine with its twin.

It sends nothing except the queries of `--join asking` before it begins.
"""

import json
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from steptwin.host.cli.app import command, end_unless
from steptwin.host.cli.arguments import RobotName, check_start_positions, naming_machine_options, run_folder
from steptwin.host.cli.live.connection import LiveOptions
from steptwin.host.cli.options import Without, naming_options, option, switch
from steptwin.host.cli.output import say, say_compiling, warn
from steptwin.host.common.errors import InputError
from steptwin.host.twin.machine.machine_options import MachineOptions

if TYPE_CHECKING:
    import can

    from steptwin.features.replay.power_up import MachineAtPowerUp
    from steptwin.features.shadow.asking import NodeValues
    from steptwin.features.shadow.discrepancy import Discrepancy
    from steptwin.features.shadow.shadow import ClockStep, Shadow
    from steptwin.host.record.recorded_bus import RecordedFrame
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.live.recording_report import UnplannedRun
    from steptwin.protocol.frame import Frame

_POLL_S: Final = 0.1
_BEHIND_US: Final = 200_000
"""Delay of the twin behind this computer's clock in silence: frames may be on their way."""
_STAMP_S_MAX: Final = 1e12
"""Largest valid stamp: 30 000 years from 1970."""
_STEPS_TOLD: Final = 10
"""Number of clock steps that are printed; a clock that steps with each frame would fill the screen."""
_WAITS_US: Final = 250_000
"""Wait of a discrepancy for equal ones on other axes; all are printed within a second."""
_STANDS_US: Final = 1_000_000
"""Time after which a stamps' clock that stands still while frames come counts as none."""
ASKING: Final = "asking"
"""Word for `--join` that allows queries of the machine."""
BOARD_LOG: Final = "board.log"
DISCREPANCIES: Final = "discrepancies.jsonl"


@dataclass(frozen=True, slots=True)
class ShadowOptions:
    """Options for start, duration and files of a shadow."""

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
    machine: Annotated[MachineOptions, Without(("faults", "bitrate"))],
    robot: RobotName = None,
) -> None:
    """Let a twin hear what the hosts tell a running machine, and say where the real board does otherwise.

    It sends nothing, but SDO uploads with --join asking before it begins. It begins with the boot-up of a node, so
    switch the board on or reset it while the shadow listens; or with --join. It tells errors, states, answers,
    positions, and the steps that a homing finds lost. Exit code 1 if something differed, or if no boot-up came. With
    --json a line for each discrepancy.
    """
    from steptwin.features.shadow.shadow import Shadow
    from steptwin.features.shadow.standing import reported_joints
    from steptwin.host.client.links.bus_link import open_bus
    from steptwin.host.twin.live.recording_report import UnplannedRun
    from steptwin.host.twin.machine.kernels import telling_of_compiling

    loaded = live.robot(robot)
    if wanted.seconds is not None and not 0 < wanted.seconds < float("inf"):
        raise InputError(f"--seconds {wanted.seconds:g}: is not above 0 and finite")
    power_up, before = _power_up(loaded, machine, wanted)
    to = None if wanted.out is None else run_folder(wanted.out)
    telling = _Telling(as_json=live.as_json)

    def twin_at(stood: "MachineAtPowerUp") -> "tuple[Shadow, UnplannedRun | None]":
        with telling_of_compiling(say_compiling), naming_machine_options():
            twin = Shadow(loaded, stood, telling.tell, keep=to is not None, tell_step=telling.tell_step)
        return twin, None if to is None else UnplannedRun(twin.machine, "shadow")

    twin, run = twin_at(power_up)
    twin.take_recording(before)
    kept: list[tuple[int, Frame]] = []
    found = live.address.required(loaded)
    since: tuple[int, int] | None = None
    with open_bus(found) as bus:
        if wanted.join == ASKING:
            standing, since = _requested_values(bus, found.title, loaded)
            stood = MachineOptions(stand_at=reported_joints(loaded, standing))
            twin, run = twin_at(replace(power_up, options=power_up.options.over(stood)))
            twin.set_initial_values(standing, *since)
        joined = _print_joined(twin)
        try:
            for us, frame, arrived_us in _heard(bus.recv, found.title, wanted.seconds, since):
                if frame is None:
                    twin.pass_time(us)
                else:
                    twin.hear(us, frame, arrived_us)
                joined = joined or _print_joined(twin)
                if to is not None and frame is not None:
                    kept.append((us, frame))
                telling.go_on(arrived_us)
                if telling.discrepancies and wanted.until_difference:
                    break
        except KeyboardInterrupt:
            if wanted.seconds is not None:
                raise
        finally:
            telling.flush()
    discrepancies = telling.discrepancies
    if run is not None and to is not None:
        _keep(run, to, kept, discrepancies)
        live.add_files("the twin's run, the board's frames and the discrepancies are", to)
    _sum_up(live, twin, discrepancies)
    end_unless(twin.joined and not discrepancies)


class _Telling:
    """Prints discrepancies, one line for equal ones of several axes, and steps of the stamps' clock."""

    def __init__(self, *, as_json: bool) -> None:
        self.discrepancies: list[Discrepancy] = []
        self._as_json = as_json
        self._waiting: list[Discrepancy] = []
        self._since_us: int | None = None
        """Arrival of the first waiting discrepancy."""
        self._steps = 0

    def tell(self, discrepancy: "Discrepancy") -> None:
        self.discrepancies.append(discrepancy)
        if self._as_json:
            say(json.dumps(discrepancy.to_dict()))
        else:
            self._waiting.append(discrepancy)

    def tell_step(self, step: "ClockStep") -> None:
        from steptwin.features.shadow.discrepancy import time_text

        self._steps += 1
        if self._steps > _STEPS_TOLD:
            return
        way = "back" if step.step_s < 0 else "forward"
        now = f"to {time_text(step.at_s)}: the twin goes on from where it is"
        warn(f"the stamps' clock was put {way} by {abs(step.step_s):.3f} s {now}")
        if self._steps == _STEPS_TOLD:
            warn("further steps of the stamps' clock are not told")

    def go_on(self, now_us: int) -> None:
        """Print discrepancies that have waited long enough."""
        if not self._waiting:
            self._since_us = None
        elif self._since_us is None:
            self._since_us = now_us
        elif now_us - self._since_us > _WAITS_US:
            self.flush()

    def flush(self) -> None:
        from steptwin.features.shadow.discrepancy import grouped

        say(*grouped(self._waiting))
        self._waiting.clear()


def _power_up(
    robot: "Robot", machine: MachineOptions, wanted: ShadowOptions
) -> "tuple[MachineAtPowerUp, tuple[RecordedFrame, ...]]":
    """Return the machine's state at power-up, and its frames since then, from a recording."""
    from steptwin.features.replay.power_up import MachineAtPowerUp, stored_machine
    from steptwin.host.record.folder import BUS_LOG
    from steptwin.host.record.recorded_bus import read_bus

    check_start_positions(robot, machine)
    folder = None if wanted.join in (None, ASKING) else Path(wanted.join)
    stood = MachineAtPowerUp() if folder is None else stored_machine(folder, robot).power_up
    options = machine.over(stood.options)
    with naming_machine_options():
        options.bits_per_s(robot)
        options.boards_of(robot)
    before = () if folder is None else tuple(read_bus(folder / BUS_LOG, None).frames)
    return replace(stood, options=options, commissioned=stood.commissioned and not wanted.new_board), before


def _requested_values(
    bus: "can.BusABC", title: str, robot: "Robot"
) -> "tuple[Mapping[int, NodeValues], tuple[int, int]]":
    """Request the machine's state; return it, and the stamp and the arrival of the last answer, in us.

    Only this function sends frames: those of `Questions`.
    """
    import can

    from steptwin.features.shadow.asking import Questions
    from steptwin.host.client.links.bus_link import bus_errors
    from steptwin.protocol.frame import FIRST_NODE_ID

    questions = Questions(robot.name, dict(enumerate(robot.axis_names, start=FIRST_NODE_ID)), warn)
    heard = _heard(bus.recv, title, None)
    while True:
        us, frame, arrived_us = next(heard)
        request = questions.hear(time.monotonic(), frame)
        if questions.standing is not None:
            return questions.standing, (us, arrived_us)
        if request is not None:
            with bus_errors(title):
                bus.send(can.Message(arbitration_id=request.cob_id, data=request.data, is_extended_id=False))


def _heard(
    recv: "Callable[[float], can.Message | None]",
    title: str,
    seconds: float | None,
    since: tuple[int, int] | None = None,
) -> "Iterator[tuple[int, Frame | None, int]]":
    """Yield frames with their stamps as they arrive; in silence, None and the time by their clock; all in us.

    That time is 0 before the first frame, which determines their clock; `since` are stamp and arrival of an earlier
    frame. The last value is the time by a clock that is never set.
    """
    from steptwin.host.client.links.bus_link import bus_errors
    from steptwin.protocol.frame import Frame

    until_s = None if seconds is None else time.monotonic() + seconds
    last_us, last_arrived_us = since or (None, 0)
    stamps = _Stamps()
    while until_s is None or time.monotonic() < until_s:
        with bus_errors(title):
            message = recv(_POLL_S)
        arrived_us = round(1e6 * time.monotonic())
        if message is None:
            silent_us = arrived_us - last_arrived_us - _BEHIND_US
            yield 0 if last_us is None else last_us + silent_us, None, arrived_us
        elif not (message.is_extended_id or message.is_remote_frame or message.is_error_frame or message.is_fd):
            last_us, last_arrived_us = stamps.of(message.timestamp, arrived_us), arrived_us
            yield last_us, Frame(message.arbitration_id, bytes(message.data)), arrived_us


class _Stamps:
    """Stamps of frames; this computer's clock replaces stamps of an interface that gives none, or always the same."""

    def __init__(self) -> None:
        self._stamp_s = 0.0
        self._since_us: int | None = None
        """Arrival of the first frame with that stamp."""
        self._told = False

    def of(self, stamp_s: float, arrived_us: int) -> int:
        """Return the stamp of a frame in us."""
        known = abs(stamp_s) < _STAMP_S_MAX
        if self._since_us is None or (known and stamp_s != self._stamp_s):
            self._stamp_s, self._since_us = (stamp_s if known else 0.0), arrived_us
        stands_us = arrived_us - self._since_us
        if known and stands_us < _STANDS_US:
            return round(1e6 * self._stamp_s)
        if not self._told:
            self._told = True
            warn(f"the stamp {stamp_s:g} s is no time: such frames are taken as they come")
        return round(1e6 * self._stamp_s) + stands_us


def _print_joined(twin: "Shadow") -> bool:
    """Print a line if the twin knows the machine's state; return whether it does."""
    if twin.joined:
        say("joined: the twin goes along with the machine", err=True)
    return twin.joined


def _keep(
    run: "UnplannedRun", folder: Path, frames: "list[tuple[int, Frame]]", discrepancies: "list[Discrepancy]"
) -> None:
    """Write the twin's run, the received frames as candump -L does, and the discrepancies."""
    with naming_options("out"):
        run.save(folder)
    lines = [f"({us / 1e6:.6f}) can0 {frame.cob_id:03X}#{frame.data.hex().upper()}\n" for us, frame in frames]
    (folder / BOARD_LOG).write_text("".join(lines), encoding="ascii")
    told = "".join(f"{json.dumps(each.to_dict())}\n" for each in discrepancies)
    (folder / DISCREPANCIES).write_text(told, encoding="utf-8")


def _sum_up(live: LiveOptions, twin: "Shadow", discrepancies: "list[Discrepancy]") -> None:
    """Print the numbers of frames and discrepancies."""
    if live.as_json:
        say(json.dumps({"joined": twin.joined, "board_frames": twin.frames, "discrepancies": len(discrepancies)}))
    elif not twin.joined:
        say("no boot-up was heard: switch the board on or reset its nodes while the shadow listens, or give --join")
    else:
        said = f"{len(discrepancies)} discrepancies" if discrepancies else "the board does what its twin does"
        say(f"{twin.frames} frames of the board: {said}")
