"""The ways to a bus: a link in real time, the library's network, and connections over TCP."""
