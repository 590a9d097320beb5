"""docs/robots.md, made by `make docs`: hand-written pieces, and what robots, kinematics and runs say about themselves.

The text depends on the sources alone, not on the machine or the time, so that a test can hold the file against it.
"""
