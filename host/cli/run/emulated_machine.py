"""The options by which an emulated machine differs from its robot's file: their names in errors, and warnings."""

from contextlib import AbstractContextManager
from dataclasses import fields, replace
from typing import TYPE_CHECKING

from steptwin.host.cli.arguments import check_one_each
from steptwin.host.cli.options import naming_options
from steptwin.host.cli.output import warn
from steptwin.host.twin.machine.machine_options import SPELLING, MachineOptions

if TYPE_CHECKING:
    from steptwin.host.robots.robot import Robot


def naming_machine_options(*parameters: str, **options: str) -> AbstractContextManager[None]:
    """Name the command line's options in errors about the machine, and about further parameters."""
    spelled = {
        field.name: field.metadata[SPELLING].option for field in fields(MachineOptions) if field.name != "motors"
    }
    return naming_options(*parameters, **spelled, **options)


def check_standing(robot: "Robot", machine: MachineOptions) -> None:
    """Raise InputError unless --stand-at says where each joint stands, if it is given."""
    if machine.stand_at is not None:
        check_one_each(machine.stand_at, robot.joint_names, "--stand-at")


def machine_for(robot: "Robot", machine: MachineOptions) -> MachineOptions:
    """Return the options with their scenario read; warn of settings of the robot's file that do not apply.

    Raises:
        InputError: the number of joints is wrong, no drivers have this name, or something is wrong in the scenario.
    """
    from steptwin.host.twin.machine.drivers import settings_left_out

    check_standing(robot, machine)
    scenario = machine.scenario_for(robot)
    if keys := settings_left_out(robot, machine.driver_profile):
        warn(f"--driver-profile {machine.driver_profile}: has its usual settings, not the robot's {', '.join(keys)}")
    return replace(machine, scenario=scenario)
