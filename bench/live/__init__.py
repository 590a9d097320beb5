"""Benchmarks of a live board as other programs see it."""
