"""A random host against the emulated board: `python -m tests.emulator.random_host --help`."""
