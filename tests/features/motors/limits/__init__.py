"""Fastest motions within what a machine's motors manage."""
