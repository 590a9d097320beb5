"""Record a run: its folder of files (`folder`), its bus log, its waveforms and its pictures (`plots`).

This room reads a run back, too: as plan and evidence, which the verifier judges again.
"""
