"""The motion of a board's axes: the kernel, its storage, and the trajectory time of the group."""
