"""What limits a motion that is timed as a whole besides its joints: the drives, as a machine's motors allow.

Planning knows the limits of joints, but no motor. So a caller hands in what knows them, such as a feature's drive model
(`known_drives`). Without it motions are within the joints' limits, and a program that asks for motors is refused.
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
    """What the drives say of a motion that they keep step with.

    Attributes:
        left_percent: least torque that is left at a steady speed, of all joints: the static margin.
        joint: the joint that has no more left.
        at_s: when, from the begin of the motion.
        load_deg: greatest load angle of a rotor, in electrical degrees.
        average_s: time over which the motion was averaged.
        slips_at: stretch of the motion, below 1, at which a rotor would slip; None if none does down to 0.5.
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
    """The drives of a machine, and how much of their torque is to be left."""

    def left_more(self, percent: float) -> "DriveLimits":
        """Return the same with more percent left."""
        ...

    def along(self, rates: Any, load: Any) -> Any:
        """Return the drives on a path, for who times motions as a whole.

        Raises:
            InputError: weights alone need too much; the message has the number.
        """
        ...


MakeDrives = Callable[[Robot, float], DriveLimits]
"""Makes the drives' limits of a robot, of a percentage of the torque that is to be left; InputError without motors."""


def known_drives() -> MakeDrives | None:
    """Return what makes the limits of a robot's drives; None if no feature knows any."""
    model = drive_model()
    return None if model is None else model.limits


LEFT_PERCENT: Final = 30.0
"""Torque that is usually left: what builders keep in hand for what a model does not know."""


def check_drives(drives: DriveLimits | None, *, is_fastest: bool) -> None:
    """Raise InputError for drives that limit a motion by another law."""
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
        """Return the drives of a robot; raise InputError if nothing here knows them."""
        if make is None:
            raise InputError(
                "limits.from: 'motors': planning alone knows no motors; `steptwin run` and `check` do, and in Python"
                " `compile_program(program, robot, drives=motor_limits)`"
            ).plainly("limits: nothing here knows the motors")
        return make(robot, self.left_percent)
