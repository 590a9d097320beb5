"""List the commands: those of the core, then those that features add, by the groups of `steptwin --help`."""

from collections.abc import Mapping
from typing import Final

from steptwin.host.common.features import COMMAND_GROUPS, CommandRow, giving

_ROBOTS, _RUN, _LIVE, _FILES = COMMAND_GROUPS
_CLI: Final = "steptwin.host.cli"

COMMANDS: Final = (
    CommandRow("robots", _ROBOTS, "List the robots that come with StepTwin.", f"{_CLI}.robots.listing"),
    CommandRow("jobs", _ROBOTS, "List a robot's jobs with their options.", f"{_CLI}.robots.listing"),
    CommandRow(
        "fk", _ROBOTS, "Compute the tool's pose from joint positions (forward kinematics).", f"{_CLI}.robots.poses"
    ),
    CommandRow(
        "ik",
        _ROBOTS,
        "Compute joint positions from a tool pose (inverse kinematics): every branch, and why one is out of reach.",
        f"{_CLI}.robots.poses",
    ),
    CommandRow(
        "workspace",
        _ROBOTS,
        "Compute the workspace: random positions of all joints, and exact sections with the slides at home.",
        f"{_CLI}.robots.workspace",
    ),
    CommandRow(
        "new",
        _RUN,
        "Write the file of a robot of your own, with comments: kind, dimensions, ranges and transmissions.",
        f"{_CLI}.run.new",
    ),
    CommandRow(
        "check",
        _RUN,
        "Say everything that is wrong in a file at once; otherwise print what it amounts to.",
        f"{_CLI}.run.check",
    ),
    CommandRow(
        "run",
        _RUN,
        "Run a job, a program or a trajectory file on an emulated board in virtual time and verify every pulse.",
        f"{_CLI}.run.run",
    ),
    CommandRow(
        "verify",
        _RUN,
        "Verify a stored run again: same verdict and exit code as the run, or 1 if its files were changed.",
        f"{_CLI}.run.verify",
    ),
    CommandRow("serve", _LIVE, "Run a robot's board, or several, in real time until Ctrl-C.", f"{_CLI}.live.serve"),
    CommandRow(
        "doctor",
        _LIVE,
        "Check bus, nodes, drives, settings, inputs, supply, temperature and positions.",
        f"{_CLI}.live.status",
    ),
    CommandRow(
        "status",
        _LIVE,
        "Show drives, positions, errors and queues. Exit code 3: a drive is in fault.",
        f"{_CLI}.live.status",
    ),
    CommandRow(
        "monitor",
        _LIVE,
        "Show the traffic of a bus in CANopen's terms, without sending anything.",
        f"{_CLI}.live.monitor",
        usual=False,
    ),
    CommandRow(
        "home", _LIVE, "Home a live machine by its switches, then move it to its home position.", f"{_CLI}.live.move"
    ),
    CommandRow(
        "move",
        _LIVE,
        "Move joints, or the tool by the branch that is reached soonest; all axes arrive together.",
        f"{_CLI}.live.move",
    ),
    CommandRow("jog", _LIVE, "Move a joint or the tool, by a step or at a speed until Ctrl-C.", f"{_CLI}.live.move"),
    CommandRow(
        "positions",
        _LIVE,
        "Save under a name where a live board stands; list the saved positions, or delete one.",
        f"{_CLI}.live.positions",
        usual=False,
    ),
    CommandRow(
        "pause",
        _LIVE,
        "Halt the running trajectory on its path; the program that streams it keeps the queue filled.",
        f"{_CLI}.live.halting",
    ),
    CommandRow("resume", _LIVE, "Continue a halted trajectory.", f"{_CLI}.live.halting", usual=False),
    CommandRow(
        "speed",
        _LIVE,
        "Make the running trajectory slower or faster, on its path; the next one begins at 100 %.",
        f"{_CLI}.live.halting",
        usual=False,
    ),
    CommandRow(
        "stop",
        _LIVE,
        "Stop all axes together by a quick stop; they hold their positions afterwards.",
        f"{_CLI}.live.halting",
    ),
    CommandRow(
        "estop",
        _LIVE,
        "Stop all axes together, switch their power off and hold them until `steptwin reset`.",
        f"{_CLI}.live.halting",
    ),
    CommandRow(
        "reset",
        _LIVE,
        "Reset the drives' faults, and start nodes that are stopped; the drives are off afterwards.",
        f"{_CLI}.live.halting",
        usual=False,
    ),
    CommandRow(
        "outputs",
        _LIVE,
        "List the digital outputs by their names in the robot's file, or switch one.",
        f"{_CLI}.live.halting",
        usual=False,
    ),
    CommandRow(
        "trace",
        _FILES,
        "Write the waveform of a stored run: every edge of every pin, or a part of it.",
        f"{_CLI}.files.trace",
    ),
    CommandRow("plot", _FILES, "Draw pictures of a stored run.", f"{_CLI}.files.plot"),
    CommandRow(
        "schema",
        _FILES,
        "Print the JSON schema of a kind of file, by which editors complete and check it.",
        f"{_CLI}.files.exports",
    ),
    CommandRow("eds", _FILES, "Print the axis nodes' electronic data sheet (CiA 306).", f"{_CLI}.files.exports"),
    CommandRow(
        "dbc",
        _FILES,
        "Print a CAN database (DBC): a robot's axes in mm and degrees, or eight axes in wire units.",
        f"{_CLI}.files.exports",
    ),
)


def command_table() -> Mapping[str, CommandRow]:
    """Return every command by name, in the order of the groups, without those of `refused_commands`."""
    table = {row.name: row for row in COMMANDS}
    for _, rows in giving("commands"):
        for row in rows:
            if row.group in COMMAND_GROUPS:
                table.setdefault(row.name, row)
    return dict(sorted(table.items(), key=lambda item: COMMAND_GROUPS.index(item[1].group)))


def refused_commands() -> list[str]:
    """Return a sentence for each impossible command of a feature."""
    table = command_table()
    return [
        f"feature {feature.name}: command {row.name}: "
        + (f"there is one in {table[row.name].module}" if row.group in COMMAND_GROUPS else f"no group {row.group!r}")
        for feature, rows in giving("commands")
        for row in rows
        if table.get(row.name) is not row
    ]
