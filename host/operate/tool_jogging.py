"""Jog the tool along a straight line, or turn it, for as long as a condition holds."""

from collections.abc import Callable
from dataclasses import dataclass

from steptwin.host.client.pausing import abandon_trajectory
from steptwin.host.client.waiting import POLL_S
from steptwin.host.operate.moving import move_within, standing_joints
from steptwin.host.operate.session import Session
from steptwin.host.planning.tool_jog import check_tool_jog, plan_tool_jog


@dataclass(frozen=True, slots=True)
class ToolJogged:
    """A finished jog of the tool: joint positions in mm and degrees, and whether the way's end was reached."""

    coordinate: str
    start: list[float]
    end: list[float]
    at_end: bool


def jog_tool(session: Session, coordinate: str, speed: float, until: Callable[[], bool]) -> ToolJogged:
    """Move the tool along x, y or z of the world, or turn it by phi, until `until` returns True.

    The speed is in mm/s or deg/s, with a sign. The way ends where reach and limits end. On the way `until` is called
    every 10 ms; then the tool halts on its line, and the rest of the way is given up.

    Raises:
        InputError: the tool cannot move in this direction, with the reason; or as `execute_live`.
        DeviceFaultError, BusError: as `execute_live`.
    """
    check_tool_jog(coordinate, speed)
    with session.alone():
        plan = plan_tool_jog(session.robot, standing_joints(session, "jog"), coordinate, speed)
        with session.in_charge("jog") as machine:
            move_within(session, session.demanded_units(), plan.start_units)
            start = session.positions(plan.start_units)
            if until():
                return ToolJogged(coordinate, start, start, at_end=False)
            stream = machine.start(plan.records(), plan.start_units)
            while not (stream.ended or until()):
                machine.wait(POLL_S)
            if not stream.ended:
                abandon_trajectory(machine)
            end = session.positions(machine.positions_units())
    return ToolJogged(coordinate, start, end, at_end=stream.ended)
