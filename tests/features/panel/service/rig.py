"""A board and a service in this process: what a page asks for, without a page."""

import time
from collections.abc import Callable

import numpy as np

from steptwin.features.faults.kinds.machine import EmergencyStop
from steptwin.features.panel.service.commands import Command, DeclareHere, Jog, MoveJoints, ResetFaults
from steptwin.features.panel.service.guards import BEAT_S
from steptwin.features.panel.service.messages import RefusedError
from steptwin.features.panel.service.service import MachineService
from steptwin.host.client.links.bus_link import Connection
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.live.served_board import ServedBoard
from tests.emulator.live.live_rig import await_true

ROBOT = load_robot("calibration-scara")
TH1, TH2 = "th1", "th2"
ANN, BOB = "tab 1", "tab 2"
"""Two clients; Ann operates the machine."""
HERE = (-20.0, -50.0, 60.0, 100.0)
"""Joint positions from which the tool can go in all directions."""


def connection(port: int | None) -> Connection:
    """Return the way to a board on this computer."""
    return Connection("socketcand", None, None, "127.0.0.1", port)


def counts(service: MachineService) -> bool:
    """Return whether commands may be asked for from the newest snapshot."""
    try:
        service.require_shown("look", service.snapshot.number)
    except RefusedError:
        return False
    return True


class Rig:
    """A service with an operator, Ann, on a machine that knows its position."""

    def __init__(self, served: ServedBoard | EmbeddedBoard, service: MachineService) -> None:
        self.served = served
        self.service = service
        self._press = 0

    def ready(self) -> None:
        """Bring the machine to HERE, enabled, whatever a test has left behind."""
        service = self.service
        self.served.operate(EmergencyStop(pressed=False))
        self.idle()
        service.operator.give_up(BOB)
        service.operator.take(ANN, "Ann")
        if service.snapshot.emergency_stopped or any(joint.error for joint in service.snapshot.joints):
            self.do(ResetFaults())
            self.await_true(lambda: not service.snapshot.emergency_stopped, "reset")
        if service.snapshot.homed:  # declared anew, the machine would wander off to its limit switches
            self.do(MoveJoints(dict(zip(ROBOT.joint_names, HERE, strict=True))))
            self.await_true(lambda: np.allclose(self.positions(), HERE, atol=0.02), "reports of the move's end")
            self.await_true(self.stands, "standstill")
        else:
            self.do(DeclareHere(HERE))
            self.await_true(lambda: service.snapshot.homed, "homed")

    def now_s(self) -> float:
        """Return the seconds on the clock by which the service measures."""
        return time.monotonic()

    def await_true(self, condition: Callable[[], bool], what: str) -> None:
        """Wait until a condition holds."""
        await_true(condition, what)

    def pass_time(self, dt_s: float) -> None:
        """Let time pass."""
        time.sleep(dt_s)

    def idle(self) -> None:
        """Wait until the service is connected and has nothing to do."""
        self.await_true(lambda: self.service.snapshot.connected and self.service.snapshot.activity is None, "idle")

    def do(self, command: Command) -> None:
        """Ask for a command, as Ann, and wait for its end; it must not fail."""
        before = self.service.events.since()[-1].number
        self.ask(command)
        self.idle()
        failed = [event.text for event in self.service.events.since(before) if event.severity == "error"]
        assert not failed

    def ask(self, command: Command, client: str = ANN) -> None:
        """Ask for a command from the machine as it is now; wait for that until nothing voids it any more."""
        self.fresh()
        self.service.ask(client, command, self.service.snapshot.number)

    def fresh(self) -> None:
        """Wait for a snapshot from after the last stop, reset or change of the operator."""
        self.await_true(lambda: counts(self.service), "a snapshot that counts")

    def pressed(self, jog: Jog) -> int:
        """Press a button, as Ann, and hold it until a joint has moved visibly; return the number of the press."""
        self.next_press()
        start = self.positions()
        self.fresh()
        self.hold(jog, lambda: max(abs(now - then) for now, then in zip(self.positions(), start, strict=True)) > 0.2)
        return self._press

    def next_press(self) -> int:
        """Return the number of a new press of Ann's."""
        self._press += 1
        return self._press

    def positions(self) -> list[float]:
        """Return where the joints are, by the last reports."""
        return [joint.position for joint in self.service.snapshot.joints]

    def hold(self, jog: Jog, until: Callable[[], bool], most_s: float = 60.0) -> None:
        """Hold the button that was pressed last until a condition, or for a time."""
        end_s = self.now_s() + most_s
        while not until() and self.now_s() < end_s:
            self.service.beat(ANN, self._press, jog, self.service.snapshot.number)
            self.pass_time(BEAT_S / 2)

    def stands(self) -> bool:
        """Return whether every joint stands, by the last reports."""
        return not any(joint.rate for joint in self.service.snapshot.joints)

    def refusal(self, command: Command, client: str = ANN) -> str:
        """Return why a command is refused."""
        self.fresh()
        try:
            self.service.ask(client, command, self.service.snapshot.number)
        except RefusedError as error:
            return str(error)
        raise AssertionError(f"{command} was not refused")

    def beat_refusal(self, press: int, jog: Jog, client: str = ANN) -> str:
        """Return why a beat is refused."""
        self.fresh()
        try:
            self.service.beat(client, press, jog, self.service.snapshot.number)
        except RefusedError as error:
            return str(error)
        raise AssertionError(f"press {press} was not refused")

    def told(self) -> list[str]:
        """Return the texts of all events."""
        return [event.text for event in self.service.events.since()]
