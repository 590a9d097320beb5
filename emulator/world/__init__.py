"""The machine around the boards: switches and wires."""
