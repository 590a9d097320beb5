"""Tests that the benchmarks measure correctly; none of them asserts how long anything takes."""
