"""State of a machine when its boards were switched on: what a replay needs besides the frames on the bus."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from steptwin.features.faults.fault import MachineFault
from steptwin.features.faults.kinds.bus import BusFault
from steptwin.features.faults.requests import read_request
from steptwin.host.common.bad_input import prefixed
from steptwin.host.common.choices import check_bitrate
from steptwin.host.common.errors import InputError
from steptwin.host.common.features import giving
from steptwin.host.common.tables import Table
from steptwin.host.record.folder import REPORT, read_evidence, read_report
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.machine.boards import check_axes_per_board, check_crystals
from steptwin.host.twin.machine.drivers import other_drivers
from steptwin.host.twin.machine.machine_options import AS_FILED, MachineOptions
from steptwin.host.verify import Evidence
from steptwin.protocol.timer import COUNTS_PER_SECOND, COUNTS_PER_US


class Operated(NamedTuple):
    """An operation on the machine at an instant in counts since power-up; axes are numbered over all boards."""

    counts: int
    operation: MachineFault


@dataclass(frozen=True, slots=True)
class MachineAtPowerUp:
    """A machine at power-up, and the later operations on it that are not on the bus.

    Attributes:
        options: differences from the robot's file.
        commissioned: True for boards with the robot's settings in flash, False for new ones.
        waits_for: inputs for which the motion has waited; None: unknown.
        operations: operations on the machine, in order of time.
        bus_faults: faults of the bus that have struck, as text; they are not repeated.
        until_counts: instant when the recording ends; None if unknown.
    """

    options: MachineOptions = AS_FILED
    commissioned: bool = True
    waits_for: Collection[str] | None = None
    operations: tuple[Operated, ...] = ()
    bus_faults: tuple[str, ...] = ()
    until_counts: int | None = None


class StoredMachine(NamedTuple):
    """Machine of a stored run: its state at power-up, and its drivers' edges."""

    folder: Path
    power_up: MachineAtPowerUp
    evidence: Evidence


def stored_machine(folder: Path, robot: Robot) -> StoredMachine:
    """Read the folder of a run of this robot, or of a live board's recording, even without an end.

    Raises:
        InputError: a file is missing or unreadable, or belongs to another robot.
        ContradictionError: the files contradict themselves.
    """
    report, evidence = read_report(folder), read_evidence(folder)
    recording = report.recording
    names = tuple(axis.name for axis in evidence.axes)
    if names != robot.axis_names:
        axes = f"its axes are {' '.join(names)}, those of {robot.name} {' '.join(robot.axis_names)}"
        raise InputError(f"{folder}: is a run of {report.run.robot}: {axes}")
    mark = None if recording is None else recording.mark
    live = report.passed is None
    with prefixed(f"{folder / REPORT}: "):
        check_bitrate(report.run.bus.bitrate, f"bus.bitrate: {report.run.bus.bitrate}")
        table = Table(report.document, "JSON object")
        done = table.each("operations", lambda each: _done(each, robot)) if "operations" in table else ()
        options = MachineOptions(
            stand_at=robot.from_steps(np.array([axis.start_steps for axis in evidence.axes])).tolist(),
            axes_per_board=(axes_per_board := _axes_per_board(table, robot)),
            crystal_ppm=_crystals(table, len(axes_per_board)),
            bitrate=report.run.bus.bitrate,
            driver_profile=other_drivers(robot.board, report.driver_profile),
            extras=[extra for _, replayed in giving("replayed") if (extra := replayed(table)) is not None],
        )
        power_up = MachineAtPowerUp(
            options,
            commissioned=table.truth("commissioned") if "commissioned" in table else live,
            waits_for=None if live else _waited_for(table),
            operations=tuple(each for each in done if isinstance(each, Operated)),
            bus_faults=(*(each for each in done if isinstance(each, str)), *_bus_faults(table, robot)),
            until_counts=mark.until_counts if mark else round(report.run.simulated_s * 1_000_000) * COUNTS_PER_US,
        )
    return StoredMachine(folder, power_up, evidence)


def _axes_per_board(table: Table, robot: Robot) -> Sequence[int]:
    if "boards" not in table:
        return (len(robot.axes),)
    counts = [count for count in table.elements("boards") if isinstance(count, int)]
    check_axes_per_board(counts, len(robot.axes))
    return counts


def _crystals(table: Table, boards: int) -> Sequence[int]:
    if "crystal_ppm" not in table:
        return ()
    crystals_ppm = [ppm for ppm in table.elements("crystal_ppm") if isinstance(ppm, int)]
    check_crystals(crystals_ppm, boards)
    return crystals_ppm


def _waited_for(table: Table) -> tuple[str, ...]:
    """Return the inputs for which a run has waited."""
    return table.each("waits", lambda wait: wait.text("input")) if "waits" in table else ()


def _bus_faults(table: Table, robot: Robot) -> tuple[str, ...]:
    """Return the faults of the bus in a scenario that have struck."""
    if "faults" not in table:
        return ()

    def of_bus(reported: Table) -> str | None:
        with reported.section("do") as request:
            fault = read_request(robot, request.values)
        struck = isinstance(fault, BusFault) and not reported.is_null("struck_s")
        return f"{reported.text('name')} ({request.text('do')})" if struck else None

    return tuple(each for each in table.each("faults", of_bus) if each is not None)


def _done(table: Table, robot: Robot) -> Operated | str | None:
    """Return an operation in a report, or a bus fault as text; None for a host's fault or a repair."""
    at_s = table.number("at_s")
    fault = read_request(robot, {key: value for key, value in table.values.items() if key != "at_s"})
    if isinstance(fault, BusFault):
        return f"{table.text('do')} at {at_s:g} s"
    return Operated(round(at_s * COUNTS_PER_SECOND), fault) if isinstance(fault, MachineFault) else None
