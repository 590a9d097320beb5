"""Recover a machine after a run as an operator would: repair it, reset its drives, home it, move it a little."""

from dataclasses import dataclass
from typing import Final

from steptwin.host.common.errors import StepTwinError
from steptwin.host.operate.homing import home_robot
from steptwin.host.operate.moving import move, units_at
from steptwin.host.operate.recovering import reset
from steptwin.host.operate.session import Session
from steptwin.host.robots.joint import Joint
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.protocol.od import UNITS_PER_FULL_STEP

_WAY: Final = 0.01
"""Part of each joint's range by which it moves at the end."""
_QUIET_S: Final = 0.7
"""Time before anything is done: boards that were reset are up again, and nobody babbles any more."""
_LONGER: Final = 10
"""Factor of all waits during the recovery."""
_EDGE_MAX_STEPS: Final = 1.0
"""Steps by which homing may find an axis elsewhere: it takes the whole step where it sees the edge of the switch,
but the edge falls between two where a rotor was put back by part of one, or another motor turns the joint along."""
_TOKEN: Final = 1
"""Under which the operator is in charge: a random one changes the lengths of frames, and so the time of the run."""
_LAG_MAX_FULL_STEPS: Final = 1.0
"""Full steps by which a rotor that turns with the board may lag while it finds a switch: a load angle of 90 degrees."""
_SWING_MAX_FULL_STEPS: Final = 0.1
"""Way in _LOOK_S within which a rotor stands: it swings by that much, or less."""
_LOOK_S: Final = 0.1
_LOOKS: Final = 10
"""Instants when it is looked at in this time: several in each swing, which take 0.2 s at most."""
_SETTLING_MAX_S: Final = 10.0
"""Longest wait for it: the homing tells whether the machine works again."""


@dataclass(frozen=True, slots=True)
class Recovery:
    """What became of the machine.

    Attributes:
        failed: what did not work, without numbers; empty if everything did.
        detail: more about it.
    """

    failed: str = ""
    detail: str = ""


def recover(board: EmbeddedBoard) -> Recovery:
    """Reset the drives of a repaired machine, home the joints that can be homed, move them all, compare positions."""
    session, doing = Session(_Unhurried(board), board.robot, _TOKEN), "the reset"
    board.wait(_QUIET_S)
    try:
        reset(session)
        if board.motors_turn:
            _let_settle(session, board)
        doing = "homing"
        _home(session)
        standing = session.machine.positions_units()  # the counts: a demand may lie between two steps
        if off := _off(board, standing):
            return Recovery("homing found another position", off)
        doing = "a move"
        goal = _goal(session, standing)
        move(session, goal)
        wanted = units_at(session, session.units(goal), goal)
        reported = session.machine.positions_units()
    except StepTwinError as error:
        return Recovery(f"{doing} failed", str(error))
    for joint, units, expected in zip(board.robot.axes, reported, wanted, strict=True):
        steps = (units - expected) * joint.transmission.microsteps / UNITS_PER_FULL_STEP
        if abs(steps) > 1:
            told = f"its drive reports to stand {steps:+.4g} steps from the goal; up to 1 is rounding"
            return Recovery("a move ended elsewhere", f"{joint.name}: {told}")
    off = _off(board, reported)
    return Recovery("a motor did not follow a move", off) if off else Recovery()


def _let_settle(session: Session, board: EmbeddedBoard) -> None:
    """Switch the drives on and wait until no rotor swings: a homing that began meanwhile would stall.

    A driver that is switched on again takes its rotor up to two full steps away, and little damps the swing.
    """
    with session.charge("hold", needs=()) as charge:
        charge.enable()
        end_s = board.now_s() + _SETTLING_MAX_S
        while board.now_s() < end_s and _swing(board):
            pass


def _swing(board: EmbeddedBoard) -> bool:
    """Return whether a rotor has moved in _LOOK_S, which pass."""
    seen = []
    for _ in range(_LOOKS):
        board.wait(_LOOK_S / _LOOKS)
        seen.append(board.rotor_positions())
    ways = (max(places) - min(places) for places in zip(*seen, strict=True))
    return any(
        way > _SWING_MAX_FULL_STEPS * joint.transmission.microsteps
        for way, joint in zip(ways, board.robot.axes, strict=True)
    )


class _Unhurried:
    """A link to a board on which each wait lasts longer: homing asks less often whether it is done.

    Asking took most of the time of a run.
    """

    def __init__(self, board: EmbeddedBoard) -> None:
        self._board = board
        self.network = board.network

    @property
    def held_up_s(self) -> float:
        """Simulated time waits for this program: 0."""
        return self._board.held_up_s

    def now_s(self) -> float:
        """Return the simulated seconds since power-up."""
        return self._board.now_s()

    def wait(self, dt_s: float) -> None:
        """Let time pass, several times as much as asked for."""
        self._board.wait(_LONGER * dt_s)


def _home(session: Session) -> None:
    """Home the joints that have a homing, all together; they stay where it ends."""
    names = [joint.name for joint in session.robot.joints if joint.homing is not None]
    if names:
        home_robot(session, joints=names, together=True, stay=True)


def _goal(session: Session, units: list[int]) -> list[float]:
    """Return a position near another one, each joint within its limits, on the side where its range is longer."""
    standing = session.positions(units)
    return [_near(joint, position) for position, joint in zip(standing, session.robot.joints, strict=True)]


def _near(joint: Joint, position: float) -> float:
    way = _WAY * (joint.upper - joint.lower)
    middle = (joint.lower + joint.upper) / 2
    within = min(max(position, joint.lower), joint.upper)
    return within + (way if within < middle else -way)


def _off(board: EmbeddedBoard, reported_units: list[int]) -> str:
    """Return of the first joint whose motor is not where its drive says it is, how far off; empty if all are."""
    offs = zip(board.robot.axes, steps_off(board, reported_units), steps_off_max(board), strict=True)
    return next((_told(joint.name, steps, most) for joint, steps, most in offs if abs(steps) > most), "")


def _told(name: str, steps: float, most: float) -> str:
    allowed = f"homing may be off by up to {most:.4g}"
    return f"{name}: its motor stands {steps:+.4g} steps from where its drive reports it; {allowed}"


def steps_off_max(board: EmbeddedBoard) -> list[float]:
    """Return by how many steps homing may find each motor elsewhere than it is.

    That is a step, with the lag of a rotor that turns with the board. A switch of a coupled joint closes where all
    motors of the joint have turned it to: what is allowed to those homed before comes on top, in steps of this one.
    """
    robot = board.robot
    lag = _LAG_MAX_FULL_STEPS if board.motors_turn else 0.0
    own = [_EDGE_MAX_STEPS + lag * joint.transmission.microsteps for joint in robot.axes]
    steps_per_unit = [joint.transmission.steps_per_unit for joint in robot.axes]
    allowed = list(own)
    for level in robot.coupling.homing_levels(len(robot.joints)):
        for axis in (motor for joint in level for motor in robot.coupling.motors_of(joint)):
            shares = {each: share / steps_per_unit[each] for each, share in robot.coupling.travel_of(axis).items()}
            before = sum(abs(share) * allowed[each] for each, share in shares.items() if each != axis)
            allowed[axis] = own[axis] + before / abs(shares[axis])
    return allowed


def steps_off(board: EmbeddedBoard, reported_units: list[int]) -> list[float]:
    """Return by how many steps of the robot's file each motor is held beyond the position that its drive reports."""
    held = zip(board.held_positions(), reported_units, board.robot.axes, strict=True)
    return [steps - units * joint.transmission.microsteps / UNITS_PER_FULL_STEP for steps, units, joint in held]
