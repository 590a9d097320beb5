"""Limits of whole motions besides those of joints: the drives of a machine, by its motors.

Planning knows the limits of joints, but not motors. So a caller passes the drives' limits, such as a feature's drive
model (`known_drives`). Without it motions are within the joints' limits, and a program that needs motors is refused.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Final, Literal, Protocol

from steptwin.host.common.errors import InputError
from steptwin.host.common.features import drive_model
from steptwin.host.common.file_models import FileTable
from steptwin.host.common.file_values import Within
from steptwin.host.robots.robot import Robot


@dataclass(frozen=True, slots=True)
class DriveAnswer:
    """Margins of the drives in a motion that they can follow.

    Attributes:
        left_percent: least torque that remains at a steady speed, of all joints: the static margin.
        joint: the joint with this margin.
        at_s: its time from the start of the motion.
        load_deg: greatest load angle of a rotor, in electrical degrees.
        average_s: averaging time of the motion.
        slips_at: stretch of the motion, below 1, at which a rotor would slip; None if none slips at 0.5.
        tries: number of motions that were tried.
    """

    left_percent: float
    joint: str
    at_s: float
    load_deg: float
    average_s: float
    slips_at: float | None = None
    tries: int = 1

    def __str__(self) -> str:
        slips = "keep step at twice the pace" if self.slips_at is None else f"would slip at stretch {self.slips_at:.2f}"
        tries = "" if self.tries == 1 else f", the {self.tries}. that was tried"
        return (
            f"motors: {self.left_percent:.0f} % of {self.joint}'s torque is left at {self.at_s:.3f} s; rotors are at"
            f" most {self.load_deg:.0f} degrees behind and {slips}; averaged over {self.average_s:.3f} s{tries}"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {name: getattr(self, name) for name in self.__slots__}


class DriveLimits(Protocol):
    """Drives of a machine, and their torque reserve."""

    def left_more(self, percent: float) -> "DriveLimits":
        """Return the limits with a larger reserve."""
        ...

    def along(self, rates: Any, load: Any) -> Any:
        """Return the drives on a path, for the timing of whole motions.

        Raises:
            InputError: the weights alone need too much torque; the message has the number.
        """
        ...


MakeDrives = Callable[[Robot, float], DriveLimits]
"""Makes the limits of a robot's drives for a torque reserve in percent; raises InputError without motors."""


def known_drives() -> MakeDrives | None:
    """Return the function that makes the limits of a robot's drives; None without such a feature."""
    model = drive_model()
    return None if model is None else model.limits


LEFT_PERCENT: Final = 30.0
"""Usual torque reserve in percent, for effects that a model leaves out."""


def check_drives(drives: DriveLimits | None, *, is_fastest: bool) -> None:
    """Raise InputError for drives that limit a motion of another law."""
    if drives is not None and not is_fastest:
        raise InputError("law=fastest is needed: the motors limit no other law")


@dataclass(frozen=True, slots=True)
class AskedLimits(FileTable):
    """What a file asks for: motions as fast as the motors manage, with some of their torque left.

    Attributes:
        from_: where the limits come from.
        left_percent: torque that is left.
    """

    from_: Literal["motors"]
    left_percent: Annotated[float, Within(0.0, 90.0, "%")] = LEFT_PERCENT

    def drives(self, robot: Robot, make: MakeDrives | None) -> DriveLimits:
        """Return the drives of a robot; raise InputError if `make` is missing."""
        if make is None:
            raise InputError(
                "limits.from: 'motors': planning alone knows no motors; `steptwin run` and `check` do, and in Python"
                " `compile_program(program, robot, drives=motor_limits)`"
            ).plainly("limits: nothing here knows the motors")
        return make(robot, self.left_percent)
