"""Run a plan on a board in virtual time, in one process."""
