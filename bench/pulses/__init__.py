"""Pulse timing: the kernel beside what else makes step pulses of the same motions, all measured against the ideal ones.

`motions` has what all methods are given, one file each has a method, `evaluation` measures what they made.
"""
