"""Verify a run: compare the steps that the drivers counted with the planned motion.

The verifier shares no code with the firmware that it judges.
"""

from steptwin.host.verify.comparison import Comparison, Expectation, compare
from steptwin.host.verify.counted import contradictions, motor_moves
from steptwin.host.verify.evidence import (
    AS_PLANNED,
    NO_SLIPS,
    SIXTEENTHS,
    AxisEvidence,
    DriverLimit,
    DriverViolations,
    Evidence,
    LevelEdges,
    OutputEdge,
    Phases,
    RateRamps,
    Slips,
)
from steptwin.host.verify.gates import (
    OWN_FIRMWARE,
    POSITION_ERROR_LIMIT_STEPS,
    THRESHOLD_TOLERANCE_STEPS,
    Gates,
    any_step_rule,
    threshold_tolerance_steps,
)
from steptwin.host.verify.report import BusReport, Report, RunInfo, speeds_document
from steptwin.host.verify.verifier import powerless_reasons, verify, verify_comparison

__all__ = [
    "AS_PLANNED",
    "NO_SLIPS",
    "OWN_FIRMWARE",
    "POSITION_ERROR_LIMIT_STEPS",
    "SIXTEENTHS",
    "THRESHOLD_TOLERANCE_STEPS",
    "AxisEvidence",
    "BusReport",
    "Comparison",
    "DriverLimit",
    "DriverViolations",
    "Evidence",
    "Expectation",
    "Gates",
    "LevelEdges",
    "OutputEdge",
    "Phases",
    "RateRamps",
    "Report",
    "RunInfo",
    "Slips",
    "any_step_rule",
    "compare",
    "contradictions",
    "motor_moves",
    "powerless_reasons",
    "speeds_document",
    "threshold_tolerance_steps",
    "verify",
    "verify_comparison",
]
