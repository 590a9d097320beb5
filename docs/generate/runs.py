"""Name the robots whose runs the pages show."""

from typing import Final

ROBOTS: Final = ("lab-scara", "warehouse-scara", "teaching-scara", "calibration-scara", "hybrid-arm")
"""The robots, in the order of the page."""
