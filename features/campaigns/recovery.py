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
"""Fraction of each joint's range for its move at the end."""
_QUIET_S: Final = 0.7
"""Wait before the recovery; reset boards have restarted and rogue nodes are silent by then."""
_LONGER: Final = 10
"""Factor on all waits during the recovery."""
_EDGE_MAX_STEPS: Final = 1.0
"""Largest difference in steps between two homings of an axis. Homing takes the whole step at the switch's edge. The
edge may fall between two steps if a rotor was put back by a fraction of one, or if another motor turns the joint, too.
"""
_TOKEN: Final = 1
"""Token of the operator's lease. A random one would change the lengths of frames, and the time of the run."""
_LAG_MAX_FULL_STEPS: Final = 1.0
"""Largest lag in full steps of a rotor in the loop while it finds a switch: a load angle of 90 degrees."""
_SWING_MAX_FULL_STEPS: Final = 0.1
"""Largest motion in _LOOK_S of a rotor at standstill, including oscillation."""
_LOOK_S: Final = 0.1
_LOOKS: Final = 10
"""Number of looks in this time: several in each oscillation, which takes 0.2 s at most."""
_SETTLING_MAX_S: Final = 10.0
"""Longest wait for it; the homing then shows whether the machine works again."""


@dataclass(frozen=True, slots=True)
class Recovery:
    """Result of a recovery.

    Attributes:
        failed: what did not work, without numbers; empty on success.
        detail: further details.
    """

    failed: str = ""
    detail: str = ""


def recover(board: EmbeddedBoard) -> Recovery:
    """Reset the drives of a repaired machine, home its joints, move them all, and compare positions."""
    session, doing = Session(_Unhurried(board), board.robot, _TOKEN), "the reset"
    board.wait(_QUIET_S)
    try:
        reset(session)
        if board.motors_turn:
            _let_settle(session, board)
        doing = "homing"
        _home(session)
        standing = session.machine.positions_units()  # the counts, since a demand may lie between two steps
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
    """Switch the drives on and wait until no rotor oscillates; otherwise a homing would stall.

    A driver that is switched on again moves its rotor by up to two full steps, with little damping.
    """
    with session.charge("hold", needs=()) as charge:
        charge.enable()
        end_s = board.now_s() + _SETTLING_MAX_S
        while board.now_s() < end_s and _swing(board):
            pass


def _swing(board: EmbeddedBoard) -> bool:
    """Let _LOOK_S pass; return whether a rotor has moved."""
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
    """A link to a board with longer waits: homing polls its end less often.

    Polling took most of the time of a run.
    """

    def __init__(self, board: EmbeddedBoard) -> None:
        self._board = board
        self.network = board.network

    @property
    def held_up_s(self) -> float:
        """Time during which the simulation waited for this program: 0."""
        return self._board.held_up_s

    def now_s(self) -> float:
        """Return the simulated seconds since power-up."""
        return self._board.now_s()

    def wait(self, dt_s: float) -> None:
        """Let time pass, several times the given one."""
        self._board.wait(_LONGER * dt_s)


def _home(session: Session) -> None:
    """Home all joints that have a homing together; they stay at its end."""
    names = [joint.name for joint in session.robot.joints if joint.homing is not None]
    if names:
        home_robot(session, joints=names, together=True, stay=True)


def _goal(session: Session, units: list[int]) -> list[float]:
    """Return a position near another one, within the joint's limits, on the side with the longer range."""
    standing = session.positions(units)
    return [_near(joint, position) for position, joint in zip(standing, session.robot.joints, strict=True)]


def _near(joint: Joint, position: float) -> float:
    way = _WAY * (joint.upper - joint.lower)
    middle = (joint.lower + joint.upper) / 2
    within = min(max(position, joint.lower), joint.upper)
    return within + (way if within < middle else -way)


def _off(board: EmbeddedBoard, reported_units: list[int]) -> str:
    """Return a text about the first joint whose motor is away from its reported position; empty if none is."""
    offs = zip(board.robot.axes, steps_off(board, reported_units), steps_off_max(board), strict=True)
    return next((_told(joint.name, steps, most) for joint, steps, most in offs if abs(steps) > most), "")


def _told(name: str, steps: float, most: float) -> str:
    allowed = f"homing may be off by up to {most:.4g}"
    return f"{name}: its motor stands {steps:+.4g} steps from where its drive reports it; {allowed}"


def steps_off_max(board: EmbeddedBoard) -> list[float]:
    """Return the largest difference in steps of each motor between two homings.

    It is a step, plus the lag of a rotor in the loop. The switch of a coupled joint depends on all motors of the joint,
    so the differences of joints that were homed before are added, in steps of this motor.
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
    """Return the distance of each motor from its drive's reported position, in steps of the robot's file."""
    held = zip(board.held_positions(), reported_units, board.robot.axes, strict=True)
    return [steps - units * joint.transmission.microsteps / UNITS_PER_FULL_STEP for steps, units, joint in held]
