"""Benchmarks: speed and timing error, as ratios measured in one run. `make bench` prints the tables."""
