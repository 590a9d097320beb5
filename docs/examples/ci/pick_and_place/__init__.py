"""Carries things with a classroom SCARA: a planner and a host program that know nothing of StepTwin."""
