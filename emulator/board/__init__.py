"""The emulated board: the firmware with its clock, inputs and traces."""
