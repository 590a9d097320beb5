"""Sessions in virtual time: the warehouse robot on an embedded board, other programs on the same bus, commands."""

import json
import shlex
from typing import Any

import canopen
import pytest
from canopen.network import PeriodicMessageTask

from steptwin.controller.backend import Kernel
from steptwin.host.cli.app import run
from steptwin.host.client import bus_link
from steptwin.host.operate.session import Session
from steptwin.host.robots import load_robot
from steptwin.host.twin.embedded_board import EmbeddedBoard

ROBOT = load_robot("warehouse-scara")
HOME = list(ROBOT.home)
SX, SZ, L1, TH1, TH2, TH3 = range(6)
HALF_STEPS = [(0.5 + 1 / 16) / joint.transmission.steps_per_unit + 1e-9 for joint in ROBOT.joints]
"""How far a counter may be from where its axis was sent, by the firmware's hysteresis."""


def board_at(joints: list[float], kernel: Kernel) -> EmbeddedBoard:
    return EmbeddedBoard(ROBOT, joints, kernel)


def preset(board: EmbeddedBoard, joints: list[float]) -> Session:
    """A session on a board that was told where it stands, by a host that has left it enabled."""
    session = Session(board, ROBOT)
    with session.in_charge("preset", known=False) as machine:
        machine.preset(session.units(joints))
    return session


class Neighbour(canopen.Network):
    """The link of another program on the same bus; while it waits, time passes for all."""

    def __init__(self, board: EmbeddedBoard, patch: pytest.MonkeyPatch) -> None:
        super().__init__()
        self._board = board
        self._hear_first = board.network.notify
        patch.setattr(board.network, "notify", self._hear)

    def _hear(self, can_id: int, data: bytearray, timestamp: float) -> None:
        self._hear_first(can_id, data, timestamp)
        self.notify(can_id, data, timestamp)

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        self._board.network.send_message(can_id, data, remote)

    def send_periodic(self, can_id: int, data: bytes, period: float, remote: bool = False) -> PeriodicMessageTask:
        return self._board.network.send_periodic(can_id, data, period, remote)

    @property
    def network(self) -> canopen.Network:
        return self

    def now_s(self) -> float:
        return self._board.now_s()

    def wait(self, dt_s: float) -> None:
        self._board.wait(dt_s)


class CommandLine:
    """`steptwin ... --connect` against an embedded board in virtual time."""

    def __init__(self, board: EmbeddedBoard, patch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
        self._capsys = capsys

        class Opened:
            def __init__(self, *_: object) -> None:
                pass

            def __enter__(self) -> Neighbour:
                return Neighbour(board, patch)

            def __exit__(self, *_: object) -> None:
                pass

        patch.setattr(bus_link, "open_bus", lambda _: None)
        patch.setattr(bus_link, "BusLink", Opened)

    def run(self, arguments: str) -> tuple[int, str, str]:
        """Exit code, stdout, stderr."""
        exit_code = run([*shlex.split(arguments), "--connect", "127.0.0.1:29536"])
        out, err = self._capsys.readouterr()
        return exit_code, out, err

    def json(self, arguments: str) -> dict[str, Any]:
        """The document of a command that must succeed."""
        exit_code, out, err = self.run(f"{arguments} --json")
        assert (exit_code, err) == (0, "")
        document: dict[str, Any] = json.loads(out)
        return document
