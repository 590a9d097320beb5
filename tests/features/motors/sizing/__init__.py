"""Sizing of motors, on short runs."""
