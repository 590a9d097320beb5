"""Verification: is what the drivers counted what was planned? Shares no code with the firmware that it judges."""

from host.verify.comparison import Comparison, compare
from host.verify.consistency import contradictions
from host.verify.evidence import (
    COUNTS_PER_SECOND,
    AxisEvidence,
    DriverLimit,
    DriverViolations,
    Evidence,
    LevelEdges,
    OutputChange,
    Phases,
)
from host.verify.oracle import IdealSteps, ideal_steps
from host.verify.outputs import OutputReport
from host.verify.plan import Forward, Plan
from host.verify.report import AxisReport, BusReport, JointsReport, Report, RunInfo, ToolReport
from host.verify.verifier import POSITION_ERROR_LIMIT_STEPS, THRESHOLD_TOLERANCE_STEPS, verify, verify_comparison
from host.verify.violations import ViolationReport

__all__ = [
    "COUNTS_PER_SECOND",
    "POSITION_ERROR_LIMIT_STEPS",
    "THRESHOLD_TOLERANCE_STEPS",
    "AxisEvidence",
    "AxisReport",
    "BusReport",
    "Comparison",
    "DriverLimit",
    "DriverViolations",
    "Evidence",
    "Forward",
    "IdealSteps",
    "JointsReport",
    "LevelEdges",
    "OutputChange",
    "OutputReport",
    "Phases",
    "Plan",
    "Report",
    "RunInfo",
    "ToolReport",
    "ViolationReport",
    "compare",
    "contradictions",
    "ideal_steps",
    "verify",
    "verify_comparison",
]
