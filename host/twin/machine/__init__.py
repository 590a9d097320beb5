"""Describe an emulated machine: its options, boards, drivers, shelf and inputs, and what its drivers did."""
