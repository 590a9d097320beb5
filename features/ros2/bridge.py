"""Offer a machine to ROS through a rosbridge server: joint positions, and an action that moves it.

The server has a WebSocket (RFC 6455). The extra is `websockets`; `roslibpy` offers no actions and brings Twisted and
autobahn.
"""

from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import suppress
from importlib.util import find_spec
from typing import Final, Protocol

import numpy as np

from steptwin.features.ros2.goals import ActiveGoal, FollowGoal, GoalEvent, GoalState, RefusedGoalError, follow_goal
from steptwin.features.ros2.messages import CancelRequest, FollowCode, GoalSent, RosNames
from steptwin.host.client.links import ANSWER_S, address_text
from steptwin.host.client.links.bus_link import reason
from steptwin.host.client.reports import Listening, check_enabled, check_faults
from steptwin.host.client.stream import Stream
from steptwin.host.client.waiting import POLL_S
from steptwin.host.common.errors import BusError, DeviceFaultError, InputError, StepTwinError
from steptwin.host.common.extras import installing
from steptwin.host.common.file_limits import MIB
from steptwin.host.operate.inputs_outputs import streamed_motion
from steptwin.host.operate.joint_positions import JointReading, axis_readings
from steptwin.host.operate.running import SETTLED_S
from steptwin.host.operate.session import Session
from steptwin.host.planning.plan import highest_speed
from steptwin.protocol.cia402 import Status

PERIOD_S: Final = 0.1
"""Period of joint_states and of a goal's feedback; the board reports as often."""
_LATE_USUAL_S: Final = 0.2
"""Usual time of the last report after a trajectory's end."""
_WHAT: Final = "ros2-bridge"
PORT: Final = 9090
"""Port of rosbridge_server's WebSocket."""
_MESSAGE_BYTES_MAX: Final = 16 * MIB
"""Largest message; a goal of six joints with 10 000 points has some 6 MB."""
_AT_ONCE: Final = 100
"""Messages read in a turn of some ms; a longer turn would let the stream to the board run dry."""
_PING_S: Final = 1.0
"""Period of pings; a server that is silent for two periods is lost."""

_CLOSE_S: Final = 0.2
"""Longest time to close a lost connection; the stream to the board lasts half a second without service."""


class RosbridgeLostError(BusError):
    """The connection to the rosbridge server has ended."""


class RosChannel(Protocol):
    """A connection to a rosbridge server."""

    def send(self, text: str) -> None:
        """Send a message; raise RosbridgeLostError if the connection has ended."""
        ...

    def received(self) -> Iterable[str | bytes]:
        """Return received messages, a limited number, without waiting; raise RosbridgeLostError as `send`."""
        ...


class _CanceledError(Exception):
    """A goal was canceled; leaving the lease of the machine stops it."""


class _TooLateError(StepTwinError):
    """A trajectory lasts longer than its goal allows."""


class RosBridge:
    """A machine offered to ROS: one goal at a time; cancellation or a lost connection stops it.

    Attributes:
        ends: number of goals by final state.
    """

    def __init__(
        self, session: Session, channel: RosChannel, names: RosNames, say: Callable[[str], None] = lambda _: None
    ) -> None:
        """Create a bridge; `say` receives a line for each goal and for each message of the server."""
        self.ends: Counter[GoalState] = Counter()
        self._session = session
        self._channel = channel
        self._names = names
        self._say = say
        self._goal: ActiveGoal | None = None
        self._due_s = session.link.now_s()

    def run(self) -> None:
        """Serve until Ctrl-C at standstill.

        Raises:
            KeyboardInterrupt: Ctrl-C during a motion; the machine has been stopped.
            RosbridgeLostError: the connection to the server has ended; a goal's motion has been stopped.
            BusError: the board no longer reports.
        """
        session = self._session
        session.require_present()
        if any(axis.drive_status is None for axis in session.machine.axes):
            session.machine.start_nodes()
        listening = Listening(session.link, session.machine.axes)
        for text in self._names.advertisements():
            self._channel.send(text)
        try:
            while True:
                listening.check()
                self._look()
                if self._goal is not None:
                    self._execute(self._goal)
                    listening = Listening(session.link, session.machine.axes)
                else:
                    session.link.wait(POLL_S)
        except KeyboardInterrupt:
            if self._goal is not None:
                raise
        finally:
            with suppress(RosbridgeLostError):
                for text in self._names.withdrawals():
                    self._channel.send(text)

    # --- messages

    def _look(self) -> None:
        """Process received messages, a limited number, and publish joint positions when due."""
        for text in self._channel.received():
            try:
                message = self._names.parsed(text)
            except InputError as error:
                self._say(f"a message of the server was dropped: {error}")
                continue
            if isinstance(message, GoalSent):
                self._arrive(message)
            elif isinstance(message, CancelRequest):
                if self._goal is not None and message.goal_id == self._goal.goal_id:
                    self._goal.take(GoalEvent.CANCEL)
            elif message is not None:
                self._say(f"the server says: {message.text}")
        self._publish()

    def _arrive(self, sent: GoalSent) -> None:
        """Start a goal; reject it while another one is active, since its start would be elsewhere by then."""
        goal = ActiveGoal(sent.goal_id, sent.args)
        if self._goal is None:
            self._goal = goal
            return
        goal.take(GoalEvent.FAILED)
        self._end(goal, FollowCode.INVALID_GOAL, f"{self._goal.goal_id} is under way: cancel it first, or wait")

    def _readings(self) -> list[JointReading]:
        """Return joint positions by the last reports; empty while an axis has not reported."""
        reports = [axis.drive_status for axis in self._session.machine.axes]
        told = [report for report in reports if report is not None]
        if len(told) < len(reports):
            return []
        knows = [bool(report.statusword & Status.POSITION_KNOWN) for report in told]
        readings = axis_readings(self._session.robot, [report.position_units for report in told], knows)
        return readings[: len(self._session.robot.joints)]

    def _publish(self, stream: Stream | None = None, follow: FollowGoal | None = None) -> None:
        """Send joint_states when due, and a goal's feedback with them."""
        now_s = self._session.link.now_s()
        if now_s < self._due_s:
            return
        self._due_s += PERIOD_S * (1 + (now_s - self._due_s) // PERIOD_S)
        robot, readings = self._session.robot, self._readings()
        known = {
            name: reading.position for name, reading in zip(robot.joint_names, readings, strict=False) if reading.known
        }
        if known:
            self._channel.send(self._names.joint_states(robot, known))
        if stream is not None and follow is not None and self._goal is not None and len(known) == len(robot.joints):
            at_s = min(stream.trajectory_s, follow.plan.motion.duration_s)
            desired = follow.plan.motion.positions(np.array([at_s]))[0]
            actual = np.array(list(known.values()))
            self._channel.send(self._names.feedback(self._goal.goal_id, robot, at_s, desired, actual))

    def _end(self, goal: ActiveGoal, code: FollowCode, text: str) -> None:
        self.ends[goal.state] += 1
        self._say(f"{goal.goal_id}: {goal.state.name}{f', {code.name}' if code else ''}{f': {text}' if text else ''}")
        self._channel.send(self._names.result(goal.goal_id, goal.state, code, text))

    # --- goals

    def _execute(self, goal: ActiveGoal) -> None:
        """Execute a goal and report its result; the machine is at standstill afterwards."""
        code, event, text = FollowCode.PATH_TOLERANCE_VIOLATED, GoalEvent.FAILED, ""
        try:
            self._say(f"{goal.goal_id}: ACCEPTED")
            missed = self._follow(goal)
            code = FollowCode.GOAL_TOLERANCE_VIOLATED if missed else FollowCode.SUCCESSFUL
            event, text = (GoalEvent.FAILED, missed) if missed else (GoalEvent.REACHED, "")
        except _CanceledError:
            code, event, text = FollowCode.SUCCESSFUL, GoalEvent.STOPPED, "canceled: the axes have made a quick stop"
        except RosbridgeLostError:
            raise
        except RefusedGoalError as error:
            code, text = error.code, str(error)
        except InputError as error:
            code, text = FollowCode.INVALID_GOAL, str(error)
        except _TooLateError as error:
            code, text = FollowCode.GOAL_TOLERANCE_VIOLATED, str(error)
        except (DeviceFaultError, BusError) as error:
            began = goal.state is not GoalState.ACCEPTED
            code, text = FollowCode.PATH_TOLERANCE_VIOLATED if began else FollowCode.INVALID_GOAL, str(error)
        except KeyboardInterrupt:
            goal.take(GoalEvent.FAILED)
            with suppress(RosbridgeLostError):
                self._end(goal, code, "the bridge was ended")
            raise
        goal.take(event)
        self._goal = None
        self._end(goal, code, text)

    def _follow(self, goal: ActiveGoal) -> str:
        """Check a goal and move the machine; return the joint that misses its end, or an empty text.

        Raises:
            RefusedGoalError: rejected before any motion.
            _CanceledError: the goal was canceled; the machine has been stopped, as after any other error.
        """
        session = self._session
        with session.one_action():
            follow = follow_goal(session.robot, goal.args, session.look(_WHAT).joints)
            motion = streamed_motion(follow.plan)._replace(highest_percent=highest_speed(follow.plan).percent)
            self._look_for_cancel(goal)
            with session.charge(_WHAT) as charge:
                follow.plan.check_start(charge.start.joints)
                machine = charge.enable()
                stream = machine.start(motion)
                goal.take(GoalEvent.BEGUN)
                self._tend(goal, follow, stream)
                session.link.wait(SETTLED_S)
                check_faults(session.link, machine.axes)
                check_enabled(machine.axes)
                return follow.missed(session.positions(machine.positions_units())) or ""

    def _tend(self, goal: ActiveGoal, follow: FollowGoal, stream: Stream) -> None:
        """Process messages until the trajectory ends."""
        machine, late_max_s = self._session.machine, follow.late_max_s
        began_s, lasts_s = machine.now_s(), follow.plan.motion.duration_s
        while not stream.ended:
            machine.wait(POLL_S)
            self._publish(stream, follow)
            self._look_for_cancel(goal)
            late_s = machine.now_s() - began_s - lasts_s - _LATE_USUAL_S
            if late_max_s is not None and late_s > late_max_s:
                raise _TooLateError(
                    f"the trajectory's end is {late_max_s:g} s late, as late as goal_time_tolerance allows"
                )

    def _look_for_cancel(self, goal: ActiveGoal) -> None:
        self._look()
        if goal.state is GoalState.CANCELING:
            raise _CanceledError


def require_websockets() -> None:
    """Raise InputError, with the remedy, if the extra `ros2` is not installed."""
    if find_spec("websockets") is None:
        raise InputError(f"the bridge to ROS is not installed: {installing('ros2')}")


class RosbridgeSocket:
    """Connection to a rosbridge server; a context manager that closes it."""

    def __init__(self, host: str, port: int) -> None:
        """Connect; raise RosbridgeLostError if no server answers."""
        from websockets.exceptions import WebSocketException
        from websockets.sync.client import connect

        self._title = f"rosbridge at {address_text(host, port)}"
        try:
            self._connection = connect(
                f"ws://{address_text(host, port)}",
                open_timeout=ANSWER_S,
                close_timeout=_CLOSE_S,
                ping_interval=_PING_S,
                ping_timeout=2 * _PING_S,
                max_size=_MESSAGE_BYTES_MAX,
                max_queue=None,  # cancellations must not wait behind other messages
                compression=None,
                proxy=None,
            )
        except (OSError, WebSocketException) as error:
            raise RosbridgeLostError(f"{self._title}: {reason(error)}: is rosbridge_server running?") from error

    def send(self, text: str) -> None:
        """Send a message; raise RosbridgeLostError if the connection has ended."""
        from websockets.exceptions import ConnectionClosed

        try:
            self._connection.send(text)
        except (OSError, ConnectionClosed) as error:
            raise self._lost() from error

    def received(self) -> list[str | bytes]:
        """Return received messages, a limited number, without waiting; raise RosbridgeLostError as `send`."""
        from websockets.exceptions import ConnectionClosed

        messages: list[str | bytes] = []
        try:
            while len(messages) < _AT_ONCE:
                messages.append(self._connection.recv(timeout=0))
        except TimeoutError:
            pass
        except (OSError, ConnectionClosed) as error:
            raise self._lost() from error
        return messages

    def _lost(self) -> RosbridgeLostError:
        return RosbridgeLostError(f"{self._title}: the connection has ended; a motion that was under way has stopped")

    def __enter__(self) -> "RosbridgeSocket":
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        self._connection.close()
