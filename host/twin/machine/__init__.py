"""Describe an emulated machine: its options, boards, drivers and inputs, and what its drivers did."""
