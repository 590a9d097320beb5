"""`steptwin conform` against a served board, by its EDS."""

import json
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from steptwin.features.conform.conformance import ordered
from steptwin.host.cli.app import run
from steptwin.protocol.exports import render_eds
from tests.end_to_end.served import serving


def test_a_served_board_passes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    junit, eds = tmp_path / "conform.xml", tmp_path / "axis.eds"
    eds.write_text(render_eds(), encoding="utf-8")
    with serving("teaching-scara") as server:
        words = server.connected("conform", "--node", "0x10", "--eds", str(eds), "--enable")
        assert run([*words, "--junit", str(junit), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["counts"]["failed"] == 0
    assert document["counts"]["passed"] >= 55
    assert {each["id"] for each in document["checks"]} == {check.id for check in ordered()}
    assert ET.parse(junit).getroot().get("failures") == "0"
