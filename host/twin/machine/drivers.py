"""Choose the drivers of the emulated board, and set them as the robot's file says."""

from collections.abc import Mapping
from dataclasses import dataclass

from steptwin.emulator.drivers.driver_module import ClkEdge, Module
from steptwin.emulator.drivers.driver_profiles import PROFILES, DriverProfile, bare_chip
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.robots.board_settings import DRIVER_SETTINGS, SWITCHED_PROFILES, BoardSettings
from steptwin.host.robots.joint import MICROSTEPS
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class DriverSetup:
    """How a robot's drivers are set.

    Attributes:
        current_a: phase current at full torque.
        standing_part: part of it that flows while an axis stands: less than all with modules' idle circuit.
        fast_decay_part: part of each chopping period with fast decay.
    """

    current_a: float
    standing_part: float
    fast_decay_part: float


def driver_profile(board: BoardSettings, instead: str | None = None) -> DriverProfile:
    """Return the drivers that the robot's file names, or those named by `instead`.

    Raises:
        InputError: the drivers do not exist.
    """
    name = board.driver_profile if instead is None else instead
    if name is None:
        assert board.osc_pf is not None
        return bare_chip(board.osc_pf)
    if name not in PROFILES:
        raise unknown("driver profile", name, PROFILES)
    return PROFILES[name]


def fitted_module(board: BoardSettings, profile: DriverProfile, microsteps: int) -> Module:
    """Return an axis' driver module: with the robot file's settings if the file names this profile, else as usual.

    Raises:
        InputError: the module has no such setting.
    """
    if profile != driver_profile(board):
        return profile.fitted(microsteps)
    edge = board.active_edge
    try:
        return profile.fitted(
            microsteps,
            board.current_a,
            ClkEdge(edge) if edge else None,
            idle_percent=board.idle_percent,
            fast_decay_percent=board.fast_decay_percent,
        )
    except ValueError as error:
        raise InputError(f"board.current_a: {error}") from error


def driver_settings(board: BoardSettings, profile: DriverProfile) -> DriverSetup:
    """Return how drivers are set: as the robot's file says if it names this profile, else as usual."""
    own = profile == driver_profile(board)

    def setting(key: str) -> float:
        stated = getattr(board, key) if own else None
        return float(getattr(profile, key) if stated is None else stated)

    return DriverSetup(
        current_a=setting("current_a"),
        standing_part=setting("idle_percent") / 100.0 if profile.switched else 1.0,
        fast_decay_part=setting("fast_decay_percent") / 100.0,
    )


def switched_microsteps(robot: Robot, profile: DriverProfile, otherwise: Mapping[str, int]) -> list[int]:
    """Return the microsteps for which each joint's driver is fitted: the file's, or those set `otherwise` by switches.

    Raises:
        InputError: the robot has no joint of that name, its drivers have no switches, or these have no such setting.
    """
    fitted = {joint.name: joint.transmission.microsteps for joint in robot.joints}
    for name, microsteps in otherwise.items():
        if name not in fitted:
            raise unknown(f"dip_microsteps={name}: joint", name, fitted)
        if not profile.switched:
            raise InputError(
                f"dip_microsteps={name}: {profile.name} has no switches for its microsteps; {SWITCHED_PROFILES[0]} has"
            )
        if microsteps not in MICROSTEPS:
            choices = ", ".join(map(str, MICROSTEPS))
            raise InputError(f"dip_microsteps={name}: {microsteps} is not one of the TB6560's {choices}")
        fitted[name] = microsteps
    return list(fitted.values())


def settings_left_out(board: BoardSettings, instead: str | None) -> tuple[str, ...]:
    """Return the keys of the robot file's driver settings that do not apply because `instead` names other drivers.

    Raises:
        InputError: the drivers do not exist.
    """
    if driver_profile(board, instead) == driver_profile(board):
        return ()
    return tuple(key for key in DRIVER_SETTINGS if getattr(board, key) is not None)
