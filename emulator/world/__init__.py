"""What stands around the board: switches, and names of what is wired to its inputs and outputs."""
