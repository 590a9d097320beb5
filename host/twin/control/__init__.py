"""The control port of a served board: what requests mean for the emulated machine, and what they answer."""
