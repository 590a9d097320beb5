"""Compare the pulse timing of the kernel with that of other step methods, on the same motions.

`motions` makes the planned motions that every method is given, `table` lists the methods, our `kernel` and the
`usual_methods` of others, and `evaluation` measures their pulses against the ideal crossings.
"""
