"""Motions: how joint and tool paths, time laws and sampled points become trajectories."""
