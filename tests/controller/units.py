"""Units that the tests of the firmware count in."""

MS = 72_000
"""A millisecond in timer counts."""
STEP = 1024
"""A step at 16 microsteps in units."""
