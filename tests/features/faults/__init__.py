"""Scenarios of faults, played on embedded boards in virtual time."""
