"""What stands around the board: switches, a shelf, and the state of the surroundings."""
