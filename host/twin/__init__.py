"""Join the host with the emulated board: whole runs in virtual time, boards for tests, live boards in real time.

Only this room imports emulator and controller. The other rooms know neither, so they drive a real board just the same.
"""
