"""The link in real time, on python-can's bus in memory."""

import socket
import threading
from types import SimpleNamespace

import can
import pytest

from steptwin.host.cli.app import run
from steptwin.host.client.lease import Heartbeat
from steptwin.host.client.links import bus_link
from steptwin.host.client.links.bus_link import BusLink, Connection, open_bus
from steptwin.host.common.errors import BusError
from tests.emulator.live.live_rig import TIMEOUT_S
from tests.messages import refusing

VIRTUAL = Connection("virtual", "test-bus-link")


def test_frames_go_both_ways() -> None:
    heard = []
    with can.Bus(interface="virtual", channel="test-bus-link") as other, BusLink(open_bus(VIRTUAL), "virtual") as link:
        link.network.send_message(0x123, b"\x01\x02")
        sent = other.recv(5.0)
        assert sent is not None
        assert (sent.arbitration_id, sent.is_extended_id, bytes(sent.data)) == (0x123, False, b"\x01\x02")
        arrived = threading.Event()

        def hear(_cob_id: int, data: bytearray, _time_s: float) -> None:
            heard.append(bytes(data))
            arrived.set()

        link.network.subscribe(0x234, hear)
        other.send(can.Message(arbitration_id=0x234, data=b"\x03", is_extended_id=False))
        assert arrived.wait(5.0)
        before_s = link.now_s()
        link.wait(0.001)
        assert link.now_s() >= before_s + 0.001
    assert heard == [b"\x03"]


@pytest.mark.parametrize(("late_s", "held_up_s"), [(0.0, 0.0), (0.009, 0.0), (0.011, 0.011), (1.5, 1.5)])
def test_time_limits_do_not_count_time_of_being_held_up(
    late_s: float, held_up_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A wait that ends up to 10 ms late is time like any other; a later end counts as if it had been in time."""
    clock_s = 1000.0

    def sleep(dt_s: float) -> None:
        nonlocal clock_s
        clock_s += dt_s + late_s

    with BusLink(open_bus(VIRTUAL), "virtual") as link:
        with monkeypatch.context() as patched:
            patched.setattr(bus_link, "time", SimpleNamespace(perf_counter=lambda: clock_s, sleep=sleep))
            link.wait(0.5)
            link.wait(0.5)
            assert link.now_s() == pytest.approx(1001.0 + 2 * (late_s - held_up_s))
        assert link.held_up_s == pytest.approx(held_up_s)


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port: int = server.getsockname()[1]
    return port


def test_a_refused_connection(capsys: pytest.CaptureFixture[str]) -> None:
    """The error comes at once, not after python-can's ten seconds of retries."""
    port = free_port()
    with refusing(BusError):
        open_bus(Connection("socketcand", None, None, "127.0.0.1", port))
    assert run(["doctor", "warehouse-scara", "--connect", f"127.0.0.1:{port}"]) == 4
    assert (
        capsys.readouterr().out == f"[FAIL] bus: 127.0.0.1:{port}: Connection refused: is `steptwin serve` running?\n"
    )


def test_an_interface_that_cannot_be_opened() -> None:
    with refusing(BusError):
        open_bus(Connection("socketcan", "no-such-can0", 500_000))


class Failing(can.BusABC):
    """A bus that takes nothing: what a driver raises when its adapter was unplugged."""

    def __init__(self) -> None:
        self.tried = threading.Event()
        super().__init__("nowhere")

    def send(self, *_: object, **__: object) -> None:
        self.tried.set()
        raise BrokenPipeError(32, "Broken pipe")

    def _recv_internal(self, *_: object, **__: object) -> tuple[can.Message | None, bool]:
        return None, False


def test_a_periodic_frame_that_cannot_be_sent(capfd: pytest.CaptureFixture[str]) -> None:
    """Its thread ends without a traceback; whoever uses the bus next is told."""
    bus = Failing()
    with BusLink(bus, "adapter") as link:
        link.network.send_periodic(0x77F, b"\5", 0.001)
        for _ in range(3):
            bus.tried.clear()
            assert bus.tried.wait(TIMEOUT_S)
        with refusing(BusError):
            link.network.send_message(0x80, b"")
    assert capfd.readouterr() == ("", "")


def test_no_thread_outlives_the_link() -> None:
    """Not even one that sleeps until the next heartbeat: one that is left can hold up the end of the program."""
    before = set(threading.enumerate())
    with BusLink(open_bus(VIRTUAL), "virtual") as link:
        for heartbeat in (Heartbeat(link.network), Heartbeat(link.network)):
            heartbeat.start()
            heartbeat.stop()
        Heartbeat(link.network).start()
        assert len(set(threading.enumerate()) - before) > 1
    assert set(threading.enumerate()) == before
