"""How a machine stood when its boards were switched on: what a replay must know beside the frames on the bus."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from steptwin.emulator.operations import Operation
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.errors import InputError
from steptwin.host.common.tables import Table
from steptwin.host.record.folder import REPORT, StoredReport, check_axes, read_evidence, read_report
from steptwin.host.record.folder.layout import EDGES, SHELF
from steptwin.host.record.folder.shelf_file import read_shelf
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.control.operations import read_request
from steptwin.host.verify import Evidence
from steptwin.protocol.timer import COUNTS_PER_SECOND, COUNTS_PER_US


@dataclass(frozen=True, slots=True)
class PowerUp:
    """A machine at power-up, and what happened to it beside the bus.

    Attributes:
        joints: positions at which it stands, mm and degrees.
        axes_per_board: number of axes on each board, in the order of the joints.
        bitrate: of the bus, in bit/s.
        commissioned: True for boards whose flash holds the robot's settings, False for new ones.
        driver_profile: name of the drivers that the boards have instead of those in the robot's file.
        dip_microsteps: microsteps to which the switches of modules are set instead of the file's, by joint.
        stock: the boxes in the robot's shelf; None: the usual ones.
        locked_drawers: slots of the shelf whose drawers are locked.
        shelf_sensors: False if the shelf's sensors are not connected.
        operations: what was done to the machine, each with its instant in counts since power-up.
        until_counts: instant at which the recording ends; None if nothing tells it.
    """

    joints: Sequence[float]
    axes_per_board: Sequence[int]
    bitrate: int
    commissioned: bool = True
    driver_profile: str | None = None
    dip_microsteps: Mapping[str, int] | None = None
    stock: Mapping[str, str] | None = None
    locked_drawers: Sequence[str] = ()
    shelf_sensors: bool = True
    operations: tuple[tuple[int, Operation], ...] = ()
    until_counts: int | None = None


@dataclass(frozen=True, slots=True)
class StoredMachine:
    """What the folder of a run tells of its machine.

    Attributes:
        folder: the folder.
        power_up: how the machine stood.
        evidence: what its drivers did.
    """

    folder: Path
    power_up: PowerUp
    evidence: Evidence


def stored_machine(folder: Path, robot: Robot) -> StoredMachine:
    """Read the folder of a run, or of a live board's recording, of this robot.

    Raises:
        InputError: a file is missing or cannot be read, or is another robot's.
        ContradictionError: the files contradict themselves.
    """
    report, evidence = read_report(folder), read_evidence(folder)
    check_axes(folder / EDGES, evidence, robot)
    document = report.document
    mark = report.recording.mark if report.recording else None
    until_counts = mark.until_counts if mark else round(report.run.simulated_s * 1e6) * COUNTS_PER_US
    steps = np.array([axis.start_steps for axis in evidence.axes])
    usual = robot.board.driver_profile
    boards = document.get("boards")
    with prefixed(f"{folder / REPORT}: "):
        power_up = PowerUp(
            joints=robot.from_steps(steps).tolist(),
            axes_per_board=_counts(boards) if boards else (len(robot.joints),),
            bitrate=report.run.bus.bitrate,
            commissioned=report.passed is None,
            driver_profile=None if report.driver_profile in (usual, "") else report.driver_profile,
            stock=_stock(folder, document),
            shelf_sensors=report.passed is None or _waits_for_sensors(robot, document),
            operations=_operations(robot, document),
            until_counts=until_counts,
        )
    return StoredMachine(folder, power_up, evidence)
