"""The preload of docs/examples/canshim: unmodified programs for SocketCAN on a served board."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from steptwin.host.cli.app import run
from tests.emulator.live.live_rig import TIMEOUT_S, await_true
from tests.end_to_end.command_line import PROGRAM
from tests.end_to_end.pages import ROOT
from tests.end_to_end.served import Server, in_real_time, serving
from tests.live import canshim_calls

SOURCES = ROOT / "docs" / "examples" / "canshim"
GCC = shutil.which("gcc")
pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="SocketCAN is Linux'"),
    pytest.mark.skipif(GCC is None, reason="no gcc is installed"),
]
needs_can_utils = pytest.mark.skipif(shutil.which("candump") is None, reason="can-utils are not installed")


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The library, compiled without a warning as the page says."""
    path = tmp_path_factory.mktemp("canshim") / "canshim.so"
    strict = ["-std=gnu11", "-Wall", "-Wextra", "-Werror"]
    sources = [str(SOURCES / name) for name in ("canshim.c", "pump.c")]
    subprocess.run(
        [GCC or "", *strict, "-shared", "-fPIC", "-O2", "-o", str(path), *sources, "-ldl", "-lpthread"],
        check=True,
        timeout=60,
    )
    return path


@contextmanager
def program(server: Server, library: Path, *words: str) -> Iterator[subprocess.Popen[str]]:
    """Run a program with the library while the block runs."""
    variables = {"STEPTWIN_CAN": f"127.0.0.1:{server.port}", "LD_PRELOAD": str(library)}
    with subprocess.Popen(
        words, env=os.environ | variables, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def said(process: subprocess.Popen[str]) -> list[str]:
    """Return what a program has printed, when it has ended well."""
    out, err = process.communicate(timeout=TIMEOUT_S)
    assert (process.returncode, err) == (0, "")
    return out.splitlines()


def done(server: Server, library: Path, *words: str) -> list[str]:
    """Run a program to its end, which must be good; return what it prints."""
    with program(server, library, *words) as process:
        return said(process)


@needs_can_utils
@in_real_time
def test_the_programs_of_can_utils(library: Path, tmp_path: Path) -> None:
    """Each frame that one program sends reaches the others and the log, in the order of the bus."""
    log = tmp_path / "run.log"
    with serving("lab-scara", "--log", str(log)) as server:
        with program(server, library, "candump", "-L", "-n", "503", "can0,123:7FF,590:7FF,124:7FF") as candump:
            clients_of(server, 1)
            done(server, library, "cangen", "can0", "-n", "500", "-g", "0", "-I", "123", "-L", "8", "-D", "i")
            done(server, library, "cansend", "vcan0", "610#4000100000000000")
            played = tmp_path / "played.log"
            played.write_text("(1.000000) can0 124#01\n(1.010000) can0 124#02\n", encoding="ascii")
            done(server, library, "canplayer", "-I", str(played))
            lines = said(candump)
        with program(server, library, "candump", "can0") as left:
            clients_of(server, 1)
            assert server.end(signal.SIGTERM)[0] == 0
            assert left.wait(TIMEOUT_S) == 1
            assert left.stderr
            assert "Network is down" in left.stderr.read()
    dumped = [line.split()[2] for line in lines]
    generated = [each for each in dumped if each.startswith("123#")]
    assert generated == [f"123#{number.to_bytes(8, 'little').hex().upper()}" for number in range(500)]
    assert sorted(set(dumped) - set(generated)) == ["124#01", "124#02", "590#4300100092010400"]
    logged = [line.split()[2] for line in log.read_text(encoding="ascii").splitlines()]
    assert [each for each in logged if each[:3] in ("123", "124", "590")] == dumped


def clients_of(server: Server, count: int) -> None:
    """Wait until so many clients are connected."""
    port = f":{server.port:04X}"

    def connected() -> bool:
        rows = [line.split() for line in Path("/proc/net/tcp").read_text(encoding="ascii").splitlines()[1:]]
        return sum(row[1].endswith(port) and row[3] == "01" for row in rows) >= count

    await_true(connected, f"{count} clients are connected")


@in_real_time
def test_every_call_that_a_program_may_make(library: Path) -> None:
    with serving("lab-scara") as server:
        (line,) = done(server, library, sys.executable, canshim_calls.__file__)
    found = json.loads(line)
    answer = canshim_calls.packed(0x590, bytes.fromhex("4300100092010400")).hex()
    other = canshim_calls.packed(0x590, bytes.fromhex("4F01100000000000")).hex()
    assert found["names"] == ["can0", "vcan0"]
    stamps = found["stamps"]
    assert (stamps["answer"], stamps["flags"], stamps["from"]) == (answer, 0, "can0")
    assert stamps["stamp_us"] > 1_600_000_000_000_000
    assert found["own"] == [0x800 | 0x4, 0]  # MSG_CONFIRM | MSG_DONTROUTE, then the answer
    assert found["filters"] == [[0x591, 0x610, 0x611], [0x591], [], [0x590]]
    assert found["fork"] == [other, answer]
    assert found["refusals"] == {
        "unbound": "ENXIO",
        "no such device": "ENODEV",
        "FD": "ENOPROTOOPT",
        "FD off": "",
        "BCM": "EPROTONOSUPPORT",
        "short": "EINVAL",
        "nine bytes": "EINVAL",
        "nothing there": "EAGAIN",
    }
    assert found["left open"] <= 0


def test_without_a_server_it_says_so(library: Path) -> None:
    code = "import socket; socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW).bind(('can0',))"
    variables = {"STEPTWIN_CAN": "127.0.0.1:1", "LD_PRELOAD": str(library)}
    ended = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | variables, capture_output=True, text=True, check=False
    )
    assert ended.stderr.splitlines()[0] == "canshim: STEPTWIN_CAN=127.0.0.1:1: no socketcand server answers"
    assert ended.stderr.splitlines()[-1].endswith("Network is down")


def served(*options: str) -> subprocess.CompletedProcess[str]:
    """Run a served board until its program ends."""
    return subprocess.run(
        [*PROGRAM, "serve", "lab-scara", "--port", "0", *options],
        capture_output=True,
        text=True,
        check=False,
        timeout=12 * TIMEOUT_S,
    )


def test_exec_runs_a_program_beside_the_board(library: Path) -> None:
    code = (
        "import os, socket;"
        "can = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW); can.bind(('can0',));"
        "can.send(bytes.fromhex('1006000008000000') + bytes.fromhex('4000100000000000'));"
        "print(can.recv(16).hex(), os.environ['STEPTWIN_CAN'], os.environ['STEPTWIN_CONTROL'], flush=True)"
    )
    ended = served("--control-port", "0", "--preload", str(library), "--exec", f'"{sys.executable}" -c "{code}"')
    assert ended.returncode == 0, ended.stderr
    port = re.search(r"port=(\d+)", ended.stdout)
    assert port
    assert f"90050000080000004300100092010400 127.0.0.1:{port[1]} 127.0.0.1:" in ended.stdout
    assert "bus: " in ended.stdout


@pytest.mark.parametrize(
    ("code", "exit_code"), [("raise SystemExit(7)", 7), ("import os; os.kill(os.getpid(), 9)", 137)]
)
def test_the_exit_code_is_the_programs(code: str, exit_code: int) -> None:
    ended = served("--json", "--exec", f"'{sys.executable}' -c '{code}'")
    assert ended.returncode == exit_code
    assert json.loads(ended.stdout)["robot"] == "lab-scara"


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (("--exec", "no-such-program"), "--exec no-such-program: there is no program 'no-such-program'"),
        (("--exec", " "), "--exec  : names no program, as in --exec 'candump can0'"),
        (("--exec", "'a"), "--exec 'a: no closing quotation"),
        (("--preload", "x.so"), "--preload: is for the program of --exec CMD"),
        (("--exec", "true", "--preload", "x.so"), "--preload x.so: is no file"),
        (("--exec", "true", "--preload", "x.so", "-i", "virtual"), "--preload: with -i there is no socketcand server"),
    ],
)
def test_what_is_wrong_is_told(options: tuple[str, ...], line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["serve", "lab-scara", "--port", "0", *options]) == 2
    assert capsys.readouterr().err.startswith(f"steptwin: {' '.join(line.split())}")
