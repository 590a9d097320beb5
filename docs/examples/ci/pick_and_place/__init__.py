"""Carry things with a classroom SCARA: a planner and a host program without any import of StepTwin."""
