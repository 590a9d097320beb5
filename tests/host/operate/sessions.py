"""Sessions in virtual time: the warehouse robot on an embedded board, and commands that operate it."""

import json
import shlex
from types import SimpleNamespace
from typing import Any

import pytest

from steptwin.controller.motion.backend import Kernel
from steptwin.host.cli.app import run
from steptwin.host.client.links import bus_link
from steptwin.host.operate.session import Session
from steptwin.host.twin.embedded.embedded_board import EmbeddedBoard
from steptwin.host.twin.machine.machine_options import MachineOptions
from tests.host.client.machines import WAREHOUSE, Neighbour

ROBOT = WAREHOUSE
HOME = list(ROBOT.home)
HALF_STEPS = [(0.5 + 1 / 16) / joint.transmission.steps_per_unit + 1e-9 for joint in ROBOT.joints]
"""Largest distance of each counter from its axis' target, in the joint's unit, by the firmware's hysteresis."""


def board_at(joints: list[float], kernel: Kernel) -> EmbeddedBoard:
    return EmbeddedBoard(ROBOT, kernel, MachineOptions(stand_at=joints))


def preset(board: EmbeddedBoard, joints: list[float]) -> Session:
    """Return a session on an enabled board whose position was declared."""
    session = Session(board, ROBOT)
    with session.charge("preset", needs=()) as charge:
        machine = charge.enable()
        machine.preset(session.units(joints))
    return session


class CommandLine:
    """`steptwin ... --connect` on an embedded board in virtual time."""

    def __init__(self, board: EmbeddedBoard, patch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
        self._capsys = capsys

        class Opened:
            def __init__(self, *_: object) -> None:
                pass

            def __enter__(self) -> Neighbour:
                return Neighbour(board, patch)

            def __exit__(self, *_: object) -> None:
                pass

        # The age of a command and that of a fault are compared: both are of virtual time here.
        patch.setattr("steptwin.host.cli.live.halting.time", SimpleNamespace(monotonic=board.now_s))
        patch.setattr(bus_link, "open_bus", lambda _: None)
        patch.setattr(bus_link, "BusLink", Opened)

    def run(self, arguments: str) -> tuple[int, str, str]:
        """Run a command; return its exit code, stdout and stderr."""
        exit_code = run([*shlex.split(arguments), "--connect", "127.0.0.1:29536"])
        out, err = self._capsys.readouterr()
        return exit_code, out, err

    def json(self, arguments: str) -> dict[str, Any]:
        """Run a command that must succeed; return its JSON document."""
        exit_code, out, err = self.run(f"{arguments} --json")
        assert (exit_code, err) == (0, "")
        document: dict[str, Any] = json.loads(out)
        return document
