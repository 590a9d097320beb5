"""The options of `run` and `serve` by which an emulated machine differs from its robot's file, read."""

from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from steptwin.host.cli.arguments import dip_settings, name_value_pairs, naming_options, warn_of_settings_left_out
from steptwin.host.cli.run.faults_on_purpose import chosen_scenario

if TYPE_CHECKING:
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.machine.machine_options import MachineKeywords


def naming_machine_options(*parameters: str, **options: str) -> AbstractContextManager[None]:
    """Name the command line's options in errors about the machine, and about further parameters."""
    return naming_options(
        *("dip_microsteps", "stock", *parameters),
        locked_drawers="--locked-drawer",
        axes_per_board="--boards",
        crystal_ppm="--crystal",
        **options,
    )


def machine_keywords(
    robot: "Robot",
    *,
    driver_profile: str | None,
    dip_microsteps: list[str] | None,
    stock: list[str] | None,
    locked_drawers: list[str] | None,
    faults: str | None,
    motors: bool,
    crystal: int | str,
    boards: str | None = None,
) -> "MachineKeywords":
    """Read the options of a machine, each as it was given; warn of settings of the robot's file that do not apply.

    Raises:
        InputError: an option is not of its form, no drivers have this name, or something is wrong in the scenario.
    """
    from steptwin.host.twin.machine.axes_per_board import read_axes_per_board
    from steptwin.host.twin.machine.boards import read_crystals

    scenario = chosen_scenario(faults, robot)
    warn_of_settings_left_out(robot, driver_profile)
    with naming_machine_options():
        return {
            "driver_profile": driver_profile,
            "dip_microsteps": dip_settings(dip_microsteps),
            "stock": name_value_pairs(stock) if stock else None,
            "locked_drawers": locked_drawers or (),
            "scenario": scenario,
            "motors": motors,
            "axes_per_board": None if boards is None else read_axes_per_board(boards, len(robot.joints)),
            "crystal_ppm": crystal if isinstance(crystal, int) else read_crystals(crystal),
        }
