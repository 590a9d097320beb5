"""The CAN bus in virtual time, the controllers that stations have on it, and further CANopen nodes on it."""
