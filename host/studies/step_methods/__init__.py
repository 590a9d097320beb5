"""Compare the pulse timing of the kernel with that of other step methods, on the same motions.

`motions` makes the planned motions that every method is given, `table` lists the methods, each in a file of
its own, and `evaluation` measures their pulses against the ideal crossings.
"""
