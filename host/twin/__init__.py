"""Join the host with the emulated board: runs in virtual time, boards for tests, live boards in real time.

Only this folder imports emulator and controller. The other folders do not depend on them, so they also drive a real
board.
"""
