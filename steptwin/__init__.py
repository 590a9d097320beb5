"""StepTwin."""
