"""A board in real time: its pace, and the servers by which other programs reach it."""
