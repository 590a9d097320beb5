"""Calibration: find the real DH parameters of a machine from measured positions of its tool."""

from steptwin.host.studies.calibration.identification import (
    Identification,
    Parameter,
    corrected_text,
    identify_errors,
    largest_mm,
    rms_mm,
)
from steptwin.host.studies.calibration.measurements import (
    Measurements,
    measurements_text,
    read_measurements,
    simulate_measurements,
)

__all__ = [
    "Identification",
    "Measurements",
    "Parameter",
    "corrected_text",
    "identify_errors",
    "largest_mm",
    "measurements_text",
    "read_measurements",
    "rms_mm",
    "simulate_measurements",
]
