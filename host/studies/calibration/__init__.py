"""Calibration: find the real DH parameters of a machine from measured positions of its tool."""

from steptwin.host.studies.calibration.identification import Identification, identify_errors
from steptwin.host.studies.calibration.measurements import Measurements, read_measurements, simulate_measurements

__all__ = ["Identification", "Measurements", "identify_errors", "read_measurements", "simulate_measurements"]
