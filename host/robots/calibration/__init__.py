"""Calibration: find the real DH parameters of a machine from measured positions of its tool."""

from steptwin.host.robots.calibration.corrected_file import corrected_text
from steptwin.host.robots.calibration.identification import (
    Identification,
    Parameter,
    identify_errors,
    largest_mm,
    rms_mm,
)
from steptwin.host.robots.calibration.measurements import Measurements, measurements_text, read_measurements
from steptwin.host.robots.calibration.simulation import simulate_measurements

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
