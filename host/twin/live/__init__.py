"""Serve a board in real time, follow its motions and record them."""
