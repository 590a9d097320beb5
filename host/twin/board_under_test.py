"""Answer what a test asks about the machine of an embedded board: positions, outputs, pins, violations, a verdict."""

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from steptwin.controller.motion.backend import Kernel, fastest_kernel
from steptwin.emulator.faults.bus_faults import BusFault, FaultScript
from steptwin.emulator.faults.operations import Scheduled
from steptwin.host.planning.trajectory import Trajectory
from steptwin.host.record.folder import TEST_JOB
from steptwin.host.robots.board_settings import Microsteps
from steptwin.host.robots.robot import Robot
from steptwin.host.twin.boards import Standing, standing_joints
from steptwin.host.twin.embedded_board import EmbeddedBoard
from steptwin.host.twin.machine_options import MachineOptions
from steptwin.host.twin.recording_report import UnplannedRun
from steptwin.host.twin.scenarios.played_document import played_document
from steptwin.host.twin.scenarios.reading import read_scenario
from steptwin.host.twin.scenarios.scenario import Scenario
from steptwin.host.verify import AxisEvidence, Expectation, Report, RunInfo, verify
from steptwin.protocol.frame import Frame
from steptwin.protocol.timer import COUNTS_PER_SECOND


class Violation(NamedTuple):
    """One instant at which a limit of a driver was broken.

    Attributes:
        joint: name of the joint that the driver moves.
        t_s: instant, in seconds since power-up.
        rule: name of the limit, such as `clk_high`.
        value: value that occurred.
        limit: value that the driver requires.
        unit: of both values.
    """

    joint: str
    t_s: float
    rule: str
    value: float
    limit: float
    unit: str


class Strike(NamedTuple):
    """One strike of a fault of the bus.

    Attributes:
        counts: its instant, in counts since power-up.
        fault: the fault.
        frame: the frame that it struck.
    """

    counts: int
    fault: BusFault
    frame: Frame


class BoardUnderTest(EmbeddedBoard):
    """A robot's board in virtual time for tests, such as the fixture `steptwin_board` gives.

    Joints go by their names in the robot's file, in mm and degrees. `network` is the canopen library's Network,
    connected to the board. Simulated time passes while frames are on the bus and in `wait`.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        stand_at: Standing | None = None,
        kernel: Kernel | None = None,
        schedule: Iterable[Scheduled] = (),
        bus_faults: Sequence[BusFault] = (),
        driver_profile: str | None = None,
        dip_microsteps: Mapping[str, int] | None = None,
        motors: bool = False,
        scenario: Scenario | Path | str | None = None,
        crystal_ppm: int = 0,
    ) -> None:
        """Switch the board on.

        Args:
            robot: the machine.
            stand_at: joint positions at which it stands, mm and degrees: all, or some by name; else the robot's home.
            kernel: form of the firmware's kernel; by default the fastest one that is installed.
            schedule: operations on the machine, such as EmergencyStop, each with its instant.
            bus_faults: faults by which the bus loses, disturbs or delays frames.
            driver_profile: name of the drivers that the board has instead of those in the robot's file.
            dip_microsteps: microsteps to which the switches of modules are set instead of the file's, by joint.
            motors: True if the robot's motors turn with the board, so that its switches follow the rotors.
            scenario: faults that happen to it, or the path of the file with them (docs/faults.md); times count from the
                motion that the first SYNC starts.
            crystal_ppm: how fast the board's crystal is, in parts per million from -1000 to 1000; no motors turn then.

        Raises:
            InputError: a joint or the drivers do not exist, or the drivers cannot be set as the robot needs them, or
                have no such switches, or the robot's file does not describe its motors and masses, or something is
                wrong in the scenario, or the crystal is too far off or motors turn with it.
        """
        self._began_s = time.perf_counter()
        joints = standing_joints(robot, stand_at)
        self.bus_faults = tuple(bus_faults)
        self._script = FaultScript(bus_faults)
        if isinstance(scenario, Path | str):
            scenario = read_scenario(str(scenario), robot)
        super().__init__(
            robot,
            joints,
            kernel or fastest_kernel(),
            MachineOptions(
                driver_profile=driver_profile,
                dip_microsteps=dip_microsteps,
                motors=motors,
                scenario=scenario,
                crystal_ppm=crystal_ppm,
            ),
            bus_faults=self._script,
            schedule=schedule,
        )
        self._run = UnplannedRun(self._parts, self._simulation, self.operations, TEST_JOB)

    def steps(self) -> dict[str, int]:
        """Return each motor's position by the steps that its driver has made, in steps from its axis' zero.

        They are steps of the robot's file. If the driver makes smaller ones, the position is rounded down.
        """
        return dict(zip(self.robot.joint_names, self.driver_positions(), strict=True))

    def joints(self) -> dict[str, float]:
        """Return each joint's position by the steps that the drivers have made, in mm or degrees."""
        positions = self.robot.from_steps(np.array(self.motor_positions()))
        return dict(zip(self.robot.joint_names, positions.tolist(), strict=True))

    def rotor_joints(self) -> dict[str, float]:
        """Return each joint's position by its rotor, in mm or degrees: where the machine is, whatever was counted.

        A rotor lags behind its field, and loses steps, only on a board with `motors`.
        """
        positions = self.robot.from_steps(np.array(self.rotor_positions()))
        return dict(zip(self.robot.joint_names, positions.tolist(), strict=True))

    def slipped(self) -> dict[str, int]:
        """Return the full steps by which each rotor has fallen out of step since power-up, with their sign."""
        return dict(zip(self.robot.joint_names, self.slipped_full_steps(), strict=True))

    def faults(self) -> list[dict[str, Any]]:
        """Return what has become of each fault so far, under the keys of report.json: docs/faults.md."""
        document: list[dict[str, Any]] = [] if self.engine is None else played_document(self.engine)["faults"]
        return document

    def mismatches(self) -> list[Microsteps]:
        """Return the axes whose driver, board and robot file do not agree on the microsteps per full step."""
        return [microsteps for microsteps in self.microsteps() if not microsteps.agree]

    def outputs(self) -> dict[str, bool]:
        """Return the level of each digital output that the robot's file names."""
        levels = dict.fromkeys(self.robot.outputs, False)
        for change in self.evidence().outputs:
            levels[change.name] = bool(change.level)
        return levels

    def pins(self, joint: str) -> AxisEvidence:
        """Return every edge of a joint's pins since power-up, and the steps counted; KeyError for an unknown joint."""
        return self.evidence().axes[self.robot.joints.index(self.robot.joint(joint))]

    def violations(self) -> list[Violation]:
        """Return every violation of a driver's limit since power-up, in order of time."""
        found = [violation for axis in self.evidence().axes for violation in _broken(axis)]
        return sorted(found, key=lambda violation: violation.t_s)

    def verify(self, trajectory: Trajectory) -> Report:
        """Verify the drivers' counts since the last SYNC, which is t = 0 of the trajectory, as `steptwin verify` does.

        Raises:
            ValueError: the trajectory's joints are not the robot's.
        """
        run = RunInfo(
            robot=self.robot.name,
            job=TEST_JOB,
            duration_s=trajectory.duration_s,
            bus=self.bus_report(),
            simulated_s=self.now_s(),
            wall_s=time.perf_counter() - self._began_s,
        )
        return verify(Expectation.of(self.robot, trajectory), self.evidence(), run)

    @property
    def struck(self) -> list[Strike]:
        """Every strike of a fault of the bus so far, in order of time: a fault without one has changed nothing."""
        return [Strike(*strike) for strike in self._script.struck]

    def save(self, folder: Path | str) -> None:
        """Write the folder of a run with all that has happened since power-up (docs/run-folder.md).

        Its plan is that of the PVT records which the axes have received, if these describe the last motion. Another
        run's files are replaced, those of a live board's recording are not.

        Raises:
            InputError: the folder holds the recording of a live board, cannot be made, or is not writable.
            OSError, RecordingError: a file cannot be written.
        """
        self._run.save(folder)


def _broken(axis: AxisEvidence) -> Iterator[Violation]:
    found = axis.violations
    for counts, which, value in zip(found.counts.tolist(), found.which.tolist(), found.values.tolist(), strict=True):
        limit = found.limits[which]
        yield Violation(axis.name, counts / COUNTS_PER_SECOND, limit.rule, value, limit.limit, limit.unit)
