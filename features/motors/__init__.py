"""Motors in the loop: rotors that may slip, motor sizing, and limits of fastest motions by motor torque.

Imports the core, and `fastest`, whose motions it limits.
"""

from collections.abc import Collection, Iterable, Sequence
from typing import TYPE_CHECKING, Final

from steptwin.host.common.errors import InputError
from steptwin.host.common.features import (
    COMMAND_GROUPS,
    CommandRow,
    DriveModel,
    Feature,
    FeatureJudge,
    LiveWords,
    MachinePart,
)

if TYPE_CHECKING:
    from steptwin.features.motors.options import MotorOptions
    from steptwin.features.motors.run import MotorRunHook
    from steptwin.host.robots.robot import Robot
    from steptwin.host.twin.machine.machine_options import MachineOptions
    from steptwin.protocol.drivers import DriverProfile

NAME: Final = "motors"


def _machine_options() -> "type[MotorOptions]":
    from steptwin.features.motors.options import MotorOptions

    return MotorOptions


def _check_machine(machine: "MachineOptions", options: "MotorOptions | None", real_time: bool) -> None:
    if options is None or not options.motors:
        return
    if any(machine.crystals_ppm):
        given = ",".join(map(str, machine.crystals_ppm))
        raise InputError(f"crystal_ppm={given}: motors that turn with the board need its exact crystal, 0")
    if real_time:
        from importlib.util import find_spec

        from steptwin.host.common.extras import installing

        if not find_spec("numba"):
            raise InputError(f"motors=True: without numba the rotors cannot keep real time; {installing('fast')}")


def _machine_warnings(robot: "Robot", drivers: "DriverProfile", options: "MotorOptions | None") -> Iterable[str]:
    if options is None or not options.motors:
        return ()
    from steptwin.features.motors.turning.ramps import steep_homings

    return steep_homings(robot, drivers)


def _part(
    robot: "Robot",
    joints: Sequence[float],
    axes_per_board: Sequence[int],
    options: "MotorOptions | None",
    _waits_for: Collection[str] | None,
) -> MachinePart | None:
    if options is None or not options.motors:
        return None
    from steptwin.features.motors.machine import MotorPart

    return MotorPart(robot, joints, axes_per_board)


def _judge() -> FeatureJudge:
    from steptwin.features.motors import evidence

    return evidence


def _live() -> LiveWords:
    from steptwin.features.motors import report

    return report


def _drive_model() -> DriveModel:
    from steptwin.features.motors import drive_model

    return drive_model


def _run_options() -> "type[MotorRunHook]":
    from steptwin.features.motors.run import MotorRunHook

    return MotorRunHook


FEATURE: Final = Feature(
    name=NAME,
    needs=("fastest",),
    check_machine=_check_machine,
    machine_warnings=_machine_warnings,
    machine_options=_machine_options,
    part=_part,
    judge=_judge,
    live=_live,
    drive_model=_drive_model,
    run_options=_run_options,
    commands=(
        CommandRow(
            "motors",
            COMMAND_GROUPS[3],
            "Turn the rotors of a stored run by its phase currents, with the arm's masses; exit code 1 if one slips.",
            "steptwin.features.motors.command",
        ),
    ),
)
