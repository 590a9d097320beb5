"""The motion of a board's axes: the kernel, its storage, and the group's trajectory time."""
