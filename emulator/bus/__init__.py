"""The CAN bus in virtual time, and the CAN controllers of its stations."""
