"""What may go wrong with an emulated machine, as data: operations on it, and faults of its bus and wires."""
