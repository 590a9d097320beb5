"""`steptwin doctor ROBOT --connect ...`: check whether a live machine is fit to move."""

from typing import TYPE_CHECKING

import typer

from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import RobotName
from steptwin.host.cli.live.connection import LiveOptions
from steptwin.host.cli.output import say
from steptwin.host.common.errors import BusError

if TYPE_CHECKING:
    from steptwin.host.operate.doctor import Check
    from steptwin.host.robots.robot import Robot


@command("lab-scara --connect 127.0.0.1", "lab-scara -i pcan -c PCAN_USBBUS1 -b 500000")
def doctor(live: LiveOptions, robot: RobotName = None) -> None:
    """Check bus, nodes, drives, settings, inputs, supply, temperature and positions.

    It changes nothing. Exit code 4: the bus or a node does not answer; 3: another check fails.
    """
    loaded = live.robot(robot)
    checks = _checks(live, loaded)
    failed = [check for check in checks if not check.passed]
    listed = [{"name": check.name, "passed": check.passed, "found": check.found} for check in checks]
    live.tell(loaded, {"passed": not failed, "checks": listed})
    if failed:
        raise typer.Exit(max(check.exit_code for check in failed))


def _checks(live: LiveOptions, robot: "Robot") -> "list[Check]":
    """Make the checks; print each at once, unless all are to be one document."""
    from steptwin.host.operate.doctor import Check, examine
    from steptwin.host.operate.session import Session

    found = live.address.required(robot)
    checks: list[Check] = []

    def add(check: "Check") -> None:
        checks.append(check)
        if not live.as_json:
            say(f"[{' OK ' if check.passed else 'FAIL'}] {check.name}: {check.found}")

    try:
        with live.link(robot) as link:
            add(Check("bus", True, found.title))
            for check in examine(Session(link, robot)):
                add(check)
    except BusError as error:
        add(Check("bus", False, str(error), BusError.exit_code))
    return checks
