"""What a page shows at an instant: the newest snapshot of the machine and of the desk."""

from collections.abc import Mapping
from dataclasses import dataclass

from steptwin.host.common.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class JointView:
    """One joint and its drive.

    Attributes:
        name: name of the joint.
        unit: `mm` or `deg`; speeds are in this unit per second.
        position: position by the step counter.
        rate: speed with its sign; None while the board does not report it.
        following_error: how far the drive's position is from the demanded one; None while the board does not report it.
        lower: lower limit of the position.
        upper: upper limit of the position.
        homed: True if the position counts from the joint's zero.
        state: the drive's state in plain words.
        drive_state: the drive's state as the standard (CiA 402) writes it.
        error: the drive's fault in plain words; None without one.
        hindrance: what keeps the drive from being switched on, in plain words; None if nothing that is known does.
    """

    name: str
    unit: str
    position: float
    rate: float | None
    following_error: float | None
    lower: float
    upper: float
    homed: bool
    state: str
    drive_state: str
    error: str | None
    hindrance: str | None = None


@dataclass(frozen=True, slots=True)
class Activity:
    """What the machine is doing.

    Attributes:
        name: such as `home`, `jog th2` or the job's name.
        fraction: the part that is done, 0 to 1; None if it has no end, as a jog.
        paused: True while the machine rests amid its trajectory.
        pausable: True if it can be paused: only trajectories can.
        foreign: True if another program moves the machine, not the desk.
    """

    name: str
    fraction: float | None
    paused: bool
    pausable: bool
    foreign: bool = False

    @property
    def jogging(self) -> bool:
        """True if the desk jogs."""
        return self.fraction is None and not self.foreign


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """The machine and the desk at an instant. Everything but the texts is the last known while not connected.

    Attributes:
        number: counts up; a command names the newest that its page had shown. -1 before the first connection.
        time_s: when it was taken, on the clock of `time.monotonic`.
        connected: False while no telemetry comes.
        why_not: why it is not connected, in one line; None while it is.
        simulated: True if the board says that it is emulated; None while that is unknown.
        joints: the joints in the robot's order; empty before the first connection.
        pose: the tool's `x_mm`, `y_mm`, `z_mm`, `attitude_deg`; None unless every joint is homed.
        links_mm: the arm's polylines, each of shape (n, 3), in the world frame; also of an arm that is not homed, with
            NaN where the mechanism cannot be assembled.
        inputs: whether each digital input is on, by its name in the robot's file.
        outputs: whether each digital output is on, by its name; as last read.
        activity: what the machine is doing; None at rest.
        emergency_stopped: True from an emergency stop until the reset.
        operator: name of the operator; None if there is none.
        bus_load_percent: of a served board; None if the bus does not tell.
        queue_fill: least part of a drive's queue of motion that is full, 0 to 1; None while no trajectory runs.
        late_ms: how late a served board is at the 99th percentile; None if it does not tell.
        stood_percent: part of the last five seconds in which a served board's clock has stood since the computer was
            too slow; None if it does not tell.
    """

    number: int
    time_s: float
    connected: bool
    why_not: str | None
    simulated: bool | None
    joints: tuple[JointView, ...]
    pose: Mapping[str, float] | None
    links_mm: tuple[FloatArray, ...]
    inputs: Mapping[str, bool]
    outputs: Mapping[str, bool]
    activity: Activity | None
    emergency_stopped: bool
    operator: str | None
    bus_load_percent: float | None = None
    queue_fill: float | None = None
    late_ms: float | None = None
    stood_percent: float | None = None

    @property
    def homed(self) -> bool:
        """True if every joint knows its position."""
        return bool(self.joints) and all(joint.homed for joint in self.joints)
