"""Benchmarks of the operator's panel."""
