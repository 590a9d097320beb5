"""`steptwin replay LOG ROBOT`: replay a recorded bus and compare the boards' reactions."""

from dataclasses import MISSING, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from steptwin.host.cli.app import command, end_unless
from steptwin.host.cli.arguments import (
    RobotName,
    RobotOptions,
    check_start_positions,
    naming_machine_options,
    run_folder,
)
from steptwin.host.cli.options import Without, argument, naming_options, option, switch
from steptwin.host.cli.output import number_of, say
from steptwin.host.twin.machine.machine_options import MachineOptions

if TYPE_CHECKING:
    from steptwin.features.replay.power_up import StoredMachine
    from steptwin.features.replay.replaying import Replayed
    from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class ReplayOptions:
    """Options of a replay: what to play, what to compare with, and where to write."""

    against: Path | None = option("DIR", "Folder of the run that was recorded: where it began, and its edges.")
    out: str | None = option("DIR", "Folder to write the replay in, like a run's.")
    new_board: bool = switch("The board had never stored the robot's settings, as `run`'s have not.")
    channel: str | None = option("NAME", "Channel of a recording with several.", "--channel", "-c")


@command("out/spiral", "night.blf lab-scara -m stand-at='150 0 30 0' --out out/night")
def replay(
    wanted: ReplayOptions,
    which: RobotOptions,
    machine: Annotated[MachineOptions, Without(("faults",))],
    log: Path = argument("LOG", "Recorded bus (.log of candump -L, .asc, .blf, .trc), or a run's folder.", MISSING),
    robot: RobotName = None,
) -> None:
    """Play the hosts' frames of a recorded bus into the board again, in virtual time, and compare what it does.

    Exit code 0 if the board's frames are the recorded ones, and its edges those of the run; 1 if not: the first
    difference is told. A log of StepTwin's own is compared to the microsecond; one of a computer's clock by what each
    node says, and by the drivers' steps. The machine is by default that of the run.
    """
    from steptwin.features.replay.power_up import MachineAtPowerUp
    from steptwin.features.replay.replaying import replay as replayed
    from steptwin.host.record.recorded_bus import read_bus

    bus_file, folder = _recording(log, wanted.against)
    loaded = _robot(which, robot, folder)
    stored = None if folder is None else _stored(folder, loaded)
    stood = MachineAtPowerUp() if stored is None else stored.power_up
    check_start_positions(loaded, machine)
    options = machine.over(stood.options)
    with naming_machine_options():
        options.bits_per_s(loaded)
        options.boards_of(loaded)
    power_up = replace(stood, options=options, commissioned=stood.commissioned and not wanted.new_board)
    to = None if wanted.out is None else run_folder(wanted.out)
    with naming_machine_options("channel"):
        bus = read_bus(bus_file, wanted.channel)
        result = replayed(bus, loaded, power_up, against=stored)
    if to is not None:
        with naming_options("out"):
            result.run.save(to)
    which.tell(result.to_dict(), lambda: print_result(result))
    if to is not None:
        which.add_files("the replay's report, edges and bus log are", to)
    end_unless(result.equal)


def _recording(log: Path, against: Path | None) -> tuple[Path, Path | None]:
    """Return the file of the recording and the folder of its run: that of --against, or the one with the log."""
    from steptwin.host.record.folder import BUS_LOG, ROBOT

    if log.is_dir():
        return log / BUS_LOG, against or log
    in_a_run = log.name == BUS_LOG and (log.parent / ROBOT).is_file()
    return log, against or (log.parent if in_a_run else None)


def _robot(which: RobotOptions, name: str | None, folder: Path | None) -> "Robot":
    """Return the named robot; without a name, the robot of the run's folder."""
    from steptwin.host.record.folder import read_robot

    if folder is not None and name is None and which.robot_file is None:
        return read_robot(folder)
    return which.robot(name)


def _stored(folder: Path, robot: "Robot") -> "StoredMachine":
    from steptwin.features.replay.power_up import stored_machine

    return stored_machine(folder, robot)


def print_result(result: "Replayed") -> None:
    """Print the result of a replay."""
    bus = result.bus
    clock = "on the board's clock" if bus.on_board_clock else "by a computer's clock"
    say(f"{bus.path}: {len(bus.frames)} frames {clock}, {result.played} of them played to {result.robot.name}")
    if result.left_out:
        say("left out: " + ", ".join(f"{count} {kind}" for kind, count in result.left_out.items()))
    if result.bus_faults:
        differ = "" if result.equal else ": what differs may differ for that"
        say(f"not repeated, because no log shows them: {', '.join(result.bus_faults)}{differ}")
    if bus.steps_back:
        say(f"the clock of its stamps was put back {number_of(bus.steps_back, 'time')}: what follows is moved on")
    if bus.cut:
        say("the recording is cut off within a frame: it is compared up to there")
    same = "the same, to the microsecond" if bus.on_board_clock else "the nodes say the same"
    say(f"frames: {same if result.frames is None else f'first difference {result.frames}'}")
    if result.against is not None:
        say(f"edges: {_edges(result)}")


def _edges(result: "Replayed") -> str:
    if result.edges is not None:
        return f"first difference from {result.against}: {result.edges}"
    if result.shift_us is None:
        return f"all those of {result.against}, to the count"
    return f"the drivers make the steps of {result.against}, those of the last motion within {result.shift_us:.1f} us"
