"""Record a run: its folder of files (`folder`), its bus log, its waveforms and its pictures (`plots`).

This folder also reads a run back as plan and evidence for the verifier.
"""
