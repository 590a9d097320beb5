"""Stepper motors and the mechanism that they turn: rotors, masses and torques."""
