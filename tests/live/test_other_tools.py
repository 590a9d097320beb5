"""Unmodified programs of other projects on a served board and on recorded logs, as docs/masters.md shows."""

import re
import shlex
import shutil
import subprocess
import sysconfig
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import canopen
import pytest
from canopen.profiles.p402 import BaseNode402

from steptwin.host.record.folder import BUS_LOG
from steptwin.protocol.cia402 import ErrorCode, Status
from tests.emulator.live.live_rig import TIMEOUT_S, await_true
from tests.end_to_end.command_line import PROGRAM
from tests.end_to_end.pages import blocks_of, read_page
from tests.end_to_end.served import serving
from tests.end_to_end.terminal import Terminal

PAGE = read_page("docs/masters.md").partition("\n## Other people's tools\n")[2].partition("\n## ")[0]
PORT_SHOWN = "29536"
ROBOT = "teaching-scara"
NODE = 0x10
TARGET_STEPS = 100
STEP = 1024
"""Wire units in a step at 16 microsteps."""
TARGET_DEG = 2.8125
"""100 steps of 360 / (200 * 16 * 4) deg."""
STATUS_SHOWN = "37 06 01 00 90 01 00"
"""TPDO1 at the target: statusword 0x0637, mode 1, position 102 400 units, each with its lowest byte first."""
TSHARK = shutil.which("tshark")


class Served(NamedTuple):
    """A served board with a folder for the programs."""

    port: str
    folder: Path


def shown(start: str) -> list[str]:
    """Return the words of the page's only command that begins with this text."""
    lines = [line for language, block in blocks_of(PAGE) if language == "sh" for line in block.splitlines()]
    (line,) = (line for line in lines if line.startswith(start))
    return shlex.split(line)


def program(name: str) -> str:
    """Return the path of a program that is installed beside the interpreter."""
    return str(Path(sysconfig.get_path("scripts")) / name)


def started(served: Served, words: list[str], **variables: str) -> Terminal:
    """Start a program on the served board, with these variables in its environment."""
    name, *arguments = [word.replace(PORT_SHOWN, served.port) for word in words]
    return Terminal([program(name), *arguments], served.folder, **variables)


def done(words: list[str], folder: Path, log: str = "") -> subprocess.CompletedProcess[str]:
    """Run a program in the folder, with the log on its standard input, until it ends."""
    name, *arguments = words
    return subprocess.run(
        [program(name), *arguments], cwd=folder, input=log, capture_output=True, text=True, check=False
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make a folder with the output of `steptwin eds` and `steptwin dbc`."""
    folder = tmp_path_factory.mktemp("tools")
    for words in (shown("steptwin eds"), shown("steptwin dbc")):
        with (folder / words[-1]).open("w", encoding="utf-8") as file:
            subprocess.run([*PROGRAM, *words[1 : words.index(">")]], stdout=file, check=True)
    return folder


@pytest.fixture(scope="module")
def served(folder: Path) -> Iterator[Served]:
    with serving(ROBOT) as server:
        yield Served(str(server.port), folder)


@pytest.fixture(scope="module")
def node(served: Served) -> Iterator[BaseNode402]:
    """Move an axis to a target with the canopen library's own CiA 402 node, from this process."""
    with canopen.Network() as network:
        network.connect(interface="socketcand", channel="vcan0", host="127.0.0.1", port=int(served.port))
        node = BaseNode402(NODE, str(served.folder / "axis.eds"))  # type: ignore[no-untyped-call]
        node.sdo.RESPONSE_TIMEOUT = TIMEOUT_S
        node.TIMEOUT_SWITCH_OP_MODE = node.TIMEOUT_SWITCH_STATE_FINAL = TIMEOUT_S
        network.add_node(node)
        node.nmt.state = "PRE-OPERATIONAL"
        node.setup_402_state_machine()  # type: ignore[no-untyped-call]
        node.nmt.state = "OPERATIONAL"
        for state in ("READY TO SWITCH ON", "SWITCHED ON", "OPERATION ENABLED"):
            node.state = state
        node.op_mode = "PROFILED POSITION"
        node.sdo[0x607A].raw = TARGET_STEPS * STEP
        node.controlword = 0x1F
        await_true(lambda: bool(node.sdo[0x6041].raw & Status.SET_POINT_ACKNOWLEDGED), "the set-point is taken")
        node.controlword = 0x0F
        await_true(lambda: node.sdo[0x6064].raw == TARGET_STEPS * STEP, "the axis is there")
        await_true(lambda: node.statusword == 0x0637, "a TPDO says that it stands there")
        yield node


# --- on a live board


def test_canopen(node: BaseNode402) -> None:
    assert node.sdo[0x6064].raw == TARGET_STEPS * STEP
    assert node.sdo[0x2F00][1].raw == TARGET_STEPS  # and the driver has counted that
    assert "SIMULATED" in node.sdo[0x1008].raw


def recorded(node: BaseNode402, log: Path) -> bool:
    """Make some traffic; return whether the log contains a TPDO, and so everything before it."""
    assert "SIMULATED" in node.sdo[0x1008].raw
    return log.exists() and " 190#" in log.read_text()


def test_can_logger_and_cantools_decode(served: Served, node: BaseNode402) -> None:
    log = served.folder / "can.log"
    with started(served, shown("can_logger")) as logger:
        logger.await_text("Connected to SocketCanDaemonBus")
        await_true(lambda: recorded(node, log), "can_logger has written a page with SDOs and a TPDO")
        logger.interrupt()
    text = log.read_text()
    assert re.search(r" vcan0 610#4008100000000000 R$", text, flags=re.MULTILINE)
    words = shown("cantools decode")
    decoded = done([*words[: words.index("<")], "--single-line"], served.folder, text)
    assert decoded.returncode == 0, decoded.stderr
    assert re.search(
        r":: th1_SDO_Request\(Command: 64, Index: 4104, SubIndex: 0, Data: 0\)$", decoded.stdout, re.MULTILINE
    )
    positions = re.findall(r":: th1_TPDO1_Status\(.*PositionActualValue: (\S+) deg\)$", decoded.stdout, re.MULTILINE)
    assert positions
    assert [float(text) for text in positions] == pytest.approx([TARGET_DEG] * len(positions))


@pytest.mark.usefixtures("node")
def test_can_viewer(served: Served) -> None:
    with started(served, shown("can_viewer")) as viewer:
        viewer.await_text("0x190")
        viewer.await_text(STATUS_SHOWN)
        viewer.type("q")
        assert viewer.await_exit() == 0


@pytest.mark.usefixtures("node")
@pytest.mark.parametrize("configured", [False, True], ids=["options", "canrc"])
def test_cantools_monitor(served: Served, tmp_path: Path, *, configured: bool) -> None:
    """Options or python-can's configuration file name the bus; one message only, so that its lines stay in place."""
    words = shown("cantools monitor")
    if configured:
        words = words[: words.index("-i")]
        ((_, canrc),) = [block for block in blocks_of(PAGE) if block[0] == "ini"]
        (tmp_path / ".canrc").write_text(canrc.replace(PORT_SHOWN, served.port), encoding="utf-8")
    with started(served, [*words, "--filter-regex", "th1_TPDO1"], HOME=str(tmp_path)) as monitor:
        monitor.await_text("th1_TPDO1_Status(")
        monitor.await_text(" deg")
        position = re.search(r"PositionActualValue: (\S+) deg", monitor.written)
        assert position, monitor.written
        assert float(position[1]) == pytest.approx(TARGET_DEG)
        monitor.type("q")
        assert monitor.await_exit() == 0


# --- on recorded logs


def lens(run_folder: Path, folder: Path) -> subprocess.CompletedProcess[str]:
    words = [word.replace("run.log", str(run_folder / BUS_LOG)) for word in shown("canopen-lens")]
    return done([*words, "--lang", "en", "--no-color"], folder)


def test_canopen_lens_finds_nothing_wrong(carry_run: Path, folder: Path) -> None:
    judged = lens(carry_run, folder)
    assert (judged.returncode, judged.stderr) == (0, "")
    assert "No problems found" in judged.stdout
    assert "Node 16, Node 17, Node 18, Node 19" in judged.stdout


def test_canopen_lens_finds_a_fault(cut_run: Path, folder: Path) -> None:
    judged = lens(cut_run, folder)
    assert judged.returncode == 1
    assert "Needs attention" in judged.stdout


@pytest.mark.skipif(TSHARK is None, reason="tshark is not installed (apt install tshark)")
@pytest.mark.parametrize("suffix", [".log", ".blf"])
def test_tshark(suffix: str, cut_run: Path, folder: Path) -> None:
    """Its CANopen dissector reads every frame of a run (all SDO transfers are expedited), also after a conversion."""
    log = cut_run / BUS_LOG
    given = log if suffix == ".log" else folder / "can.blf"
    if given != log:
        converted = done([word.replace("can.log", str(log)) for word in shown("can_logconvert")], folder)
        assert converted.returncode == 0, converted.stderr
    _, *arguments = [word.replace("run.log", str(given)) for word in shown("tshark")]
    fields = ("function_code", "node_id", "sdo.main_idx", "em.err_code")
    wanted = [word for field in fields for word in ("-e", f"canopen.{field}")]
    shown_by_it = subprocess.run(
        [str(TSHARK), *arguments, "-T", "fields", *wanted], cwd=folder, capture_output=True, text=True, check=True
    )
    rows = [tuple(int(text or "0", 16) for text in line.split("\t")) for line in shown_by_it.stdout.splitlines()]
    assert rows == [dissected(line) for line in log.read_text().splitlines()]
    assert {code for *_, code in rows} == {0, ErrorCode.PVT_UNDERRUN, ErrorCode.GROUP_STOPPED}


def dissected(line: str) -> tuple[int, int, int, int]:
    """Return function code, node id, index and error code of a line of a log, as CiA 301 defines them."""
    identifier, data_hex = line.rsplit(maxsplit=1)[-1].split("#")
    cob_id, data = int(identifier, 16), bytes.fromhex(data_hex)
    function_code, node_id = cob_id >> 7, cob_id & 0x7F
    index = int.from_bytes(data[1:3], "little") if function_code in (0xB, 0xC) else 0
    error_code = int.from_bytes(data[:2], "little") if function_code == 0x1 and node_id else 0
    return function_code, node_id, index, error_code


# --- the data sheet


def test_eds_validate(folder: Path) -> None:
    words = shown("eds-validate")
    judged = done(words, folder)
    assert (judged.returncode, judged.stdout, judged.stderr) == (0, "", "")
    sheet = (folder / "axis.eds").read_text()
    (folder / "worse.eds").write_text(sheet.replace("DefaultValue=0x60400010", "DefaultValue=0x6040"))
    judged = done([words[0], "worse.eds"], folder)
    assert judged.returncode == 1
    assert "mapping value" in judged.stderr
