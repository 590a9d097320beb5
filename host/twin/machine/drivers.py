"""Select the drivers of the emulated board, and set them by the robot's file."""

from collections.abc import Mapping
from dataclasses import dataclass

from steptwin.emulator.drivers.driver_module import Module, fitted
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.robots.board_settings import DRIVER_SETTINGS, BoardSettings, named_profile
from steptwin.host.robots.robot import Robot
from steptwin.protocol.drivers import GENERIC, ActiveEdge, ChipSheet, DriverProfile, driver_names


@dataclass(frozen=True, slots=True)
class DriverSetup:
    """Settings of a robot's drivers.

    Attributes:
        chip: the chip.
        current_a: phase current at full torque.
        standing_part: fraction of it at standstill: below 1 with modules' idle circuits.
        fast_decay_part: fraction of each chopping period with fast decay.
        by_pins: True if the board's pins set torque and decay, False for switches or registers of the driver.
    """

    chip: ChipSheet
    current_a: float
    standing_part: float
    fast_decay_part: float
    by_pins: bool = True


def driver_profile(board: BoardSettings, instead: str | None = None) -> DriverProfile:
    """Return the drivers of the robot's file, or those named by `instead`.

    Raises:
        InputError: the drivers do not exist, or the robot's file has no figures for generic ones.
    """
    if instead is None:
        return board.profile
    profile = named_profile(instead, board.driver)
    if profile is not None:
        return profile
    if instead == GENERIC:
        raise InputError(
            f"driver profile {GENERIC}: the robot's file has no table [board.driver] with its times (docs/driver.md)"
        )
    raise unknown("driver profile", instead, driver_names())


def other_drivers(board: BoardSettings, name: str) -> str | None:
    """Return the name of a run's drivers if they are not the robot file's."""
    return None if name == board.profile.name else name


def fitted_module(board: BoardSettings, profile: DriverProfile, microsteps: int) -> Module:
    """Return an axis' driver module, with the file's settings if the file names this profile, else with usual ones.

    Raises:
        InputError: the module does not have such a setting.
    """
    if profile != driver_profile(board):
        return fitted(profile, microsteps)
    try:
        return fitted(
            profile,
            microsteps,
            board.current_a,
            None if board.active_edge is None else ActiveEdge(board.active_edge),
            idle_percent=board.idle_percent,
            fast_decay_percent=board.fast_decay_percent,
            fault_wired=bool(board.fault_wired),
        )
    except ValueError as error:
        raise InputError(f"board.current_a: {error}") from error


def driver_settings(board: BoardSettings, profile: DriverProfile) -> DriverSetup:
    """Return the drivers' settings: the file's if the file names this profile, else the usual ones."""
    own = profile == driver_profile(board)

    def setting(key: str) -> float:
        stated = getattr(board, key) if own else None
        return float(getattr(profile, key) if stated is None else stated)

    return DriverSetup(
        chip=profile.chip,
        current_a=setting("current_a"),
        standing_part=setting("idle_percent") / 100.0 if profile.switched else 1.0,
        fast_decay_part=setting("fast_decay_percent") / 100.0,
        by_pins=not profile.switched,
    )


def phase_currents_a(robot: Robot, profile: DriverProfile) -> tuple[float, ...]:
    """Return the phase current at full torque of each axis' driver, by `driver_settings`."""
    return tuple(driver_settings(robot.board_at(joint), profile).current_a for joint in robot.axes)


def switched_microsteps(robot: Robot, profile: DriverProfile, otherwise: Mapping[str, int]) -> list[int]:
    """Return the microsteps of each joint's driver: the file's, or those of `otherwise`, set by switches.

    Raises:
        InputError: the robot has no such joint, its drivers have no switches, or no such microsteps.
    """
    chosen = {joint.name: joint.transmission.microsteps for joint in robot.axes}
    for name, microsteps in otherwise.items():
        if name not in chosen:
            raise unknown(f"dip_microsteps={name}: joint", name, chosen)
        if not profile.switched:
            raise InputError(f"dip_microsteps={name}: {profile.name} has no switches for its microsteps; 3a-module has")
        chosen[name] = microsteps
    for name, microsteps in chosen.items():
        try:
            profile.mode(microsteps)
        except ValueError as error:
            option = f"dip_microsteps={name}" if name in otherwise else f"driver_profile={profile.name}: {name}"
            raise InputError(f"{option}: {error}") from error
    return list(chosen.values())


def settings_left_out(robot: Robot, instead: str | None) -> tuple[str, ...]:
    """Return the keys of the robot file's driver settings that do not apply to the drivers `instead`.

    Raises:
        InputError: the drivers do not exist.
    """
    board = robot.board
    if driver_profile(board, instead) == driver_profile(board):
        return ()
    own = (f"{joint.name}.current_a" for joint in robot.joints if joint.current_a is not None)
    return (*(key for key in DRIVER_SETTINGS if getattr(board, key) is not None), *own)
