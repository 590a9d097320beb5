"""What the worker does while the machine is connected: one thing at a time, stops first."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from steptwin.host.client import stopping
from steptwin.host.client.waiting import wait_until
from steptwin.host.common.errors import BusError, DeviceFaultError, InputError
from steptwin.host.operate.jogging import jog, jog_tool
from steptwin.host.operate.recovering import stop
from steptwin.host.operate.session import Session
from steptwin.host.operate.switching import read_outputs
from steptwin.host.panel.desk.actions import ACTIONS, Doing
from steptwin.host.panel.desk.commands import JointJog, Order
from steptwin.host.panel.desk.parts import Asked, Parts
from steptwin.host.panel.desk.presses import EXPIRED, RELEASED, Press
from steptwin.host.panel.desk.reports import Reports, ask_once, set_up_reports
from steptwin.host.panel.desk.settings import read_settings
from steptwin.host.panel.desk.stops import Stop, StopAskedError
from steptwin.host.panel.desk.words import told
from steptwin.protocol import od

_TURN_S: Final = 0.01
"""Longest time until an idle worker looks round."""
_SLOWLY_S: Final = 1.0
"""Period of the questions about what no node reports by itself."""
_HELD_S: Final = 0.5
"""Longest wait for the reports that drives are held, once they are."""
_SIMULATED: Final = "SIMULATED"
"""What an emulated board's device name (1008h) says."""


class Connected:
    """A machine that is connected; everything here happens in the worker's thread."""

    def __init__(self, session: Session, reports: Reports, parts: Parts, asked: Asked) -> None:
        self.session = session
        self.reports = reports
        self._parts = parts
        self._asked = asked
        self._asked_slowly_s = float("-inf")
        self._often = self._known = False
        """Whether the nodes report often, and whether settings and the like have been read."""

    def turn(self) -> None:
        """Stop if that is asked for; then carry out a command, or jog, or wait.

        Raises:
            StopAskedError: a stop is asked for; the next turn makes it.
            BusError: the connection is lost.
        """
        self.make_stop()
        self._tell_missed()
        wanted = self._asked.take()
        if wanted is None:
            self.session.link.wait(_TURN_S)
            self._ask_slowly()
        elif isinstance(wanted, Press):
            self._jog(wanted)
        else:
            self._carry_out(wanted)

    @contextmanager
    def _telling(self, name: str) -> Iterator[list[str]]:
        """Tell in the events how the block fails, and in the list that is yielded; then the worker does nothing."""
        events, failures = self._parts.events, list[str]()
        try:
            yield failures
        except (InputError, DeviceFaultError, BusError) as error:
            failures.append(f"{name}: {told(error)}")
            events.error(failures[0])
        except StopAskedError as asked:
            events.warning(f"{name}: {asked}")
            raise
        finally:
            self._asked.end()

    def _carry_out(self, order: Order) -> None:
        action, parts = ACTIONS[type(order.command)], self._parts
        name = action.title(order.command)
        with self._telling(name), self.session.one_action():
            seen_s = parts.shown.require(order.shown)
            doing = Doing(
                self.session,
                parts.limits,
                lambda fraction: self._asked.begin(name, fraction),
                parts.results,
                parts.events.info,
                seen_s,
            )
            text = action.perform(doing, order.command)
            self._asked_slowly_s = float("-inf")
            self._known = self._known and not action.changes_settings
            if text:
                parts.events.info(f"{name}: {text}" if name not in text else text)

    def _jog(self, press: Press) -> None:
        """Jog until the button is released; whatever else ends the jog ends the press too."""
        wanted, presses = press.jog, self._parts.presses
        name = f"jog {wanted.name}"

        def released() -> bool:
            return not presses.holds(press)

        why = f"{name}: stopped"
        try:
            with self._telling(name) as failures, self.session.one_action():
                if isinstance(wanted, JointJog):
                    jogged = jog(self.session, wanted.joint, wanted.speed, None, until=released)
                    moved, at_end = jogged.end != jogged.start, jogged.at_limit
                else:
                    tool = jog_tool(self.session, wanted.coordinate, wanted.speed, released)
                    moved, at_end = tool.end != tool.start, tool.at_end
                over = presses.why_over(press)
                if not (moved or at_end):
                    self._tell_in_vain(name, over)
                elif over == EXPIRED:
                    self._parts.events.warning(f"{name}: {over}")
                why = f"{name}: at the end of its travel"
                if at_end:
                    self._parts.events.info(why)
        finally:
            if not released():
                presses.end(failures[0] if failures else why)

    def _tell_missed(self) -> None:
        """Say which presses were over before the machine was free: nothing was ever done for them."""
        for press, why in self._parts.presses.missed():
            self._tell_in_vain(f"jog {press.jog.name}", why)

    def _tell_in_vain(self, name: str, why: str) -> None:
        """Say that a button has moved nothing, unless a stop or the like has ended it, which says so itself."""
        if why == EXPIRED:
            self._parts.events.error(f"{name}: nothing has moved: {why}")
        elif why in ("", RELEASED):
            self._parts.events.error(
                f"{name}: nothing has moved: {RELEASED} before the drives were ready: hold it longer"
            )

    # --- stops

    def make_stop(self) -> None:
        """Make the stop that is asked for, if any.

        Raises:
            StopAskedError: meanwhile a greater stop is asked for.
            BusError: an emergency stop has found a node that does not answer; it is still to be made.
        """
        asked = self._parts.stops.answer()
        if asked is Stop.NONE:
            return
        if asked is Stop.EMERGENCY:
            self._hold()
        elif asked is Stop.STOP:
            with self._telling("stop"):
                stop(self.session)
        self._parts.stops.done(asked)

    def _hold(self) -> None:
        """Hold all drives until a reset."""
        axes, link = self.session.machine.axes, self.session.link
        try:
            stopping.emergency_stop(link, axes)
        except DeviceFaultError as error:
            self._parts.events.error(f"emergency stop: {told(error)}")
            return
        wait_until(link, lambda: all(axis.in_fault for axis in axes), _HELD_S)
        self._parts.events.warning("emergency stop: all drives are off and held until a reset")

    # --- what no node reports by itself

    def require_own(self) -> None:
        """Raise BusError if the board carries another robot's name."""
        foreign = self.session.foreign_board()
        if foreign:
            raise BusError(f"{foreign}; --force goes on all the same").plainly(
                f"{foreign.axis} belongs to the robot {foreign.found}, not to {foreign.expected}"
            )

    def _ask_slowly(self) -> None:
        """Ask for what is not reported, from time to time while nothing moves: questions disturb who streams."""
        session, now_s = self.session, time.monotonic()
        if now_s - self._asked_slowly_s < _SLOWLY_S or session.streaming:
            return
        self._asked_slowly_s = now_s
        known = self._parts.publisher.known
        try:
            self._often = self._often or set_up_reports(session)
            if not self._known:
                ask_once(session, self.reports)
                known.simulated = _SIMULATED in session.machine.axes[0].read_text(od.DEVICE_NAME)
                self._parts.limits.settings = read_settings(session, self._parts.limits)
                self._known = True
            known.outputs = read_outputs(session)
        except InputError:
            return  # a trajectory has begun meanwhile
        except DeviceFaultError as error:
            self._parts.events.warning(told(error))
