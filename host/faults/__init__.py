"""Scenarios: faults on purpose, what starts and ends them, and whether the machine answers as it is documented to."""
