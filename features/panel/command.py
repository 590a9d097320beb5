"""`steptwin panel ROBOT --connect ...`: the machine in a browser."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from steptwin.features.panel.options import require_extra
from steptwin.host.cli.app import command
from steptwin.host.cli.arguments import PositionsFile, RobotFile, RobotName, RobotOptions, positions_path
from steptwin.host.cli.live.connection import BoardAddress, Force, host_and_port
from steptwin.host.cli.options import naming_options, option, switch
from steptwin.host.cli.output import say, warn
from steptwin.host.common.choices import EXAMPLE_PORT

if TYPE_CHECKING:
    from steptwin.features.panel.page.server import Address
    from steptwin.host.client.links.bus_link import Connection
    from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class PageOptions:
    """Options for the page's address and the service's connections."""

    host: str = option("ADDRESS", "Address of this machine for the page.", default="127.0.0.1")
    port: int | None = option("PORT", "Port of the page; by default 8090, or a free one; 0 is free.")
    allow_remote: bool = switch("Permit an address that other machines reach, with a token.")
    control: str | None = option("HOST:PORT", "Control port of a served board, for the tab that operates its machine.")
    file: PositionsFile = None


@command("lab-scara --connect 127.0.0.1", "warehouse-scara -i socketcan -c can0 --port 8091")
def panel(
    board: BoardAddress,
    page: PageOptions,
    robot: RobotName = None,
    robot_file: RobotFile = None,
    force: Force = False,
) -> None:
    """Show a live machine in a browser, and operate it there, until Ctrl-C.

    The command prints the page's address. Any number of browsers may watch, one of them operates, and all can stop.
    The emergency stop of the page is no safety function: it needs this computer, the network and the bus.
    """
    loaded = RobotOptions(robot_file=robot_file).robot(robot)
    found = board.required(loaded)
    served = None if page.control is None else host_and_port("--control", page.control, EXAMPLE_PORT)
    require_extra()
    from steptwin.features.panel.page.server import Address

    with naming_options("host", "port", "allow_remote"):
        address = Address(page.host, page.port, page.allow_remote)
        _serve(loaded, found, served, address, positions_path(loaded, page.file), force=force)


def _serve(
    robot: "Robot",
    found: "Connection",
    control: tuple[str, int] | None,
    address: "Address",
    positions_file: str,
    *,
    force: bool,
) -> None:
    from steptwin.features.panel.page.hub import Hub
    from steptwin.features.panel.page.server import open_port, serve_page
    from steptwin.features.panel.service.service import MachineService
    from steptwin.host.client.control_client import ControlClient

    with open_port(address) as listener:  # bad input is reported before any message to the machine
        if address.allow_remote:
            warn("other machines can move this one; its page asks them for the token in the address")
        service = MachineService(found, robot, control=control, force=force)
        service.start()
        try:
            hub = Hub(service, positions_file, None if control is None else ControlClient(*control))
            hub.start()
            serve_page(
                hub.build, listener, f"{robot.name} – StepTwin", lambda url: say(f"panel: {url}", "Ctrl-C ends it")
            )
        finally:
            service.close()
