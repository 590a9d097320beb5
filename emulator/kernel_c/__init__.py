"""Translate the motion kernel to C11, with the standard library only; check the promises that the translation rests on.

It is here and not on the host or in the bench, because the emulated core executes what it makes, and both the command
line (through the twin) and the bench may import it. It imports nothing of ours but the kernel.
"""
