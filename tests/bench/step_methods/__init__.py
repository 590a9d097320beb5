"""Tests that the benchmarks measure correctly; no test asserts how long anything takes."""
