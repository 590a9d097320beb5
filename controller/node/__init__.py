"""The CANopen nodes of a board: their drives, errors and stops, and their frames to and from the bus."""
