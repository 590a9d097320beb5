"""`steptwin conform`: what is refused, JUnit, and a node of another library on a bus in real time."""

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

import can
import canopen
import pytest

from steptwin.features.conform.check import Checked, CheckResult, Need
from steptwin.features.conform.command import junit_text
from steptwin.features.conform.conformance import conformance, ordered
from steptwin.features.conform.node import Description, NodeUnderTest
from steptwin.host.client.links.bus_link import BusLink
from steptwin.protocol.exports import render_eds
from tests.end_to_end.command_line import refusal

LOCAL: int = 0x05


@pytest.fixture
def eds(tmp_path: Path) -> str:
    file = tmp_path / "axis.eds"
    file.write_text(render_eds(), encoding="utf-8")
    return str(file)


@pytest.mark.parametrize(
    "words",
    [
        [],
        ["--node", "0x80", "--connect", "127.0.0.1"],
        ["--node", "0", "--connect", "127.0.0.1"],
        ["--node", "axis", "--connect", "127.0.0.1"],
        ["--node", "3"],
        ["--node", "3", "--connect", "127.0.0.1", "--only", "S99"],
        ["--node", "3", "--connect", "127.0.0.1", "--eds", "nowhere.eds"],
        ["--node", "3", "--connect", "127.0.0.1", "--eds", "{no_eds}"],
        ["--node", "3", "--connect", "127.0.0.1", "--junit", "{no_eds}"],
    ],
    ids=["nothing", "too high", "zero", "no number", "no bus", "unknown check", "no file", "no EDS", "kept"],
)
def test_what_is_refused(words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    no_eds = tmp_path / "no.eds"
    no_eds.write_text("[FileInfo]\n", encoding="utf-8")
    refusal(capsys, "conform", *(word.format(no_eds=no_eds) for word in words))


def test_junit_tells_failures_and_skipped_checks_and_lets_what_differs_pass() -> None:
    check = ordered()[0]
    done = [Checked(check, result, "because", ()) for result in CheckResult]
    suite = ET.fromstring(junit_text(done))
    assert {key: suite.get(key) for key in ("tests", "failures", "skipped")} == {
        "tests": "4",
        "failures": "1",
        "skipped": "1",
    }
    children = [[child.tag for child in case] for case in suite]
    assert children == [["system-out"], ["failure"], ["system-out"], ["skipped"]]


@pytest.fixture
def local_node(eds: str) -> Iterator[canopen.LocalNode]:
    """A node of the canopen library on a bus in this process."""
    network = canopen.Network(can.Bus("conform", interface="virtual"))
    network.connect()
    node = canopen.LocalNode(LOCAL, eds)
    network.add_node(node)
    node.nmt.state = "PRE-OPERATIONAL"
    yield node
    network.disconnect()


@pytest.mark.live
@pytest.mark.usefixtures("local_node")
def test_a_node_of_another_library_is_checked(eds: str) -> None:
    """It refuses by SDO as CiA 301 says, but answers when it is stopped, and stores whatever a master writes."""
    right, wrong = ["D1", "D4", "S6", "S8", "N1"], ["S14", "P4", "P8", "R1"]
    with BusLink(can.Bus("conform", interface="virtual"), "virtual conform") as link:
        node = NodeUnderTest(link, LOCAL, Description.read(eds, LOCAL))
        found = {each.check.id: each.result for each in conformance(node, [Need.EDS], right + wrong)}
    assert found == dict.fromkeys(right, CheckResult.PASSED) | dict.fromkeys(wrong, CheckResult.FAILED)
