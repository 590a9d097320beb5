"""The desk: what pages read and ask. One in a process, for one machine."""

import time
from typing import Final

from steptwin.host.client.bus_link import Connection
from steptwin.host.panel.desk.commands import Command, Jog
from steptwin.host.panel.desk.events import EventLog
from steptwin.host.panel.desk.history import History
from steptwin.host.panel.desk.operators import Operators
from steptwin.host.panel.desk.presses import Presses
from steptwin.host.panel.desk.publisher import Publisher
from steptwin.host.panel.desk.refused import RefusedError
from steptwin.host.panel.desk.results import Result
from steptwin.host.panel.desk.settings import Setting
from steptwin.host.panel.desk.snapshot import Snapshot
from steptwin.host.panel.desk.stops import StopRequests
from steptwin.host.panel.desk.worker import Worker
from steptwin.host.robots.robot import Robot

AGE_MAX_S: Final = 1.0
"""Age beyond which a command is dropped: its operator may have gone."""


class Desk:
    """A machine that any number of pages watch and one of them operates; thread-safe, and no call waits for the bus.

    A page is a client, under a text of its own. It reads `snapshot`, `history`, `events`, `settings` and `results`. To
    move the machine it becomes the operator (`operators.take`), then asks for commands or holds a jog by beats.
    Everybody may stop at any time.

    Attributes:
        events: what has happened, in words.
        history: the last minutes of every joint.
        operators: who may move the machine.
    """

    def __init__(self, connection: Connection, robot: Robot, *, control: tuple[str, int] | None = None) -> None:
        """Connect in a thread of its own, again and again until `close`.

        Args:
            connection: the bus.
            robot: the machine on it.
            control: host and port of a served board's control port, for its load and lateness; None without one.
        """
        self.events = EventLog()
        self._presses = Presses()
        self.operators = Operators(self.events, lambda: self._presses.end("another client operates the machine"))
        self.history = History(len(robot.joints))
        self._robot = robot
        self._control = control
        self._stops = StopRequests()
        self._publisher = Publisher(self.operators, self.history, self.events)
        self._worker = Worker(connection, robot, self._publisher, self._stops, self.events)
        self._worker.start()

    @property
    def robot(self) -> Robot:
        """The machine, with the limits that the settings have now: plan for this one."""
        return self._robot

    @property
    def snapshot(self) -> Snapshot:
        """The machine now; a new one comes at least 30 times a second."""
        return self._publisher.snapshot

    @property
    def settings(self) -> tuple[Setting, ...]:
        """The settings as last read; empty before the first connection."""
        return ()

    @property
    def results(self) -> tuple[Result, ...]:
        """The last runs that have ended, the newest last."""
        return ()

    # --- for the operator

    def ask(self, client: str, command: Command) -> None:
        """Let the machine carry out a command; return at once. How it ends is in `events`, and `results` for a run.

        Raises:
            RefusedError: nothing happens, and why: the client is not the operator; the command is more than a second
                old or wrong; the machine is not connected, is busy, is held by an emergency stop, or not homed.
        """
        self.operators.require(client)
        age_s = time.monotonic() - command.asked_s
        if age_s > AGE_MAX_S:
            raise RefusedError(f"the command is {age_s:.1f} s old, more than {AGE_MAX_S:g} s: ask again")
        raise RefusedError(f"not connected: {self.snapshot.why_not}")

    def beat(self, client: str, press: int, jog: Jog) -> None:
        """Begin a jog or hold it: call this when a button is pressed and every 80 ms (`presses.BEAT_S`) after that.

        The machine stops 250 ms (`presses.LEASE_S`) after the last beat. Each press has a number, greater than all
        before on this client; a press that is over stays so.

        Raises:
            RefusedError: nothing moves, and why: as `ask`, or because the press is over.
        """
        self.operators.require(client)
        self._presses.beat(client, press, jog)

    def release(self, client: str, press: int) -> None:
        """End a jog: the button is released, the page is left or loses the focus. Never raises."""
        self._presses.release(client, press)

    def resume(self, client: str) -> None:
        """Let a paused trajectory go on; raise RefusedError unless the client is the operator."""
        self.operators.require(client)

    # --- for everybody, at any time

    def pause(self) -> None:
        """Halt the trajectory that runs, on its path; raise RefusedError if there is none."""

    def stop(self, by: str = "a client") -> None:
        """Stop all axes together; they hold their positions. `by` is whom the events name."""

    def emergency_stop(self, by: str = "a client") -> None:
        """Stop all axes at once and switch their power off, until a reset; `by` is whom the events name.

        The quick stop is sent from the calling thread. Without a connection it is made as soon as there is one again.
        """

    def gone(self, client: str) -> None:
        """Say that a page is closed for ever: its jog ends, and it no longer operates the machine."""
        self.operators.give_up(client)
        self._presses.forget(client)

    def close(self) -> None:
        """End the connection; the machine stops what the desk makes it do."""
        self._worker.close()
