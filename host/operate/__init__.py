"""Operate a robot's machine over any link, in real or virtual time: the live commands without the command line."""
