"""The CANopen nodes of a board: drives with their states, errors and stops, and the frames between them and the bus."""
