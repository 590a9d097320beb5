"""The drivers of a board: chips, the modules around them, and their supply."""
