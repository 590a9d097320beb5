"""A served board with a control port: the client, the command, and a hostile peer, on one board in real time."""

import errno
import json
import re
import shlex
import socket
from collections.abc import Iterator
from dataclasses import replace

import can
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from steptwin.controller.motion.backend import Kernel
from steptwin.host.cli.app import run
from steptwin.host.client.control_client import ControlClient, SwitchState
from steptwin.host.common.choices import Stuck
from steptwin.host.common.errors import BusError, InputError
from steptwin.host.robots import load_robot
from steptwin.host.robots.board_settings import Input
from steptwin.host.twin.live.served_board import ServedBoard
from tests.emulator.live.live_rig import TIMEOUT_S
from tests.end_to_end.pages import blocks_of, read_page
from tests.messages import refusing

pytestmark = pytest.mark.live

ROBOT = replace(load_robot("lab-scara"), inputs={"box": Input("th4", 2)})
HUNG_UP = (errno.ECONNRESET, errno.EPIPE, errno.ENOTCONN)
"""Errors of a socket whose peer has closed the connection: in reading, in writing, in shutting it down."""


@pytest.fixture(scope="module")
def served(fast_kernel: Kernel) -> Iterator[ServedBoard]:
    with ServedBoard(ROBOT, port=0, control_port=0, kernel=fast_kernel) as served:
        yield served


@pytest.fixture
def client(served: ServedBoard) -> Iterator[ControlClient]:
    with client_of(served) as client:
        yield client


def client_of(served: ServedBoard) -> ControlClient:
    assert served.control
    return ControlClient("127.0.0.1", served.control.port)


def test_each_answer_is_the_state_after_it(client: ControlClient, served: ServedBoard) -> None:
    first = client.state()
    assert (first.robot, first.simulated, first.estop) == ("lab-scara", True, False)
    assert client.emergency_stop(pressed=True).estop
    assert not client.emergency_stop(pressed=False).estop
    assert client.supply(9.5).supply_v == 9.5
    assert client.supply(first.supply_v).supply_v == 24.0
    assert client.temperature(-20).temperature_degc == -20.0
    assert client.temperature(25).temperature_degc == 25.0
    assert client.protect("th2", held=True).protect["th2"].held
    assert not client.protect("th2", held=False).protect["th2"].held
    assert client.set_input("box", on=True).inputs == {"box": True}
    assert client.set_input("box", on=False).inputs == {"box": False}
    assert client.switch("d1", "+", Stuck.CLOSED).switches["d1"]["+"] == SwitchState(closed=True, stuck=True)
    last = client.switch("d1", "+", Stuck.FREE)
    assert last.switches == first.switches
    assert last.simulated_s > first.simulated_s
    assert last.document["bus"]["frames"] == 4
    with refusing(InputError):
        client.supply(-1)
    operations = served.report()["operations"]
    assert len(operations) == 12
    assert {"do": "switch", "joint": "d1", "switch": "+", "stuck": "closed"}.items() <= operations[-2].items()
    assert first.simulated_s <= operations[0]["at_s"] < operations[-1]["at_s"] <= last.simulated_s


def test_programs_on_the_bus_see_it(client: ControlClient, served: ServedBoard) -> None:
    """All nodes say so in an EMCY at the instant of the request, and say later that it is over."""
    with can.Bus("vcan0", interface="socketcand", host="127.0.0.1", port=served.port) as bus:
        bus.send(can.Message(arbitration_id=0x000, data=[1, 0], is_extended_id=False))
        for word in (0x06, 0x07, 0x0F):
            for node in range(0x10, 0x14):
                bus.send(can.Message(arbitration_id=0x200 + node, data=[word, 0, 7], is_extended_id=False))
        while (frame := bus.recv(TIMEOUT_S)) and not (frame.arbitration_id == 0x193 and frame.data[0] & 0x6F == 0x27):
            pass
        client.emergency_stop(pressed=True)
        nodes: set[int] = set()
        while len(nodes) < 4:
            frame = bus.recv(TIMEOUT_S)
            assert frame
            if frame.arbitration_id in range(0x090, 0x094) and frame.data[:2] == b"\x00\x90":
                nodes.add(frame.arbitration_id)
        client.emergency_stop(pressed=False)
    assert served.report()["real_time"]["frames"]["count"] > 4


@pytest.mark.slow
def test_the_command(served: ServedBoard, client: ControlClient, capsys: pytest.CaptureFixture[str]) -> None:
    assert served.control
    address = served.control.address

    def inject(*words: str, robot: str = "lab-scara") -> tuple[int, str, str]:
        code = run(["inject", robot, *words, "--control", address])
        return code, *capsys.readouterr()

    for words, told in {
        ("estop", "on"): "emergency stop: pressed",
        ("estop", "off"): "emergency stop: released",
        ("supply", "9"): "supply: 9.00 V",
        ("supply", "24"): "supply: 24.00 V",
        ("temperature", "-20"): "board: -20.0 degC",
        ("temperature", "25"): "board: 25.0 degC",
        ("protect", "th2", "on"): "Protect of th2: held low",
        ("protect", "th2", "off"): "Protect of th2: free",
        ("input", "box", "on"): "input box: on",
        ("input", "box", "off"): "input box: off",
        ("switch", "d1", "-", "closed"): "switch - of d1: stuck closed",
        ("switch", "d1", "-", "free"): "switch - of d1: open",
        ("switch", "th4", "home", "open"): "switch home of th4: stuck open",
    }.items():
        assert inject(*words) == (0, f"SIMULATED lab-scara: {told}\n", "")
    for done, ends in {
        "slip th2 -4": "",
        "slip th2 4": "",
        "wire th2 step noisy 1000 35": "`wire th2 step whole`",
        "wire th2 step noisy 1000 35 count=9": "9 disturbances or `wire th2 step whole`",
        "wire th2 step whole": "",
        "short-circuit th2 on": "`short-circuit th2 off`",
        "short-circuit th2 off": "",
        "mode th2 8": "`mode th2`",
        "mode th2": "",
        "switch-wire d1 + normally-open": "`switch-wire d1 + whole`",
        "switch-wire d1 + whole": "",
        "bounce d1 + 5": "`bounce d1 + 0`",
        "bounce d1 + 0": "",
        "osc th2 1000": "`osc th2` with the capacitor of before",
        "rogue-node 0x77E 05": "",
        "babble 0x7FF data= 1000 1000000": "1000 s or `bus-ok`",
        "babble 0x7FF data= 1000 0": "",
        "loss records th2": "`bus-ok`",
        "corruption sync rate=0.5": "`bus-ok`",
        "delay sync 0.1": "`bus-ok`",
        "duplicate sync count=1": "strike 1 or `bus-ok`",
        "bus-off th2": "",
        "bus-off host": "",
        "bit-rate 500000": "`bit-rate` with that of the boards, or `bus-ok`",
        "bit-rate 250000": "`bit-rate` with that of the boards, or `bus-ok`",
        "brown-out joint=th3": "`power-up`",
        "brown-out 5": "",
        "watchdog": "",
        "power-up": "",
    }.items():
        lasts = f"; it lasts until {ends}" if ends else ""
        assert inject(*done.split()) == (0, f"SIMULATED lab-scara: {done}: done{lasts}\n", "")
    assert inject("osc", "th2", "330")[0] == 0
    assert client.state().document["bus"]["faults"] >= 4
    assert ", the host at 250 kbit/s instead of 1000\n" in inject("state")[1]
    assert inject("bus-ok") == (0, "SIMULATED lab-scara: bus-ok: done\n", "")
    assert client.state().document["bus"]["faults"] == 0
    assert client.state().host_bitrate == 1_000_000
    code, out, err = inject("state")
    assert (code, err) == (0, "")
    assert re.search(r"(?m)^SIMULATED lab-scara: .* bus load .*\nemergency stop: released\nsupply: 24.00 V\n", out)
    assert "\ninputs: box off\nticks late, ms (p50 p99 max): " in out
    assert [line.split() for line in out.splitlines()][-1] == ["th4", "free", "open", "open", "stuck", "open"]
    code, out, err = inject("switch", "th4", "home", "free", "--json")
    assert (code, err) == (0, "")
    assert json.loads(out)["switches"]["th4"]["home"] == {"closed": False, "stuck": False}
    for wrong, told in {
        ("estpo", "on"): "WHAT 'estpo' is unknown: did you mean estop?",
        ("estop",): "after estop: on|off, not nothing",
        ("supply", "nine"): "supply_v: 'nine' is not a number",
        ("supply", "656"): "supply_v: 656.0 V is outside 0..655.35 V; the nearest is 655.35 V",
        ("switch", "d1", "+", "shut"): "stuck: 'shut' is not one of closed, open, free",
        ("switch", "d1", "home", "open"): "switch of d1 'home' is unknown: there are -, +",
        ("protect", "th5", "on"): "joint 'th5' is unknown: did you mean th4 or th3 or th2?",
        ("slip", "th2", "1.5"): "full_steps: '1.5' is not a whole number",
        ("payload", "1"): "payload_kg: 1 kg: only motors that turn with the board feel it: run --motors=loop,"
        " serve --machine motors, or MotorOptions in a test",
        ("loss", "sync", "receiver=2"): "receiver: 2 is not from 0 to 1, the number of boards",
        (
            "slip",
            "th2",
            "6",
        ): "full_steps: 6 is not a multiple of 4: a motor slips by whole electrical cycles; the nearest is 8",
        ("wire", "th2", "clk", "low"): "wire: 'clk' is not one of step, dir, enable",
        ("wire", "th2", "step", "noisy"): "rate_hz: is missing: a noisy wire has rate_hz and width_us",
        ("brown-out", "0"): "for_ms: 0 is below 1",
        ("loss", "recrods"): "frames: 'recrods' is unknown: did you mean records?",
        ("delay", "sync", "0"): "by_s: 0.000000 s is outside 1e-06..86400 s; the nearest is 1e-06 s",
        ("babble", "0", "data=", "100", "1000000000"): "count: 1000000000 is not a whole number up to 1000000",
        ("babble", "0", "data=", "46", "1"): "period_us: 46 is below 47",
        ("babble", "0", "data=", "10000001", "1"): "period_us: 10000001 is not a whole number up to 10000000",
        ("bus-off", "th5"): "joint 'th5' is unknown: did you mean th4 or th3 or th2?",
    }.items():
        assert inject(*wrong) == (2, "", f"steptwin: {told}\n")
    told = f"steptwin: {address}: the board is one of lab-scara, not of hybrid-arm\n"
    assert inject("estop", "on", robot="hybrid-arm") == (2, "", told)
    assert not client.state().estop


@pytest.mark.slow
def test_the_page_shows_what_happens(served: ServedBoard, capsys: pytest.CaptureFixture[str]) -> None:
    """Each command of docs/live.md for this robot works, and each request gets the answer that it shows."""
    assert served.control
    (_, shell), (_, dialogue) = blocks_of(read_page("docs/live.md").partition("## The control port\n")[2])
    commands = [shlex.split(line, comments=True) for line in shell.splitlines() if "inject lab-scara" in line]
    assert len(commands) == 14
    for _, *words, _ in commands:
        assert run([*words, served.control.address]) == 0
    assert len(capsys.readouterr().out.splitlines()) > len(commands)
    for undo in (
        "estop off",
        "temperature 25",
        "protect th2 off",
        "switch d1 + free",
        "wire th2 step whole",
        "wire th2 dir whole",
        "bounce d1 + 0",
        "mode th2",
        "slip th2 -4",
        "bus-ok",
    ):
        assert run(["inject", "lab-scara", *undo.split(), "--control", served.control.address]) == 0
    with socket.create_connection(("127.0.0.1", served.control.port), timeout=TIMEOUT_S) as program:
        said = program.makefile("r")
        lines = dialogue.splitlines()
        for request, shown in zip(lines[::2], lines[1::2], strict=True):
            program.sendall(f"{request}\n".encode())
            assert said.readline().startswith(shown.removesuffix(" ...}"))
        said.close()
    assert run(["inject", "lab-scara", "supply", "24", "--control", served.control.address]) == 0


@pytest.mark.parametrize(
    ("control", "code", "told"),
    [
        ([], 2, "which board? --control HOST:PORT, as `steptwin serve --control-port` prints it"),
        (["--control", "127.0.0.1"], 2, "--control 127.0.0.1: is not of the form HOST:PORT, such as 127.0.0.1:29537"),
        (["--control", "::1"], 2, "--control ::1: put an IPv6 address in brackets, such as [::1]:29537"),
        (["--control", "127.0.0.1:1"], 4, "127.0.0.1:1: Connection refused"),
    ],
)
def test_no_such_port(control: list[str], code: int, told: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["inject", "lab-scara", "state", *control]) == code
    assert capsys.readouterr() == ("", f"steptwin: {told}\n")


@pytest.mark.parametrize(
    "answer",
    [
        b"",
        b"< hi >",
        b"[]\n",
        b"{}\n",
        b'{"error": 1}\n',
        None,
    ],
)
def test_another_server_than_a_boards(
    answer: bytes | None, served: ServedBoard, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The client says what is wrong, and connects anew when it is asked again."""
    monkeypatch.setattr("steptwin.host.client.control_client.ANSWER_S", 0.1)
    monkeypatch.setattr("steptwin.host.client.control_client.SILENT", "accepts but does not answer within 0.1 s")
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
        client = ControlClient("127.0.0.1", port)
        client._socket = socket.create_connection(("127.0.0.1", port))  # noqa: SLF001
        peer, _ = listener.accept()
        with peer:
            if answer is None:
                peer.shutdown(socket.SHUT_WR)
            else:
                peer.sendall(answer)
            with refusing(BusError):
                client.state()
    assert served.control
    client._port = served.control.port  # noqa: SLF001
    monkeypatch.undo()
    assert client.state().robot == "lab-scara"
    client.close()


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(
        st.one_of(
            st.binary(max_size=60),
            st.sampled_from([b'{"do": "state"}\n', b'{"do": "supply", "supply_v": 1e5}\n', b"\n", b"{" * 2000, b"[\n"]),
        ),
        max_size=6,
    )
)
def test_no_bytes_break_it(served: ServedBoard, client: ControlClient, pieces: list[bytes]) -> None:
    """Whatever is sent, each answer is one JSON object in a line, and the machine stays as it is."""
    assert served.control
    before = client.state()
    with socket.create_connection(("127.0.0.1", served.control.port), timeout=TIMEOUT_S) as rude:
        try:
            for piece in pieces:
                rude.sendall(piece)
            rude.shutdown(socket.SHUT_WR)
            with rude.makefile("rb") as answers:
                for line in answers:
                    assert ("error" in json.loads(line)) != ("estop" in json.loads(line))
        except OSError as error:  # it has hung up, because of what was junk, before all was said
            if error.errno not in HUNG_UP:
                raise
    after = client.state()
    for key in ("estop", "supply_v", "temperature_degc", "protect", "inputs", "switches"):
        assert after.document[key] == before.document[key]


def test_the_report_counts(fast_kernel: Kernel) -> None:
    with ServedBoard(ROBOT, port=0, control_port=0, kernel=fast_kernel, axes_per_board=(2, 2)) as served:
        with client_of(served) as client:
            served.set_input("box", on=True)
            assert client.state().inputs["box"]
            with pytest.raises(InputError):
                client.set_input("boxes", on=True)
        assert served.control
        with socket.create_connection(("127.0.0.1", served.control.port), timeout=TIMEOUT_S) as junk:
            junk.sendall(b"GET / HTTP/1.1\r\n")
            assert json.loads(junk.makefile("rb").readline())
    control = served.report()["control"]
    figures = {"served": 2, "disconnected": {"junk": 1}, "requests": 2, "refused": 1}
    assert control == {"address": served.control.address} | figures
    assert [operation["do"] for operation in served.report()["operations"]] == ["input"]


def test_there_is_none_unless_asked_for(fast_kernel: Kernel) -> None:
    with ServedBoard(ROBOT, port=0, kernel=fast_kernel) as served:
        assert served.control is None
    assert "control" not in served.report()


def test_a_port_that_cannot_be(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert run(["serve", "lab-scara", "--port", "0", "--control-port", str(port)]) == 4
        told = f"steptwin: 127.0.0.1:{port} is in use; --control-port 0 takes a free one\n"
        assert capsys.readouterr() == ("", told)
    assert run(["serve", "lab-scara", "--port", "0", "--control-port", "80"]) == 2
    assert capsys.readouterr() == ("", "steptwin: --control-port 80: is neither 0 nor from 1024 to 65535\n")
