"""Add up what the driver of a joint of a live board has done, from the traces that are taken of it."""

from dataclasses import dataclass

from steptwin.emulator.driver_bank import AxisTrace
from steptwin.host.robots.board_settings import ActiveEdge
from steptwin.host.robots.joint import Joint
from steptwin.host.twin.recording_report import JointFigures


@dataclass(slots=True)
class JointTotals:
    """Totals of a joint's driver since power-up.

    Attributes:
        joint: the joint.
        start_steps: position at power-up, in steps of the robot's file from the joint's zero.
        active_edge: edge of CLK that the driver counts.
        moved_sixteenths: way of the motor from power-up to the last trace, in sixteenths of a full step.
        pulses: number of rising CLK edges.
        violations: number of times that a limit of the driver was broken.
    """

    joint: Joint
    start_steps: int
    active_edge: ActiveEdge
    moved_sixteenths: int = 0
    pulses: int = 0
    violations: int = 0

    @property
    def name(self) -> str:
        """Name of the joint."""
        return self.joint.name

    def add(self, trace: AxisTrace) -> None:
        """Add what the driver has done since the last trace."""
        self.moved_sixteenths = trace.position_sixteenths
        self.pulses += trace.clk_rise_counts.size
        self.violations += trace.violations.counts.size

    @property
    def figures(self) -> JointFigures:
        """The figures as of the last trace."""
        end_steps = self.start_steps + self.moved_sixteenths / self.joint.transmission.step_sixteenths
        return JointFigures(self.start_steps, end_steps, self.pulses, self.violations)
