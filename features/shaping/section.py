"""The table `[shaping]` of a robot file: the shaper of each joint."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Final, Literal

from steptwin.features.fastest.shaper import ShaperKind
from steptwin.host.common.bad_input import unknown
from steptwin.host.common.errors import InputError
from steptwin.host.common.file_models import FileReading, FileTable, read_table, table_schema
from steptwin.host.common.file_values import ReadBy, Within, check_limits
from steptwin.host.common.findings import Findings
from steptwin.host.robots.robot import Robot

DAMPING: Final = 0.1
"""Usual damping ratio of belts and frames, as Klipper assumes it."""


@dataclass(frozen=True, slots=True)
class JointShaping(FileTable):
    """The shaper of a joint, and the oscillation that it suppresses.

    Attributes:
        kind: kind of the shaper: zv takes the least time, ei tolerates the largest error of the frequency.
        frequency_hz: frequency of the oscillation as measured.
        damping: damping ratio of the oscillation as measured, 0.1 without it.
        from_: motors: frequency and damping are computed from the motors and the masses of the robot file.
    """

    kind: ShaperKind
    frequency_hz: Annotated[float, Within(1.0, 200.0, "Hz")] | None = None
    damping: Annotated[float, Within(0.0, 0.9)] | None = None
    from_: Literal["motors"] | None = None

    def __post_init__(self) -> None:
        check_limits(self)
        if self.from_ is None and self.frequency_hz is None:
            raise InputError("frequency_hz: is missing, such as frequency_hz = 45.0; or from = 'motors'")
        if self.from_ is not None:
            for key in ("frequency_hz", "damping"):
                if getattr(self, key) is not None:
                    raise InputError(f"{key}: from = 'motors' computes it: leave one of both out")


@dataclass(frozen=True, slots=True)
class Shaping:
    """The shapers of a robot, by joint; the other joints are only delayed as the shaped ones are."""

    joints: Mapping[str, JointShaping]

    def check(self, robot: Robot) -> None:
        """Raise InputError for a joint that the robot does not have, or whose motors and masses are unknown."""
        from steptwin.features.motors.turning.drives import check_described

        findings = Findings()
        for name, joint in self.joints.items():
            if name not in robot.joint_names:
                findings.add(str(unknown("shaping: joint", name, robot.joint_names)))
            elif joint.from_ is not None:
                with findings.collecting(f"shaping.{name}.from: "):
                    check_described(robot)
        findings.raise_first()


def _read(value: Any, reading: FileReading) -> Shaping:
    return Shaping(read_table(Mapping[str, JointShaping], value, reading))


def _schema() -> dict[str, Any]:
    hint: Any = Mapping[str, JointShaping]
    return {**table_schema(hint), "description": "Input shapers of joints that oscillate, by joint."}


SHAPING_TABLE: Final = Annotated[Any, ReadBy(_read, _schema)]
"""How the table is read: a table for each joint, under its name."""
