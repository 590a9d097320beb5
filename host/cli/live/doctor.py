"""`steptwin doctor ROBOT --connect ...`: check whether a live machine is fit to move."""

from typing import TYPE_CHECKING

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import AsJson, RobotFile, RobotName, one_robot
from steptwin.host.cli.live.connection import NOT_CONNECTED, BoardAddress, opened_link, required
from steptwin.host.cli.output import print_json, say
from steptwin.host.common.errors import BusError

if TYPE_CHECKING:
    from steptwin.host.client.links.bus_link import Connection
    from steptwin.host.operate.doctor import Check
    from steptwin.host.robots.robot import Robot


@command("lab-scara --connect 127.0.0.1", "lab-scara -i pcan -c PCAN_USBBUS1 -b 500000")
def doctor(
    robot: RobotName = None,
    robot_file: RobotFile = None,
    board: BoardAddress = NOT_CONNECTED,
    as_json: AsJson = False,
) -> None:
    """Check bus, nodes, drives, settings, inputs, supply, temperature and positions.

    It changes nothing. Exit code 4: the bus or a node does not answer; 3: another check fails.
    """
    loaded = one_robot(robot, robot_file)
    checks = _checks(loaded, required(board.connection(loaded)), show=not as_json)
    failed = [check for check in checks if not check.passed]
    if as_json:
        listed = [{"name": check.name, "passed": check.passed, "found": check.found} for check in checks]
        print_json({"robot": loaded.name, "passed": not failed, "checks": listed})
    if failed:
        raise typer.Exit(max(check.exit_code for check in failed))


def _checks(robot: "Robot", found: "Connection", *, show: bool) -> "list[Check]":
    from steptwin.host.operate.doctor import Check, examine
    from steptwin.host.operate.session import Session

    checks: list[Check] = []

    def add(check: "Check") -> None:
        checks.append(check)
        if show:
            say(f"[{' OK ' if check.passed else 'FAIL'}] {check.name}: {check.found}")

    try:
        with opened_link(found) as link:
            add(Check("bus", True, found.title))
            for check in examine(Session(link, robot)):
                add(check)
    except BusError as error:
        add(Check("bus", False, str(error), BusError.exit_code))
    return checks
