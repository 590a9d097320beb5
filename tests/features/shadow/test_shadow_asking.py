"""`steptwin shadow --join asking`: it reads how a machine at rest stands, by SDO uploads alone, and then is silent."""

import json
from collections.abc import Callable, Sequence

import can
import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.features.faults.kinds.machine import Slip
from steptwin.features.shadow import command
from steptwin.host.cli.app import run
from steptwin.host.client.links import bus_link
from steptwin.host.operate.homing import home_robot
from steptwin.host.operate.jogging import jog
from steptwin.host.operate.moving import move
from steptwin.host.operate.status import read_status
from steptwin.host.robots import load_robot
from steptwin.protocol import od
from steptwin.protocol.frame import COB_SDO_REQUEST, Frame
from tests.features.shadow.machines import CLOCK_US, Real

ROBOT = load_robot("teaching-scara")
NODES = range(0x10, 0x14)
COMMAND = ["shadow", "teaching-scara", "--connect", "127.0.0.1", "--join", "asking"]
AWAY, BACK = [20.0, 30.0, 10.0, 40.0], [-20.0, 10.0, 0.0, -40.0]
Action = Callable[[Real], object]


class AskedBus:
    """A bus of python-can to a machine in virtual time; what is sent reaches the machine, and is kept.

    When nothing has been sent for a second of the machine's time, the next action is done to it; after the last one
    comes Ctrl-C.
    """

    def __init__(self, real: Real, *actions: Action) -> None:
        self._real = real
        self._actions = list(actions)
        self._log = real.board.bus_log
        self._heard = len(self._log)
        self._last_us = 0
        self.sent: list[Frame] = []
        self._own: Frame | None = None
        """What was sent last and has not been on the bus yet."""
        self.sent_before_actions: int | None = None
        """Number of frames sent until the first action."""
        self._sent_s = real.board.now_s()

    def __enter__(self) -> "AskedBus":
        return self

    def __exit__(self, *_: object) -> None: ...

    def monotonic(self) -> float:
        return self._real.board.now_s()

    def recv(self, timeout_s: float) -> can.Message | None:
        if self._heard == len(self._log):
            self._log = self._real.board.bus_log
        while self._heard < len(self._log):
            counts, frame = self._log[self._heard]
            self._heard += 1
            if frame == self._own:
                self._own = None  # an interface does not let its own frames be heard
                continue
            self._last_us = max(CLOCK_US + counts // 72, self._last_us + 1)
            return can.Message(
                timestamp=self._last_us / 1e6, arbitration_id=frame.cob_id, data=frame.data, is_extended_id=False
            )
        if self._real.board.now_s() - self._sent_s < 1.0:
            self._real.board.wait(min(timeout_s, 0.002))
            return None
        if self.sent_before_actions is None:
            self.sent_before_actions = len(self.sent)
        if not self._actions:
            raise KeyboardInterrupt
        self._actions.pop(0)(self._real)
        self._sent_s = self._real.board.now_s()
        return self.recv(timeout_s)

    def send(self, message: can.Message) -> None:
        frame = Frame(message.arbitration_id, bytes(message.data))
        assert not message.is_extended_id
        assert not message.is_remote_frame
        self.sent.append(frame)
        self._own = frame
        self._sent_s = self._real.board.now_s()
        self._real.board.network.send_message(*frame)

    def __getattr__(self, name: str) -> object:
        raise AssertionError(f"the shadow uses its bus to {name}")


def asking(bus: AskedBus, monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    monkeypatch.setattr(bus_link, "open_bus", lambda _: bus)
    monkeypatch.setattr(command, "time", bus)
    code = run([*COMMAND, *words])
    check_sent(bus.sent)
    assert bus.sent_before_actions in (None, len(bus.sent)), "it has sent something after the questions"
    return code


def check_sent(sent: Sequence[Frame]) -> None:
    """Each frame begins an upload of one of the robot's nodes, and has no other effect."""
    for frame in sent:
        assert frame.cob_id - COB_SDO_REQUEST in NODES
        assert (len(frame.data), frame.data[0], frame.data[4:]) == (8, 0x40, bytes(4))


@pytest.fixture(scope="module")
def at_work(fast_kernel: Kernel) -> Real:
    """A machine that has been homed and moved; each test goes on with it."""
    real = Real(ROBOT, fast_kernel)
    home_robot(real.session)
    move(real.session, BACK)
    real.board.wait(0.5)
    return real


@pytest.mark.slow
def test_it_joins_a_machine_that_runs(
    at_work: Real, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its twin does what it does from then on, and the board's past is no discrepancy."""
    bus = AskedBus(
        at_work,
        lambda real: move(real.session, AWAY),
        lambda real: jog(real.session, "d3", 0.9 * ROBOT.joints[2].speed_max, 0.5),
        lambda real: read_status(real.session),
        lambda real: home_robot(real.session),
        lambda real: move(real.session, BACK),
    )
    assert asking(bus, monkeypatch, "--json") == 0
    (line,) = capsys.readouterr().out.splitlines()
    summary = json.loads(line)
    assert summary.pop("board_frames") > 500
    assert summary == {"joined": True, "discrepancies": 0}
    assert len(bus.sent) == 4 * 212


@pytest.mark.slow
def test_a_slip_is_found_as_after_a_boot_up(
    at_work: Real, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where the machine stands is known from the asking: a homing tells what was lost since."""

    def slip(real: Real) -> None:
        real.operate(Slip(1, 20))
        home_robot(real.session)

    assert asking(AskedBus(at_work, slip), monkeypatch, "--json") == 1
    found, _ = map(json.loads, capsys.readouterr().out.splitlines())
    assert (found["axis"], found["kind"]) == ("th2", "homing")
    assert found["error_steps"] == pytest.approx(-320, abs=3)


@pytest.mark.slow
def test_it_joins_a_board_that_nobody_has_led_yet(
    fast_kernel: Kernel, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bus = AskedBus(Real(ROBOT, fast_kernel), lambda real: home_robot(real.session, joints=["th2"], stay=True))
    assert asking(bus, monkeypatch) == 0
    told = capsys.readouterr()
    assert told.out.endswith("the board does what its twin does\n")
    assert told.err == "joined: the twin goes along with the machine\n"


def test_a_fault_is_refused(
    fast_kernel: Kernel, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    real = Real(ROBOT, fast_kernel)
    real.session.machine.axes[2].write(od.EMERGENCY_STOP, 1)
    bus = AskedBus(real)
    assert asking(bus, monkeypatch) == 3
    assert "d3: FAULT, estop (0x9000), error register 0x01: end it, then join" in capsys.readouterr().err
    assert len(bus.sent) == 3 * 8
