"""Trajectories of joint moves, tool paths, time laws, sampled points and pauses."""
