"""The CAN bus in virtual time, and the controllers that stations have on it."""
