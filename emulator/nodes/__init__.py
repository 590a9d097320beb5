"""Further CANopen nodes on the machine's bus, as simple as their device descriptions: no boards, no motors."""
