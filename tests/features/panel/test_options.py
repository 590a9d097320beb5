"""`serve --panel`: whether a panel is wanted, and the command by which it is opened."""

import pytest

pytest.importorskip("nicegui", reason="the extra `panel` is not installed")

from steptwin.features.panel.options import PanelOptions
from steptwin.host.cli.live.served_programs import ServedPlace

LAB = ServedPlace(["lab-scara"], ["--connect", "127.0.0.1:29536"], None)


def test_a_panel_is_wanted_by_either_option() -> None:
    assert [PanelOptions(panel=panel, panel_port=port).wanted for panel, port in ((False, None), (True, None))] == [
        False,
        True,
    ]
    assert PanelOptions(panel_port=0).wanted


def test_the_command_names_the_board_the_page_and_the_control_port() -> None:
    assert PanelOptions().command(LAB) == ["panel", "lab-scara", "--connect", "127.0.0.1:29536"]
    own = ServedPlace(["--robot-file", "a.toml"], ["-i", "socketcan", "-c", "can0"], "127.0.0.1:4000")
    assert PanelOptions(panel_port=8091).command(own) == [
        *("panel", "--robot-file", "a.toml", "-i", "socketcan", "-c", "can0"),
        *("--port", "8091", "--control", "127.0.0.1:4000"),
    ]
