"""The benchmarks measure what they say: no test here asserts how long anything takes."""
