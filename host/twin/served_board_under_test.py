"""A served board for tests: programs of any language drive it in real time, and the test asks what it has done."""

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from steptwin.controller.motion.backend import Kernel
from steptwin.emulator.faults.operations import Operation
from steptwin.host.common.listening import LOOPBACK
from steptwin.host.record.bus_log import read_frames
from steptwin.host.record.folder import BUS_LOG, read_edges
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.boards import Standing
from steptwin.host.twin.served_board import ServedBoard
from steptwin.host.verify import Evidence
from steptwin.protocol.frame import Frame


class ServedBoardUnderTest:
    """A robot's board in real time behind a socketcand server of its own, such as the fixture `steptwin_served_board`.

    It runs in a thread of this process from its construction until `end`, and records into a folder.

    Attributes:
        robot: the machine.
        host: address of the server: this machine's loopback.
        port: TCP port of the server.
        folder: the folder of the recording (docs/run-folder.md), complete after `end`.
        log: the bus log in it, which grows twice a second until then.
    """

    def __init__(
        self,
        robot: Robot,
        folder: Path,
        *,
        stand_at: Standing | None = None,
        driver_profile: str | None = None,
        dip_microsteps: Mapping[str, int] | None = None,
        kernel: Kernel | None = None,
    ) -> None:
        """Serve a board at a free port.

        Args:
            robot: the machine.
            folder: receives the recording.
            stand_at: joint positions at which it stands, mm and degrees: all, or some by name; else the robot's home.
            driver_profile: name of the drivers that the board has instead of those in the robot's file.
            dip_microsteps: microsteps to which the switches of modules are set instead of the file's, by joint.
            kernel: form of the firmware's kernel; by default the fastest one that is installed.

        Raises:
            InputError: a joint or the drivers do not exist, or the drivers cannot be set as the robot needs them.
            BusError: no port is free.
        """
        self.robot = robot
        self.folder = folder
        self.log = folder / BUS_LOG
        self.host = LOOPBACK
        self._served = ServedBoard(
            robot,
            stand_at=stand_at,
            port=0,
            driver_profile=driver_profile,
            dip_microsteps=dip_microsteps,
            kernel=kernel,
            out=folder,
        )
        self.port = self._served.port
        self._served.__enter__()
        self._running = True

    def operate(self, operation: Operation) -> None:
        """Do an operation on the machine, such as EmergencyStop(pressed=True)."""
        self._served.operate(operation)

    def set_input(self, name: str, *, on: bool) -> None:
        """Set a digital input of the machine; raise InputError for an unknown name."""
        self._served.set_input(name, on=on)

    def end(self) -> dict[str, Any]:
        """End the board, complete its folder, and return its report (docs/live.md); again, it returns the same.

        Raises:
            RecordingError: a file could not be written.
        """
        if self._running:
            self._running = False
            self._served.__exit__(None, None, None)
        return self._served.report()

    def copy(self, folder: Path) -> None:
        """End the board, and copy its folder to another place."""
        self.end()
        shutil.copytree(self.folder, folder, dirs_exist_ok=True)

    def joints(self) -> dict[str, float]:
        """End the board; return each joint's position by its driver's steps, in mm or degrees."""
        joints = self.end()["joints"]
        return dict(zip(joints["names"], joints["end"], strict=True))

    def evidence(self) -> Evidence:
        """End the board; return every edge at its drivers."""
        self.end()
        return read_edges(self.folder)

    def bus_log(self) -> list[tuple[int, Frame]]:
        """End the board; return every frame with the instant, in counts since power-up, at which it became valid."""
        self.end()
        return list(read_frames(self.log))
