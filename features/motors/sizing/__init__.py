"""Sizing of motors: suitable motors, torque margins of a run, and resonances."""
