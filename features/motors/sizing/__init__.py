"""Sizing of motors: which would do, how far a run is from losing steps, and where a motor resonates."""
